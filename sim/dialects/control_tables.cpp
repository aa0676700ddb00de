#include "sim/dialects/control_tables.h"

#include <algorithm>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "sim/dialects/bad_program.h"
#include "sim/dialects/fanuc_tables.h"
#include "sim/dialects/heidenhain_tables.h"
#include "sim/dialects/linuxcnc_tables.h"
#include "sim/dialects/siemens_tables.h"

namespace abbe::sim::dialects {

namespace {

constexpr std::size_t most_table_bytes = std::size_t(64) << 20;
constexpr int most_lines_for_sign = 2000;

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

std::string offset_name(Dialect control, int system) {
  if (control == Dialect::Heidenhain)
    return fmt::format("preset {}", system > 1000 ? system - 1000 : system);
  if (control == Dialect::Siemens && system > 4)
    return fmt::format("G{}", system > 500 ? system : 500 + system);
  if (system == 0) return "the external offset";
  if (system > 100) return fmt::format("G54.1 P{}", system - 100);
  return system > 6 ? fmt::format("G59.{}", system - 6) : fmt::format("G{}", 53 + system);
}

std::vector<std::string> table_warnings(const ControlTable& table, std::string_view read_as,
                                        const std::set<int>& called) {
  std::vector<std::string> warnings = table.notes;
  const std::string_view control = name_of(table.control);
  if (read_as.empty()) {
    warnings.push_back(
        fmt::format("{} is without effect: a table of times has no tools and offsets", table.file));
    return warnings;
  }
  if (!read_as.starts_with(control)) {
    warnings.push_back(fmt::format("{} is a table of {}, and the program is read as {}", table.file,
                                   control, read_as));
    return warnings;
  }
  std::string lacking;
  for (const int system : called)
    if (!table.offsets.empty() && !table.offsets.contains(system))
      lacking += (lacking.empty() ? "" : ", ") + offset_name(table.control, system);
  if (!lacking.empty())
    warnings.push_back(
        fmt::format("{} has no {}, which the program calls: zero unless the program sets it",
                    table.file, lacking));
  return warnings;
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
  for (const int system : reading.unread) reading.table.offsets.erase(system);
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
