#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "sim/program/place.h"

namespace abbe::sim::program {

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
NcBlock parse_block(std::string_view text, const NcPlace& place, NcBlock reused);

}  // namespace abbe::sim::program
