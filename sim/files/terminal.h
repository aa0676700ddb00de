#pragma once

#include <cstdio>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json_fwd.hpp>

#include "kinematics/bad_input.h"

/// Prints to the terminal, every text on one line and with its control characters escaped.
namespace abbe::sim {

/// A text that abbe composed of several lines. Texts from elsewhere in it must be escaped to one
/// line each (single_lined, escaped). Of its control characters only newlines and tabs are printed.
struct MultilineText {
  std::string text;
};

/// Returns an argument in the form in which `print` shows it.
template <typename Argument>
auto shown(const Argument& argument) {
  if constexpr (std::is_same_v<Argument, MultilineText>)
    return escape_keeping_lines(argument.text);
  else if constexpr (std::is_convertible_v<const Argument&, std::string_view>)
    return escaped(std::string_view(argument));
  else
    return argument;
}
template <typename Argument>
using PrintedType = decltype(shown(std::declval<const std::remove_cvref_t<Argument>&>()));

/// Prints a formatted text to a stream.
template <typename... Arguments>
void print(std::FILE* stream, fmt::format_string<PrintedType<Arguments>...> format,
           const Arguments&... arguments) {
  const std::string text = fmt::format(format, shown(arguments)...);
  std::fwrite(text.data(), 1, text.size(), stream);
}

/// Prints a formatted text to standard output.
template <typename... Arguments>
void print(fmt::format_string<PrintedType<Arguments>...> format, const Arguments&... arguments) {
  sim::print(stdout, format, arguments...);
}

/// Makes every failed write return an error. A standard stream that the shell closed is replaced by
/// /dev/null, so that no file opened later gets its descriptor; exceeding the limit on file sizes
/// (`ulimit -f`) no longer raises a signal.
void enable_write_errors();

/// Flushes standard output.
/// @throws OutputFailure if any output was lost
void flush_output();

/// Returns the JSON with every string and key escaped to one line, so that no external text
/// can begin a line in a report.
nlohmann::ordered_json escape_strings(const nlohmann::ordered_json& json);

}  // namespace abbe::sim
