#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "kinematics/bad_input.h"

/// Splitting of the lines of an RS274/NGC program into tokens, and the errors of readers.
namespace abbe::sim::program {

/// A line of a program file.
struct NcLocation {
  const std::string& file;
  int line = 0;
};

/// The text in a line that causes an error message, with its column, from 1.
struct Cause {
  int column = 0;
  std::string_view text;
};

/// Throws BadInput at `cause`. `seen` defaults to the text of the cause.
[[noreturn]] void throw_input_error(const NcLocation& location, const Cause& cause,
                                    std::string expected, std::optional<std::string> seen = {});

// Input errors that readers handle differently from others.

/// Thrown when a limit of the program is exceeded. Reading ends there.
struct ProgramLimitExceeded : BadInput {
  using BadInput::BadInput;
};

/// Thrown for an error that is a consequence of an earlier one. It is not reported.
struct FollowingError : BadInput {
  using BadInput::BadInput;
};

/// One NC token of a block: a letter and its number.
struct NcWord {
  double value = 0.0;
  int column = 0;         ///< of the letter, from 1; 0 if the block has no such token
  std::string_view text;  ///< points into the program
  explicit operator bool() const { return column > 0; }
  operator Cause() const { return {column, text}; }
};

/// The tokens of one line of an RS274/NGC program, not yet interpreted.
struct NcBlock {
  int line = 0;
  bool is_percent_line = false;  ///< the line is a % mark
  bool deleted = false;          ///< the line starts with /
  std::array<NcWord, 26> words;  ///< by letter; G and M are in `g` and `m`
  std::vector<NcWord> g;
  std::vector<NcWord> m;
  std::vector<std::string_view> comments;  ///< text in ( ) and after ;
  const NcWord& operator[](char letter) const { return words[std::size_t(letter - 'A')]; }
  bool empty() const;
};

/// Parses a line. Reuses the memory of `reused`, the block of an earlier line. Throws BadInput on
/// anything but tokens, comments, blanks, a line number and the marks / and %.
NcBlock parse_block(std::string_view text, const NcLocation& location, NcBlock reused);

}  // namespace abbe::sim::program
