#include "sim/dialects/linuxcnc/linuxcnc.h"
#include "sim/dialects/read_program.h"

namespace abbe::sim::dialects {

namespace linuxcnc {
namespace {

using Line = CodeTableLine<Group>;

// Short names, so that most entries fit on a line.
constexpr WordTreatment read = WordTreatment::Read, none = WordTreatment::WithoutEffect,
                        refused = WordTreatment::Refused;

// The only list of codes: the word table of the README, messages and groups are all made from it.
constexpr Line lines[] = {
    {"G0 G1", Group::Motion, read, "rapid; line"},
    {"G2 G3", Group::Motion, read,
     "arc clockwise, counter-clockwise, also helix; I J K or R, P full or partial turns"},
    {"G4", Group::OneShot, read, "dwell, P seconds, before a move of the same block", true},
    {"G5 G5.1", Group::Motion, read,
     "cubic (I J P Q) and quadratic (I J) spline in X Y, as chords within 0.0001 mm; the previous "
     "motion mode stays active"},
    {"G5.2 G5.3", Group::Motion, read,
     "NURBS in X Y, P weights, L order, as chords within 0.0001 mm"},
    {"G7 G8", Group::LatheDiameter, read,
     "X words are diameters; radii, active at the start unless `x_words` states otherwise"},
    {"G10", Group::OneShot, read,
     "L2 L20: origin (and R rotation) of a coordinate system, as stated or so that the current "
     "position has the stated coordinates; L1 L10 L11: length and radius of a tool"},
    {"G17 G18 G19", Group::Plane, read, "plane X Y, Z X, Y Z"},
    {"G17.1 G18.1 G19.1", Group::None, refused,
     "a plane of X Y Z: planes of U V W are not supported"},
    {"G20 G21", Group::Units, read, "inch, mm; for the whole block, including F"},
    {"G28 G30", Group::OneShot, read,
     "rapid to the stored position, through the point of the axis words if there are any"},
    {"G28.1 G30.1", Group::OneShot, read, "stores the position; axis words are rejected"},
    {"G33", Group::Motion, read, "line at K mm per revolution of the spindle"},
    {"G33.1", Group::Motion, read,
     "rigid tapping: at K mm per revolution and back, the spindle reversed"},
    {"G38.2 G38.3 G38.4 G38.5", Group::None, refused,
     "no probing: a virtual part is measured by instruments (abbe measure)"},
    {"G40", Group::CutterRadius, read, "cutter compensation off"},
    {"G41 G42", Group::CutterRadius, read,
     "cutter compensation left, right; tool D, otherwise that in the spindle"},
    {"G41.1 G42.1", Group::CutterRadius, read, "the same, D is the diameter, L1 ... L9 rejected"},
    {"G43", Group::ToolLength, read,
     "tool length, tool H, otherwise that in the spindle; on a turning control its offset: X Z "
     "guide the tip, X0 is on the spindle line"},
    {"G43.1", Group::ToolLength, read, "tool length by axis words"},
    {"G43.2", Group::ToolLength, read, "adds a second tool length, tool H"},
    {"G43.4", Group::ToolLength, read,
     "abbe's own word, tool H: X Y Z are the tip in the workpiece frame, rotary words are axis "
     "positions"},
    {"G49", Group::ToolLength, read, "no tool length; ends G43.4"},
    {"G52", Group::OneShot, read, "shift on top of the coordinate system"},
    {"G53", Group::OneShot, read,
     "with G0 or G1, also a modal one, under G90: axis positions, without offsets", true},
    {"G54 G55 G56 G57 G58 G59 G59.1 G59.2 G59.3", Group::WorkOffset, read,
     "coordinate system 1 to 9; 1 to 6 start as stated by `work_offset`, all as stated by "
     "`offsets`, others at zero"},
    {"G61 G61.1", Group::PathMode, none, "exact path: abbe always cuts it"},
    {"G64", Group::PathMode, none,
     "blending within P and Q: abbe cuts the exact path, without the roundings of a real control"},
    {"G70 G71 G71.1 G71.2 G72 G72.1 G72.2", Group::None, refused,
     "explicit passes: turning cycles G70 to G72 are not expanded"},
    {"G73 G83", Group::Motion, read,
     "drilling with pecks Q, with chip breaking; with full retraction"},
    {"G74 G84", Group::Motion, read,
     "tapping left, right, with the spindle reversed at the bottom"},
    {"G76", Group::Motion, read, "threading cycle, P Z I J R K Q H E L"},
    {"G80", Group::Motion, read, "cancels the motion mode; no effect with another motion code"},
    {"G81 G82", Group::Motion, read, "drilling; with dwell P"},
    {"G85 G86 G89", Group::Motion, read,
     "boring: feed out; spindle stop, rapid out; dwell, feed out"},
    {"G87 G88", Group::None, refused, "G81 to G86 or G89: LinuxCNC has no G87 and G88 either"},
    {"G90 G91", Group::Distance, read, "absolute, incremental"},
    {"G90.1 G91.1", Group::ArcDistance, read, "centres I J K absolute; from the start of the arc"},
    {"G92", Group::OneShot, read,
     "shift that gives the current position the programmed coordinates"},
    {"G92.1 G92.2 G92.3", Group::OneShot, read,
     "shift of G92 and G52 cleared; suspended; restored; axis words are rejected"},
    {"G93 G94 G95", Group::FeedMode, read,
     "F: inverse time, in every block; per minute; per revolution of the spindle; each clears F"},
    {"G96", Group::SpeedMode, read,
     "S is a surface speed at the radius of X, D the maximum rpm: the duration of a block is "
     "computed from the speeds at its points"},
    {"G97", Group::SpeedMode, read, "S is a speed in rpm"},
    {"G98 G99", Group::ReturnLevel, read, "cycles return to the initial level; to R"},
    {"M0 M1 M60", Group::Stop, none, "stops"},
    {"M2 M30", Group::Stop, read, "end of the program"},
    {"M3 M4 M5", Group::Spindle, read, "spindle clockwise, counter-clockwise, off"},
    {"M6", Group::ToolChange, read, "change to the tool of T"},
    {"M7 M8 M9", Group::Coolant, none, "coolant"},
    {"M19", Group::Spindle, none, "spindle orientation"},
    {"M48 M49 M50 M51 M52 M53", Group::Override, none, "no overrides: abbe runs at 100 %"},
    {"M61", Group::ToolChange, read, "Q is the tool in the spindle"},
    {"M62 M63 M64 M65", Group::Override, none, "digital outputs, P their number"},
    {"M67 M68", Group::Override, none, "analog outputs, E their number, Q the value"},
    {"M66", Group::None, refused, "no wait for an input: there are no inputs"},
    {"M70 M71 M72 M73", Group::State, read,
     "modes saved; discarded; restored; saved here and restored at the end of the call, in a "
     "separate block. Tool length and cutter compensation must be as saved"},
    {"M98 M99", Group::None, refused, "o call and o return, or dialect = \"fanuc\""},
    {"M428", Group::Kinematics, read,
     "kinematics of the tip, as G43.4; the length of G43 must be that of the tool"},
    {"M429", Group::Kinematics, read, "identity kinematics: G43 as before, ends G43.4"},
};

// Words other than G and M codes.
constexpr WordTableEntry other_words[] = {
    {"F S", read, "feed; spindle speed"},
    {"T", read, "tool"},
    {"N", read, "line number"},
    {"X Y Z A B C U V W", read, "axes of the machine; mm or inch, degrees"},
    {"$", read, "spindle for S M3 M4 M5: 0 is that of the machine, others have no effect"},
    {"@ ^", read, "polar X Y: radius, and angle in degrees; an omitted one keeps its value"},
    {"#n #<name> #<_name>", read,
     "parameters, of the call and of the program; #1 to #30 of the call"},
    {"[ ] + - * / ** MOD EQ NE GT GE LT LE AND OR XOR", read,
     "expressions: ** first, then * / MOD, + -, comparisons, AND OR XOR, each left to right"},
    {"ABS ACOS ASIN ATAN COS EXISTS EXP FIX FUP LN ROUND SIN SQRT TAN", read,
     "functions, degrees; ATAN[y]/[x]"},
    {"sub endsub call return", read,
     "subprograms o<name> or o123, in the file or in name.ngc next to it; results in #<_value>"},
    {"if elseif else endif while endwhile do repeat endrepeat break continue", read,
     "conditions and loops"},
    {"( ) ; %", read,
     "comments, those with a tool diameter are noted; tape marks. A / at the start of a line "
     "leaves it out"},
    {"(MSG,) (DEBUG,) (PRINT,) (LOG,)", none, "messages"},
};

}  // namespace

// Built once and indexed by tenths, because every code of a program is looked up.
const gcode::CodeProperties& find_entry(char letter, int tenths) {
  static const CodeTable<Group> table(lines);
  return table.find_entry(letter, tenths);
}

namespace {

constexpr double equality_tolerance = 1e-4;  // of EQ and NE, TOLERANCE_EQUAL of LinuxCNC

// MOD of RS274 is never negative, unlike std::fmod.
double modulo(double a, double b) {
  const double remainder = std::fmod(a, b);
  return remainder < 0 ? remainder + std::abs(b) : remainder;
}

// Levels of RS274/NGC as the README lists them: ** binds most tightly, logical operators least.
constexpr Operator operators[] = {
    {"**", 6, [](double a, double b) { return std::pow(a, b); }, require_real_power},
    {"*", 5, [](double a, double b) { return a * b; }},
    {"/", 5, [](double a, double b) { return a / b; }, require_nonzero_divisor},
    {"MOD", 5, modulo, require_nonzero_divisor},
    {"+", 4, [](double a, double b) { return a + b; }},
    {"-", 4, [](double a, double b) { return a - b; }},
    {"EQ", 3, [](double a, double b) { return double(std::abs(a - b) < equality_tolerance); }},
    {"NE", 3, [](double a, double b) { return double(std::abs(a - b) >= equality_tolerance); }},
    {"GT", 3, [](double a, double b) { return double(a > b); }},
    {"GE", 3, [](double a, double b) { return double(a >= b); }},
    {"LT", 3, [](double a, double b) { return double(a < b); }},
    {"LE", 3, [](double a, double b) { return double(a <= b); }},
    {"AND", 2, [](double a, double b) { return double(a != 0 && b != 0); }},
    {"XOR", 2, [](double a, double b) { return double((a != 0) != (b != 0)); }},
    {"OR", 2, [](double a, double b) { return double(a != 0 || b != 0); }},
};

// `Flow::parse_operand` handles ATAN, which takes two arguments.
constexpr Function functions[] = {
    {"FIX", [](double x) { return std::floor(x); }},
    {"FUP", [](double x) { return std::ceil(x); }},
    {"ROUND", [](double x) { return double(std::round(x)); }},  // half away from zero
};

}  // namespace

const ExpressionGrammar& grammar() {
  static const ExpressionGrammar ngc_grammar{operators, functions, '[',
                                             ']',       true,      common_functions()};
  return ngc_grammar;
}

namespace {

// Both limits bound the memory of a hostile line; LinuxCNC too allows 50 assignments in a block.
constexpr std::size_t max_name_bytes = 100;
constexpr std::size_t max_assignments = 50;

}  // namespace

int whole_number(const Cursor& cursor, std::size_t from, double value, int max) {
  const double rounded = std::round(value);
  // rs274 accepts a computed index within 1e-4 of an integer.
  if (!(std::abs(value - rounded) < 1e-4) || rounded < 0 || rounded > max)
    cursor.throw_input_error(from, fmt::format("an integer from 0 to {}", max),
                             fmt::format("{}", value));
  return int(rounded);
}

std::string parse_name(Cursor& cursor) {
  const std::size_t from = cursor.at;
  std::string name;
  for (++cursor.at; cursor.current() != '>'; ++cursor.at) {
    if (cursor.at_end()) cursor.throw_input_error(from, "> after a name", "the end of the line");
    const char c = cursor.current();
    // Blanks and case do not matter, as in every line that rs274 reads.
    if (!is_blank(c)) name += c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c;
    if (name.size() > max_name_bytes)
      cursor.throw_input_error(from, "a name of at most 100 letters");
  }
  ++cursor.at;
  if (name.empty()) cursor.throw_input_error(from, "a name between < and >");
  return name;
}

namespace {

// Splits a block into words, codes and assignments.
class BlockReader : public gcode::BlockReader {
 public:
  BlockReader(Cursor& cursor, ProgramRun& run, OperandParser& operands, Block& block)
      : gcode::BlockReader(cursor, run, block), operands_(operands) {}

  void read() {
    if (next_char(cursor_) == '%') {
      ++cursor_.at;
      skip_blanks_and_comments();
      if (!cursor_.at_end()) cursor_.throw_input_error(cursor_.at, "nothing after %");
      block_.is_percent_line = true;
      return;
    }
    if (cursor_.current() == '/') {
      ++cursor_.at;
      block_.is_deleted = true;
      // A skipped block is not parsed, so that its errors do not matter.
      if (run_.canon.options().block_skip.test(0)) return;
    }
    bool is_first = true;
    for (skip_blanks_and_comments(); !cursor_.at_end(); skip_blanks_and_comments()) {
      if (cursor_.current() == '#')
        read_assignment();
      else
        read_word(is_first);
      is_first = false;
    }
  }

 private:
  // A comment after ; extends to the end of the line.
  void skip_blanks_and_comments() {
    for (cursor_.skip_blanks(); !cursor_.at_end(); cursor_.skip_blanks()) {
      if (cursor_.current() == '(') {
        const std::size_t bracket = cursor_.text.find_first_of("()", cursor_.at + 1);
        if (bracket != std::string_view::npos && cursor_.text[bracket] == '(')
          cursor_.throw_input_error(bracket, ") before another ( in a comment", "(");
        block_.comments.push_back(gcode::read_comment(cursor_));
      } else if (cursor_.current() == ';') {
        block_.comments.push_back(cursor_.text.substr(cursor_.at + 1));
        cursor_.at = cursor_.text.size();
      } else {
        return;
      }
    }
  }

  // The flow executes the assignments after the whole block has been read, so that the block uses
  // the old values.
  void read_assignment() {
    const std::size_t from = cursor_.at++;
    cursor_.skip_blanks();
    std::string name;
    int number = 0;
    if (cursor_.current() == '<')
      name = parse_name(cursor_);
    else
      number = whole_number(cursor_, from, parse_value(cursor_, grammar(), operands_), 5601);
    double result = 0.0;
    run_.define(name.empty() ? fmt::format("#{}", number) : fmt::format("#<{}>", name), [&] {
      expect_text(cursor_, "=", "= after a parameter that starts a word");
      result = parse_value(cursor_, grammar(), operands_);
    });
    if (block_.number_assignments.size() + block_.name_assignments.size() == max_assignments)
      cursor_.throw_input_error(from, "at most 50 parameters set in a block");
    if (name.empty())
      block_.number_assignments.emplace_back(number, result);
    else
      block_.name_assignments.emplace_back(std::move(name), result);
  }

  void read_word(bool is_first) {
    if (cursor_.current() == '[')
      cursor_.throw_input_error(cursor_.at, "a word (letter and number)", "an expression ([)");
    Word word = read_letter("@^$");
    read_number(word, grammar(), operands_);
    // A line number must be digits, not an expression.
    const std::size_t digits = word.text.find_first_not_of(" \t", 1);
    if (word.letter == 'N' && (digits == std::string_view::npos || !is_digit(word.text[digits])))
      run_.canon.throw_input_error(word, "a line number in digits");
    if (word.letter == 'G' || word.letter == 'M') return store_code(word);
    if (word.letter == 'N' && !is_first)
      run_.canon.throw_input_error(word, "a line number at the start of the block");
    if (word.letter == 'O') return run_.handle_unknown_word(word, "a word of LinuxCNC");
    if (word.letter == 'N') return;
    put_word(word);
  }

  void store_code(const Word& word) {
    const auto* properties = find_code(word, "LinuxCNC", find_entry);
    if (properties == nullptr) return;
    // rs274 accepts G80 with another motion code and executes the other one.
    const Code& previous = block_[properties->group];
    const bool is_end = tenths_of(word) == 800;
    const bool ends_cycle =
        properties->group == Group::Motion && previous && is_end != (previous.tenths == 800);
    if (!ends_cycle || !is_end)
      put_code(word, properties->group, !ends_cycle, "only one code of a modal group per block");
  }

  OperandParser& operands_;
};

}  // namespace

void read_block(Cursor cursor, ProgramRun& run, OperandParser& operands, Block& block) {
  BlockReader(cursor, run, operands, block).read();
}

}  // namespace linuxcnc

std::span<const WordTableEntry> linuxcnc_words() {
  static const std::vector<WordTableEntry> table =
      word_table<linuxcnc::Line>(linuxcnc::lines, linuxcnc::other_words);
  return table;
}

}  // namespace abbe::sim::dialects
