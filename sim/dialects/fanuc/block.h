#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "sim/dialects/cursor.h"
#include "sim/dialects/expression.h"
#include "sim/dialects/program_run.h"
#include "sim/program/nc_block.h"

/// One block of a Fanuc program, with its expressions evaluated.
namespace abbe::sim::dialects::fanuc {

using program::Cause;
using program::Target;

/// A letter and its number.
struct Word : program::NcWord {
  char letter = '\0';
  /// True for a decimal point or an expression: the number does not count increments.
  bool is_in_full_units = false;
};

/// Groups of G and M codes. Of several codes of a modal group in a block the last one is in force,
/// as on the control. A block has at most one code of group OneShot (00).
enum class Group {
  None,        ///< rejected, or without effect and without axis words
  WithMotion,  ///< without effect; axis words in its block belong to the motion in force
  WholeBlock,  ///< without effect, like all other words of its block
  MirrorEnd,   ///< without effect, like the axis words of its block
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

/// Returns true for groups whose codes leave the axis words of their block to the motion.
bool is_beside_motion(Group group);

using Code = TenthsCode<Word>;

/// The words and codes of one block.
struct Block {
  SparseSlots<Word, 26> words;  ///< by letter; G and M are in `codes`
  SparseSlots<Code, std::size_t(Group::Count)> codes;
  std::vector<Word> arguments;      ///< of G65 and G66, in program order
  Word skipped_code;                ///< an unknown code that was skipped
  Word code_forbidding_axis_words;  ///< a code without effect with which axis words are an error
  std::vector<std::string_view> comments;
  bool is_percent_line = false;

  const Word& operator[](char letter) const { return words[std::size_t(letter - 'A')]; }
  const Code& operator[](Group group) const { return codes[std::size_t(group)]; }
  int tenths(Group group) const { return codes[std::size_t(group)].tenths; }
  bool empty() const { return words.empty() && codes.empty(); }
  void clear();
};

/// Value of a variable that has not been set: it counts as zero in arithmetic, but is not EQ zero.
inline constexpr double vacant = 4.9406564584124654e-324;  // smallest positive double
inline bool is_vacant(double value) { return value == vacant || value == -vacant; }
/// Returns the value that arithmetic uses: zero for a vacant variable.
inline double zero_if_vacant(double value) { return is_vacant(value) ? 0.0 : value; }

/// Parser of the operands of macro expressions: variables and functions. ROUND in a word rounds to
/// the resolution of its address.
class MacroOperands : public OperandParser {
 public:
  double resolution = 1.0;  ///< increment that ROUND rounds to
};

/// Returns the operators and functions of custom macro B.
const ExpressionGrammar& grammar();

/// Entry of a code in the word table of the dialect.
using CodeProperties = dialects::CodeProperties<Group>;
/// Returns the table entry of a code. `letter` is G or M.
const CodeProperties& find_entry(char letter, int tenths);
/// Same as `find_entry` for a turning control, G-code system A.
const CodeProperties& find_lathe_entry(char letter, int tenths);

/// Returns the description of a word that is no code, such as "SETVN", which must be in the table.
std::string_view word_sentence(std::string_view word);

/// Returns the least input increment of an address, system IS-B: 0.001 mm or degree, 0.0001 inch.
double min_increment(char letter, bool inch);

/// Parses a block into `block`, whose memory is reused. Words with a vacant value are ignored.
/// Throws BadInput.
void read_block(Cursor cursor, ProgramRun& run, MacroOperands& operands, Block& block);

/// Advances past blanks and comments, and appends the comments to `comments`.
void collect_comments(Cursor& cursor, std::vector<std::string_view>& comments);

/// Returns the block skip level at the cursor, 2 for /2 and 1 for /, and advances past it.
int read_skip_level(Cursor& cursor);

/// Returns the value of a word as an integer from 0 to `max`, rounded if it comes from an
/// expression. Throws BadInput.
int whole_number(const program::Canon& canon, const Word& word, int max);

}  // namespace abbe::sim::dialects::fanuc
