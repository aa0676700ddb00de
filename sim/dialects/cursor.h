#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/program/place.h"

namespace abbe::sim::dialects {

char upper(char c);
bool is_digit(char c);
bool is_letter(char c);
bool is_blank(char c);

/// All lines of a text, as `Lines` gives them.
std::vector<std::string_view> lines_of_text(std::string_view text);

/// Where a front end stands in a line.
struct Cursor {
  std::string_view text;
  program::NcPlace place;
  std::size_t at = 0;
  int depth = 0;  ///< levels of the expression that is read there, `NestingLevel`

  bool at_end() const { return at >= text.size(); }
  char here() const { return at < text.size() ? text[at] : '\0'; }
  char next(std::size_t n = 1) const { return at + n < text.size() ? text[at + n] : '\0'; }
  void skip_blanks() {
    while (at < text.size() && (text[at] == ' ' || text[at] == '\t')) ++at;
  }
  /// Takes the text if it stands there after blanks, letters of either case.
  bool take(std::string_view wanted);
  /// The same, but not where a letter, digit or _ follows: a whole word.
  bool take_word(std::string_view wanted);
  /// From there to the next blank, for messages.
  std::string_view cell(std::size_t from) const;
  program::Cause cause(std::size_t from, std::size_t to) const {
    return {int(from) + 1, text.substr(from, to - from)};
  }
  program::Cause cause(std::size_t from) const { return cause(from, at); }
  /// @throws BadInput at a byte of the line
  [[noreturn]] void refuse(std::size_t from, std::string expected, std::string seen) const;
  /// The same; what is seen is the word there, or the end of the line.
  [[noreturn]] void refuse(std::size_t from, std::string expected) const;

  /// A number of digits with at most one point, a sign before it if `sign`; none if there is none,
  /// and then nothing is taken. Blanks within are passed over, as RS274 does, if `blanks_within`.
  /// @throws BadInput beyond 1e9
  std::optional<double> number(bool sign = true, bool blanks_within = false);
};

}  // namespace abbe::sim::dialects
