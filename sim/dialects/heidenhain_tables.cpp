#include "sim/dialects/heidenhain_tables.h"

#include <algorithm>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::sim::dialects {

namespace {

constexpr std::size_t most_columns = 256;

/// A column by its name, and where it begins and ends in every line.
struct TableColumn {
  std::string name;
  std::size_t from = 0, to = 0;
};

std::string next_word(Cursor& line) {
  line.skip_blanks();
  std::string word;
  while (!line.at_end() && !is_blank(line.here())) word += upper(line.text[line.at++]);
  return word;
}

/// BEGIN TOOL .T MM
void head_of_table(TableReading& reading, Cursor& line) {
  const std::string_view wanted = reading.kind == TableKind::Tools ? ".T" : ".PR";
  bool kind = false, unit = false;
  if (next_word(line) != "BEGIN") line.refuse(0, "BEGIN, with which a table begins");
  for (line.skip_blanks(); !line.at_end(); line.skip_blanks()) {
    const std::size_t from = line.at;
    const std::string word = next_word(line);
    kind = kind || word.ends_with(wanted);
    if (word != "MM" && word != "INCH") continue;
    unit = true;
    reading.state_unit(word == "MM" ? 1.0 : units::inch, line, from);
  }
  if (!kind) line.refuse(0, fmt::format("a table named {}", wanted));
  if (!unit) line.refuse(0, "MM or INCH in the first line of a table");
}

std::vector<TableColumn> columns_of(TableReading& reading, Cursor& line) {
  std::vector<TableColumn> columns;
  for (line.skip_blanks(); !line.at_end(); line.skip_blanks()) {
    const std::size_t from = line.at;
    const std::string name = next_word(line);
    if (!columns.empty()) columns.back().to = from;
    const auto same = [&](const TableColumn& one) { return one.name == name; };
    if (std::any_of(columns.begin(), columns.end(), same))
      line.refuse(from, "columns of different names");
    columns.push_back({name, from, std::string_view::npos});
    if (columns.size() > most_columns) line.refuse(from, "at most 256 columns");
  }
  if (!columns.empty()) columns.front().from = 0;
  const auto has = [&](std::string_view name) {
    return std::any_of(columns.begin(), columns.end(),
                       [&](const TableColumn& one) { return one.name == name; });
  };
  const bool tools = reading.kind == TableKind::Tools;
  if (tools ? !has("T") || !has("L") || !has("R") : !has("NR") && !has("NO"))
    line.refuse(0, tools ? "columns named T, L and R" : "a column named NR");
  return columns;
}

/// The cell of a column without the blanks around it, as a cursor that stands at it.
std::optional<Cursor> cell_in(const TableColumn& column, const Cursor& line) {
  const std::string_view text = line.text;
  const std::size_t to = std::min(column.to, text.size());
  if (column.from > 0 && column.from < text.size() && !is_blank(text[column.from]) &&
      !is_blank(text[column.from - 1]))
    line.refuse(column.from, "a blank before the column " + column.name);
  if (column.from >= to) return std::nullopt;
  Cursor cell{text.substr(0, to), line.place, column.from};
  cell.skip_blanks();
  return cell.at_end() ? std::nullopt : std::optional(cell);
}

double cell_number(Cursor cell, const std::string& name) {
  const double value = table_number(cell, name);
  cell.skip_blanks();
  if (!cell.at_end()) cell.refuse(cell.at, "nothing behind the value of " + name);
  return value;
}

/// A cell without effect, as text: other than nothing, zero, - and a word for no.
bool has_content(const Cursor& cell) {
  return cell.text.substr(cell.at).find_first_not_of("+-0. ") != std::string_view::npos;
}

struct ToolRow {
  std::optional<int> number;
  bool indexed = false;
  double length = 0.0, radius = 0.0, more_length = 0.0, more_radius = 0.0;
  std::string name;
};

void tool_cell(TableReading& reading, const TableColumn& column, const Cursor& cell, ToolRow& row) {
  const std::string& name = column.name;
  double* const to = name == "L"    ? &row.length
                     : name == "R"  ? &row.radius
                     : name == "DL" ? &row.more_length
                     : name == "DR" ? &row.more_radius
                                    : nullptr;
  if (to != nullptr) {
    *to = cell_number(cell, name) * *reading.unit;
  } else if (name == "T") {
    Cursor at = cell;
    const std::size_t point = cell.text.find('.', cell.at);
    if (point != std::string_view::npos) {
      row.indexed = true;
      at.text = at.text.substr(0, point);
    }
    row.number = table_whole(at, 0, 32'767, "T");
    at.skip_blanks();
    if (!at.at_end()) at.refuse(at.at, "nothing behind the number of the tool");
  } else if (name == "NAME") {
    std::string_view text = cell.text.substr(cell.at);
    text = text.substr(0, text.find_last_not_of(" \t") + 1);
    row.name = std::string(text);
  } else if (has_content(cell)) {
    reading.leave_out(name);
  }
}

void tool_row(TableReading& reading, const std::vector<TableColumn>& columns, const Cursor& line) {
  ToolRow row;
  for (const TableColumn& column : columns)
    if (const auto cell = cell_in(column, line)) tool_cell(reading, column, *cell, row);
  if (!row.number) line.refuse(0, "the number of a tool in the column T", "none");
  if (row.indexed) return reading.leave_out("tools with an index, as 5.1");
  const TableTool tool{row.length + row.more_length,
                       row.radius + row.more_radius,
                       row.more_length,
                       row.more_radius,
                       row.name,
                       line.place.line};
  if (!reading.table.tools.emplace(*row.number, tool).second)
    line.refuse(0, "a tool that the table does not have already", fmt::format("{}", *row.number));
}

void preset_cell(TableReading& reading, const TableColumn& column, const Cursor& cell,
                 TableOffset& offset) {
  const std::string& name = column.name;
  const bool axis =
      name.size() == 1 && std::string_view("XYZABCUVW").find(name[0]) != std::string_view::npos;
  const bool turned =
      name == "ROT" || name == "SPA" || name == "SPB" || name == "SPC" || name.ends_with("_OFFS");
  const std::string_view text = cell.text.substr(cell.at);
  if (text.substr(0, text.find_last_not_of(' ') + 1) == "-") return;  // not set
  if (axis) {
    const bool turns = name[0] >= 'A' && name[0] <= 'C';
    offset.axes[name[0]] = {cell_number(cell, name) * (turns ? 1.0 : *reading.unit),
                            cell.place.line, int(cell.at) + 1};
  } else if (turned && cell_number(cell, name) != 0.0) {
    cell.refuse(cell.at,
                "0 for " + name + ": a preset that is not turned, without offsets of axes");
  } else if (!turned && name != "DOC" && has_content(cell)) {
    reading.leave_out(name);
  }
}

int preset_number(Cursor cell, const std::string& name) {
  const int number = table_whole(cell, 0, 99'999, name);
  cell.skip_blanks();
  if (!cell.at_end()) cell.refuse(cell.at, "nothing behind the number of the preset");
  return number;
}

void preset_row(TableReading& reading, const std::vector<TableColumn>& columns,
                const Cursor& line) {
  std::optional<int> number;
  for (const TableColumn& column : columns)
    if (auto cell = cell_in(column, line); cell && (column.name == "NR" || column.name == "NO"))
      number = preset_number(*cell, column.name);
  if (!number) line.refuse(0, "the number of a preset in the column NR", "none");
  if (*number < 1 || *number > most_preset)
    return reading.leave_out(fmt::format("presets other than 1 to {}", most_preset));
  TableOffset offset;
  const int system = system_of_preset(*number);
  const auto read_cells = [&] {
    for (const TableColumn& column : columns)
      if (const auto cell = cell_in(column, line);
          cell && column.name != "NR" && column.name != "NO")
        preset_cell(reading, column, *cell, offset);
  };
  if (*number <= 6)
    read_cells();
  else
    reading.read_beyond(system, read_cells);
  if (!reading.table.offsets.emplace(system, offset).second)
    line.refuse(0, "a preset that the table does not have already", fmt::format("{}", *number));
}

}  // namespace

void read_heidenhain_table(TableReading& reading) {
  std::vector<TableColumn> columns;
  bool begun = false, ended = false, hopeless = false;
  int last = 1;
  each_line(reading, [&](Cursor& line) {
    last = line.place.line;
    line.skip_blanks();
    if (line.at_end()) return true;
    line.at = 0;
    if (!begun) {
      begun = hopeless = true;
      head_of_table(reading, line);
      hopeless = false;
    } else if (hopeless) {
      return false;
    } else if (columns.empty()) {
      hopeless = true;
      columns = columns_of(reading, line);
      hopeless = false;
    } else if (line.take("[END]")) {
      ended = true;
      return false;
    } else if (reading.kind == TableKind::Tools) {
      tool_row(reading, columns, line);
    } else {
      preset_row(reading, columns, line);
    }
    return true;
  });
  if (!ended && !hopeless)
    reading.faults.add(
        BadInput(reading.table.file, last, 1, "[END] behind the last row", "the end of the file"));
}

}  // namespace abbe::sim::dialects
