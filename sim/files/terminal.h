#pragma once

#include <cstdio>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json_fwd.hpp>

#include "kinematics/bad_input.h"

/// Functions that print to the terminal: every text is printed on one line, with control characters
/// spelt out.
namespace abbe::sim {

/// A text of abbe's own that has several lines; foreign texts in it must be on one line each
/// (single_lined, escaped). Only its line ends and tabs reach the terminal unchanged.
struct Lines {
  std::string text;
};

/// Returns an argument as it is printed.
template <typename Argument>
auto shown(const Argument& argument) {
  if constexpr (std::is_same_v<Argument, Lines>)
    return escaped_lines(argument.text);
  else if constexpr (std::is_convertible_v<const Argument&, std::string_view>)
    return escaped(std::string_view(argument));
  else
    return argument;
}
template <typename Argument>
using Shown = decltype(shown(std::declval<const std::remove_cvref_t<Argument>&>()));

template <typename... Arguments>
void print(std::FILE* to, fmt::format_string<Shown<Arguments>...> format,
           const Arguments&... arguments) {
  const std::string text = fmt::format(format, shown(arguments)...);
  std::fwrite(text.data(), 1, text.size(), to);
}

template <typename... Arguments>
void print(fmt::format_string<Shown<Arguments>...> format, const Arguments&... arguments) {
  sim::print(stdout, format, arguments...);
}

/// Makes every failed write return an error: a standard stream that the shell closed is replaced by
/// /dev/null, so that no file opened later gets its number, and exceeding the limit on file sizes
/// (`ulimit -f`) raises no signal.
void enable_write_errors();

/// Flushes standard output.
/// @throws OutputFailure if any output was lost
void flush_output();

/// Returns the JSON with every text and key on one line, as `escaped` does, for reports, so that no
/// foreign text can begin a line of its own.
nlohmann::ordered_json single_lined(const nlohmann::ordered_json& json);

}  // namespace abbe::sim
