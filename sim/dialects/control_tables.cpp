#include "sim/dialects/control_tables.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/bad_program.h"
#include "sim/dialects/control_table_reading.h"

namespace abbe::sim::dialects {

namespace {

constexpr std::size_t most_table_bytes = std::size_t(64) << 20;
constexpr int most_lines_for_sign = 2000;
constexpr std::size_t most_unused_names = 200;

bool has_number_behind(std::string_view line, char letter) {
  return line.size() > 1 && upper(line[0]) == letter && is_digit(line[1]);
}

/// Whose table has such a line.
std::optional<Dialect> control_of_line(std::string_view line, TableKind kind) {
  if (line.starts_with("BEGIN ")) return Dialect::Heidenhain;
  for (const std::string_view sign : {"%_N_", "$TC_", "$P_UIFR"})
    if (line.find(sign) != std::string_view::npos) return Dialect::Siemens;
  if (line[0] == ';' || line[0] == '(' || line[0] == '%') return std::nullopt;
  if (line.find("G10") != std::string_view::npos || has_number_behind(line, 'O'))
    return Dialect::Fanuc;
  const bool is_linuxcnc =
      kind == TableKind::Tools ? has_number_behind(line, 'T') : is_digit(line[0]);
  return is_linuxcnc ? std::optional(Dialect::LinuxCnc) : std::nullopt;
}

std::optional<Dialect> control_of(std::string_view text, TableKind kind) {
  Lines lines(text);
  while (const auto line = lines.next()) {
    if (lines.number() > most_lines_for_sign) break;
    const std::size_t from = std::min(line->find_first_not_of(" \t"), line->size());
    if (from == line->size()) continue;
    if (const auto found = control_of_line(line->substr(from), kind)) return found;
  }
  return std::nullopt;
}

std::string unused_text(const TableReading& reading) {
  std::string names;
  for (const auto& [name, count] : reading.unused)
    names += fmt::format("{}{} ({})", names.empty() ? "" : ", ", name, count);
  return fmt::format("{} has values without effect, other than zero: {}", reading.table.file,
                     names);
}

void read_as(Dialect control, TableReading& reading) {
  reading.table.control = control;
  switch (control) {
    case Dialect::Fanuc:
      return read_fanuc_table(reading);
    case Dialect::Siemens:
      return read_siemens_table(reading);
    case Dialect::Heidenhain:
      return read_heidenhain_table(reading);
    default:
      return read_linuxcnc_table(reading);
  }
}

}  // namespace

void TableReading::leave_out(const std::string& name) {
  const bool known = unused.contains(name) || unused.size() < most_unused_names;
  ++unused[known ? name : "others"];
}

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
  Lines lines(reading.text);
  while (const auto line = lines.next()) {
    Cursor cursor{*line, {reading.table.file, lines.number()}};
    try {
      for (std::size_t i = 0; i < line->size(); ++i) {
        const auto c = static_cast<unsigned char>((*line)[i]);
        if ((c < ' ' && c != '\t') || c == 0x7f)
          cursor.refuse(i, "plain text", fmt::format("a byte 0x{:02x}", c));
      }
      if (!read(cursor)) return;
    } catch (const BadInput& fault) {
      reading.faults.add(fault);
      if (reading.faults.full()) return;
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

ControlTable read_control_table(std::string_view text, const std::string& file, TableKind kind,
                                std::optional<double> unit) {
  const bool tools = kind == TableKind::Tools;
  if (text.size() > most_table_bytes)
    throw BadProgram({BadInput(file, 0, 0, fmt::format("at most {} bytes", most_table_bytes),
                               fmt::format("{}", text.size()))});
  const auto control = control_of(text, kind);
  if (!control)
    throw BadProgram(
        {BadInput(file, 1, 1,
                  tools ? "a tool table of LinuxCNC (T1 Z D), Fanuc (G10), Siemens ($TC_DP) or "
                          "Heidenhain (BEGIN)"
                        : "work offsets of LinuxCNC (5221), Fanuc (G10), Siemens ($P_UIFR) or "
                          "Heidenhain (BEGIN)",
                  "no line that has a sign of one")});
  TableReading reading{text, kind, unit};
  reading.table.file = file;
  read_as(*control, reading);
  const bool empty = tools ? reading.table.tools.empty() : reading.table.offsets.empty();
  if (empty && reading.faults.empty())
    reading.faults.add(BadInput(file, 1, 1, tools ? "a tool" : "a work offset", "none"));
  if (!reading.faults.empty()) throw BadProgram(reading.faults.list());
  if (!reading.unused.empty()) reading.table.notes.push_back(unused_text(reading));
  return std::move(reading.table);
}

ControlTable read_control_table_file(const std::filesystem::path& file, TableKind kind,
                                     std::optional<double> unit) {
  return read_control_table(read_text(file, most_table_bytes), file.string(), kind, unit);
}

}  // namespace abbe::sim::dialects
