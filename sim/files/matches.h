#pragma once

#include <string>

namespace abbe::sim {

/// Whether all of a text is as an ECMAScript pattern says.
bool matches(const std::string& text, const std::string& pattern);

}  // namespace abbe::sim
