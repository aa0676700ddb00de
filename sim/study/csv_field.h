#pragma once

#include <optional>
#include <string>

namespace abbe::sim::study {

/// A field as RFC 4180 has it: quoted where it holds a comma, a quote or an end of line.
std::string csv_field(const std::string& text);

/// Shortest text that reads back the same bits; empty where there is no value.
std::string csv_field(double value);
std::string csv_field(const std::optional<double>& value);

}  // namespace abbe::sim::study
