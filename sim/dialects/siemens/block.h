#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/dialects/cursor.h"
#include "sim/dialects/expression.h"
#include "sim/dialects/program_run.h"

/// One block of Siemens 840D with its values worked out.
namespace abbe::sim::dialects::siemens {

using program::Cause;
using program::Target;

/// Groups of words of which a block has at most one each.
enum class Group {
  None,    ///< a word that is refused, or without effect and without axis words
  Beside,  ///< without effect; axis words in its block are those of the motion in force
  Master,  ///< SETMS
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
  OrientationWay,
  Pole,
  Dwell,
  Frame,
  Limits,
  Stop,
  ToolChange,
  Spindle,
  Count
};

/// Returns true for groups of words that leave the axis words of their block to the motion.
bool is_beside_motion(Group group);

/// A word of letters or a code.
struct WordEntry {
  std::string_view word;  ///< "G64", "TRAORI"
  Group group = Group::None;
  Use use = Use::Read;
  std::string_view sentence;
};
/// @param word  upper case, a code without leading zeros; null where the control has none
const WordEntry* find_entry(std::string_view word);

/// What takes a value.
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

/// How the value of an axis counts.
enum class Measure {
  Modal,     ///< by G90 or G91
  Absolute,  ///< AC()
  Step,      ///< IC()
  Shortest,  ///< DC(): absolute, the shortest way of a turning axis
  Upwards,   ///< ACP()
  Downwards  ///< ACN()
};

struct Value {
  double value = 0.0;
  Cause cause;
  Measure measure = Measure::Modal;
  bool given = false;
  explicit operator bool() const { return given; }
  operator Cause() const { return cause; }
};

struct Code {
  std::string_view word;  ///< as `WordEntry` has it
  Cause cause;
  explicit operator bool() const { return !word.empty(); }
};

/// What stands between two commas behind the name of a cycle or subprogram.
struct Argument {
  std::optional<double> number;
  std::optional<std::string> text;
  Cause cause;
  bool empty() const { return !number && !text; }
};

/// A cycle or subprogram by its name.
struct ProgramCall {
  std::string name;  ///< upper case
  std::vector<Argument> arguments;
  bool in_brackets = false;
  Cause cause;
};

/// S or M with the number of a spindle: S2=1000, M[2]=3.
struct SpindleWord {
  int spindle = 0;
  std::optional<double> speed;
  std::string_view direction;  ///< "M3", "M4" or "M5"; empty for S
  Cause cause;
};

struct Block {
  std::array<Value, std::size_t(Address::Count)> values;
  std::array<Code, std::size_t(Group::Count)> codes;
  std::vector<std::string_view> coolant;  ///< M7 M8 M9
  std::optional<std::string> tool_name;   ///< of T="..."
  std::vector<SpindleWord> spindles;      ///< S2=, M3=4
  int master = 1;                         ///< of SETMS
  Code wordless;                          ///< without effect, and takes no axis words
  std::optional<ProgramCall> call;
  bool modal = false;  ///< MCALL, with `call` or alone
  Cause modal_cause;

  const Value& operator[](Address address) const { return values[std::size_t(address)]; }
  const Code& operator[](Group group) const { return codes[std::size_t(group)]; }
  std::string_view word(Group group) const { return codes[std::size_t(group)].word; }
  void clear();
};

/// The operators and functions of the control.
const ExpressionGrammar& grammar();

/// What a program names: its variables and subprograms.
class Names : public Operands {
 public:
  /// A variable that is set where it stands, R1=..., COUNT=..., FIELD[2]=...: its value is read and
  /// stored, and the cursor stands behind it. @return false where none begins there
  virtual bool set_variable(Cursor& cursor) = 0;
  /// The text of a string variable that begins at the cursor, which is moved behind it.
  virtual std::optional<std::string> text_variable(Cursor& cursor) = 0;
};

/// An expression up to where it ends: an operator of letters that goes on as a word (ORIWKS, DIVON)
/// is none.
double number_at(Cursor& cursor, Names& names);

/// Letters, digits and _ at the cursor in upper case, which is moved behind them; empty if none.
std::string name_at(Cursor& cursor);

/// The text between the quotes at the cursor. @throws BadInput where the second is missing
std::string quoted_at(Cursor& cursor);

/// (a, b, ...) at the cursor. @throws BadInput
std::vector<Argument> arguments_at(Cursor& cursor, Names& names);

/// The line up to its comment, and the comment without its ; if there is one.
struct CommentSplit {
  std::string_view block;
  std::optional<std::string_view> comment;
};
CommentSplit split_comment(std::string_view line);

/// Reads the words from the cursor on into `block`, whose memory is used again.
/// @throws BadInput
void read_block(Cursor cursor, ProgramRun& run, Names& names, Block& block);

}  // namespace abbe::sim::dialects::siemens
