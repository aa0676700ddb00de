#pragma once

#include <cstdio>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "kinematics/escape.h"

/// The one door to the terminal: whatever a text holds, of what is no letter only ends of lines and
/// tabs reach it as they are.
namespace abbe::sim {

template <typename... Arguments>
void print(std::FILE* to, fmt::format_string<Arguments...> format, Arguments&&... arguments) {
  const std::string text = escaped_lines(fmt::format(format, std::forward<Arguments>(arguments)...));
  std::fwrite(text.data(), 1, text.size(), to);
}

template <typename... Arguments>
void print(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
  sim::print(stdout, format, std::forward<Arguments>(arguments)...);
}

}  // namespace abbe::sim
