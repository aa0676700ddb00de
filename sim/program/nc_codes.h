#pragma once

#include <array>

#include "sim/program/nc_block.h"

namespace abbe::sim::program {

/// The groups of G and M codes of which a block has at most one each.
enum class CodeGroup {
  OneBlock,
  ArcDistance,
  CutterRadius,
  Distance,
  FeedMode,
  Motion,
  Plane,
  ToolLength,
  Units,
  WorkOffset,
  Stop,
  Spindle,
  ToolChange,
  Coolant,
  Count
};

/// The codes of a block by group.
struct Codes {
  struct Code {
    int tenths = -1;  ///< of the number: G43.4 is 434; -1 where the block has none
    NcWord word;
    explicit operator bool() const { return tenths >= 0; }
  };
  std::array<Code, std::size_t(CodeGroup::Count)> by_group;
  const Code& operator[](CodeGroup group) const { return by_group[std::size_t(group)]; }
};

/// @throws BadInput at a code that the control does not know, or the second of a group
Codes codes_of(const NcBlock& block, const NcPlace& place);

}  // namespace abbe::sim::program
