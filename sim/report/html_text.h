#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "sim/report/report_labels.h"

/// Text as it stands in a page.
namespace abbe::sim::html {

std::string in_html(std::string_view text);

/// JSON as it may stand in a script.
std::string in_script(const nlohmann::ordered_json& json);

/// An element that the script of the page fills with the label, in the language that is shown.
std::string label(const char* key, const char* element = "span");

/// A term and its description, as they stand in a <dl>.
std::string row(const char* key, const std::string& value);

/// A <ul>, or that there is none.
std::string list(const std::vector<std::string>& lines);

/// {"key": {"en": ..., "zh": ...}}
nlohmann::ordered_json labels_json(std::span<const ReportLabel> labels);

/// A page with the words of its labels in a language, "en" or "zh": a browser that runs no script
/// shows them as they are.
/// @throws std::out_of_range if a label is not among them
std::string with_labels(std::string_view page, std::span<const ReportLabel> labels,
                        const std::string& language);

/// The page with what stands in it for {{name}}; what is put in is not looked at again.
/// @throws std::out_of_range if a name has no value
std::string filled(std::string_view page, const std::map<std::string, std::string>& values);

}  // namespace abbe::sim::html
