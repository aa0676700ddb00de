#include "sim/dialects/control_table.h"
#include "sim/dialects/expression.h"

#include <array>
#include <cmath>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::sim::dialects {

namespace {
// Bounds memory for a file of many different names; further names are counted together.
constexpr std::size_t max_unused_names = 200;
}  // namespace

void ControlTableParser::count_unused(const std::string& name) {
  const bool has_own_count = unused.contains(name) || unused.size() < max_unused_names;
  ++unused[has_own_count ? name : "other values"];
}

// Siemens and Heidenhain tables hold offsets of other jobs; errors in them must not stop this job.
void ControlTableParser::read_extra_offset(int offset_key, const std::function<void()>& read) {
  try {
    read();
  } catch (const BadInput&) {
    count_unused("offsets after the sixth that cannot be read");
    unreadable_offsets.insert(offset_key);
  }
}

double ControlTableParser::require_unit(const Cursor& cursor, std::size_t start) const {
  if (!unit)
    cursor.throw_input_error(
        start, "a unit next to the file name, because the file does not state it", "none");
  return *unit;
}

double ControlTableParser::axis_unit(char axis, double value, const Cursor& cursor,
                                     std::size_t start) const {
  const bool is_rotary = axis >= 'A' && axis <= 'C';
  return is_rotary || value == 0.0 ? 1.0 : require_unit(cursor, start);
}

void ControlTableParser::set_unit(double mm_per_unit, const Cursor& cursor, std::size_t start) {
  const auto unit_name = [](double length_mm) { return length_mm == 1.0 ? "mm" : "inch"; };
  if (unit && *unit != mm_per_unit)
    cursor.throw_input_error(
        start, fmt::format("a table in {}, as stated next to its name", unit_name(*unit)),
        unit_name(mm_per_unit));
  unit = mm_per_unit;
}

void for_each_line(ControlTableParser& parser, const std::function<bool(Cursor&)>& read) {
  try {
    check_encoding(parser.text, parser.table.file);
  } catch (const BadInput& input_error) {
    parser.input_errors.add(input_error);
    return;
  }
  LineReader lines(parser.text);
  while (const auto line = lines.next()) {
    Cursor cursor{*line, {parser.table.file, lines.number()}};
    try {
      // Control characters indicate a binary file, so only the first one is reported, not every
      // cell.
      for (std::size_t i = 0; i < line->size(); ++i) {
        const auto c = static_cast<unsigned char>((*line)[i]);
        if ((c < ' ' && c != '\t') || c == 0x7f)
          cursor.throw_input_error(i, "plain text", fmt::format("a byte 0x{:02x}", c));
      }
      if (!read(cursor)) return;
    } catch (const BadInput& input_error) {
      parser.input_errors.add(input_error);
      if (parser.input_errors.full()) return;
    }
  }
}

double parse_table_number(Cursor& cursor, std::string_view what) {
  constexpr double max_value = 1e6;
  const std::size_t start = skip_blanks(cursor);
  const auto value = cursor.number();
  if (!value || !(std::abs(*value) <= max_value))
    cursor.throw_input_error(start, fmt::format("a number within 1e6 for {}", what));
  // Delimiters of all formats: comments, CTRANS lists and their closing bracket.
  const bool is_delimited = cursor.at_end() || is_blank(cursor.current()) ||
                            cursor.current() == ';' || cursor.current() == ',' ||
                            cursor.current() == ')';
  if (!is_delimited) cursor.throw_input_error(start, fmt::format("a number for {}", what));
  return *value;
}

int parse_table_integer(Cursor& cursor, int min_value, int max_value, std::string_view what) {
  const std::size_t start = skip_blanks(cursor);
  const auto value = cursor.number();
  if (!value || *value != std::floor(*value) || *value < min_value || *value > max_value)
    cursor.throw_input_error(
        start, fmt::format("an integer from {} to {} for {}", min_value, max_value, what));
  return int(*value);
}

namespace {

constexpr std::string_view table_axes = "XYZABCUVW";
// Parameter layout of LinuxCNC: 20 parameters for each of nine systems from 5221 on, X first.
constexpr int first_system_parameter = 5221, system_count = 9, parameters_per_system = 20;
// Index of the rotation among the parameters of a system, after the nine axes.
constexpr int system_rotation_index = 9;
// 5210 is non-zero while the shift of G92, 5211 to 5219, is in force; 5220 is the system in force.
constexpr int shift_state_parameter = 5210, first_shift_parameter = 5211,
              active_system_parameter = 5220;

/// Reads a line of a tool table, for example "T1 P1 Z+0.511 D0.125 ;a comment".
bool parse_tool_line(ControlTableParser& parser, Cursor& cursor) {
  std::optional<int> number;
  // LinuxCNC treats missing values as zero.
  ControlTableTool tool{0.0, 0.0, 0.0, 0.0, {}, cursor.location.line};
  std::string seen_letters;
  for (cursor.skip_blanks(); !cursor.at_end() && cursor.current() != ';'; cursor.skip_blanks()) {
    const std::size_t start = cursor.at;
    const char letter = upper(cursor.current());
    if (std::string_view("TPDXYZABCUVWIJQ").find(letter) == std::string_view::npos)
      cursor.throw_input_error(
          start, "a word T P D X Y Z A B C U V W I J or Q of a tool, or ; and a comment");
    if (seen_letters.find(letter) != std::string::npos)
      cursor.throw_input_error(start, fmt::format("{} only once in the line of a tool", letter));
    seen_letters += letter;
    ++cursor.at;
    if (letter == 'T') {
      number = parse_table_integer(cursor, 0, 999'999, "T");
      continue;
    }
    const double value = parse_table_number(cursor, std::string_view(&letter, 1));
    if (letter == 'Z')
      tool.length = value * parser.require_unit(cursor, start);
    else if (letter == 'D')
      tool.radius = 0.5 * value * parser.require_unit(cursor, start);
    // An offset across the tool axis would need a separate chain, which only the scene can
    // describe.
    else if (letter != 'P' && value != 0.0 && table_axes.find(letter) != std::string_view::npos)
      cursor.throw_input_error(start,
                               fmt::format("0 for {}: the length of a tool lies along Z", letter));
    else if (letter != 'P' && value != 0.0)
      parser.count_unused(std::string(1, letter));
  }
  if (seen_letters.empty()) return true;
  if (!number) cursor.throw_input_error(0, "T (tool number)", "none");
  if (!parser.table.tools.emplace(*number, tool).second)
    cursor.throw_input_error(0, "a tool not yet in the table", fmt::format("T{}", *number));
  return true;
}

/// Counts a parameter without effect: one that is not zero and not a work offset.
void count_other_parameter(ControlTableParser& parser, int number, double value) {
  if (value == 0.0 || number == shift_state_parameter) return;
  // A program begins in G54, system 1, whatever the control had in force before.
  if (number == active_system_parameter) {
    if (value != 1.0) parser.count_unused("5220, a program starts in G54");
  } else if (number >= 5161 && number <= 5169) {
    parser.count_unused("5161 to 5169, the position of G28");
  } else if (number >= 5181 && number <= 5189) {
    parser.count_unused("5181 to 5189, the position of G30");
  } else if (number < first_shift_parameter || number > first_shift_parameter + 8) {
    // `parse_parameter_line` handles the shift of G92.
    parser.count_unused(number <= 30 || number >= 5000 ? "control parameters"
                                                       : "program parameters");
  }
}

/// Shift of G92. The errors of its values are kept because another line states whether it is in
/// force.
struct G92Shift {
  bool in_force = false;
  std::array<std::optional<BadInput>, 9> input_errors;
};

/// Reads a line of a parameter file: number, tab, value.
bool parse_parameter_line(ControlTableParser& parser, Cursor& cursor, G92Shift& shift) {
  cursor.skip_blanks();
  if (cursor.at_end() || cursor.current() == ';' || cursor.current() == '#') return true;
  const int number = parse_table_integer(cursor, 1, 99'999, "a parameter number");
  const std::size_t start = skip_blanks(cursor);
  const double value = parse_table_number(cursor, "a parameter");
  cursor.skip_blanks();
  if (!cursor.at_end())
    cursor.throw_input_error(cursor.at, "the end of the line after a parameter");
  if (number == shift_state_parameter) shift.in_force = value != 0.0;
  if (number >= first_shift_parameter && number < first_shift_parameter + 9 && value != 0.0)
    shift.input_errors[std::size_t(number - first_shift_parameter)] = BadInput(
        cursor.location.file, cursor.location.line, int(start) + 1,
        "0 for a G92 shift: clear it, or move it into a work offset", fmt::format("{}", value));
  const int index_from_first = number - first_system_parameter,
            system = index_from_first / parameters_per_system;
  const int parameter_index = index_from_first % parameters_per_system;
  if (index_from_first < 0 || system >= system_count || parameter_index > system_rotation_index) {
    count_other_parameter(parser, number, value);
    return true;
  }
  if (parameter_index == system_rotation_index) {
    if (value != 0.0) cursor.throw_input_error(start, "0 for the rotation of a coordinate system");
    return true;
  }
  ControlTableOffset& offset = parser.table.offsets[system + 1];
  const char axis = table_axes[std::size_t(parameter_index)];
  const double unit = parser.axis_unit(axis, value, cursor, start);
  if (!offset.axes
           .emplace(axis,
                    ControlTableOffset::Value{value * unit, cursor.location.line, int(start) + 1})
           .second)
    // LinuxCNC would take the last value; a duplicate usually shows that two files were merged.
    cursor.throw_input_error(0, "a parameter not yet in the file", fmt::format("{}", number));
  return true;
}

}  // namespace

void read_linuxcnc_table(ControlTableParser& parser) {
  if (parser.kind == ControlTableKind::Tools)
    return for_each_line(parser, [&](Cursor& cursor) { return parse_tool_line(parser, cursor); });
  G92Shift shift;
  for_each_line(parser,
                [&](Cursor& cursor) { return parse_parameter_line(parser, cursor, shift); });
  // A shift of G92 that is stored but not in force has no effect.
  for (const std::optional<BadInput>& input_error : shift.input_errors)
    if (input_error && shift.in_force) parser.input_errors.add(*input_error);
}

namespace {

// Bounds the memory that a malicious line can take.
constexpr std::size_t max_words = 64;  // in a block

// A word of a G10 block.
struct G10Word {
  char letter = ' ';
  double value = 0.0;
  bool has_point = false;  // decimal point
  std::size_t start = 0;   // first byte in the line
};

/// Returns the words of a block without its comments.
std::vector<G10Word> parse_words(Cursor& cursor) {
  std::vector<G10Word> words;
  for (cursor.skip_blanks(); !cursor.at_end(); cursor.skip_blanks()) {
    const std::size_t start = cursor.at;
    const char c = upper(cursor.current());
    if (c == '(') {
      const std::size_t closing_bracket = cursor.text.find(')', start);
      if (closing_bracket == std::string_view::npos)
        cursor.throw_input_error(start, "a ) that closes the comment");
      cursor.at = closing_bracket + 1;
      continue;
    }
    // Tape marks and block skip have no meaning in a listing of the memory.
    if (c == ';' || c == '%' || c == '/') {
      ++cursor.at;
      continue;
    }
    if (!is_letter(c)) cursor.throw_input_error(start, "a letter and a number");
    ++cursor.at;
    const auto value = cursor.number();
    if (!value) cursor.throw_input_error(start, "a number after the letter");
    const bool has_point =
        cursor.text.substr(start, cursor.at - start).find('.') != std::string_view::npos;
    words.push_back({c, *value, has_point, start});
    if (words.size() > max_words) cursor.throw_input_error(start, "at most 64 words in a block");
  }
  return words;
}

/// A block of a listing: G10 and its words.
struct G10Block {
  bool has_g10 = false;
  std::optional<G10Word> l, p, r;
  std::vector<G10Word> axes;
};

void set_once(std::optional<G10Word>& target, const G10Word& word, const Cursor& cursor) {
  if (target)
    cursor.throw_input_error(word.start, fmt::format("{} only once in a block", word.letter));
  target = word;
}

// G11 ends G10, and controls write G90 into their listings; neither changes a value.
void apply_g_code(ControlTableParser& parser, const G10Word& word, const Cursor& cursor,
                  G10Block& block) {
  if (word.value == 10.0)
    block.has_g10 = true;
  else if (word.value == 20.0)
    parser.set_unit(units::inch, cursor, word.start);
  else if (word.value == 21.0)
    parser.set_unit(1.0, cursor, word.start);
  else if (word.value != 11.0 && word.value != 90.0)
    cursor.throw_input_error(word.start, "G10 G11 G20 G21 or G90 in a listing of control memory");
}

G10Block parse_g10_block(ControlTableParser& parser, Cursor& cursor) {
  G10Block block;
  for (const G10Word& word : parse_words(cursor)) {
    if (word.letter == 'G')
      apply_g_code(parser, word, cursor, block);
    else if (word.letter == 'L')
      set_once(block.l, word, cursor);
    else if (word.letter == 'P')
      set_once(block.p, word, cursor);
    else if (word.letter == 'R')
      set_once(block.r, word, cursor);
    else if (table_axes.find(word.letter) != std::string_view::npos)
      block.axes.push_back(word);
    // Program, sequence and M numbers frame the listing.
    else if (word.letter != 'O' && word.letter != 'N' && word.letter != 'M')
      cursor.throw_input_error(word.start, "G10 with L, P, and R or axis words");
  }
  return block;
}

int whole_number(const G10Word& word, int min_value, int max_value, const Cursor& cursor) {
  if (word.value != int(word.value) || word.value < min_value || word.value > max_value)
    cursor.throw_input_error(word.start,
                             fmt::format("{} from {} to {}", word.letter, min_value, max_value));
  return int(word.value);
}

// Without a decimal point the value depends on the increment system of the control (IS-B or
// others), which the listing does not state.
void check_value(const G10Word& word, const Cursor& cursor) {
  if (!word.has_point && word.value != 0.0)
    cursor.throw_input_error(word.start,
                             "a value with a decimal point: without one it would be in increments");
  if (!(word.value <= 1e6 && word.value >= -1e6))
    cursor.throw_input_error(word.start, "a value within 1e6");
}

void set_tool(ControlTableParser& parser, const G10Block& block, int l_code, const Cursor& cursor) {
  const G10Word& r = *block.r;
  if (!block.axes.empty())
    cursor.throw_input_error(block.axes.front().start, "R with G10 for a tool");
  const int number = whole_number(*block.p, 1, 999, cursor);
  if (parser.kind != ControlTableKind::Tools) return parser.count_unused("G10 L10 to L13");
  check_value(r, cursor);
  const double length_mm = r.value == 0.0 ? 0.0 : r.value * parser.require_unit(cursor, r.start);
  ControlTableTool& tool = parser.table.tools.try_emplace(number).first->second;
  if (tool.line == 0) tool.line = cursor.location.line;
  // Wear may be listed before or after its geometry, so the sum is formed at the end.
  if (l_code == 10) tool.length = length_mm;
  if (l_code == 11) tool.length_wear = length_mm;
  if (l_code == 12) tool.radius = length_mm;
  if (l_code == 13) tool.radius_wear = length_mm;
}

void set_offset(ControlTableParser& parser, const G10Block& block, bool additional,
                const Cursor& cursor) {
  if (block.r) cursor.throw_input_error(block.r->start, "axis words with G10 L2 and L20");
  const int system_number =
      whole_number(*block.p, additional ? 1 : 0, additional ? 300 : 6, cursor);
  if (parser.kind != ControlTableKind::Offsets) return parser.count_unused("G10 L2 and L20");
  // Keys as in `program::NcOptions::extra_offsets`: 0 is the external offset, 100 + P those of
  // G54.1.
  ControlTableOffset& offset =
      parser.table.offsets[additional ? 100 + system_number : system_number];
  for (const G10Word& word : block.axes) {
    check_value(word, cursor);
    const double unit = parser.axis_unit(word.letter, word.value, cursor, word.start);
    offset.axes[word.letter] = {word.value * unit, cursor.location.line, int(word.start) + 1};
  }
}

bool parse_listing_line(ControlTableParser& parser, Cursor& cursor) {
  const G10Block block = parse_g10_block(parser, cursor);
  const bool is_empty = !block.l && !block.p && !block.r && block.axes.empty();
  if (!block.has_g10) {
    if (!is_empty) cursor.throw_input_error(0, "G10 in a block that sets a value", "none");
    return true;
  }
  if (is_empty) return true;
  if (!block.l) cursor.throw_input_error(0, "L2 L10 L11 L12 L13 or L20 with G10", "none");
  if (!block.p) cursor.throw_input_error(0, "P (number) with G10", "none");
  const int l_code = int(block.l->value);
  if (l_code != block.l->value || (l_code != 2 && l_code != 20 && (l_code < 10 || l_code > 13)))
    cursor.throw_input_error(block.l->start, "L2 L10 L11 L12 L13 or L20 with G10");
  if (l_code == 2 || l_code == 20) {
    set_offset(parser, block, l_code == 20, cursor);
    return true;
  }
  if (!block.r) cursor.throw_input_error(0, "R (value) with G10 for a tool", "none");
  set_tool(parser, block, l_code, cursor);
  return true;
}

}  // namespace

void read_fanuc_table(ControlTableParser& parser) {
  for_each_line(parser, [&](Cursor& cursor) { return parse_listing_line(parser, cursor); });
  // `ControlTableTool` states length and radius including wear.
  for (auto& [number, tool] : parser.table.tools) {
    if (tool.length) *tool.length += tool.length_wear;
    if (tool.radius) *tool.radius += tool.radius_wear;
  }
}

}  // namespace abbe::sim::dialects
