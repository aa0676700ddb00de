#include "sim/dialects/fanuc/fanuc.h"
#include "sim/dialects/read_program.h"

namespace abbe::sim::dialects {

namespace fanuc {
namespace {

using Line = CodeTableLine<Group>;

// Short names, so that an entry fits its line.
constexpr WordTreatment read = WordTreatment::Read, none = WordTreatment::WithoutEffect,
                        refused = WordTreatment::Refused;

// The single source of the word table in the README, of the messages and of the groups of codes.
constexpr Line lines[] = {
    {"G0 G1", Group::Motion, read, "rapid, active at the start; line"},
    {"G2 G3", Group::Motion, read,
     "arc clockwise, counter-clockwise, also helix; I J K from the start, or R"},
    {"G2.2 G3.2 G2.3 G3.3 G6.2", Group::None, refused,
     "lines and arcs: involutes, exponential curves and NURBS are not supported"},
    {"G2.4 G3.4", Group::None, refused,
     "lines, or arcs in a plane: a circle in space through an intermediate point is not supported"},
    {"G4", Group::OneShot, read, "dwell, X or U in seconds, P in milliseconds, alone in its block"},
    {"G5 G5.1 G5.4 G8", Group::WholeBlock, none,
     "contour control, smoothing, look-ahead and HRV filter: abbe cuts the exact path"},
    {"G7.1 G107 G12.1 G112", Group::None, refused,
     "plain X Y Z: no cylindrical or polar coordinate interpolation"},
    {"G9 G61", Group::WithMotion, none, "exact stop: abbe cuts the exact path"},
    {"G62", Group::WithMotion, none, "slower feed in inside corners; the feed stays as programmed"},
    {"G63", Group::WithMotion, none, "tapping mode: no overrides, abbe runs at 100 %"},
    {"G64", Group::WithMotion, none, "cutting mode: abbe cuts the exact path"},
    {"G10", Group::OneShot, read,
     "L2 L20: origin of G54 to G59 (P0: of all) or of G54.1; L10 L11 L12 L13: length, length wear, "
     "radius, radius wear of a tool; added under G91"},
    {"G10.6 G27 G29 G30.1", Group::None, refused, "moves to a reference position with G28 or G30"},
    {"G11 G13.1 G113", Group::None, none,
     "ends the modes started by G10 and G12.1; axis words with them are rejected"},
    {"G15 G16", Group::Polar, read,
     "polar coordinates off, on: the first axis of the plane is a radius, the second an angle"},
    {"G17 G18 G19", Group::Plane, read, "plane X Y, Z X, Y Z"},
    {"G20 G21", Group::Units, read, "inch, mm"},
    {"G22 G23", Group::WholeBlock, none, "stored stroke checks"},
    {"G25 G26", Group::WholeBlock, none, "checks of spindle speed fluctuation"},
    {"G28 G30", Group::OneShot, read,
     "together with any motion code, which stays active afterwards: rapid through the programmed "
     "point to the reference position of these axes (`reference` of the machine, otherwise their "
     "start position); also for G30"},
    {"G31 G37", Group::None, refused,
     "no probing: a virtual part is measured by instruments (abbe measure)"},
    {"G33", Group::None, refused, "G84 or G1: single-point threading is not possible on a mill"},
    {"G40", Group::CutterRadius, read, "cutter compensation off"},
    {"G41 G42", Group::CutterRadius, read,
     "cutter compensation left, right, by the radius D: the first move, a line, ends perpendicular "
     "to the start of the next (type A, 5003.0 SUP = 0), arcs around outside corners (19607.2 CCC "
     "= 1)"},
    {"G40.1 G41.1 G42.1 G41.2 G42.2 G41.3 G41.4 G42.4 G41.5 G42.5 G41.6 G42.6", Group::None,
     refused, "G41 or G42: no 3D compensation, no normal direction control"},
    {"G43 G44", Group::ToolLength, read,
     "tool length H added to Z, subtracted; it moves no axis by itself (5006.6 TOS = 1)"},
    {"G43.4", Group::ToolLength, read,
     "X Y Z are the tip of tool H in the workpiece frame, rotary words are axis positions; "
     "switching it on moves no axis"},
    {"G43.5", Group::ToolLength, read,
     "the same, but I J K are the tool direction at the end of a block, from the tip to the "
     "spindle"},
    {"G43.1 G43.3 G43.7 G45 G46 G47 G48", Group::None, refused,
     "G43, G43.4 or G43.5 for the tool length"},
    {"G49", Group::ToolLength, read, "no tool length; ends G43.4 and G43.5"},
    {"G50", Group::None, none,
     "end of scaling, which is not supported; axis words with it are rejected"},
    {"G50.1", Group::MirrorEnd, none,
     "end of mirror images, which are not supported; axis words with it name axes and move "
     "nothing"},
    {"G51 G51.1", Group::None, refused, "plain coordinates: no scaling, no mirror images"},
    {"G52", Group::OneShot, read, "shift on top of all coordinate systems"},
    {"G53", Group::OneShot, read,
     "rapid to axis positions, without offsets, under G90, together with any motion code"},
    {"G53.1", Group::OneShot, read,
     "turns the rotary axes so that the tool is along Z of the tilted plane while the linear axes "
     "rest; of two solutions, the one that turns the first axis less (for head and table: the "
     "table)"},
    {"G53.6", Group::OneShot, read, "the same with the tip at rest"},
    {"G54 G55 G56 G57 G58 G59", Group::WorkOffset, read,
     "coordinate system as stated in the scene"},
    {"G54.1", Group::WorkOffset, read,
     "coordinate system P 1 to 300, initially zero; G54 P the same"},
    {"G54.2 G54.4", Group::None, refused, "G54 to G59 or G54.1: no dynamic fixture offsets"},
    {"G60", Group::None, refused, "G0: its overrun beyond the end is a parameter"},
    {"G65", Group::Macro, read, "calls program P with arguments, L times"},
    {"G66", Group::Macro, read, "calls it after every block with motion, until G67"},
    {"G67", Group::Macro, read, "end of G66", true},
    {"G66.1", Group::None, refused, "G66: no call for each block"},
    {"G68", Group::Rotation, read, "rotates the coordinate system in the plane by R about a point"},
    {"G68.2", Group::Rotation, read,
     "tilted plane: origin X Y Z, Euler angles I about Z, J about the new X, K about the new Z"},
    {"G68.3 G68.4", Group::None, refused, "G68.2 with Euler angles"},
    {"G69", Group::Rotation, read, "end of G68 and G68.2", true},
    {"G70 G71 G72 G75 G77 G78 G79", Group::None, refused,
     "a milling program: cycles of lathes and grinding machines are not supported"},
    {"G72.1 G72.2", Group::None, refused, "M98: no rotated or shifted copies"},
    {"G73 G83", Group::Cycle, read,
     "drilling with pecks Q: with chip breaking; with full retraction"},
    {"G74 G84", Group::Cycle, read, "tapping left, right, the spindle reversed at the bottom"},
    {"G76 G87", Group::Cycle, read,
     "fine boring, back boring: the spindle stops, the tool is shifted by Q along +X"},
    {"G80", Group::Cycle, read, "ends a cycle"},
    {"G81 G82", Group::Cycle, read, "drilling; with dwell P"},
    {"G84.2 G84.3", Group::None, refused, "M29 and G84 or G74 for rigid tapping"},
    {"G85 G86 G89", Group::Cycle, read,
     "boring: feed out; spindle stop, rapid out; dwell, feed out"},
    {"G88", Group::None, refused, "G86 or G89: no operator retracts the spindle by hand"},
    {"G90 G91", Group::Distance, read, "absolute, incremental"},
    {"G92", Group::OneShot, read,
     "shift of all coordinate systems that gives the current position the programmed coordinates; "
     "with S alone the maximum speed of G96"},
    {"G92.1", Group::OneShot, read, "cancels the effect of G92 and G52 on these axes"},
    {"G93 G94 G95", Group::FeedMode, read,
     "F: inverse time, in every block; per minute; per revolution of the spindle"},
    {"G96", Group::SpeedMode, read,
     "S is a surface speed at the radius of X: the duration of a block is computed from the speeds "
     "at its points"},
    {"G97", Group::SpeedMode, read, "S is a speed in rpm"},
    {"G98 G99", Group::ReturnLevel, read,
     "cycles return to the initial level, even if it is below R, with a warning; to R"},
    {"M0 M1", Group::Stop, none, "stops"},
    {"M2 M30", Group::Stop, read, "end of the program"},
    {"M3 M4 M5", Group::Spindle, read, "spindle clockwise, counter-clockwise, off"},
    {"M6", Group::ToolChange, read, "change to the tool of T"},
    {"M7 M8 M9 M88 M89", Group::Coolant, none, "coolant, M88 M89 through the tool"},
    {"M10 M11", Group::WithMotion, none, "rotary axes clamped, free"},
    {"M19", Group::WithMotion, none, "spindle orientation"},
    {"M29", Group::RigidTap, read, "rigid tapping: the cycle turns the spindle itself"},
    {"M48 M49", Group::WithMotion, none, "no overrides: abbe runs at 100 %"},
    {"M96 M97", Group::None, refused, "no interrupts: there is no signal"},
    {"M98", Group::Call, read,
     "calls program P, L times; P of up to 8 digits: repeats, then program"},
    {"M99", Group::Call, read, "return, P to this sequence number; in the main program its end"},
    {"M198", Group::None, refused, "M98: programs are in the file or next to it"},
};

// Words other than codes.
constexpr WordTableEntry other_words[] = {
    {"O :", read, "program number"},
    {"N", read, "sequence number"},
    {"F S", read, "feed; spindle speed"},
    {"T D H", read, "tool; its radius, its length by number"},
    {"X Y Z A B C U V W", read, "axes of the machine; mm or inch, degrees"},
    {"1 1.", read,
     "without a decimal point a length or angle is in units of 0.001 mm, 0.001 degrees or 0.0001 "
     "inch (3401.0 DPI = 0, IS-B); with one it is taken as written, with all its digits"},
    {"#1...#33 #100...#199 #500...#999", read,
     "variables of a macro call, of the program; #0 and unset variables are vacant: their words "
     "are omitted"},
    {"#2001...#2400 #10001...#13999", read,
     "offsets: wear and length H, wear (#12001...) and radius (#13001...) D"},
    {"#3000 #3006", read, "alarm, reported as an error; stop"},
    {"#3003 #3004", none, "single block and feed hold"},
    {"#4001...#4130", read, "modes of groups 1 to 10, 12 to 17; D F H M N O S T and P of G54.1"},
    {"#5001...#5009 #5021...#5029 #5041...#5049", read,
     "programmed position; of the axes; with the tool length; X Y Z, then the others by letter"},
    {"#5081...#5089 #5201...#5329 #7001...#7959", read,
     "active tool length; origins of all, G54 to G59 and G54.1 P1 to P48"},
    {"[ ] + - * / MOD AND OR XOR EQ NE GT GE LT LE", read,
     "expressions: * / MOD AND first, then + - OR XOR, then comparisons, each left to right"},
    {"ABS ACOS ASIN ATAN COS EXP FIX FUP LN POW ROUND SIN SQRT TAN", read,
     "functions, degrees; ATAN[y]/[x] from 0 to 360; ROUND in a word to its least increment"},
    {"BIN BCD ADP SETVN", refused, "plain numbers"},
    {"IF GOTO THEN WHILE DO END", read, "conditions, jumps to N, loops 1 to 3"},
    {"ELSE ENDIF", refused, "IF with GOTO, or with THEN on one line"},
    {"( ) ; %", read,
     "comments, those with a tool diameter are noted; end of block; tape marks. The text after / "
     "is left out"},
    {"POPEN PCLOS DPRNT BPRNT", none, "output"},
};

/// Returns the entry of the milling controls.
constexpr Line same(std::string_view words) {
  return *std::ranges::find(lines, words, &Line::words);
}

// G-code system A differs in most groups, so a turning control has a table of its own.
constexpr Line lathe_lines[] = {
    same("G0 G1"),
    {"G2 G3", Group::Motion, read,
     "arc clockwise, counter-clockwise, viewed against Y in G18: I K from the start, I a radius, "
     "or R"},
    {"G4", Group::OneShot, read, "dwell, X or U in seconds, P in milliseconds"},
    {"G7.1 G107 G12.1 G112", Group::None, refused,
     "plain X Z: no cylindrical or polar coordinate interpolation"},
    same("G5 G5.1 G5.4 G8"),
    same("G9 G61"),
    same("G62"),
    same("G63"),
    same("G64"),
    {"G10", Group::OneShot, read,
     "L2 L20: origin of G54 to G59 (P0: of all) or of G54.1, U W adding; without L: X Z U W R, "
     "wear of an offset P1 to P99"},
    same("G11 G13.1 G113"),
    {"G17 G18 G19", Group::Plane, read, "plane X Y, Z X, Y Z; G18 is active at the start"},
    same("G20 G21"),
    same("G22 G23"),
    same("G25 G26"),
    {"G27 G29 G30.1", Group::None, refused, "moves to a reference position with G28 or G30"},
    {"G28 G30", Group::OneShot, read,
     "rapid through the programmed point (U0 W0: from the current position) to the reference "
     "position of these axes (`reference` of the machine, otherwise their start position); also "
     "for G30"},
    {"G31 G36 G37", Group::None, refused,
     "no probing: a virtual part is measured by instruments (abbe measure)"},
    {"G32 G33 G34 G35 G76 G78 G92", Group::None, refused,
     "G1 with the feed of the lead under G99: threads are not synchronised with the spindle"},
    {"G40", Group::CutterRadius, read, "nose compensation off"},
    {"G41 G42", Group::CutterRadius, read,
     "nose compensation left, right: the tool nose follows the contour"},
    {"G50", Group::OneShot, read,
     "S: the maximum speed of G96; X Z: a shift that gives the current position these coordinates; "
     "U W: an incremental shift"},
    {"G50.3", Group::OneShot, read, "cancels the effect of G50 and G52 on these axes"},
    {"G50.2 G51.2 G250 G251", Group::None, refused, "G1: no polygon turning"},
    same("G52"),
    {"G53", Group::OneShot, read, "rapid to axis positions, without offsets"},
    same("G54 G55 G56 G57 G58 G59"),
    same("G54.1"),
    same("G65"),
    same("G66"),
    same("G67"),
    {"G68", Group::None, refused, "one turret: no mirror image for a second one"},
    {"G69 G69.1", Group::None, none,
     "end of the mirror image of a second turret; axis words with it are rejected"},
    {"G70 G71 G72 G73 G74 G75", Group::None, refused,
     "explicit passes with G1 to G3, G90 or G94: roughing, finishing and grooving cycles are not "
     "expanded"},
    {"G80", Group::Cycle, read, "no cycle"},
    {"G81 G82 G83 G84 G85 G86 G87 G88 G89", Group::None, refused,
     "explicit moves: drilling cycles of a turning control are not expanded"},
    {"G90 G94", Group::Motion, read,
     "turning along Z, facing along X: rapid to the cut, feed along it and out of it, rapid back; "
     "R tapers"},
    {"G91 G93 G95", Group::None, refused,
     "U V W H for increments, G98 or G99 for feeds: G91, G93 and G95 belong to G-code systems B "
     "and C"},
    same("G96"),
    {"G97", Group::SpeedMode, read, "S is a speed in rpm; without S the speed is kept"},
    {"G98 G99", Group::FeedMode, read, "F is per minute; per revolution of the spindle"},
    same("M0 M1"),
    same("M2 M30"),
    same("M3 M4 M5"),
    {"M6", Group::WithMotion, none, "T alone indexes the turret"},
    same("M7 M8 M9 M88 M89"),
    {"M10 M11", Group::WithMotion, none, "chuck closed, open"},
    same("M19"),
    {"M40 M41 M42 M43 M44 M45", Group::WithMotion, none, "spindle gears"},
    {"M23 M24", Group::WithMotion, none, "thread run-out"},
    same("M48 M49"),
    same("M96 M97"),
    same("M98"),
    same("M99"),
    same("M198"),
};

// Words other than codes, of a turning control.
constexpr WordTableEntry other_lathe_words[] = {
    {"O :", read, "program number"},
    {"N", read, "sequence number"},
    {"F S", read, "feed; spindle speed"},
    {"T", read,
     "tool and offset, T0101. With an offset, X Z guide the tool point, and X0 is on the spindle "
     "line: the geometry is that of the scene's tool, and program.tip states which point; T0100 "
     "ends it"},
    {"X Z Y C", read, "axes of the machine, X a diameter; mm or inch, degrees"},
    {"U W V H", read, "increments of X Z Y C"},
    {",C ,R", refused, "plain lines and arcs: corners are not expanded"},
};

}  // namespace

// Tables are built at first use and indexed by tenths: every code of a program is looked up.
const gcode::CodeProperties& find_entry(char letter, int tenths) {
  static const CodeTable<Group> table(lines);
  return table.find_entry(letter, tenths);
}

const gcode::CodeProperties& find_lathe_entry(char letter, int tenths) {
  static const CodeTable<Group> table(lathe_lines);
  return table.find_entry(letter, tenths);
}

std::string_view word_sentence(std::string_view word) {
  return find_word(other_words, word)->sentence;
}

namespace {

// Checks of operands. Each returns what it expected, for the error message, or null if the operands
// are valid.

const char* expect_nonzero_divisor(double, double b) {
  return zero_if_vacant(b) == 0 ? "a nonzero divisor" : nullptr;
}

// AND, OR, XOR and MOD work on whole numbers of 32 bits.
const char* expect_integers(double a, double b) {
  const auto is_integer = [](double x) { return x == std::floor(x) && std::abs(x) < 2147483648.0; };
  return is_integer(zero_if_vacant(a)) && is_integer(zero_if_vacant(b))
             ? nullptr
             : "32-bit integers on both sides";
}

const char* expect_modulus_operands(double a, double b) {
  const char* expected = expect_nonzero_divisor(a, b);
  return expected != nullptr ? expected : expect_integers(a, b);
}

long long to_bits(double x) { return (long long)(zero_if_vacant(x)); }

// A vacant variable is equal (EQ) only to another one.
bool are_equal(double a, double b) {
  return is_vacant(a) == is_vacant(b) && zero_if_vacant(a) == zero_if_vacant(b);
}

// Precedence levels of custom macro B: multiplication and AND bind most tightly, then addition, OR
// and XOR, then comparisons.
constexpr Operator operators[] = {
    {"*", 3, [](double a, double b) { return zero_if_vacant(a) * zero_if_vacant(b); }},
    {"/", 3, [](double a, double b) { return zero_if_vacant(a) / zero_if_vacant(b); },
     expect_nonzero_divisor},
    {"MOD", 3, [](double a, double b) { return std::fmod(zero_if_vacant(a), zero_if_vacant(b)); },
     expect_modulus_operands},
    {"AND", 3, [](double a, double b) { return double(to_bits(a) & to_bits(b)); }, expect_integers},
    {"+", 2, [](double a, double b) { return zero_if_vacant(a) + zero_if_vacant(b); }},
    {"-", 2, [](double a, double b) { return zero_if_vacant(a) - zero_if_vacant(b); }},
    {"XOR", 2, [](double a, double b) { return double(to_bits(a) ^ to_bits(b)); }, expect_integers},
    {"OR", 2, [](double a, double b) { return double(to_bits(a) | to_bits(b)); }, expect_integers},
    {"EQ", 1, [](double a, double b) { return double(are_equal(a, b)); }},
    {"NE", 1, [](double a, double b) { return double(!are_equal(a, b)); }},
    {"GT", 1, [](double a, double b) { return double(zero_if_vacant(a) > zero_if_vacant(b)); }},
    {"GE", 1, [](double a, double b) { return double(zero_if_vacant(a) >= zero_if_vacant(b)); }},
    {"LT", 1, [](double a, double b) { return double(zero_if_vacant(a) < zero_if_vacant(b)); }},
    {"LE", 1, [](double a, double b) { return double(zero_if_vacant(a) <= zero_if_vacant(b)); }},
};

/// Arc sine in degrees, 270 to 360 for negative arguments and 0 to 90 otherwise, as with parameter
/// 6004.0 (NAT) = 0.
double arc_sine(double x) {
  const double angle = std::asin(x) / units::deg;
  return angle < 0 ? angle + 360.0 : angle;
}

// `Flow::parse_operand` handles ROUND, ATAN and POW, which take several arguments or depend on the
// address.
constexpr Function functions[] = {
    {"ASIN", arc_sine,
     [](double x) { return x < -1 || x > 1 ? "a number from -1 to 1" : nullptr; }},
    {"FIX", [](double x) { return std::trunc(x); }},
    {"FUP", [](double x) { return x < 0 ? std::floor(x) : std::ceil(x); }},
};

}  // namespace

const ExpressionGrammar& grammar() {
  static const ExpressionGrammar macro_grammar{operators, functions,          '[',           ']',
                                               false,     common_functions(), zero_if_vacant};
  return macro_grammar;
}

namespace {

constexpr std::string_view address_letters = "ABCDFGHIJKLMNPQRSTUVWXYZ";
constexpr std::size_t max_arguments = 100;  // bounds the memory for a hostile line

// Splits a block into words and codes.
class BlockReader : public gcode::BlockReader {
 public:
  BlockReader(Cursor& cursor, ProgramRun& run, MacroOperands& operands, Block& block)
      : gcode::BlockReader(cursor, run, block), operands_(operands) {}

  void read() {
    cursor_.skip_blanks();
    // The rest of a line with % is outside of the program.
    block_.is_percent_line = cursor_.current() == '%';
    while (!block_.is_percent_line && skip_to_next_word()) read_word();
  }

 private:
  /// Advances past comments to the next word. Returns false at the end of the block: at the end of
  /// the line, at ; or at a / whose level is skipped. Throws an input error if another block
  /// follows a ;.
  bool skip_to_next_word() {
    collect_comments(cursor_, block_.comments);
    if (cursor_.at_end()) return false;
    if (cursor_.current() == ';') {
      ++cursor_.at;
      collect_comments(cursor_, block_.comments);
      // A second block on a line would have no line number of its own.
      if (!cursor_.at_end())
        cursor_.throw_input_error(cursor_.at, "the next block on a line of its own");
      return false;
    }
    if (cursor_.current() != '/') return true;
    return !run_.skips_block(read_skip_level(cursor_)) && skip_to_next_word();
  }

  void read_word() {
    // ,C and ,R would insert a chamfer or a rounding before the next block.
    if (cursor_.current() == ',')
      cursor_.throw_input_error(cursor_.at,
                                "plain lines and arcs: corners with ,C and ,R are not expanded");
    Word word = read_letter();
    // ROUND[] rounds to the least increment of the address that it follows.
    operands_.resolution = min_increment(word.letter, run_.canon.inch());
    read_number(word, grammar(), operands_);
    // A number with a point or an expression is in full units (mm, degrees); only a bare integer
    // counts increments.
    word.is_in_full_units = word.text.find_first_of(".#[") != std::string_view::npos;
    // The control ignores an address whose value is a vacant variable.
    if (is_vacant(word.value)) return;
    // In tenths: 650 is G65, 660 is G66.
    const int macro_code = block_.tenths(Group::Macro);
    const bool is_macro_call = macro_code == 650 || macro_code == 660;
    if (word.letter == 'G') return store_code(word);
    if (word.letter == 'N')
      return run_.canon.throw_input_error(word, "a sequence number at the start of the block");
    // After G65 and G66 all letters except L and P are arguments of the macro.
    if (is_macro_call && std::string_view("LP").find(word.letter) == std::string_view::npos) {
      if (block_.arguments.size() == max_arguments)
        cursor_.throw_input_error(std::size_t(word.column - 1), "at most 100 arguments");
      block_.arguments.push_back(word);
      return;
    }
    if (word.letter == 'M') return store_code(word);
    if (address_letters.find(word.letter) == std::string_view::npos)
      return run_.handle_unknown_word(word, "a word of Fanuc's milling controls");
    put_word(word);
  }

  void store_code(const Word& word) {
    const bool is_turning = run_.is_turning();
    const auto* properties =
        find_code(word, is_turning ? "Fanuc's turning controls" : "Fanuc's milling controls",
                  is_turning ? find_lathe_entry : find_entry);
    if (properties == nullptr) return;
    // The last of several G codes of a modal group is in force. Codes of group 00, and M codes
    // other than coolant, may appear only once in a block.
    const Group group = properties->group;
    const bool must_be_unique =
        word.letter == 'M' ? group != Group::Coolant : group == Group::OneShot;
    put_code(word, group, must_be_unique, "only one such code per block");
  }

  MacroOperands& operands_;
};

}  // namespace

int whole_number(const program::Canon& canon, const Word& word, int max) {
  const double rounded = std::round(word.value);
  // A literal must be an integer; a computed value carries rounding errors, so it is rounded.
  const bool is_literal = word.text.find_first_of("#[") == std::string_view::npos;
  if ((is_literal && word.is_in_full_units) || rounded < 0 || rounded > max)
    canon.throw_input_error(word,
                            fmt::format("an integer from 0 to {} without a decimal point", max));
  return int(rounded);
}

double min_increment(char letter, bool inch) {
  // Increment system IS-B. In inches too, rotary axes count in 0.001 degrees.
  return inch && !(letter >= 'A' && letter <= 'C') ? 1e-4 : 1e-3;
}

int read_skip_level(Cursor& cursor) {
  // The level follows directly; / alone is level 1.
  const bool has_level_digit = is_digit(cursor.peek());
  const int level = has_level_digit ? cursor.peek() - '0' : 1;
  cursor.at += has_level_digit ? 2 : 1;
  return level;
}

void collect_comments(Cursor& cursor, std::vector<std::string_view>& comments) {
  for (cursor.skip_blanks(); cursor.current() == '('; cursor.skip_blanks())
    comments.push_back(gcode::read_comment(cursor));
}

void read_block(Cursor cursor, ProgramRun& run, MacroOperands& operands, Block& block) {
  BlockReader(cursor, run, operands, block).read();
}

}  // namespace fanuc

std::span<const WordTableEntry> fanuc_words() {
  static const std::vector<WordTableEntry> table =
      word_table<fanuc::Line>(fanuc::lines, fanuc::other_words);
  return table;
}

std::span<const WordTableEntry> fanuc_lathe_words() {
  static const std::vector<WordTableEntry> table =
      word_table<fanuc::Line>(fanuc::lathe_lines, fanuc::other_lathe_words);
  return table;
}

}  // namespace abbe::sim::dialects
