#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "kinematics/bad_input.h"

namespace abbe::sim::program {

/// A line of a program.
struct NcLocation {
  const std::string& file;
  int line = 0;
};

/// What of a line a refusal points at: its column, from 1, and the text that was seen.
struct Cause {
  int column = 0;
  std::string_view text;
};

/// Refuses what stands there; what was seen is its own text unless stated.
/// @throws BadInput
[[noreturn]] void refuse(const NcLocation& place, const Cause& cause, std::string expected,
                         std::optional<std::string> seen = {});

// Input errors behind which a program is read otherwise than behind others.

/// A limit of the program was reached: reading ends there.
struct ProgramLimitExceeded : BadInput {
  using BadInput::BadInput;
};

/// An input error that only follows from one that is reported already: it is left out.
struct FollowingError : BadInput {
  using BadInput::BadInput;
};

/// One word as it stands in a block.
struct NcWord {
  double value = 0.0;
  int column = 0;         ///< of its letter, from 1; 0 where the block has no such word
  std::string_view text;  ///< points into the program
  explicit operator bool() const { return column > 0; }
  operator Cause() const { return {column, text}; }
};

/// One line of an RS274/NGC program taken apart, its words not yet understood.
struct NcBlock {
  int line = 0;
  bool percent = false;          ///< the line is a % mark
  bool deleted = false;          ///< it starts with /
  std::array<NcWord, 26> words;  ///< by letter; G and M are in `g` and `m`
  std::vector<NcWord> g;
  std::vector<NcWord> m;
  std::vector<std::string_view> comments;  ///< what stands in ( ) and after ;
  const NcWord& operator[](char letter) const { return words[std::size_t(letter - 'A')]; }
  bool empty() const;
};

/// Takes a line apart into `block` of the line before, whose memory is used again.
/// @throws BadInput on anything but words, comments, blanks, a line number and marks / and %
NcBlock parse_block(std::string_view text, const NcLocation& place, NcBlock reused);

}  // namespace abbe::sim::program
