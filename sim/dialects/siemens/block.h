#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/dialects/cursor.h"
#include "sim/dialects/expression.h"
#include "sim/dialects/program_run.h"

/// A block of a Siemens 840D program, with its expressions evaluated.
namespace abbe::sim::dialects::siemens {

using program::Cause;
using program::Target;

/// Groups of words. A block may have at most one word of each group.
enum class Group {
  None,           ///< rejected, or without effect and not to be combined with axis words
  WithMotion,     ///< without effect; axis words of the block belong to the motion in force
  MasterSpindle,  ///< SETMS
  Motion,
  Plane,
  Units,
  Distance,
  FeedMode,
  SpeedMode,
  Diameters,
  CutterRadius,
  WorkOffset,
  WithoutOffset,
  Transformation,
  OrientationFrame,
  OrientationPath,
  Pole,
  Dwell,
  Frame,
  Limits,
  Stop,
  ToolChange,
  Spindle,
  Count
};

/// Returns true for groups whose words may share a block with axis words of a motion.
bool is_beside_motion(Group group);

/// An entry of the word table: a keyword or a G or M code.
struct WordEntry {
  std::string_view word;  ///< "G64", "TRAORI"
  Group group = Group::None;
  WordTreatment use = WordTreatment::Read;
  std::string_view sentence;
};
/// Returns the entry of a word, or null if the control does not have it.
/// @param word  upper case, a code without leading zeros
const WordEntry* find_entry(std::string_view word);

/// Addresses to which a value is assigned.
enum class Address : std::uint8_t {
  X,
  Y,
  Z,
  A,
  B,
  C,
  U,
  V,
  W,
  I,
  J,
  K,
  I1,
  J1,
  K1,
  A3,
  B3,
  C3,
  CR,
  AR,
  AP,
  RP,
  TURN,
  RPL,
  F,
  S,
  T,
  D,
  P,
  OFFN,
  LIMS,
  Count
};

/// Meaning of the value of an axis word.
enum class PositionMode {
  Modal,        ///< G90 or G91
  Absolute,     ///< AC()
  Incremental,  ///< IC()
  Shortest,     ///< DC(): absolute, in the shorter direction of a rotary axis
  Positive,     ///< ACP(): absolute, rotary axis in positive direction
  Negative      ///< ACN(): absolute, rotary axis in negative direction
};

/// The programmed value of an address.
struct Value {
  double value = 0.0;
  Cause cause;
  PositionMode mode = PositionMode::Modal;
  bool is_programmed = false;
  explicit operator bool() const { return is_programmed; }
  operator Cause() const { return cause; }
};

/// The programmed word of a group.
struct Code {
  std::string_view word;  ///< as in `WordEntry`
  Cause cause;
  explicit operator bool() const { return !word.empty(); }
};

/// An argument of a cycle or subprogram.
struct Argument {
  std::optional<double> number;
  std::optional<std::string> text;
  Cause cause;
  bool empty() const { return !number && !text; }
};

/// A call of a cycle or subprogram by its name.
struct ProgramCall {
  std::string name;  ///< upper case
  std::vector<Argument> arguments;
  Cause cause;
};

/// S or M with a spindle number: S2=1000, M[2]=3.
struct SpindleWord {
  int spindle = 0;
  std::optional<double> speed;
  std::string_view direction;  ///< "M3", "M4" or "M5"; empty for S
  Cause cause;
};

/// The words of one block.
struct Block {
  std::array<Value, std::size_t(Address::Count)> values;
  std::array<Code, std::size_t(Group::Count)> codes;
  std::vector<std::string_view> coolant;  ///< M7 M8 M9
  std::optional<std::string> tool_name;   ///< T="..."
  std::vector<SpindleWord> spindles;      ///< S2=, M3=4
  int master_spindle = 1;                 ///< argument of SETMS
  Code code_forbidding_axis_words;  ///< a word without effect that must not be combined with axis
                                    ///< words
  std::optional<ProgramCall> call;
  bool is_modal = false;  ///< MCALL, with `call` or alone
  Cause modal_cause;

  const Value& operator[](Address address) const { return values[std::size_t(address)]; }
  const Code& operator[](Group group) const { return codes[std::size_t(group)]; }
  std::string_view word(Group group) const { return codes[std::size_t(group)].word; }
  void clear();
};

/// Returns the operators and functions in expressions of this control.
const ExpressionGrammar& grammar();

/// Parser of the variables of a program in expressions and assignments.
class VariableParser : public OperandParser {
 public:
  /// Executes an assignment at the cursor, R1=..., COUNT=... or FIELD[2]=..., and advances past it.
  /// Returns false if none begins there.
  virtual bool assign_variable(Cursor& cursor) = 0;
  /// Returns the text of the string variable at the cursor and advances past it. Returns nothing if
  /// no string variable begins there.
  virtual std::optional<std::string> parse_text_variable(Cursor& cursor) = 0;
};

/// Evaluates the expression at the cursor. It ends before a word that only begins like an operator
/// (ORIWKS, DIVON).
double parse_number(Cursor& cursor, VariableParser& variables);

/// Returns true for a letter, a digit and _.
bool is_name_char(char c);

/// Returns the name at the cursor in upper case and advances past it. Returns an empty text if no
/// name begins there.
std::string parse_name(Cursor& cursor);

/// Returns true if a single = follows; == is a comparison.
bool is_before_assignment(const Cursor& cursor);

/// Returns the text in quotes at the cursor. Throws BadInput if the closing quote is missing.
std::string parse_quoted_text(Cursor& cursor);

/// Parses (a, b, ...) at the cursor. Throws BadInput.
std::vector<Argument> parse_arguments(Cursor& cursor, VariableParser& variables);

/// The block of a line and its comment.
struct CommentSplit {
  std::string_view block;
  std::optional<std::string_view> comment;  ///< without the semicolon
};

/// Splits a line at the semicolon that begins its comment.
CommentSplit split_comment(std::string_view line);

/// Parses the words from the cursor to the end of the line into `block`, whose memory is reused.
/// Throws BadInput.
void read_block(Cursor cursor, ProgramRun& run, VariableParser& variables, Block& block);

}  // namespace abbe::sim::dialects::siemens
