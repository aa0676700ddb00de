#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "sim/dialects/cursor.h"
#include "sim/dialects/expression.h"
#include "sim/dialects/program_run.h"
#include "sim/program/nc_block.h"

/// One block of a Fanuc program with its values worked out.
namespace abbe::sim::dialects::fanuc {

using program::Cause;
using program::Target;

/// A letter and its number.
struct Word : program::NcWord {
  char letter = '\0';
  bool pointed = false;  ///< with a decimal point, or worked out: taken as it is
};

/// Groups of G and M codes. Of a modal group the last code of a block counts, as the control has
/// it; of OneShot a block has at most one.
enum class Group {
  None,       ///< a code that is refused, or without effect and without axis words
  Beside,     ///< without effect; axis words in its block are those of the motion in force
  Alone,      ///< without effect, with all the words of its block
  MirrorEnd,  ///< without effect, with the axis words of its block
  OneShot,
  Motion,
  Plane,
  Distance,
  FeedMode,
  Units,
  CutterRadius,
  ToolLength,
  Cycle,
  ReturnLevel,
  Macro,
  SpeedMode,
  WorkOffset,
  Rotation,
  Polar,
  Stop,
  ToolChange,
  Spindle,
  Coolant,
  Call,
  RigidTap,
  Count
};

/// Returns true for groups of codes that leave the axis words of their block to the motion.
bool is_beside_motion(Group group);

using Code = TenthsCode<Word>;

struct Block {
  SparseSlots<Word, 26> words;  ///< by letter; G and M are in `codes`
  SparseSlots<Code, std::size_t(Group::Count)> codes;
  std::vector<Word> arguments;  ///< of G65 and G66, in their order
  Word skipped;                 ///< a code that the dialect has not, passed over
  Word wordless;                ///< a code without effect that takes no axis words
  std::vector<std::string_view> comments;
  bool percent = false;

  const Word& operator[](char letter) const { return words[std::size_t(letter - 'A')]; }
  const Code& operator[](Group group) const { return codes[std::size_t(group)]; }
  int tenths(Group group) const { return codes[std::size_t(group)].tenths; }
  bool empty() const { return words.empty() && codes.empty(); }
  void clear();
};

/// What variables hold that nothing has been set to: a number that counts as zero wherever it is
/// worked with, but is not EQ zero.
inline constexpr double vacant = 4.9406564584124654e-324;  // the least double above zero
inline bool is_vacant(double value) { return value == vacant || value == -vacant; }

/// Variables and functions; where ROUND stands in a word it rounds to what its address resolves.
class MacroOperands : public Operands {
 public:
  double resolution = 1.0;  ///< that ROUND rounds to
};

/// The operators and functions of custom macro B.
const ExpressionGrammar& grammar();

/// What the table of words says of a code.
using CodeEntry = dialects::CodeEntry<Group>;
/// @param letter  G or M
const CodeEntry& find_entry(char letter, int tenths);
/// The same of a turning control, G-code system A.
const CodeEntry& find_lathe_entry(char letter, int tenths);

/// What the table of words says of a word that is no code, "SETVN"; it has one.
std::string_view word_sentence(std::string_view word);

/// Least input increment of an address, system IS-B: 0.001 mm or degree, 0.0001 inch.
double min_increment(char letter, bool inch);

/// Reads a block into `block`, whose memory is used again. Words of vacant variables are left out.
/// @throws BadInput
void read_block(Cursor cursor, ProgramRun& run, MacroOperands& operands, Block& block);

/// Blanks and comments, which are kept.
void pass_comments(Cursor& cursor, std::vector<std::string_view>& comments);

/// Returns the level of the block skip at the cursor, /2 or / for 1, and passes it.
int skip_level(Cursor& cursor);

/// A whole number from 0, as rounded from an expression. @throws BadInput
int whole(const program::Canon& canon, const Word& word, int most);

}  // namespace abbe::sim::dialects::fanuc
