#pragma once

#include "sim/dialects/control.h"

/// Blocks of letters with numbers, as Fanuc controls and LinuxCNC read them.
namespace abbe::sim::dialects::gcode {

/// A letter and its number.
struct Word : program::NcWord {
  char letter = '\0';
  /// Fanuc: true for a decimal point or an expression, when the number counts no increments.
  bool is_in_full_units = false;
};

/// Groups of G and M codes; the code table of each dialect states those that it has.
enum class Group {
  None,        ///< rejected, or without effect and without axis words
  WithMotion,  ///< without effect; axis words in its block belong to the motion in force
  WholeBlock,  ///< without effect, like all other words of its block
  MirrorEnd,   ///< without effect, like the axis words of its block
  OneShot,     ///< group 0: in force for its block only
  Motion,
  Plane,
  Distance,
  ArcDistance,
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
  PathMode,
  LatheDiameter,
  Stop,
  ToolChange,
  Spindle,
  Coolant,
  Call,
  RigidTap,
  Override,
  Kinematics,
  State,
  Count
};

/// Returns true for groups whose codes leave the axis words of their block to the motion.
bool is_beside_motion(Group group);

using Code = TenthsCode<Word>;
/// Entry of a code in the word table of a dialect.
using CodeProperties = dialects::CodeProperties<Group>;

/// The words and codes of one block, with its expressions evaluated.
struct Block {
  SparseSlots<Word, 29> words;  ///< by letter, then @ ^ $; G and M are in `codes`
  SparseSlots<Code, std::size_t(Group::Count)> codes;
  std::vector<Word> arguments;      ///< of G65 and G66, in program order
  Word skipped_code;                ///< an unknown code that was skipped
  Word code_forbidding_axis_words;  ///< a code without effect with which axis words are an error
  std::vector<std::string_view> comments;
  // Assignments of LinuxCNC, which are executed after the whole block has been read.
  std::vector<std::pair<int, double>> number_assignments;        ///< #n = value
  std::vector<std::pair<std::string, double>> name_assignments;  ///< #<name> = value
  bool is_deleted = false, is_percent_line = false;

  /// Returns the slot of a letter or of @ ^ $.
  static constexpr std::size_t slot(char letter) {
    return letter == '@' ? 26 : letter == '^' ? 27 : letter == '$' ? 28 : std::size_t(letter - 'A');
  }
  const Word& operator[](char letter) const { return words[slot(letter)]; }
  bool is_polar() const { return (*this)['@'] || (*this)['^']; }
  /// Returns the first word of the block that has one of the letters, or null.
  const Word* first_word(std::string_view letters) const;
  const Code& operator[](Group group) const { return codes[std::size_t(group)]; }
  int tenths(Group group) const { return codes[std::size_t(group)].tenths; }
  bool empty() const { return words.empty() && codes.empty(); }
  void clear();
};

/// Splits a block into words and codes, as far as the dialects agree.
class BlockReader {
 protected:
  BlockReader(Cursor& cursor, ProgramRun& run, Block& block);

  /// Parses the letter of a word, or one of the signs that the dialect has besides letters.
  Word read_letter(std::string_view signs = {});
  /// Parses the number of a word.
  void read_number(Word& word, const ExpressionGrammar& grammar, OperandParser& operands);
  /// Returns the code of a G or M word, or nothing if it belongs to no group. Throws BadInput for a
  /// refused code. `control` names the control in messages.
  const gcode::CodeProperties* find_code(const Word& word, std::string_view control,
                                         const CodeProperties& (*find_entry)(char letter,
                                                                             int tenths));
  /// Puts a code into its group. Throws BadInput if `must_be_unique` and the group has one.
  void put_code(const Word& word, Group group, bool must_be_unique, std::string_view expected);
  /// Puts a word into its slot. Throws BadInput if the block has one of its letter.
  void put_word(const Word& word);

  Cursor& cursor_;
  ProgramRun& run_;
  Block& block_;
};

/// Parses the comment in ( ) at the cursor.
std::string_view read_comment(Cursor& cursor);

/// Returns the tenths of a code, 434 for G43.4, or -1 for a number that is no code.
int tenths_of(const Word& word);

/// Letters other than those of axis words that belong to a code, which is stated in tenths.
struct CodeLetters {
  int tenths = -1;
  std::string_view letters;
};
/// Returns the letters of a code; none if it is not in the table.
std::string_view letters_of_code(std::span<const CodeLetters> table, int tenths);

/// Records the modes that a block states.
void mark_stated_modes(ProgramRun& run, const Block& block);

/// Checks the axis words of a block, of which `axis` is the first, or null. Throws BadInput beside
/// a skipped G code, which may give them another meaning.
void check_skipped_code(const program::Canon& canon, const Block& block, const Word* axis);
/// Throws BadInput for axis words beside a code that forbids them.
void check_forbidden_axis_words(const program::Canon& canon, const Block& block, const Word* axis);

/// Records T, M6, M7 and M8 of a block for rewriting; `tool` is the text of T, or empty.
void record_tool_and_coolant(program::Canon& canon, const Block& block, std::string tool);

/// Records M9 and stops, which take effect after the motion of their block. Returns false at the
/// end of the program.
bool finish_block(program::Canon& canon, const Block& block);

}  // namespace abbe::sim::dialects::gcode
