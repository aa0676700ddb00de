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

/// One line of RS274/NGC, with its expressions evaluated.
namespace abbe::sim::dialects::linuxcnc {

using program::Cause;
using program::NcWord;
using program::Target;

/// Modal groups of G and M codes. A block has at most one code of each group.
enum class Group {
  None,  ///< rejected, or without effect and without axis words
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

/// Returns true for groups whose codes leave the axis words of their block to the motion.
bool is_beside_motion(Group group);

using Code = TenthsCode<NcWord>;

/// The words, codes and parameter settings of one line.
struct Block {
  SparseSlots<NcWord, 29> words;  ///< by letter, then @ ^ $; G and M are in `codes`
  SparseSlots<Code, std::size_t(Group::Count)> codes;
  NcWord skipped_code;                ///< an unknown code that was skipped
  NcWord code_forbidding_axis_words;  ///< a code without effect with which axis words are an error
  std::vector<std::string_view> comments;
  // Assignments, which are executed after the whole block has been read.
  std::vector<std::pair<int, double>> number_assignments;        ///< #n = value
  std::vector<std::pair<std::string, double>> name_assignments;  ///< #<name> = value
  bool deleted = false, is_percent_line = false;

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

/// Returns the operators and functions of RS274/NGC.
const ExpressionGrammar& grammar();

/// Entry of a code in the word table of the dialect.
using CodeProperties = dialects::CodeProperties<Group>;
/// Returns the table entry of a code. `letter` is G or M.
const CodeProperties& find_entry(char letter, int tenths);

/// Parses a line without O word into `block`, whose memory is reused. `operands` evaluates
/// parameters and functions. Throws BadInput.
void read_block(Cursor cursor, ProgramRun& run, OperandParser& operands, Block& block);

/// Returns the integer from 0 to `max` that a computed value stands for, within 1e-4. Throws
/// BadInput at byte `from` of the line.
int whole_number(const Cursor& cursor, std::size_t from, double value, int max);

/// Parses the name in < > at the cursor, and returns it in lower case without blanks. Throws
/// BadInput.
std::string parse_name(Cursor& cursor);

}  // namespace abbe::sim::dialects::linuxcnc
