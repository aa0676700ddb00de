#pragma once

#include <cstddef>
#include <string>

#include "sim/study/study.h"

/// How tables and pictures call things; scripts get the names of study.h.
namespace abbe::sim::study {

/// "PV", "area in tolerance"
std::string title_of(Response response);
/// "µm", "%"
std::string shown_unit(Response response);
/// "um" as "µm", "urad" as "µrad", "deg" as "°"; others as they are.
std::string shown_unit(const std::string& unit);

/// "um", "W_per_K"; "1" of an input that is a pure number, such as a factor.
std::string unit_of(const Input& input);

/// The text in one line: whatever ends a line or cannot be seen becomes a space.
std::string one_line(const std::string& text);

/// The same, at most so many characters: the middle goes first, as names differ at their ends.
std::string short_line(const std::string& text, std::size_t most);

}  // namespace abbe::sim::study
