#pragma once

#include <cstdio>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json_fwd.hpp>

#include "kinematics/bad_input.h"

/// The one door to the terminal: a text reaches it on one line, and what is no letter spelt out.
namespace abbe::sim {

/// A text of abbe's own that has several lines; foreign texts in it are on one line each
/// (one_lined, escaped). Only its ends of lines and its tabs reach the terminal as they are.
struct Lines {
  std::string text;
};

/// An argument as the terminal gets it.
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

/// Lets every write that cannot succeed fail with an error: a standard stream that the shell closed
/// is held by /dev/null, so that no file opened later takes its number, and the limit on the size
/// of files (`ulimit -f`) raises no signal.
void enable_write_errors();

/// Hands over what standard output still holds. @throws OutputFailure if any of it was lost
void flush_output();

/// The same with every text and key on one line, as `escaped` has it: what a report for a person is
/// composed of, so that no foreign text begins a line of its own in it.
nlohmann::ordered_json single_lined(const nlohmann::ordered_json& json);

}  // namespace abbe::sim
