#include "sim/dialects/read_program.h"
#include "sim/dialects/siemens/siemens.h"

namespace abbe::sim::dialects {

namespace siemens {
namespace {

using WordLine = CodeTableLine<Group>;

// Short names, so that an entry fits its line.
constexpr WordTreatment read = WordTreatment::Read, none = WordTreatment::WithoutEffect,
                        refused = WordTreatment::Refused;

// The single source of the word table in the README, of the messages and of the groups of words.
constexpr WordLine word_lines[] = {
    {"G0 G1", Group::Motion, read, "rapid; line"},
    {"G2 G3", Group::Motion, read,
     "arc clockwise, counter-clockwise, also helix: I J K from the start or by AC(), CR= "
     "(negative: more than half a turn), AR=, about the pole with AP= RP=; TURN= additional full "
     "turns"},
    {"CIP", Group::Motion, read, "arc through I1= J1= K1=, in any plane"},
    {"CT", Group::None, refused, "G2, G3 or CIP: tangential arcs are not supported"},
    {"G4", Group::Dwell, read, "dwell, F seconds or S revolutions of the spindle"},
    {"G33", Group::Motion, read,
     "line at I J K mm per revolution of the spindle, along the axis with the longest travel"},
    {"G34 G35 G63 G331 G332", Group::None, refused,
     "G33 for threads, CYCLE84 for tapping: variable pitches and taps without a cycle are not "
     "supported"},
    {"G17 G18 G19", Group::Plane, read, "plane X Y, Z X, Y Z"},
    {"G40", Group::CutterRadius, read, "cutter compensation off"},
    {"G41 G42", Group::CutterRadius, read,
     "cutter compensation left, right, by lines and arcs in the plane: approach and retract "
     "perpendicular to the contour (NORM), arcs around outside corners (G450); corners below 0.001 "
     "rad are ignored"},
    {"OFFN", Group::None, refused, "OFFN=0: no allowance on a contour"},
    {"G53 G153 SUPA", Group::WithoutOffset, read,
     "for the block: axis positions without offsets and frames; an active tool length (D1) is "
     "still included"},
    {"G54 G55 G56 G57 G505 G506", Group::WorkOffset, read,
     "work offset, G54 to G59 of the scene or as stated by `offsets`: position of the workpiece "
     "with the rotary axes at zero"},
    {"G507 G508 G509 G510 G511 G512 G513 G514 G515 G516 G517 G518 G519 G520 G521 G522 G523 G524 "
     "G525 G526 G527 G528 G529 G530 G531 G532 G533 G534 G535 G536 G537 G538 G539 G540 G541 G542 "
     "G543 G544 G545 G546 G547 G548 G549 G550 G551 G552 G553 G554 G555 G556 G557 G558 G559 G560 "
     "G561 G562 G563 G564 G565 G566 G567 G568 G569 G570 G571 G572 G573 G574 G575 G576 G577 G578 "
     "G579 G580 G581 G582 G583 G584 G585 G586 G587 G588 G589 G590 G591 G592 G593 G594 G595 G596 "
     "G597 G598 G599",
     Group::WorkOffset, read,
     "work offset of the control's table, `offsets`, $P_UIFR[7] to [99]; rejected if the table has "
     "none"},
    {"G500", Group::WorkOffset, read, "no work offset"},
    {"G58 G59", Group::None, refused, "TRANS or ATRANS: no shifts axis by axis"},
    {"TRANS ATRANS", Group::Frame, read, "programmable shift: alone, on top"},
    {"ROT AROT", Group::Frame, read,
     "programmable rotation: alone, on top; for several axes Z, then Y, then X, each about the "
     "rotated axis; RPL= about the axis normal to the plane"},
    {"MIRROR AMIRROR SCALE ASCALE ROTS AROTS CROTS", Group::None, refused,
     "TRANS and ROT: no mirroring or scaling frames, no rotation by solid angles"},
    {"G60 G601 G602 G603 G9", Group::WithMotion, none,
     "exact stop: abbe always cuts the exact path"},
    {"G64 G641 G642 G643 G644 G645 ADIS ADISPOS", Group::WithMotion, none,
     "continuous path: abbe cuts the exact path, without the roundings of a real control"},
    {"G70 G700", Group::Units, read, "inch: lengths; lengths and F"},
    {"G71 G710", Group::Units, read, "mm: lengths; lengths and F"},
    {"G90 G91", Group::Distance, read, "absolute, incremental"},
    {"G93 G94 G95", Group::FeedMode, read,
     "F: inverse time, in every block; per minute; per revolution of the spindle"},
    {"G96 G961 G962", Group::SpeedMode, read,
     "S is a surface speed at the radius of X, LIMS= the maximum rpm: the duration of a block is "
     "computed from the speeds at its points. F is per revolution; per minute; as it was"},
    {"G97 G971 G972 G973", Group::SpeedMode, read,
     "S is a speed in rpm. F is per revolution; per minute; as it was; per revolution, without "
     "LIMS"},
    {"G110 G111 G112", Group::Pole, read,
     "pole of AP= RP=: from the current position, from the origin, from the previous pole"},
    {"G25 G26", Group::Limits, none, "limits of working area and speed"},
    {"G74 G75", Group::None, refused,
     "SUPA and positions: reference points are specific to the machine"},
    {"G147 G148 G247 G248 G347 G348 G140 G141 G142 G143", Group::None, refused,
     "lines and arcs: approaches computed by the control are not supported"},
    {"G290", Group::None, none, "the language of Siemens"},
    {"G291", Group::None, refused, "G290, or dialect = \"fanuc\": programs in ISO dialect mode"},
    {"NORM G450", Group::WithMotion, none,
     "approach and retract perpendicular to the contour, arcs around outside corners: abbe always "
     "moves this way"},
    {"CUT2D CUT2DF", Group::WithMotion, none,
     "cutter compensation in the plane: abbe always computes it this way"},
    {"CFTCP CFC CFIN", Group::WithMotion, none,
     "reference point of F under G41 and G42: F is taken at the tool centre"},
    {"G451 KONT KONTC KONTT DISC", Group::None, refused,
     "G450 and NORM: no other contour approach and corner treatment"},
    {"CUT3DC CUT3DF CUT3DFS CUT3DFF", Group::None, refused,
     "a path of the tool centre: no 3D compensation"},
    {"TRAORI", Group::Transformation, read,
     "X Y Z are the tip in the workpiece frame, rotary words are axis positions"},
    {"TRAFOOF", Group::Transformation, read, "X Y Z are axes again"},
    {"TRANSMIT TRACYL TRAANG TRACON", Group::None, refused,
     "TRAORI, or axis positions: no other transformation"},
    {"ORIWKS ORIMKS", Group::OrientationFrame, read,
     "a line turns the tool on a great circle, as chords within 1 urad; its rotary axes "
     "interpolate linearly"},
    {"ORIVECT ORIPLANE ORIAXES", Group::OrientationPath, read,
     "the same as separate words, which take precedence: great circle; rotary axes interpolate "
     "linearly"},
    {"ORICONCW ORICONCCW ORICONIO ORICONTO ORICURVE ORIPATH ORIPATHS", Group::None, refused,
     "ORIVECT or ORIAXES: no orientation on cones, curves or along a path"},
    {"ORIEULER ORIRPY ORIRPY2 ORIVIRT1 ORIVIRT2", Group::WithMotion, none,
     "meaning of A2 B2 C2, which are rejected"},
    {"ORISON ORISOF", Group::WithMotion, none, "orientation smoothing: abbe cuts as programmed"},
    {"TOROT TOFRAME PAROT TCARR TCOABS TCOFR", Group::None, refused,
     "CYCLE800 or TRAORI: no frames from a tool carrier"},
    {"TOROTOF PAROTOF", Group::WithMotion, none, "no frame from a tool carrier"},
    {"ASPLINE BSPLINE CSPLINE POLY INVCW INVCCW", Group::None, refused,
     "lines and arcs: no splines, polynomials and involutes"},
    {"CHF CHR RND RNDM ANG", Group::None, refused,
     "plain contour: no chamfers, roundings and angles between blocks"},
    {"COMPCAD COMPCURV COMPON COMPSURF COMPOF", Group::WithMotion, none,
     "compressor: abbe cuts the points as programmed"},
    {"CTOL OTOL", Group::WithMotion, none,
     "tolerances of contour and orientation: abbe cuts as programmed"},
    {"SOFT BRISK DRIVE", Group::WithMotion, none, "acceleration behaviour of the axes"},
    {"FFWON FFWOF", Group::WithMotion, none, "feedforward of the drives"},
    {"JERKLIM VELOLIM ACC ACCLIMA", Group::WithMotion, none,
     "limits of jerk, speed and acceleration"},
    {"CPRECON CPRECOF", Group::WithMotion, none, "contour accuracy by a lower feed"},
    {"FIFOCTRL STARTFIFO STOPFIFO STOPRE", Group::WithMotion, none, "preparation of blocks"},
    {"SBLON SBLOF", Group::WithMotion, none, "single block"},
    {"DISPLON DISPLOF", Group::WithMotion, none, "display of blocks"},
    {"SETMS", Group::MasterSpindle, read,
     "the master spindle, to which S and M without a number apply: that with this number, without "
     "one spindle 1"},
    {"UPATH SPATH", Group::WithMotion, none, "parameter of polynomials, which are not supported"},
    {"RTLION RTLIOF", Group::WithMotion, none,
     "rapids on a line or with each axis independent: abbe takes the line"},
    {"FNORM", Group::WithMotion, none, "constant feed along a block: abbe always keeps it"},
    {"WALIMON WALIMOF", Group::WithMotion, none, "limits of the working area"},
    {"SPOS SPOSA", Group::WithMotion, none, "spindle orientation"},
    {"SPCON SPCOF", Group::WithMotion, none, "position control of the spindle"},
    {"FGROUP FGREF", Group::WithMotion, none,
     "axes to which F applies: abbe applies F to X Y Z, otherwise to the degrees of rotary axes"},
    {"FL", Group::WithMotion, none, "maximum speed of an axis"},
    {"FLIN FCUB FPO FB FZ FRC FRCM", Group::None, refused, "F: no other feed"},
    {"DIAMON DIAM90 DIAMOF", Group::Diameters, read,
     "X words are diameters; absolute ones are; none is. Also I=AC(), other I and CR= are radii. "
     "Turning controls start with DIAMON; others reject DIAMON and DIAM90"},
    {"CYCLE832", Group::None, none,
     "tolerance of fast cutting: abbe cuts as programmed; axis words with it are rejected"},
    {"GROUP_BEGIN GROUP_END GROUP_ADDEND", Group::None, none,
     "blocks folded by an editor; axis words with them are rejected"},
    {"WORKPIECE", Group::None, none,
     "the blank: that of the scene is cut; axis words with it are rejected"},
    {"EXTERN", Group::None, none, "declaration of a subprogram; axis words with it are rejected"},
    {"PROTA PROTS", Group::None, none,
     "protection areas of the control; axis words with them are rejected"},
    {"MSG", Group::WithMotion, none, "messages"},
    {"WAITM WAITMC WAITE WAITP INIT START SETM CLEARM", Group::None, none,
     "other channels: abbe has only one"},
    {"MEAS MEAW MEASA MEAWA MEAC", Group::None, refused,
     "no probing: a virtual part is measured by instruments (abbe measure)"},
    {"PCALL EXTCALL CALLPATH ISOCALL", Group::None, refused,
     "CALL \"NAME\": files in the folder of the program"},
    {"A2 B2 C2 A4 B4 C4 A5 B5 C5 A6 B6 C6 A7 B7 C7 LEAD TILT THETA", Group::None, refused,
     "A3= B3= C3=: the tool direction as a vector"},
    {"CYCLE840 CYCLE87 CYCLE88", Group::None, refused,
     "CYCLE84 to CYCLE86 or CYCLE89: no tapping with a floating chuck, no stops in a bore"},
    {"HOLES1 HOLES2 CYCLE801 CYCLE802 CYCLE71 CYCLE72 CYCLE76 CYCLE77 CYCLE78 CYCLE79 CYCLE899 "
     "CYCLE90 CYCLE60 CYCLE61 CYCLE62 CYCLE63 CYCLE64 CYCLE70 POCKET1 POCKET2 POCKET3 POCKET4 "
     "SLOT1 SLOT2 LONGHOLE CYCLE977 CYCLE978 CYCLE996 CYCLE9960",
     Group::None, refused, "explicit moves: only drilling cycles are expanded"},
    {"CYCLE92 CYCLE93 CYCLE94 CYCLE95 CYCLE96 CYCLE97 CYCLE98 CYCLE99 CYCLE930 CYCLE940 CYCLE951 "
     "CYCLE952",
     Group::None, refused,
     "explicit passes: cycles for stock removal, grooves, undercuts and threads are not expanded"},
    {"MCALL", Group::None, read, "calls a cycle or subprogram after every block with motion"},
    {"M0 M1 M60", Group::Stop, none, "stops"},
    {"M2 M30 M17", Group::Stop, read, "end of the program or subprogram"},
    {"M3 M4 M5", Group::Spindle, read, "spindle clockwise, counter-clockwise, off"},
    {"M6", Group::ToolChange, read,
     "change to the tool of T; without M6 in the program, T itself changes it"},
    {"M7 M8 M9", Group::WithMotion, none, "coolant"},
    {"M19", Group::WithMotion, none, "spindle orientation"},
    {"M40 M41 M42 M43 M44 M45", Group::WithMotion, none, "spindle gears"},
    {"M70", Group::None, refused, "M3, M4 or M5: the spindle is not an axis"},
};

// Words other than codes.
constexpr WordTableEntry siemens_other_words[] = {
    {"F", read, "feed"},
    {"S", read, "spindle speed; S2=, S[2]= for a spindle by number"},
    {"T", read,
     "tool by number or T=\"NAME\" of the scene; T1=, T2= with a spindle, which must be the "
     "master"},
    {"N", read, "line number"},
    {"D", read, "D0 no tool length, D1 that of the tool, active after every tool change"},
    {"M= M1= M[1]=", read,
     "M code as an expression, and for a spindle: M3 M4 M5 of the master spindle; for others they "
     "have no effect, with a warning"},
    {"H", none, "outputs of the control", true},
    {"X Y Z A B C U V W", read, "axes of the machine; mm or inch, degrees; X=expression"},
    {"AC() IC() DC() ACP() ACN()", read,
     "absolute, incremental, by the shortest way, in the positive, in the negative direction"},
    {"A3 B3 C3", read,
     "tool direction in the workpiece frame, from the tip to the spindle, under TRAORI: the rotary "
     "axes take the shortest way to it",
     true},
    {"I J K", read, "centre of an arc from its start, or by AC()", true},
    {"CR", read, "radius of an arc, negative for more than half a turn", true},
    {"AR", read, "opening angle of an arc", true},
    {"TURN", read, "additional full turns of a helix", true},
    {"I1 J1 K1", read, "point between the ends of the arc of CIP", true},
    {"AP RP", read, "polar angle and radius about the pole", true},
    {"RPL", read, "angle of ROT and AROT in the plane"},
    {"LIMS", read, "maximum rpm under G96", true},
    {"P", read, "number of repeats of a subprogram or a part of a program", true},
    {"CYCLE800", read,
     "swivelled plane: by angles about axes in any order or by solid angle, X0 Y0 Z0 and X1 Y1 Z1, "
     "new or additive, swivelled by _DIR or not; () ends it"},
    {"CYCLE81 CYCLE82 CYCLE83", read,
     "drilling; with dwell; with pecks, chip breaking or full retraction"},
    {"CYCLE84", read, "rigid tapping at the pitch PIT or MPIT"},
    {"CYCLE85 CYCLE86 CYCLE89", read,
     "boring: feed out at RFF; spindle stop and lift-off; dwell, feed out"},
    {"R", read, "R parameters"},
    {"DEF REAL INT BOOL CHAR STRING AXIS", read,
     "variables: numbers, arrays of them, and strings as names of tools and programs"},
    {"+ - * / DIV MOD == <> < > <= >= NOT AND OR XOR B_AND B_OR B_XOR", read,
     "expressions: * / DIV MOD, + -, B_AND, B_XOR, B_OR, AND, XOR, OR, comparisons last"},
    {"SIN COS TAN ASIN ACOS ATAN2 SQRT ABS POT TRUNC ROUND ROUNDUP LN EXP MINVAL MAXVAL BOUND",
     read, "functions, degrees"},
    {"$PI TRUE FALSE", read, "pi, 1 and 0"},
    {"$P_EP $AA_IW", read, "current positions in the workpiece frame"},
    {"$AA_IM", read, "current positions of the axes"},
    {"IF ELSE ENDIF FOR TO ENDFOR WHILE ENDWHILE LOOP ENDLOOP REPEAT UNTIL", read,
     "conditions and loops"},
    {"GOTO GOTOF GOTOB GOTOC CASE OF DEFAULT", read, "jumps to labels and line numbers"},
    {"GOTOS", refused, "GOTOB and a label: no jump to the start"},
    {"REPEATB ENDLABEL", read, "with REPEAT and labels: parts of a program again, P times"},
    {"L CALL PROC RET", read,
     "subprograms L123, NAME, NAME(...), in the program after %_N_NAME_SPF or in NAME.SPF next to "
     "it; parameters by value"},
    {"VAR SAVE", refused, "parameters by value, modes set again by the caller"},
    {"%_N_ ;", read,
     "program headers; comments, those with a tool diameter are noted; a / at the start of a line "
     "leaves it out"},
};

// Built at first use: every word of a program is looked up.
std::unordered_map<std::string_view, WordEntry> entries_by_word() {
  std::unordered_map<std::string_view, WordEntry> entries;
  for (const WordLine& line : word_lines)
    each_word(line.words, [&](std::string_view word) {
      entries[word] = {word, line.group, line.use, line.sentence};
    });
  return entries;
}

}  // namespace

bool is_beside_motion(Group group) {
  static constexpr Group others[] = {Group::None, Group::Pole, Group::Dwell, Group::Frame,
                                     Group::Limits};
  return std::ranges::find(others, group) == std::end(others);
}

const WordEntry* find_entry(std::string_view word) {
  static const std::unordered_map<std::string_view, WordEntry> entries = entries_by_word();
  const auto entry = entries.find(word);
  return entry == entries.end() ? nullptr : &entry->second;
}

namespace {

// Relative tolerance of == and other comparisons.
constexpr double equality_tolerance = 1e-12;

bool are_equal(double a, double b) {
  return std::abs(a - b) <= equality_tolerance * std::max(std::abs(a), std::abs(b));
}

// Bitwise operators work on 32 bit integers.
const char* require_32_bits(double a, double b) {
  constexpr double limit = 2147483648.0;
  return std::abs(a) < limit && std::abs(b) < limit ? nullptr : "32-bit integers";
}

std::int64_t to_integer(double x) { return std::int64_t(std::trunc(x)); }

// Comparisons bind least tightly, below AND and OR: as on the control, IF A==1 AND B==2 needs
// brackets.
constexpr Operator operators[] = {
    {"*", 9, [](double a, double b) { return a * b; }},
    {"/", 9, [](double a, double b) { return a / b; }, require_nonzero_divisor},
    {"DIV", 9, [](double a, double b) { return std::trunc(a / b); }, require_nonzero_divisor},
    {"MOD", 9, [](double a, double b) { return std::fmod(a, b); }, require_nonzero_divisor},
    {"+", 8, [](double a, double b) { return a + b; }},
    {"-", 8, [](double a, double b) { return a - b; }},
    {"B_AND", 7, [](double a, double b) { return double(to_integer(a) & to_integer(b)); },
     require_32_bits},
    {"B_XOR", 6, [](double a, double b) { return double(to_integer(a) ^ to_integer(b)); },
     require_32_bits},
    {"B_OR", 5, [](double a, double b) { return double(to_integer(a) | to_integer(b)); },
     require_32_bits},
    {"AND", 4, [](double a, double b) { return double(a != 0 && b != 0); }},
    {"XOR", 3, [](double a, double b) { return double((a != 0) != (b != 0)); }},
    {"OR", 2, [](double a, double b) { return double(a != 0 || b != 0); }},
    {"==", 1, [](double a, double b) { return double(are_equal(a, b)); }},
    {"<>", 1, [](double a, double b) { return double(!are_equal(a, b)); }},
    {"<=", 1, [](double a, double b) { return double(a <= b || are_equal(a, b)); }},
    {">=", 1, [](double a, double b) { return double(a >= b || are_equal(a, b)); }},
    {"<", 1, [](double a, double b) { return double(a < b && !are_equal(a, b)); }},
    {">", 1, [](double a, double b) { return double(a > b && !are_equal(a, b)); }},
};

// `Flow::parse_multi_argument_function` handles functions of several numbers.
constexpr Function functions[] = {
    {"POT", [](double x) { return x * x; }},
    {"TRUNC", [](double x) { return std::trunc(x); }},
    {"ROUND", [](double x) { return double(std::round(x)); }},
    {"ROUNDUP", [](double x) { return std::ceil(x); }},
};

/// Returns true if the word at `at` begins like an operator but is longer.
bool is_longer_word(std::string_view text, std::size_t at) {
  static const std::string nowhere;
  for (const std::string_view op : {"DIV", "MOD", "AND", "XOR", "OR"}) {
    Cursor cursor{text, {nowhere, 0}, at};
    if (!cursor.accept(op)) continue;
    return is_letter(cursor.current()) || cursor.current() == '_';
  }
  return false;
}

}  // namespace

const ExpressionGrammar& grammar() {
  static const ExpressionGrammar siemens_grammar{operators, functions, '(',
                                                 ')',       false,     common_functions()};
  return siemens_grammar;
}

double parse_number(Cursor& cursor, VariableParser& variables) {
  // Operators need no blank after them (DIV2), so the parser would read ORIWKS as OR. Therefore
  // the text is cut before such a word.
  std::size_t end = cursor.text.size();
  for (std::size_t at = cursor.at + 1; at < end; ++at)
    if (is_blank(cursor.text[at - 1]) && is_letter(cursor.text[at]) &&
        is_longer_word(cursor.text, at))
      end = at;
  Cursor expression{cursor.text.substr(0, end), cursor.location, cursor.at};
  const double value = parse_expression(expression, grammar(), variables);
  // Messages quote the expression without the blanks after it.
  while (expression.at > cursor.at && is_blank(expression.text[expression.at - 1])) --expression.at;
  cursor.at = expression.at;
  return value;
}

namespace {

// Bounds the memory of a hostile line.
constexpr std::size_t max_name_bytes = 100;
constexpr std::size_t max_block_bytes = 4096;
constexpr std::size_t max_arguments = 100;

std::optional<Address> find_address(std::string_view name) {
  const auto entry = std::ranges::find(address_names, name);
  if (entry == std::end(address_names)) return std::nullopt;
  return Address(std::size_t(entry - address_names));
}

/// Advances past a bracket, its content and the closing bracket. Brackets in quoted text do not
/// count.
void skip_brackets(Cursor& cursor, char open, char close) {
  const std::size_t from = cursor.at;
  int depth = 0;
  for (bool is_quoted = false; !cursor.at_end(); ++cursor.at) {
    const char c = cursor.current();
    if (c == '"') is_quoted = !is_quoted;
    if (is_quoted) continue;
    if (c == open) ++depth;
    if (c == close && --depth == 0) {
      ++cursor.at;
      return;
    }
  }
  cursor.throw_input_error(from, fmt::format("{} after {}", close, open), "the end of the line");
}

}  // namespace

bool is_name_char(char c) { return is_letter(c) || is_digit(c) || c == '_'; }

bool is_before_assignment(const Cursor& cursor) {
  Cursor ahead = cursor;
  ahead.skip_blanks();
  return ahead.current() == '=' && ahead.peek() != '=';
}

void Block::clear() {
  values.fill({});
  codes.fill({});
  coolant.clear();
  tool_name.reset();
  spindles.clear();
  code_forbidding_axis_words = {};
  call.reset();
  is_modal = false;
}

std::string parse_name(Cursor& cursor) {
  std::string name;
  const std::size_t from = cursor.at;
  if (!is_letter(cursor.current()) && cursor.current() != '_') return name;
  for (; is_name_char(cursor.current()); ++cursor.at) name += upper(cursor.current());
  if (name.size() > max_name_bytes)
    cursor.throw_input_error(from, "a name of at most 100 letters", "a longer one");
  return name;
}

std::string parse_quoted_text(Cursor& cursor) {
  const std::size_t from = cursor.at++;
  std::string text;
  for (; cursor.current() != '"'; ++cursor.at) {
    if (cursor.at_end())
      cursor.throw_input_error(from, "\" that ends the string on its line", "none");
    text += cursor.current();
  }
  ++cursor.at;
  return text;
}

std::vector<Argument> parse_arguments(Cursor& cursor, VariableParser& variables) {
  std::vector<Argument> arguments;
  const std::size_t open = cursor.at++;
  if (next_char(cursor) == ')') {
    ++cursor.at;
    return arguments;
  }
  while (true) {
    const std::size_t from = skip_blanks(cursor);
    Argument argument;
    if (cursor.current() == '"')
      argument.text = parse_quoted_text(cursor);
    else if (auto text = variables.parse_text_variable(cursor))
      argument.text = std::move(text);
    // An empty argument, as in CYCLE83(10,,2), keeps its position.
    else if (cursor.current() != ',' && cursor.current() != ')')
      argument.number = parse_number(cursor, variables);
    argument.cause = cursor.cause(from);
    arguments.push_back(std::move(argument));
    if (arguments.size() > max_arguments)
      cursor.throw_input_error(open, "at most 100 parameters", "more");
    if (next_char(cursor) == ')') break;
    if (cursor.current() != ',') cursor.throw_input_error(cursor.at, ", or ) after a parameter");
    ++cursor.at;
  }
  ++cursor.at;
  return arguments;
}

CommentSplit split_comment(std::string_view line) {
  bool is_quoted = false;
  for (std::size_t at = 0; at < line.size(); ++at) {
    // A semicolon inside quotes begins no comment.
    if (line[at] == '"') is_quoted = !is_quoted;
    if (line[at] == ';' && !is_quoted) return {line.substr(0, at), line.substr(at + 1)};
  }
  return {line, std::nullopt};
}

namespace {

// Parser that splits a block into its words.
class SiemensBlockReader {
 public:
  SiemensBlockReader(Cursor& cursor, ProgramRun& run, VariableParser& variables, Block& block)
      : cursor_(cursor), run_(run), variables_(variables), block_(block) {}

  void read() {
    for (cursor_.skip_blanks(); !cursor_.at_end(); cursor_.skip_blanks()) read_word();
  }

 private:
  void read_word() {
    const std::size_t from = cursor_.at;
    if (cursor_.current() == '$')
      cursor_.throw_input_error(from,
                                "words and variables of the program: system data are not writable");
    // Assignments come first, because R1=5 and COUNT=3 are no addresses.
    if (variables_.assign_variable(cursor_)) return;
    const char first = cursor_.current(), second = cursor_.peek();
    if (!is_letter(first) && first != '_')
      cursor_.throw_input_error(from, "a word (letter and number)");
    Cursor ahead = cursor_;
    const std::string name = parse_name(ahead);
    // Before = or [ the whole name is the address; otherwise it may be a letter with a number.
    if (is_before_assignment(ahead) || (name.size() == 1 && ahead.current() == '[')) {
      const std::size_t start = std::exchange(cursor_.at, ahead.at);
      if (read_extended_address(from, name)) return;
      if (is_before_assignment(cursor_)) return read_assigned_word(from, name);
      cursor_.at = start;
    }
    const bool has_number =
        is_digit(second) || second == '+' || second == '-' || second == '.' || is_blank(second);
    // A letter followed by a digit, a sign, a point or a blank is an address with its number.
    if (name.size() == 1 || (first != '_' && is_digit(second))) {
      if (has_number) return read_short_word(from);
      cursor_.throw_input_error(from, fmt::format("a number or = after {}", upper(first)));
    }
    cursor_.at = ahead.at;
    read_long_word(from, name);
  }

  /// Parses a letter and its number without =, for example X10.5 or G1.
  void read_short_word(std::size_t from) {
    const char letter = upper(cursor_.current());
    ++cursor_.at;
    if (letter == 'G' || letter == 'M') return read_code(from, letter);
    // L and a number is the name of a subprogram.
    if (letter == 'L') {
      std::string name = "L";
      for (; is_digit(cursor_.current()); ++cursor_.at) name += cursor_.current();
      if (name.size() > max_name_bytes)
        cursor_.throw_input_error(from, "a name of at most 100 letters", "longer");
      return read_call(from, name);
    }
    const auto number = cursor_.number();
    if (!number) cursor_.throw_input_error(from, fmt::format("a number after {}", letter));
    const auto address = find_address(std::string_view(&letter, 1));
    // H passes a value to the PLC and causes no motion.
    if (letter == 'H') return;
    if (!address) return run_.handle_unknown_word(cursor_.cause(from), "a word of Siemens");
    put_value(from, *address, *number, PositionMode::Modal);
  }

  /// Parses G or M and a number.
  void read_code(std::size_t from, char letter) {
    const auto number = cursor_.number(false);
    if (!number) cursor_.throw_input_error(from, fmt::format("a number after {}", letter));
    const Cause cause = cursor_.cause(from);
    const bool is_code = *number == std::floor(*number) && *number < 10000;
    const WordEntry* entry =
        is_code ? find_entry(fmt::format("{}{}", letter, int(*number))) : nullptr;
    if (entry == nullptr)
      return run_.handle_unknown_word(cause, fmt::format("a {} code of Siemens", letter));
    put_entry(*entry, cause);
  }

  void put_value(std::size_t from, Address address, double value, PositionMode mode) {
    Value& slot = block_.values[address.index];
    const Cause cause = cursor_.cause(from);
    if (slot)
      run_.canon.throw_input_error(
          cause, "only one word per address in a block",
          fmt::format("{} after {}", shown(cause.text), shown(slot.cause.text)));
    slot = {value, cause, mode, true};
  }

  void put_entry(const WordEntry& entry, const Cause& cause) {
    if (entry.use == WordTreatment::Refused)
      run_.canon.throw_input_error(cause, std::string(entry.sentence));
    if (entry.word == "MCALL") {
      block_.is_modal = true;
      block_.modal_cause = cause;
      return;
    }
    if (entry.group == Group::None) {
      block_.code_forbidding_axis_words = {entry.word, cause};
      return;
    }
    if (entry.group == Group::WithMotion) {
      // Coolant has no group because M7 and M8 may be in one block.
      if (entry.word == "M7" || entry.word == "M8" || entry.word == "M9")
        block_.coolant.push_back(entry.word);
      return;
    }
    Code& slot = block_.codes[std::size_t(entry.group)];
    if (slot)
      run_.canon.throw_input_error(
          cause, "only one word of a modal group per block",
          fmt::format("{} after {}", shown(cause.text), shown(slot.cause.text)));
    slot = {entry.word, cause};
  }

  /// Parses a word with = after its address.
  void read_assigned_word(std::size_t from, const std::string& name) {
    const auto address = find_address(name);
    const WordEntry* entry = find_entry(name);
    // The value of a word without effect is skipped with the word.
    if (!address && entry != nullptr && entry->use != WordTreatment::Read) {
      skip_value();
      return put_entry(*entry, cursor_.cause(from));
    }
    cursor_.accept("=");
    cursor_.skip_blanks();
    if (name == "M") return put_m_code(from, parse_number(cursor_, variables_));
    if (name == "T") return read_tool(from);
    const auto mode = position_mode();
    const double value =
        mode ? parse_bracketed(cursor_, grammar(), variables_) : parse_number(cursor_, variables_);
    if (name == "H") return;
    // A variable whose definition has an error must not be reported as an unknown address.
    run_.require_certain(name, cursor_.cause(from));
    if (!address) return run_.handle_unknown_word(cursor_.cause(from), "an address or a variable");
    put_value(from, *address, value, mode.value_or(PositionMode::Modal));
  }

  void put_m_code(std::size_t from, double value) {
    const WordEntry* code = find_entry(fmt::format("M{}", value));
    if (code == nullptr)
      return run_.handle_unknown_word(cursor_.cause(from), "an M code of Siemens");
    put_entry(*code, cursor_.cause(from));
  }

  void read_tool(std::size_t from) {
    // T and T="..." are one address.
    if (block_.tool_name || block_["T"])
      cursor_.throw_input_error(from, "only one word per address in a block");
    if (cursor_.current() == '"')
      block_.tool_name = parse_quoted_text(cursor_);
    else
      block_.tool_name = variables_.parse_text_variable(cursor_);
    if (block_.tool_name)
      block_.values[Address("T").index] = {0.0, cursor_.cause(from), PositionMode::Modal, true};
    else
      put_value(from, "T", parse_number(cursor_, variables_), PositionMode::Modal);
  }

  /// Parses an address with an extension, M1=3 or S[2]=500, from after its name or letter on.
  /// Returns false if it is no such address.
  bool read_extended_address(std::size_t from, const std::string& name) {
    static constexpr std::string_view letters = "MSTHFD";
    if (letters.find(name.front()) == std::string_view::npos) return false;
    const bool has_digits =
        name.size() > 1 && name.size() < 5 && std::all_of(name.begin() + 1, name.end(), is_digit);
    const bool has_index = name.size() == 1 && cursor_.current() == '[';
    if (!has_digits && !has_index) return false;
    double number = 0.0;
    if (has_digits) {
      number = std::stoi(name.substr(1));
    } else {
      const std::size_t open = cursor_.at++;
      number = parse_number(cursor_, variables_);
      expect_text(cursor_, "]", "] after a spindle number");
      if (!(number >= 0 && number <= 9999 && number == std::floor(number)))
        cursor_.throw_input_error(open, "an integer from 0 to 9999 as the address extension");
      if (!is_before_assignment(cursor_))
        cursor_.throw_input_error(cursor_.at, "= after an address with an extension");
    }
    cursor_.accept("=");
    cursor_.skip_blanks();
    put_extended_value(from, name.front(), int(number));
    return true;
  }

  /// Handles the value of an address with an extension. Extension 0 is the address without one.
  void put_extended_value(std::size_t from, char letter, int number) {
    if (letter == 'D')
      cursor_.throw_input_error(from, "D without an extension: this control has none");
    if (letter == 'T') {
      if (number > 1)
        cursor_.throw_input_error(from, "T or T1=: there is one tool holder, that of spindle 1");
      return read_tool(from);
    }
    const double value = parse_number(cursor_, variables_);
    const Cause cause = cursor_.cause(from);
    if (letter == 'H') return;
    if (letter == 'F') {
      if (number != 0)
        cursor_.throw_input_error(from,
                                  "F or F0=, the path feed: axes have no feed of their own here");
      return put_value(from, "F", value, PositionMode::Modal);
    }
    if (number == 0)
      return letter == 'M' ? put_m_code(from, value)
                           : put_value(from, "S", value, PositionMode::Modal);
    if (letter == 'S') return block_.spindles.push_back({number, value, {}, cause});
    // Stops and ends concern the whole program and have no spindle.
    const WordEntry* code = find_entry(fmt::format("M{}", value));
    if (code != nullptr && code->group == Group::Stop)
      cursor_.throw_input_error(
          from,
          fmt::format("{} without an extension: program ends and stops have none", code->word));
    if (code != nullptr && code->group == Group::Spindle)
      return block_.spindles.push_back({number, {}, code->word, cause});
    if (number != 1 && (code == nullptr || code->use != WordTreatment::WithoutEffect))
      cursor_.throw_input_error(from, "only M3, M4 or M5 for a spindle other than 1");
    put_m_code(from, value);
  }

  /// Parses SETMS or SETMS(2).
  void read_setms(std::size_t from) {
    block_.master_spindle = 1;
    if (next_char(cursor_) != '(') return;
    const std::vector<Argument> arguments = parse_arguments(cursor_, variables_);
    if (arguments.empty()) return;
    const double number = arguments[0].number.value_or(0.0);
    if (arguments.size() > 1 || !(number >= 1 && number <= 99 && number == std::floor(number)))
      cursor_.throw_input_error(from, "SETMS or SETMS with a spindle number, 1 to 99");
    block_.master_spindle = int(number);
  }

  /// Parses a word of several letters.
  void read_long_word(std::size_t from, const std::string& name) {
    const WordEntry* entry = find_entry(name);
    if (entry == nullptr) {
      // A bracket [ shows a variable; any other unknown word may be a subprogram.
      if (cursor_.current() == '[') return handle_unknown(from, "a defined variable");
      return read_call(from, name);
    }
    if (entry->use == WordTreatment::Read) {
      // TRAORI may state the number of its transformation; the machine has one.
      if (name == "TRAORI" && cursor_.accept("(")) {
        --cursor_.at;
        const std::vector<Argument> arguments = parse_arguments(cursor_, variables_);
        if (arguments.size() > 1 || (arguments.size() == 1 && arguments[0].number != 1.0))
          cursor_.throw_input_error(from,
                                    "TRAORI or TRAORI(1): the machine has one transformation");
      }
      if (name == "SETMS") read_setms(from);
      return put_entry(*entry, cursor_.cause(from));
    }
    skip_value();
    put_entry(*entry, cursor_.cause(from));
  }

  void read_call(std::size_t from, const std::string& name) {
    ProgramCall call{name, {}, cursor_.cause(from)};
    if (next_char(cursor_) == '(') call.arguments = parse_arguments(cursor_, variables_);
    if (block_.call)
      run_.canon.throw_input_error(call.cause, "only one cycle or subprogram per block");
    block_.call = std::move(call);
  }

  /// Skips what may follow a skipped word: [...], (...), and = with a value.
  void skip_value() {
    if (cursor_.current() == '[') skip_brackets(cursor_, '[', ']');
    if (next_char(cursor_) == '(') skip_brackets(cursor_, '(', ')');
    if (!is_before_assignment(cursor_)) return;
    cursor_.accept("=");
    if (next_char(cursor_) == '"')
      parse_quoted_text(cursor_);
    else if (position_mode())
      skip_brackets(cursor_, '(', ')');
    else
      parse_number(cursor_, variables_);
  }

  /// Handles an unknown word together with everything that belongs to it.
  void handle_unknown(std::size_t from, const std::string& expected) {
    skip_value();
    run_.handle_unknown_word(cursor_.cause(from), expected);
  }

  /// Parses AC, IC, DC, ACP or ACN up to the bracket that follows. Returns nothing if there is
  /// none.
  std::optional<PositionMode> position_mode() {
    static constexpr std::pair<std::string_view, PositionMode> modes[] = {
        {"ACP", PositionMode::Positive},
        {"ACN", PositionMode::Negative},
        {"AC", PositionMode::Absolute},
        {"IC", PositionMode::Incremental},
        {"DC", PositionMode::Shortest}};
    for (const auto& [name, mode] : modes) {
      const std::size_t start = cursor_.at;
      if (!cursor_.accept_word(name)) continue;
      if (next_char(cursor_) == '(') return mode;
      cursor_.at = start;
    }
    return std::nullopt;
  }

  Cursor& cursor_;
  ProgramRun& run_;
  VariableParser& variables_;
  Block& block_;
};

}  // namespace

void read_block(Cursor cursor, ProgramRun& run, VariableParser& variables, Block& block) {
  block.clear();
  if (cursor.text.size() > max_block_bytes)
    cursor.throw_input_error(0, fmt::format("a block of at most {} characters", max_block_bytes),
                             fmt::format("{}", cursor.text.size()));
  // A NUL is not visible in messages, so its name is reported.
  if (const std::size_t nul = cursor.text.find('\0'); nul != std::string_view::npos)
    cursor.throw_input_error(nul, "text", "a NUL byte");
  SiemensBlockReader(cursor, run, variables, block).read();
}

}  // namespace siemens

std::span<const WordTableEntry> siemens_words() {
  static const std::vector<WordTableEntry> table =
      word_table<siemens::WordLine>(siemens::word_lines, siemens::siemens_other_words);
  return table;
}

}  // namespace abbe::sim::dialects
