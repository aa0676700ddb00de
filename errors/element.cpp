#include "errors/element.h"

#include <stdexcept>

namespace abbe::errors {
namespace {

constexpr std::string_view directions = "XYZABC";
constexpr std::string_view axes = "XYZUVWABCS";

/// Text that may be anything, made fit for a message.
std::string shown(std::string_view text) {
  std::string result = "'";
  for (const char c : text.substr(0, 40)) result += c >= ' ' && c <= '~' ? c : '?';
  return result + (text.size() > 40 ? "...'" : "'");
}

}  // namespace

ElementName parse_element_name(std::string_view text) {
  const bool is_long = !text.empty() && text.front() == 'E';
  const std::string_view rest = is_long ? text.substr(1) : text;
  const bool location = rest.size() == 3 && rest[1] == '0';
  // only a location element may leave out the E: "C0Y", but not "XX"
  const bool fits = location || (is_long && rest.size() == 2);
  if (!fits || directions.find(rest.front()) == std::string_view::npos ||
      axes.find(rest.back()) == std::string_view::npos) {
    throw std::invalid_argument(
        "expected an element name: E, direction (X Y Z A B C), 0 for a location error, axis "
        "(X Y Z U V W A B C S), such as EYX or EC0Y, seen " +
        shown(text));
  }
  return {rest.front(), rest.back(), location};
}

std::string to_string(const ElementName& name) {
  return std::string("E") + name.direction + (name.location ? "0" : "") + name.axis;
}

}  // namespace abbe::errors
