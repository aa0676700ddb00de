#include "sim/dialects/control_table.h"

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
// Bounds memory for a file of many different names; the rest is counted together.
constexpr std::size_t max_unused_names = 200;
}  // namespace

void TableReading::leave_out(const std::string& name) {
  const bool known = unused.contains(name) || unused.size() < max_unused_names;
  ++unused[known ? name : "others"];
}

// Siemens and Heidenhain tables hold offsets of other jobs, which must not stop this one.
void TableReading::read_beyond(int system, const std::function<void()>& read) {
  try {
    read();
  } catch (const BadInput&) {
    leave_out("offsets beyond the sixth that cannot be read");
    unread.insert(system);
  }
}

// The unit is needed only for values other than zero, so callers ask when they meet one.
double TableReading::unit_at(const Cursor& cursor, std::size_t from) const {
  if (!unit)
    cursor.refuse(from, "a unit beside the name of the file, which does not say it", "none");
  return *unit;
}

void TableReading::state_unit(double mm, const Cursor& cursor, std::size_t from) {
  const auto named = [](double length) { return length == 1.0 ? "mm" : "inch"; };
  if (unit && *unit != mm)
    cursor.refuse(from, fmt::format("a table in {}, as is stated beside its name", named(*unit)),
                  named(mm));
  unit = mm;
}

void each_line(TableReading& reading, const std::function<bool(Cursor&)>& read) {
  try {
    check_encoding(reading.text, reading.table.file);
  } catch (const BadInput& fault) {
    reading.input_errors.add(fault);
    return;
  }
  Lines lines(reading.text);
  while (const auto line = lines.next()) {
    Cursor cursor{*line, {reading.table.file, lines.number()}};
    try {
      // Control characters show a binary file; the first one is reported instead of every cell.
      for (std::size_t i = 0; i < line->size(); ++i) {
        const auto c = static_cast<unsigned char>((*line)[i]);
        if ((c < ' ' && c != '\t') || c == 0x7f)
          cursor.refuse(i, "plain text", fmt::format("a byte 0x{:02x}", c));
      }
      if (!read(cursor)) return;
    } catch (const BadInput& fault) {
      reading.input_errors.add(fault);
      if (reading.input_errors.full()) return;
    }
  }
}

double table_number(Cursor& cursor, std::string_view what) {
  constexpr double most = 1e6;
  cursor.skip_blanks();
  const std::size_t from = cursor.at;
  const auto value = cursor.number();
  if (!value || !(std::abs(*value) <= most))
    cursor.refuse(from, fmt::format("a number within 1e6 for {}", what));
  // Delimiters of all formats: comments, CTRANS lists and their closing bracket.
  const bool ends = cursor.at_end() || is_blank(cursor.here()) || cursor.here() == ';' ||
                    cursor.here() == ',' || cursor.here() == ')';
  if (!ends) cursor.refuse(from, fmt::format("a number for {}", what));
  return *value;
}

int table_whole(Cursor& cursor, int least, int most, std::string_view what) {
  cursor.skip_blanks();
  const std::size_t from = cursor.at;
  const auto value = cursor.number();
  if (!value || *value != std::floor(*value) || *value < least || *value > most)
    cursor.refuse(from, fmt::format("a whole number from {} to {} for {}", least, most, what));
  return int(*value);
}

namespace {

constexpr std::string_view table_axes = "XYZABCUVW";
// Parameter layout of LinuxCNC: 20 parameters for each of nine systems from 5221 on, X first.
constexpr int first_system = 5221, systems = 9, parameters_of_system = 20;
// Index of the rotation among the parameters of a system, behind the nine axes.
constexpr int system_rotation_index = 9;
// 5210 is non-zero while the shift of G92, 5211 to 5219, is in force; 5220 is the system in force.
constexpr int shift_in_force = 5210, first_of_shift = 5211, system_in_force = 5220;

/// One line of a tool table, for example "T1 P1 Z+0.511 D0.125 ;a comment".
bool tool_line(TableReading& reading, Cursor& line) {
  std::optional<int> number;
  // LinuxCNC treats missing values as zero.
  TableTool tool{0.0, 0.0, 0.0, 0.0, {}, line.place.line};
  std::string seen;
  for (line.skip_blanks(); !line.at_end() && line.here() != ';'; line.skip_blanks()) {
    const std::size_t from = line.at;
    const char letter = upper(line.here());
    if (std::string_view("TPDXYZABCUVWIJQ").find(letter) == std::string_view::npos)
      line.refuse(from, "a word T P D X Y Z A B C U V W I J or Q of a tool, or ; and a comment");
    if (seen.find(letter) != std::string::npos)
      line.refuse(from, fmt::format("{} once in the line of a tool", letter));
    seen += letter;
    ++line.at;
    if (letter == 'T') {
      number = table_whole(line, 0, 999'999, "T");
      continue;
    }
    const double value = table_number(line, std::string_view(&letter, 1));
    if (letter == 'Z')
      tool.length = value * reading.unit_at(line, from);
    else if (letter == 'D')
      tool.radius = 0.5 * value * reading.unit_at(line, from);
    // An offset across the tool axis would need a chain of its own, which the scene describes
    // instead.
    else if (letter != 'P' && value != 0.0 && table_axes.find(letter) != std::string_view::npos)
      line.refuse(from, fmt::format("0 for {}: the length of a tool lies along Z", letter));
    else if (letter != 'P' && value != 0.0)
      reading.leave_out(std::string(1, letter));
  }
  if (seen.empty()) return true;
  if (!number) line.refuse(0, "T (number of the tool)", "none");
  if (!reading.table.tools.emplace(*number, tool).second)
    line.refuse(0, "a tool that the table does not have already", fmt::format("T{}", *number));
  return true;
}

/// Counts parameters that are no work offset but have a value.
void other_parameter(TableReading& reading, int number, double value) {
  if (value == 0.0 || number == shift_in_force) return;
  // A program begins in G54, system 1, whatever the control had in force before.
  if (number == system_in_force) {
    if (value != 1.0) reading.leave_out("5220, a program begins in G54");
  } else if (number >= 5161 && number <= 5169) {
    reading.leave_out("5161 to 5169, the position of G28");
  } else if (number >= 5181 && number <= 5189) {
    reading.leave_out("5181 to 5189, the position of G30");
  } else if (number < first_of_shift || number > first_of_shift + 8) {
    // The shift of G92 has been handled by the caller.
    reading.leave_out(number <= 30 || number >= 5000 ? "parameters of the control"
                                                     : "parameters of programs");
  }
}

/// Shift of G92: whether it is in force is stated in another line than its values.
struct Shift {
  bool in_force = false;
  std::array<std::optional<BadInput>, 9> input_errors;
};

/// One line of a parameter file: number, tab, value.
bool parameter_line(TableReading& reading, Cursor& line, Shift& shift) {
  line.skip_blanks();
  if (line.at_end() || line.here() == ';' || line.here() == '#') return true;
  const int number = table_whole(line, 1, 99'999, "the number of a parameter");
  line.skip_blanks();
  const std::size_t from = line.at;
  const double value = table_number(line, "a parameter");
  line.skip_blanks();
  if (!line.at_end()) line.refuse(line.at, "the end of the line behind a parameter");
  if (number == shift_in_force) shift.in_force = value != 0.0;
  if (number >= first_of_shift && number < first_of_shift + 9 && value != 0.0)
    shift.input_errors[std::size_t(number - first_of_shift)] = BadInput(
        line.place.file, line.place.line, int(from) + 1,
        "0 for a shift of G92: clear it, or put it into a work offset", fmt::format("{}", value));
  const int at = number - first_system, system = at / parameters_of_system;
  const int k = at % parameters_of_system;
  if (at < 0 || system >= systems || k > system_rotation_index) {
    other_parameter(reading, number, value);
    return true;
  }
  if (k == system_rotation_index) {
    if (value != 0.0) line.refuse(from, "0 for the rotation of a coordinate system");
    return true;
  }
  // Rotary axes A B C are in degrees, without unit of length.
  const bool turns = k >= 3 && k <= 5;
  TableOffset& offset = reading.table.offsets[system + 1];
  const double unit = turns || value == 0.0 ? 1.0 : reading.unit_at(line, from);
  if (!offset.axes
           .emplace(table_axes[std::size_t(k)],
                    TableOffset::Value{value * unit, line.place.line, int(from) + 1})
           .second)
    // LinuxCNC would take the last value; a duplicate usually shows that two files were merged.
    line.refuse(0, "a parameter that the file does not have already", fmt::format("{}", number));
  return true;
}

}  // namespace

void read_linuxcnc_table(TableReading& reading) {
  if (reading.kind == TableKind::Tools)
    return each_line(reading, [&](Cursor& line) { return tool_line(reading, line); });
  Shift shift;
  each_line(reading, [&](Cursor& line) { return parameter_line(reading, line, shift); });
  // G92 values that are stored but suspended have no effect.
  for (const std::optional<BadInput>& fault : shift.input_errors)
    if (fault && shift.in_force) reading.input_errors.add(*fault);
}

namespace {

// Bounds the memory of a hostile line.
constexpr std::size_t max_words = 64;  // of a block

// A word of a G10 block.
struct ListedWord {
  char letter = ' ';
  double value = 0.0;
  bool point = false;    // it has a decimal point
  std::size_t from = 0;  // where it begins
};

/// Returns the words of a block without its comments.
std::vector<ListedWord> listed_words(Cursor& line) {
  std::vector<ListedWord> words;
  for (line.skip_blanks(); !line.at_end(); line.skip_blanks()) {
    const std::size_t from = line.at;
    const char c = upper(line.here());
    if (c == '(') {
      const std::size_t close = line.text.find(')', from);
      if (close == std::string_view::npos) line.refuse(from, "a ) that closes the comment");
      line.at = close + 1;
      continue;
    }
    // Tape marks and block skip have no meaning in a listing of the memory.
    if (c == ';' || c == '%' || c == '/') {
      ++line.at;
      continue;
    }
    if (!is_letter(c)) line.refuse(from, "a letter and a number");
    ++line.at;
    const auto value = line.number();
    if (!value) line.refuse(from, "a number behind the letter");
    const bool point = line.text.substr(from, line.at - from).find('.') != std::string_view::npos;
    words.push_back({c, *value, point, from});
    if (words.size() > max_words) line.refuse(from, "at most 64 words in a block");
  }
  return words;
}

/// Words of a G10 block.
struct Setting {
  bool sets = false;
  std::optional<ListedWord> l, p, r;
  std::vector<ListedWord> axes;
};

void put_once(std::optional<ListedWord>& to, const ListedWord& word, const Cursor& line) {
  if (to) line.refuse(word.from, fmt::format("{} once in a block", word.letter));
  to = word;
}

// G11 ends G10, and G90 is what listings are written with: both change no value.
void take_code(TableReading& reading, const ListedWord& word, const Cursor& line,
               Setting& setting) {
  if (word.value == 10.0)
    setting.sets = true;
  else if (word.value == 20.0)
    reading.state_unit(units::inch, line, word.from);
  else if (word.value == 21.0)
    reading.state_unit(1.0, line, word.from);
  else if (word.value != 11.0 && word.value != 90.0)
    line.refuse(word.from, "G10 G11 G20 G21 or G90 in a listing of a control's memory");
}

Setting setting_of(TableReading& reading, Cursor& line) {
  Setting setting;
  for (const ListedWord& word : listed_words(line)) {
    if (word.letter == 'G')
      take_code(reading, word, line, setting);
    else if (word.letter == 'L')
      put_once(setting.l, word, line);
    else if (word.letter == 'P')
      put_once(setting.p, word, line);
    else if (word.letter == 'R')
      put_once(setting.r, word, line);
    else if (table_axes.find(word.letter) != std::string_view::npos)
      setting.axes.push_back(word);
    // Program, sequence and M numbers frame the listing.
    else if (word.letter != 'O' && word.letter != 'N' && word.letter != 'M')
      line.refuse(word.from, "G10 with L, P, and R or axis words");
  }
  return setting;
}

int to_whole_number(const ListedWord& word, int least, int most, const Cursor& line) {
  if (word.value != int(word.value) || word.value < least || word.value > most)
    line.refuse(word.from, fmt::format("{} from {} to {}", word.letter, least, most));
  return int(word.value);
}

// Without a decimal point the value depends on the increment system of the control (IS-B or
// others), which the listing does not state.
void check_point(const ListedWord& word, const Cursor& line) {
  if (!word.point && word.value != 0.0)
    line.refuse(word.from, "a value with a decimal point: without one it counts increments");
  if (!(word.value <= 1e6 && word.value >= -1e6)) line.refuse(word.from, "a value within 1e6");
}

void listed_tool(TableReading& reading, const Setting& setting, int kind, const Cursor& line) {
  const ListedWord& r = *setting.r;
  if (!setting.axes.empty()) line.refuse(setting.axes.front().from, "R beside G10 of a tool");
  const int number = to_whole_number(*setting.p, 1, 999, line);
  if (reading.kind != TableKind::Tools) return reading.leave_out("G10 L10 to L13");
  check_point(r, line);
  const double mm = r.value == 0.0 ? 0.0 : r.value * reading.unit_at(line, r.from);
  TableTool& tool = reading.table.tools.try_emplace(number).first->second;
  if (tool.line == 0) tool.line = line.place.line;
  // Wear may be listed before or after its geometry, so the sum is formed at the end.
  if (kind == 10) tool.length = mm;
  if (kind == 11) tool.length_wear = mm;
  if (kind == 12) tool.radius = mm;
  if (kind == 13) tool.radius_wear = mm;
}

void listed_offset(TableReading& reading, const Setting& setting, bool additional,
                   const Cursor& line) {
  if (setting.r) line.refuse(setting.r->from, "axis words beside G10 L2 and L20");
  const int p = to_whole_number(*setting.p, additional ? 1 : 0, additional ? 300 : 6, line);
  if (reading.kind != TableKind::Offsets) return reading.leave_out("G10 L2 and L20");
  // Keys as `program::NcOptions::more_offset`: 0 is the external offset, 100 + P those of G54.1.
  TableOffset& offset = reading.table.offsets[additional ? 100 + p : p];
  for (const ListedWord& word : setting.axes) {
    check_point(word, line);
    const bool turns = word.letter >= 'A' && word.letter <= 'C';
    const double unit = turns || word.value == 0.0 ? 1.0 : reading.unit_at(line, word.from);
    offset.axes[word.letter] = {word.value * unit, line.place.line, int(word.from) + 1};
  }
}

bool listed_block(TableReading& reading, Cursor& line) {
  const Setting setting = setting_of(reading, line);
  const bool empty = !setting.l && !setting.p && !setting.r && setting.axes.empty();
  if (!setting.sets) {
    if (!empty) line.refuse(0, "G10 in a block that sets something", "none");
    return true;
  }
  if (empty) return true;
  if (!setting.l) line.refuse(0, "L2 L10 L11 L12 L13 or L20 beside G10", "none");
  if (!setting.p) line.refuse(0, "P (number) beside G10", "none");
  const int kind = int(setting.l->value);
  if (kind != setting.l->value || (kind != 2 && kind != 20 && (kind < 10 || kind > 13)))
    line.refuse(setting.l->from, "L2 L10 L11 L12 L13 or L20 beside G10");
  if (kind == 2 || kind == 20) {
    listed_offset(reading, setting, kind == 20, line);
    return true;
  }
  if (!setting.r) line.refuse(0, "R (value) beside G10 of a tool", "none");
  listed_tool(reading, setting, kind, line);
  return true;
}

}  // namespace

void read_fanuc_table(TableReading& reading) {
  each_line(reading, [&](Cursor& line) { return listed_block(reading, line); });
  // Tables state length and radius including wear.
  for (auto& [number, tool] : reading.table.tools) {
    if (tool.length) *tool.length += tool.length_wear;
    if (tool.radius) *tool.radius += tool.radius_wear;
  }
}

}  // namespace abbe::sim::dialects
