#include "sim/dialects/linuxcnc_tables.h"

#include <array>
#include <string_view>

#include <fmt/format.h>

namespace abbe::sim::dialects {

namespace {

constexpr std::string_view table_axes = "XYZABCUVW";
constexpr int first_system = 5221, systems = 9, parameters_of_system = 20;
constexpr int rotation_of_system = 9;  // of its parameters, behind those of the axes
constexpr int shift_in_force = 5210, first_of_shift = 5211, system_in_force = 5220;

/// T1 P1 Z+0.511 D0.125 ;a comment
bool tool_line(TableReading& reading, Cursor& line) {
  std::optional<int> number;
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

/// Parameters that are no work offset.
void other_parameter(TableReading& reading, int number, double value) {
  if (value == 0.0 || number == shift_in_force) return;
  if (number == system_in_force) {
    if (value != 1.0) reading.leave_out("5220, a program begins in G54");
  } else if (number >= 5161 && number <= 5169) {
    reading.leave_out("5161 to 5169, the position of G28");
  } else if (number >= 5181 && number <= 5189) {
    reading.leave_out("5181 to 5189, the position of G30");
  } else if (number < first_of_shift || number > first_of_shift + 8) {
    reading.leave_out(number <= 30 || number >= 5000 ? "parameters of the control"
                                                     : "parameters of programs");
  }
}

/// What of a file of parameters depends on others.
struct Shift {
  bool in_force = false;
  std::array<std::optional<BadInput>, 9> faults;
};

/// 5221 <tab> 10.5
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
    shift.faults[std::size_t(number - first_of_shift)] = BadInput(
        line.place.file, line.place.line, int(from) + 1,
        "0 for a shift of G92: clear it, or put it into a work offset", fmt::format("{}", value));
  const int at = number - first_system, system = at / parameters_of_system;
  const int k = at % parameters_of_system;
  if (at < 0 || system >= systems || k > rotation_of_system) {
    other_parameter(reading, number, value);
    return true;
  }
  if (k == rotation_of_system) {
    if (value != 0.0) line.refuse(from, "0 for the rotation of a coordinate system");
    return true;
  }
  const bool turns = k >= 3 && k <= 5;
  TableOffset& offset = reading.table.offsets[system + 1];
  const double unit = turns || value == 0.0 ? 1.0 : reading.unit_at(line, from);
  if (!offset.axes
           .emplace(table_axes[std::size_t(k)],
                    TableOffset::Value{value * unit, line.place.line, int(from) + 1})
           .second)
    line.refuse(0, "a parameter that the file does not have already", fmt::format("{}", number));
  return true;
}

}  // namespace

void read_linuxcnc_table(TableReading& reading) {
  if (reading.kind == TableKind::Tools)
    return each_line(reading, [&](Cursor& line) { return tool_line(reading, line); });
  Shift shift;
  each_line(reading, [&](Cursor& line) { return parameter_line(reading, line, shift); });
  for (const std::optional<BadInput>& fault : shift.faults)
    if (fault && shift.in_force) reading.faults.add(*fault);
}

}  // namespace abbe::sim::dialects
