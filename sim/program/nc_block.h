#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "kinematics/bad_input.h"

namespace abbe::sim::program {

/// A line of a program file.
struct NcLocation {
  const std::string& file;
  int line = 0;
};

/// The part of a line that an error message points at: its column, from 1, and its text.
struct Cause {
  int column = 0;
  std::string_view text;
};

/// Throws BadInput at `cause`. `seen` defaults to the text of the cause.
[[noreturn]] void refuse(const NcLocation& place, const Cause& cause, std::string expected,
                         std::optional<std::string> seen = {});

// Input errors that are handled differently from others.

/// Thrown when a limit of the program is exceeded: reading ends there.
struct ProgramLimitExceeded : BadInput {
  using BadInput::BadInput;
};

/// Thrown for an error that is a consequence of one reported before; it is not reported.
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

/// One line of an RS274/NGC program split into tokens, not yet interpreted.
struct NcBlock {
  int line = 0;
  bool percent = false;          ///< the line is a % mark
  bool deleted = false;          ///< the line starts with /
  std::array<NcWord, 26> words;  ///< by letter; G and M are in `g` and `m`
  std::vector<NcWord> g;
  std::vector<NcWord> m;
  std::vector<std::string_view> comments;  ///< text in ( ) and after ;
  const NcWord& operator[](char letter) const { return words[std::size_t(letter - 'A')]; }
  bool empty() const;
};

/// Parses a line. `reused` is the block of an earlier line; its memory is reused. Throws BadInput
/// on anything but tokens, comments, blanks, a line number and the marks / and %.
NcBlock parse_block(std::string_view text, const NcLocation& place, NcBlock reused);

}  // namespace abbe::sim::program
