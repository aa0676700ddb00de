#pragma once

#include <array>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sim/dialects/cursor.h"
#include "sim/dialects/expression.h"
#include "sim/dialects/program_run.h"
#include "sim/program/nc_block.h"

/// One line of RS274/NGC with its values worked out.
namespace abbe::sim::dialects::linuxcnc {

using program::Cause;
using program::NcWord;
using program::Target;

/// Groups of G and M codes of which a block has at most one each.
enum class Group {
  None,  ///< a code that is refused, or without effect and without axis words
  OneBlock,
  Motion,
  Plane,
  Distance,
  ArcDistance,
  FeedMode,
  Units,
  CutterRadius,
  ToolLength,
  ReturnLevel,
  WorkOffset,
  PathMode,
  SpeedMode,
  LatheDiameter,
  Stop,
  ToolChange,
  Spindle,
  Coolant,
  Override,
  Kinematics,
  State,
  Count
};

/// Returns true for groups of codes that leave the axis words of their block to the motion.
bool is_beside_motion(Group group);

using Code = TenthsCode<NcWord>;

struct Block {
  SparseSlots<NcWord, 29> words;  ///< by letter, then @ ^ $; G and M are in `codes`
  SparseSlots<Code, std::size_t(Group::Count)> codes;
  NcWord skipped;   ///< a code that the dialect has not, passed over
  NcWord wordless;  ///< a code without effect that takes no axis words
  std::vector<std::string_view> comments;
  std::vector<std::pair<int, double>> numbers;        ///< #n = value, set when the block is read
  std::vector<std::pair<std::string, double>> names;  ///< #<name> = value
  bool deleted = false, percent = false;

  const NcWord& operator[](char letter) const { return words[std::size_t(letter - 'A')]; }
  const NcWord& radius() const { return words[26]; }   ///< @
  const NcWord& angle() const { return words[27]; }    ///< ^
  const NcWord& spindle() const { return words[28]; }  ///< $
  bool is_polar() const { return radius() || angle(); }
  const Code& operator[](Group group) const { return codes[std::size_t(group)]; }
  int tenths(Group group) const { return codes[std::size_t(group)].tenths; }
  bool empty() const;
  void clear();
};

/// The operators and functions of RS274/NGC.
const ExpressionGrammar& grammar();

/// What the table of words says of a code.
using CodeEntry = dialects::CodeEntry<Group>;
/// @param letter  G or M
const CodeEntry& find_entry(char letter, int tenths);

/// Reads a line that has no O word into `block`, whose memory is used again.
/// @param operands  parameters and functions
/// @throws BadInput
void read_block(Cursor cursor, ProgramRun& run, Operands& operands, Block& block);

/// The whole number that an index or a code is. @throws BadInput
int whole(const Cursor& cursor, std::size_t from, double value, int most);

/// The name in < >, lower case without blanks, at the cursor. @throws BadInput
std::string name_in_brackets(Cursor& cursor);

}  // namespace abbe::sim::dialects::linuxcnc
