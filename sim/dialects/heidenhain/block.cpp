#include "sim/dialects/heidenhain/heidenhain.h"

namespace abbe::sim::dialects {

namespace heidenhain {
namespace {

// Short names, so that an entry fits its line.
constexpr WordTreatment read = WordTreatment::Read, none = WordTreatment::WithoutEffect,
                        refused = WordTreatment::Refused;

// No-break spaces join the parts of a word, because blanks separate the words of an entry.
constexpr WordTableEntry words[] = {
    {"BEGIN\u00a0PGM END\u00a0PGM", read,
     "start and end of a program, MM or INCH; a called program returns at END PGM"},
    {"BLK\u00a0FORM BLK", none, "the blank: that of the scene is cut"},
    {"; * ~ /", read,
     "comment, structure of the program, the block continues on the next line, the block may be "
     "left out"},
    {"TOOL\u00a0CALL", read,
     "tool by number, axis Z, S, F, DL, DR. A name and the axes X and Y are rejected. Without M128 "
     "and PLANE the length is applied so that X Y Z are the tip in the workpiece frame with the "
     "rotary axes at zero"},
    {"TOOL\u00a0DEF", read, "length L and radius R of a tool as the control believes them"},
    {"L", read, "line, X Y Z A B C U V W absolute or with I, R0 RL RR, F, M", true},
    {"LN", read,
     "line with TX TY TZ, the tool direction under M128; NX NY NZ have no effect, because DL and "
     "DR must be zero. The rotary axes take the shortest way",
     true},
    {"CC", read, "pole: two of X Y Z, absolute or with I, otherwise the current position"},
    {"C CR CT", read, "arc about the pole; by radius; tangential to the previous move", true},
    {"LP CP CTP", read, "line and arcs in polar coordinates PR PA, IPR IPA; CP with Z is a helix",
     true},
    {"DR PR PA IPR IPA", read, "direction of an arc; polar radius and angle"},
    {"RND CHF", read, "corner rounding, chamfer, between two lines in X Y; rejected with arcs"},
    {"R0 RL RR", read,
     "on the path, left, right of it by the tool radius, in X Y; starts and ends with L. Rejected "
     "in tilted planes and under M128"},
    {"APPR DEP", refused, "L with RL, RR or R0: APPR and DEP are not supported"},
    {"FK FPOL FL FC FLT FCT FSELECT", refused, "L, C and CR: free contours are not computed"},
    {"F FMAX F\u00a0AUTO FU", read,
     "mm/min, in inches tenths of an inch per minute; rapid, for its block; that of TOOL CALL; per "
     "revolution"},
    {"FZ", refused, "F or FU: the number of teeth is unknown"},
    {"FT FMAXT", refused, "F: a feed cannot be stated as a time"},
    {"M0 M1", none, "stops", true},
    {"STOP", none, "stop; its M functions are executed"},
    {"M2 M30", read, "end of the program"},
    {"M3 M4 M5 M13 M14", read, "spindle clockwise, counter-clockwise, off; with coolant"},
    {"M6", none, "tool change by hand", true},
    {"M7 M8 M9", none, "coolant", true},
    {"M19", none, "spindle orientation", true},
    {"M89 M99", read, "a cycle is called after every block with axes; after this one"},
    {"M91", read, "axis positions, without datum and tool"},
    {"M92", refused, "M91: the zero point of the machine manufacturer is unknown"},
    {"M94", read, "reduces the position of one rotary axis or of all by full turns"},
    {"M97 M98", refused,
     "a contour that the tool can reach: M97 and M98, which leave corners out, are not supported"},
    {"M90", none, "corner smoothing: abbe cuts the path as programmed", true},
    {"M107 M108", none, "messages for sister tools", true},
    {"M118", none,
     "handwheel superimposition, at most by the X Y Z after it: there is no handwheel", true},
    {"M120", none, "look-ahead of LA blocks", true},
    {"M148 M149", none, "lift-off at a stop, which does not occur", true},
    {"M143", none, "end of a basic rotation, which is not supported", true},
    {"M103", none, "the F after it is a feed factor for plunging, which stays as programmed", true},
    {"M109 M110 M111", none, "feed of the cutting edge on arcs: F is that of the tool centre here",
     true},
    {"M101 M102", none, "a sister tool after BT; there is none", true},
    {"M117", none, "end of M116, which is rejected", true},
    {"M145", none, "end of M144, which is rejected", true},
    {"M116", refused, "M117: feeds of rotary axes are in degrees per minute"},
    {"M114 M115 M144", refused, "M128 or PLANE"},
    {"M124 M138 M141 M150 M197", refused, "blocks without it: it changes the path"},
    {"M126 M127", read, "rotary axes take the shortest way; move as their positions state"},
    {"M128 M129", read,
     "X Y Z are the tip in the workpiece frame, rotary words are axis positions, interpolated "
     "linearly; F with M128 has no effect. M128 acts from the start of its block, M129 from its "
     "end"},
    {"M136 M137", read, "F is mm per revolution; per minute"},
    {"M140", read, "MB: back along the tool, or MB MAX to the end of travel"},
    {"FUNCTION\u00a0TCPM FUNCTION\u00a0RESET\u00a0TCPM", read,
     "as M128 and M129, with F TCP, AXIS POS, PATHCTRL AXIS, REFPNT TIP-TIP; F CONT, AXIS SPAT, "
     "PATHCTRL VECTOR and other points are rejected"},
    {"FUNCTION\u00a0DWELL", read, "TIME, seconds"},
    {"FUNCTION\u00a0MODE", read, "MILL; others are rejected"},
    {"PLANE\u00a0SPATIAL PLANE\u00a0EULER PLANE\u00a0VECTOR PLANE\u00a0POINTS PLANE\u00a0RELATIV",
     read,
     "tilted plane about the datum by SPA SPB SPC about fixed x, y, z; Euler angles; base vector "
     "and normal; three points; one more angle about an axis of the active plane"},
    {"PLANE\u00a0RESET", read, "ends the plane; with TURN or MOVE the tool returns upright"},
    {"STAY TURN MOVE", read,
     "the rotary axes stay, Q120 to Q122 give their required positions; turn; turn about the tip "
     "or a point DIST in front of it"},
    {"SEQ SYM", read,
     "sign of the rotary axis nearest to the tool; without it the shorter way is taken, and the "
     "positive one if both are equal. A free axis goes to zero"},
    {"COORD\u00a0ROT TABLE\u00a0ROT", read,
     "a free axis goes to zero; turns the x axis of the plane to that of the machine"},
    {"PLANE\u00a0AXIAL PLANE\u00a0PROJECTED", refused,
     "PLANE SPATIAL: the meaning of the axes of its plane is unknown here"},
    {"CYCL\u00a0DEF\u00a07 TRANS\u00a0DATUM", read, "datum shift; datum tables are rejected"},
    {"CYCL\u00a0DEF\u00a08 CYCL\u00a0DEF\u00a011", read,
     "end of mirror image and scaling, which are rejected"},
    {"CYCL\u00a0DEF\u00a09", read, "dwell, seconds"},
    {"CYCL\u00a0DEF\u00a010 TRANS\u00a0ROTATION", read, "rotation about the datum"},
    {"CYCL\u00a0DEF\u00a019", read, "as PLANE SPATIAL STAY, with spatial angles"},
    {"CYCL\u00a0DEF\u00a013", none, "spindle orientation"},
    {"CYCL\u00a0DEF\u00a032", none, "tolerance: abbe cuts the exact path"},
    {"CYCL\u00a0DEF\u00a0247 PRESET\u00a0SELECT", read,
     "presets 1 to 6: G54 to G59 of the scene, or 1 to 9999 of the control's table, `offsets`: "
     "positions in the workpiece frame with and without M128; shift and rotation end"},
    {"CYCL\u00a0DEF\u00a0200 CYCL\u00a0DEF\u00a0203 CYCL\u00a0DEF\u00a0205", read,
     "drilling with infeeds; universal; deep holes. Q395=0, Q379=0, Q258=Q259"},
    {"CYCL\u00a0DEF\u00a0201 CYCL\u00a0DEF\u00a0202 CYCL\u00a0DEF\u00a0240", read,
     "reaming; boring, Q214; centring with Q343=0"},
    {"CYCL\u00a0DEF\u00a0206 CYCL\u00a0DEF\u00a0207", read,
     "tapping with a floating holder; rigid"},
    {"CYCL\u00a0DEF\u00a01 CYCL\u00a0DEF\u00a02 CYCL\u00a0DEF\u00a03 CYCL\u00a0DEF\u00a04 "
     "CYCL\u00a0DEF\u00a05 CYCL\u00a0DEF\u00a06 CYCL\u00a0DEF\u00a017 CYCL\u00a0DEF\u00a018",
     refused, "cycles 200 and above"},
    {"CYCL\u00a0DEF\u00a012", refused, "CALL PGM"},
    {"CYCL\u00a0DEF\u00a014 CYCL\u00a0DEF\u00a020 CYCL\u00a0DEF\u00a021 CYCL\u00a0DEF\u00a022 "
     "CYCL\u00a0DEF\u00a023 CYCL\u00a0DEF\u00a024 CYCL\u00a0DEF\u00a025 CYCL\u00a0DEF\u00a0270",
     refused, "explicit moves: contour cycles are not computed"},
    {"CYCL\u00a0DEF\u00a026", refused, "plain coordinates: nothing is scaled"},
    {"CYCL\u00a0DEF\u00a027 CYCL\u00a0DEF\u00a028 CYCL\u00a0DEF\u00a029 CYCL\u00a0DEF\u00a039",
     refused, "programmed rotary axes: cylinder surfaces are not unrolled"},
    {"CYCL\u00a0DEF\u00a0204 CYCL\u00a0DEF\u00a0208 CYCL\u00a0DEF\u00a0209 CYCL\u00a0DEF\u00a0241",
     refused, "cycles 200 to 203, 205 to 207 or 240"},
    {"CYCL\u00a0DEF\u00a0220 CYCL\u00a0DEF\u00a0221 PATTERN", refused,
     "CYCL CALL POS or M99 at every position"},
    {"CYCL\u00a0DEF\u00a0251 CYCL\u00a0DEF\u00a0252 CYCL\u00a0DEF\u00a0253 CYCL\u00a0DEF\u00a0254 "
     "CYCL\u00a0DEF\u00a0256 CYCL\u00a0DEF\u00a0257 CYCL\u00a0DEF\u00a0230 CYCL\u00a0DEF\u00a0231 "
     "CYCL\u00a0DEF\u00a0232 CYCL\u00a0DEF\u00a0233 CYCL\u00a0DEF\u00a0262 CYCL\u00a0DEF\u00a0263 "
     "CYCL\u00a0DEF\u00a0264 CYCL\u00a0DEF\u00a0265 CYCL\u00a0DEF\u00a0267 CYCL\u00a0DEF\u00a0225",
     refused, "explicit moves: milling cycles are not expanded"},
    {"CYCL\u00a0CALL CYCL\u00a0CALL\u00a0POS", read, "calls the cycle; at a position"},
    {"TCH", refused, "no probing: a virtual part is measured by instruments (abbe measure)"},
    {"LBL CALL\u00a0LBL REP", read,
     "label, by number or name; a subprogram until LBL 0; repeats of the blocks before"},
    {"CALL\u00a0PGM", read, "a program next to this one"},
    {"SEL CONTOUR DECLARE", refused,
     "blocks in the program: tables, contours and strings are not supported"},
    {"Q QL QR", read,
     "parameters: of all programs, of one, permanent; formulas with + - * / ^ % SQ SQRT SIN COS "
     "TAN ASIN ACOS ATAN EXP LN LOG NEG INT ABS FRAC SGN PI. A parameter that was never set is "
     "rejected"},
    {"QS", refused, "Q, QL and QR: strings are not stored"},
    {"Q108 Q109 Q110 Q113 Q114 Q120 Q121 Q122", read,
     "radius, axis, spindle, unit and length of the tool; positions A B C of the last plane"},
    {"FN\u00a00 FN\u00a01 FN\u00a02 FN\u00a03 FN\u00a04 FN\u00a05 FN\u00a06 FN\u00a07 FN\u00a08 "
     "FN\u00a013",
     read, "assignment, + - * DIV SQRT SIN COS LEN ANG"},
    {"FN\u00a09 FN\u00a010 FN\u00a011 FN\u00a012 IF", read, "jumps: IF EQU NE GT LT GOTO LBL"},
    {"FN\u00a014 FN\u00a015 FN\u00a016 FN\u00a017 FN\u00a018 FN\u00a019 FN\u00a020 FN\u00a026 "
     "FN\u00a027 FN\u00a028 FN\u00a029 FN\u00a037 FN\u00a038",
     refused, "FN 0 to FN 13: messages and data of the control do not exist here"},
};

}  // namespace
}  // namespace heidenhain

std::span<const WordTableEntry> heidenhain_words() { return heidenhain::words; }

}  // namespace abbe::sim::dialects

namespace abbe::sim::dialects::heidenhain {

namespace {

constexpr std::size_t max_lines = 1000;  // of one block; bounds memory

/// Layout of a line.
struct LineLayout {
  std::size_t words_end = 0;                     ///< first byte of the comment or ~
  std::size_t comment = std::string_view::npos;  ///< first byte after the semicolon
  bool is_continued = false;                     ///< ~ at the end, after any comment
};

LineLayout line_layout(std::string_view line) {
  LineLayout layout;
  std::size_t end = line.size();
  while (end > 0 && is_blank(line[end - 1])) --end;
  layout.is_continued = end > 0 && line[end - 1] == '~';
  if (layout.is_continued) --end;
  bool is_quoted = false;
  for (std::size_t i = 0; i < end; ++i) {
    // A semicolon inside a quoted name begins no comment.
    if (line[i] == '"') is_quoted = !is_quoted;
    if (line[i] != ';' || is_quoted) continue;
    layout.comment = i + 1;
    end = i;
    break;
  }
  layout.words_end = end;
  return layout;
}

/// Beginning of a block.
struct BlockHead {
  std::size_t end = 0;  ///< first byte after the block number and /
  bool is_skipped = false;
};

/// Parses a block number with a / before or after it.
BlockHead parse_block_head(std::string_view line) {
  std::size_t at = 0;
  bool is_skipped = false;
  const auto skip_blanks = [&] {
    while (at < line.size() && is_blank(line[at])) ++at;
  };
  const auto accept_slash = [&] {
    if (at == line.size() || line[at] != '/') return;
    is_skipped = true;
    ++at;
  };
  skip_blanks();
  accept_slash();
  skip_blanks();
  const std::size_t digits = at;
  while (at < line.size() && is_digit(line[at])) ++at;
  // Digits with other characters directly after them are no block number.
  if (at > digits && at < line.size() && !is_blank(line[at]) && line[at] != '/' &&
      line[at] != '*' && line[at] != ';')
    at = digits;
  skip_blanks();
  accept_slash();
  return {at, is_skipped};
}

// Levels of Q formulas: ^ binds most tightly, then * / %, then + -.
constexpr Operator operators[] = {
    {"^", 3, [](double a, double b) { return std::pow(a, b); }, require_real_power},
    {"*", 2, [](double a, double b) { return a * b; }},
    {"/", 2, [](double a, double b) { return a / b; }, require_nonzero_divisor},
    {"%", 2, [](double a, double b) { return std::fmod(a, b); }, require_nonzero_divisor},
    {"+", 1, [](double a, double b) { return a + b; }},
    {"-", 1, [](double a, double b) { return a - b; }},
};

constexpr Function functions[] = {
    {"SQ", [](double x) { return x * x; }},
    {"ATAN", [](double x) { return std::atan(x) / units::deg; }},
    {"LOG", [](double x) { return std::log10(x); }, require_positive},
    {"NEG", [](double x) { return -x; }},
    {"INT", [](double x) { return std::trunc(x); }},
    {"FRAC", [](double x) { return x - std::trunc(x); }},
    {"SGN", [](double x) { return double((x > 0) - (x < 0)); }},
};

}  // namespace

const ExpressionGrammar& grammar() {
  static constexpr ExpressionGrammar klartext_grammar{operators, {}, '(', ')', false};
  return klartext_grammar;
}

// Functions need no brackets; SIN Q1 is the sine of Q1.
std::optional<double> parse_function(Cursor& cursor, OperandParser& parameters) {
  const std::size_t from = cursor.at;
  if (cursor.accept_word("PI")) return pi;
  for (const std::span<const Function> table :
       {std::span<const Function>(functions), common_functions()})
    for (const Function& function : table)
      if (cursor.accept_word(function.name))
        return apply_function(function, parse_value(cursor, grammar(), parameters), grammar(),
                              cursor, from);
  return std::nullopt;
}

void read_block(const std::vector<std::string_view>& lines, std::size_t at, Block& block) {
  block.comment = {};
  block.block_lines.clear();
  block.line_count = 1;
  const std::string_view line = lines[at];
  const BlockHead head = parse_block_head(line);
  block.is_skipped = head.is_skipped;
  const std::size_t begin = head.end;
  LineLayout layout = line_layout(line);
  std::size_t first = begin;
  while (first < layout.words_end && is_blank(line[first])) ++first;
  // * begins a structure comment, which is a block without words.
  if (first < line.size() && line[first] == '*') {
    block.comment = line.substr(first + 1);
    block.text = {};
    return;
  }
  if (first >= layout.words_end && layout.comment != std::string_view::npos)
    block.comment = line.substr(layout.comment);
  // Nearly all blocks have one line; they refer to the text of the file without copying it.
  if (!layout.is_continued) {
    block.text = line.substr(0, std::max(layout.words_end, begin));
    block.block_lines.push_back({begin, int(at) + 1, int(begin)});
    return;
  }
  block.joined.clear();
  std::size_t from = begin;
  for (std::size_t i = at;; ++i) {
    const std::string_view text = lines[i];
    block.block_lines.push_back({block.joined.size(), int(i) + 1, int(from)});
    block.joined += text.substr(from, layout.words_end > from ? layout.words_end - from : 0);
    block.line_count = i - at + 1;
    if (!layout.is_continued || i + 1 >= lines.size() || block.line_count == max_lines) break;
    block.joined += ' ';
    layout = line_layout(lines[i + 1]);
    from = 0;
  }
  block.text = block.joined;
}

BadInput relocate_error(const Block& block, const BadInput& input_error) {
  if (block.line_count == 1 || input_error.column < 1) return input_error;
  const std::size_t offset = std::size_t(input_error.column - 1);
  // The last line that begins at or before the offset contains it.
  const Block::BlockLine* origin = &block.block_lines.front();
  for (const Block::BlockLine& line : block.block_lines)
    if (line.offset <= offset) origin = &line;
  return {input_error.file, origin->line, int(offset - origin->offset) + origin->column + 1,
          input_error.expected, input_error.seen};
}

std::string WordReader::read_name() {
  cursor.skip_blanks();
  std::string letters;
  while (is_letter(cursor.current())) letters += upper(cursor.text[cursor.at++]);
  if (!is_digit(cursor.current())) return letters;
  // In XQ1 the name is X, and Q1 is a parameter.
  for (const std::string_view parameter : {"Q", "QL", "QR", "QS"})
    if (letters.size() > parameter.size() && letters.ends_with(parameter)) {
      letters.resize(letters.size() - parameter.size());
      cursor.at -= parameter.size();
      break;
    }
  return letters;
}

bool WordReader::has_value() const {
  Cursor ahead = cursor;
  ahead.skip_blanks();
  while (ahead.current() == '+' || ahead.current() == '-') ++ahead.at;
  return is_digit(ahead.current()) || ahead.current() == '.' || upper(ahead.current()) == 'Q';
}

double WordReader::read_value() {
  cursor.skip_blanks();
  if (!has_value()) cursor.throw_input_error(cursor.at, "a number or a Q parameter");
  return dialects::parse_value(cursor, grammar(), parameters_);
}

int WordReader::read_whole_number(int max) {
  const std::size_t from = skip_blanks(cursor);
  const double number = read_value();
  if (number < 0 || number > max || number != std::floor(number))
    cursor.throw_input_error(from, fmt::format("an integer from 0 to {}", max));
  return int(number);
}

std::string WordReader::read_label() {
  const std::size_t from = skip_blanks(cursor);
  if (cursor.current() != '"') return fmt::format("{}", read_whole_number(65535));
  const std::size_t end = cursor.text.find('"', from + 1);
  // The control allows 32 characters.
  if (end == std::string_view::npos || end == from + 1 || end - from > 33)
    cursor.throw_input_error(from, "a name of 1 to 32 characters in quotes");
  cursor.at = end + 1;
  return std::string(cursor.text.substr(from, end + 1 - from));
}

void WordReader::expect_end() {
  if (!at_end()) cursor.throw_input_error(cursor.at, "nothing more in the block");
}

}  // namespace abbe::sim::dialects::heidenhain
