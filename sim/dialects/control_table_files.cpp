#include "sim/dialects/control_table_files.h"
#include "sim/dialects/expression.h"

#include <algorithm>
#include <array>
#include <map>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/control_table.h"
#include "sim/dialects/read_options.h"

// Readers of the tool and offset tables of Heidenhain and Siemens controls, and the detection of
// the control of a table.

namespace abbe::sim::dialects {

/// Reads a Heidenhain table, whose format the header describes. Collects errors in `parser`.
void read_heidenhain_table(ControlTableParser& parser);

/// Reads the $TC_DP and $P_UIFR of a Siemens table, whose format the header describes. Collects
/// errors in `parser`.
void read_siemens_table(ControlTableParser& parser);

namespace {

constexpr std::size_t max_columns = 256;  // bounds memory

// Keys of work offsets: G54.1 Pn has the key g54_1_base + n, and G5nn of Siemens g500_base + nn.
constexpr int g54_1_base = 100, g500_base = 500;

/// A column: its name, and the range of bytes of every line that belongs to it.
struct TableColumn {
  std::string name;
  std::size_t from = 0, to = 0;
};

// Returns the next word in upper case.
std::string next_word(Cursor& line) {
  line.skip_blanks();
  std::string word;
  while (!line.at_end() && !is_blank(line.current())) word += upper(line.text[line.at++]);
  return word;
}

/// Checks the first line, for example "BEGIN TOOL .T MM", and reads its unit.
void parse_table_header(ControlTableParser& parser, Cursor& line) {
  const std::string_view expected_name = parser.kind == ControlTableKind::Tools ? ".T" : ".PR";
  bool has_name = false, has_unit = false;
  if (next_word(line) != "BEGIN") line.throw_input_error(0, "BEGIN, the first word of a table");
  for (line.skip_blanks(); !line.at_end(); line.skip_blanks()) {
    const std::size_t from = line.at;
    const std::string word = next_word(line);
    has_name = has_name || word.ends_with(expected_name);
    if (word != "MM" && word != "INCH") continue;
    has_unit = true;
    parser.set_unit(word == "MM" ? 1.0 : units::inch, line, from);
  }
  if (!has_name) line.throw_input_error(0, fmt::format("a table named {}", expected_name));
  if (!has_unit) line.throw_input_error(0, "MM or INCH in the first line of a table");
}

bool has_column(const std::vector<TableColumn>& columns, std::string_view name) {
  return std::ranges::any_of(columns,
                             [&](const TableColumn& column) { return column.name == name; });
}

// Parses the line of column names. A column extends from the beginning of its name to the beginning
// of the next name.
std::vector<TableColumn> parse_columns(ControlTableParser& parser, Cursor& line) {
  std::vector<TableColumn> columns;
  for (line.skip_blanks(); !line.at_end(); line.skip_blanks()) {
    const std::size_t from = line.at;
    const std::string name = next_word(line);
    if (!columns.empty()) columns.back().to = from;
    if (has_column(columns, name)) line.throw_input_error(from, "columns with different names");
    columns.push_back({name, from, std::string_view::npos});
    if (columns.size() > max_columns) line.throw_input_error(from, "at most 256 columns");
  }
  // Row numbers may be right-aligned and begin before their name.
  if (!columns.empty()) columns.front().from = 0;
  const auto has_name = [&](std::string_view name) { return has_column(columns, name); };
  const bool is_tool_table = parser.kind == ControlTableKind::Tools;
  if (is_tool_table ? !has_name("T") || !has_name("L") || !has_name("R")
                    : !has_name("NR") && !has_name("NO"))
    line.throw_input_error(0, is_tool_table ? "columns named T, L and R" : "a column named NR");
  return columns;
}

/// Returns a cursor at the cell of a column in a row, or nothing if the cell is blank.
std::optional<Cursor> cell_of_column(const TableColumn& column, const Cursor& line) {
  const std::string_view text = line.text;
  const std::size_t end = std::min(column.to, text.size());
  // A value that runs across the boundary of its column would be read as two numbers.
  if (column.from > 0 && column.from < text.size() && !is_blank(text[column.from]) &&
      !is_blank(text[column.from - 1]))
    line.throw_input_error(column.from, "a blank before the column " + column.name);
  if (column.from >= end) return std::nullopt;
  Cursor cell{text.substr(0, end), line.location, column.from};
  cell.skip_blanks();
  return cell.at_end() ? std::nullopt : std::optional(cell);
}

// Parses the whole cell as a number.
double parse_cell_number(Cursor cell, const std::string& name) {
  const double value = parse_table_number(cell, name);
  cell.skip_blanks();
  if (!cell.at_end()) cell.throw_input_error(cell.at, "nothing after the value of " + name);
  return value;
}

/// Returns true for a cell other than blank, zero or -. The user is warned of such a cell if it has
/// no effect.
bool has_content(const Cursor& cell) {
  return cell.text.substr(cell.at).find_first_not_of("+-0. ") != std::string_view::npos;
}

// Values of a row of a tool table.
struct ToolRow {
  std::optional<int> number;
  bool is_indexed = false;
  double length = 0.0, radius = 0.0, delta_length = 0.0, delta_radius = 0.0;
  std::string name;
};

void parse_tool_cell(ControlTableParser& parser, const TableColumn& column, const Cursor& cell,
                     ToolRow& row) {
  const std::string& name = column.name;
  double* const value = name == "L"    ? &row.length
                        : name == "R"  ? &row.radius
                        : name == "DL" ? &row.delta_length
                        : name == "DR" ? &row.delta_radius
                                       : nullptr;
  if (value != nullptr) {
    *value = parse_cell_number(cell, name) * *parser.unit;
  } else if (name == "T") {
    Cursor number = cell;
    // T 5.1 is an indexed tool: a second cutting edge of tool 5.
    const std::size_t point = cell.text.find('.', cell.at);
    if (point != std::string_view::npos) {
      row.is_indexed = true;
      number.text = number.text.substr(0, point);
    }
    row.number = parse_table_integer(number, 0, 32'767, "T");
    number.skip_blanks();
    if (!number.at_end()) number.throw_input_error(number.at, "nothing after the tool number");
  } else if (name == "NAME") {
    std::string_view text = cell.text.substr(cell.at);
    text = text.substr(0, text.find_last_not_of(" \t") + 1);
    row.name = std::string(text);
  } else if (has_content(cell)) {
    parser.count_unused(name);
  }
}

void parse_tool_row(ControlTableParser& parser, const std::vector<TableColumn>& columns,
                    const Cursor& line) {
  ToolRow row;
  for (const TableColumn& column : columns)
    if (const auto cell = cell_of_column(column, line)) parse_tool_cell(parser, column, *cell, row);
  if (!row.number) line.throw_input_error(0, "a tool number in column T", "none");
  // A scene has one length for each tool, that of index 0.
  if (row.is_indexed) return parser.count_unused("tools with an index such as 5.1");
  // The control adds DL and DR to L and R.
  const ControlTableTool tool{row.length + row.delta_length,
                              row.radius + row.delta_radius,
                              row.delta_length,
                              row.delta_radius,
                              row.name,
                              line.location.line};
  if (!parser.table.tools.emplace(*row.number, tool).second)
    line.throw_input_error(0, "a tool not yet in the table", fmt::format("{}", *row.number));
}

void parse_preset_cell(ControlTableParser& parser, const TableColumn& column, const Cursor& cell,
                       ControlTableOffset& offset) {
  const std::string& name = column.name;
  const bool is_axis =
      name.size() == 1 && std::string_view("XYZABCUVW").find(name[0]) != std::string_view::npos;
  const bool is_rotation =
      name == "ROT" || name == "SPA" || name == "SPB" || name == "SPC" || name.ends_with("_OFFS");
  const std::string_view text = cell.text.substr(cell.at);
  // "-": the axis keeps the value of the active preset.
  if (text.substr(0, text.find_last_not_of(' ') + 1) == "-") return;
  if (is_axis) {
    const bool is_rotary = name[0] >= 'A' && name[0] <= 'C';
    offset.axes[name[0]] = {parse_cell_number(cell, name) * (is_rotary ? 1.0 : *parser.unit),
                            cell.location.line, int(cell.at) + 1};
  } else if (is_rotation && parse_cell_number(cell, name) != 0.0) {
    // A rotated preset or an axis offset would change what X Y Z mean; a scene has no such offset.
    cell.throw_input_error(cell.at,
                           "0 for " + name + ": a preset without rotation and axis offsets");
  } else if (!is_rotation && name != "DOC" && has_content(cell)) {
    // DOC is a comment.
    parser.count_unused(name);
  }
}

int parse_preset_number(Cursor cell, const std::string& name) {
  const int number = parse_table_integer(cell, 0, 99'999, name);
  cell.skip_blanks();
  if (!cell.at_end()) cell.throw_input_error(cell.at, "nothing after the preset number");
  return number;
}

void parse_preset_row(ControlTableParser& parser, const std::vector<TableColumn>& columns,
                      const Cursor& line) {
  std::optional<int> number;
  // The number comes first, because errors in a row are reported only up to number 6.
  for (const TableColumn& column : columns)
    if (auto cell = cell_of_column(column, line);
        cell && (column.name == "NR" || column.name == "NO"))
      number = parse_preset_number(*cell, column.name);
  if (!number) line.throw_input_error(0, "a preset number in column NR", "none");
  // Preset 0 is the active preset of the control, not an entry of the table.
  if (*number < 1 || *number > max_preset)
    return parser.count_unused(fmt::format("presets other than 1 to {}", max_preset));
  ControlTableOffset offset;
  const int offset_key = preset_offset_key(*number);
  const auto read_cells = [&] {
    for (const TableColumn& column : columns)
      if (const auto cell = cell_of_column(column, line);
          cell && column.name != "NR" && column.name != "NO")
        parse_preset_cell(parser, column, *cell, offset);
  };
  // The first six are G54 to G59 of a scene and must be valid.
  if (*number <= 6)
    read_cells();
  else
    parser.read_extra_offset(offset_key, read_cells);
  if (!parser.table.offsets.emplace(offset_key, offset).second)
    line.throw_input_error(0, "a preset not yet in the table", fmt::format("{}", *number));
}

}  // namespace

void read_heidenhain_table(ControlTableParser& parser) {
  std::vector<TableColumn> columns;
  bool has_begun = false, has_ended = false, is_aborted = false;
  int last_line = 1;
  for_each_line(parser, [&](Cursor& line) {
    last_line = line.location.line;
    line.skip_blanks();
    if (line.at_end()) return true;
    line.at = 0;
    if (!has_begun) {
      // Without header or columns no row can be read, so only the first error is reported:
      // `for_each_line` catches it; the flag then stays true and ends the reading.
      has_begun = is_aborted = true;
      parse_table_header(parser, line);
      is_aborted = false;
    } else if (is_aborted) {
      return false;
    } else if (columns.empty()) {
      is_aborted = true;
      columns = parse_columns(parser, line);
      is_aborted = false;
    } else if (line.accept("[END]")) {
      has_ended = true;
      return false;
    } else if (parser.kind == ControlTableKind::Tools) {
      parse_tool_row(parser, columns, line);
    } else {
      parse_preset_row(parser, columns, line);
    }
    return true;
  });
  // A missing [END] shows that the file is truncated.
  if (!has_ended && !is_aborted)
    parser.input_errors.add(BadInput(parser.table.file, last_line, 1, "[END] after the last row",
                                     "the end of the file"));
}

namespace {

/// Values of cutting edge 1 of a tool, mm. The length of the tool is length + wear + base, its
/// radius radius + radius_wear.
struct CuttingEdge {
  double length = 0.0, wear = 0.0, base = 0.0, radius = 0.0, radius_wear = 0.0;
  std::string name;
  int line = 0;
  bool is_defined = false;  // a $TC_DP of the edge has been read
};
using CuttingEdges = std::map<int, CuttingEdge>;

/// Left side of an assignment.
struct AssignmentTarget {
  std::string name;                // for example $TC_DP3
  std::vector<std::string> index;  // for example 1, X, TR
  std::size_t from = 0;
};

AssignmentTarget parse_assignment_target(Cursor& line) {
  AssignmentTarget target{{}, {}, line.at};
  while (!line.at_end() && line.current() != '[' && line.current() != '=' &&
         !is_blank(line.current()))
    target.name += upper(line.text[line.at++]);
  if (next_char(line) == '[') {
    const std::size_t close = line.text.find(']', line.at);
    if (close == std::string_view::npos)
      line.throw_input_error(line.at, "a ] that closes the index");
    target.index.emplace_back();
    for (++line.at; line.at < close; ++line.at) {
      const char c = line.current();
      if (c == ',')
        target.index.emplace_back();
      else if (!is_blank(c))
        target.index.back() += upper(c);
    }
    line.at = close + 1;
  }
  if (next_char(line) != '=') line.throw_input_error(line.at, "= after " + target.name);
  ++line.at;
  return target;
}

/// Returns the i-th index of a target. Throws an input error unless it is a number from 0 to
/// `max_index`.
int table_index(const AssignmentTarget& target, std::size_t i, int max_index, const Cursor& line) {
  const std::string& text = i < target.index.size() ? target.index[i] : std::string();
  int value = -1;
  // Eight digits keep std::stoi from overflowing.
  if (!text.empty() && text.size() <= 8 &&
      text.find_first_not_of("0123456789") == std::string::npos)
    value = std::stoi(text);
  if (value < 0 || value > max_index)
    line.throw_input_error(target.from,
                           fmt::format("an index from 0 to {} in {}", max_index, target.name));
  return value;
}

/// Skips a value: a text in "", or everything up to the next blank. Returns true if the value is
/// zero or empty.
bool skip_value(Cursor& line) {
  const std::size_t from = skip_blanks(line);
  if (line.current() == '"') {
    const std::size_t close = line.text.find('"', from + 1);
    if (close == std::string_view::npos)
      line.throw_input_error(from, "a \" that closes the string");
    line.at = close + 1;
    return close == from + 1;
  }
  while (!line.at_end() && !is_blank(line.current())) ++line.at;
  const std::string_view value = line.text.substr(from, line.at - from);
  if (value.empty()) line.throw_input_error(from, "a value after =");
  return value.find_first_not_of("+-0.") == std::string_view::npos;
}

std::string parse_text(Cursor& line) {
  const std::size_t from = skip_blanks(line);
  if (line.current() != '"') line.throw_input_error(from, "a name in \"\"");
  skip_value(line);
  return std::string(line.text.substr(from + 1, line.at - from - 2));
}

void parse_edge_value(ControlTableParser& parser, const AssignmentTarget& target, int parameter,
                      CuttingEdge& edge, Cursor& line) {
  const std::size_t from = line.at;
  const double value = parse_table_number(line, target.name);
  edge.is_defined = true;
  static constexpr std::pair<int, double CuttingEdge::*> lengths[] = {
      {3, &CuttingEdge::length},
      {6, &CuttingEdge::radius},
      {12, &CuttingEdge::wear},
      {15, &CuttingEdge::radius_wear},
      {21, &CuttingEdge::base}};
  for (const auto& [number, member] : lengths)
    if (number == parameter) {
      edge.*member = value == 0.0 ? 0.0 : value * parser.require_unit(line, from);
      return;
    }
  if (value == 0.0) return;
  // Lengths 2 and 3, their wear and base.
  static constexpr int across[] = {4, 5, 13, 14, 22, 23};
  if (std::ranges::find(across, parameter) != std::end(across))
    line.throw_input_error(from, "0 for length 2 and 3: the tool length lies along the tool axis");
  if (parameter != 1) return parser.count_unused(fmt::format("$TC_DP{}", parameter));
  // Types 100 to 299 are mills and drills, whose length 1 lies along the tool in G17. Turning tools
  // (500 to 599) have other axes.
  if (!(value >= 100.0 && value < 300.0))
    line.throw_input_error(from, "a milling cutter or drill, type 100 to 299");
}

/// Returns the number n of $TC_DPn, or nothing for another name.
std::optional<int> edge_parameter(const std::string& name) {
  constexpr std::string_view prefix = "$TC_DP";
  if (!name.starts_with(prefix) || name.size() <= prefix.size() ||
      name.size() > prefix.size() + 3 ||
      name.find_first_not_of("0123456789", prefix.size()) != std::string::npos)
    return std::nullopt;
  return std::stoi(name.substr(prefix.size()));
}

void parse_tool_value(ControlTableParser& parser, const AssignmentTarget& target,
                      CuttingEdges& edges, Cursor& line) {
  const auto parameter = edge_parameter(target.name);
  // $TC_TP2 is the name of the tool; other data of the magazine does not matter.
  if (!parameter && target.name != "$TC_TP2") {
    if (!skip_value(line)) parser.count_unused(target.name);
    return;
  }
  const int number = table_index(target, 0, 999'999, line);
  // A scene has one cutting edge for each tool.
  if (parameter && table_index(target, 1, 12, line) != 1) {
    if (!skip_value(line)) parser.count_unused("$TC_DP for cutting edges other than 1");
    return;
  }
  CuttingEdge& edge = edges[number];
  if (edge.line == 0) edge.line = line.location.line;
  if (parameter)
    parse_edge_value(parser, target, *parameter, edge, line);
  else
    edge.name = parse_text(line);
}

char axis_letter(const std::string& name, const Cursor& line, std::size_t from) {
  if (name.size() != 1 || std::string_view("XYZABCUVW").find(name[0]) == std::string_view::npos)
    line.throw_input_error(from, "an axis X Y Z A B C U V or W", name.empty() ? "none" : name);
  return name[0];
}

// Coarse and fine values, TR and FI, add up.
void add_to_offset(ControlTableParser& parser, int offset_key, char axis, double value,
                   std::size_t from, const Cursor& line) {
  const double unit = parser.axis_unit(axis, value, line, from);
  ControlTableOffset::Value& sum = parser.table.offsets[offset_key].axes[axis];
  sum = {sum.value + value * unit, line.location.line, int(from) + 1};
}

/// Reads the value of a frame, for example CTRANS(X,10,Y,20):CFINE(X,0.1).
void parse_frame(ControlTableParser& parser, int offset_key, Cursor& line) {
  while (true) {
    const std::size_t from = skip_blanks(line);
    if (!line.accept_word("CTRANS") && !line.accept_word("CFINE"))
      line.throw_input_error(
          from, "CTRANS or CFINE: a work offset without rotation, scaling and mirroring");
    if (next_char(line) != '(') line.throw_input_error(line.at, "( and axes with their values");
    do {
      ++line.at;
      const std::size_t axis_from = skip_blanks(line);
      std::string name;
      while (is_letter(line.current())) name += upper(line.text[line.at++]);
      const char axis = axis_letter(name, line, axis_from);
      if (next_char(line) != ',')
        line.throw_input_error(line.at, "a comma and the value of the axis");
      ++line.at;
      const double value = parse_table_number(line, name);
      add_to_offset(parser, offset_key, axis, value, axis_from, line);
      line.skip_blanks();
    } while (line.current() == ',');
    if (line.current() != ')') line.throw_input_error(line.at, "a ) that closes the frame");
    ++line.at;
    if (next_char(line) != ':') return;
    ++line.at;
  }
}

/// Reads a value of $P_UIFR: a whole frame, or one component of an axis, such as its translation
/// (TR) or fine translation (FI). Rotation, scale and mirroring must be neutral.
void parse_offset(ControlTableParser& parser, const AssignmentTarget& target, int offset_key,
                  Cursor& line) {
  if (target.index.size() == 1) return parse_frame(parser, offset_key, line);
  if (target.index.size() != 3)
    line.throw_input_error(target.from,
                           "an index consisting of a number, an axis and TR, FI, RT, SC or MI");
  const std::size_t from = skip_blanks(line);
  const double value = parse_table_number(line, target.name);
  const std::string& component = target.index[2];
  const char axis = axis_letter(target.index[1], line, target.from);
  if (component == "TR" || component == "FI")
    return add_to_offset(parser, offset_key, axis, value, from, line);
  if (component != "RT" && component != "SC" && component != "MI")
    line.throw_input_error(target.from, "TR, FI, RT, SC or MI");
  // SC is a factor, so its neutral value is 1.
  if (value != (component == "SC" ? 1.0 : 0.0))
    line.throw_input_error(from, "a work offset without rotation, scaling and mirroring");
}

/// Reads $P_UIFR[n]. Errors are reported for n up to 6; a later frame that cannot be read is left
/// out.
void parse_numbered_offset(ControlTableParser& parser, const AssignmentTarget& target,
                           Cursor& line) {
  const int number = table_index(target, 0, 99, line), offset_key = g500_base + number;
  if (number <= 6) return parse_offset(parser, target, number, line);
  const std::size_t value_from = line.at;
  parser.read_extra_offset(offset_key, [&] { parse_offset(parser, target, offset_key, line); });
  // The rejected value may continue in the line.
  if (parser.unreadable_offsets.contains(offset_key))
    line.at = std::min(line.text.find('$', value_from), line.text.size());
}

bool parse_siemens_line(ControlTableParser& parser, CuttingEdges& edges, Cursor& line) {
  if (next_char(line) == '%') return true;  // file names such as %_N_TO1_TOA
  for (; !line.at_end() && line.current() != ';'; line.skip_blanks()) {
    const std::size_t from = line.at;
    const char c = upper(line.current());
    // Block numbers, and M17 or M30 at the end of the file.
    if ((c == 'N' || c == 'M') && is_digit(line.peek())) {
      ++line.at;
      parse_table_integer(line, 0, 1'000'000'000, "a block or M number");
      continue;
    }
    if (line.accept("CHANDATA(")) {
      parse_table_integer(line, 1, 99, "a channel");
      if (line.current() != ')') line.throw_input_error(from, "CHANDATA and a channel in ()");
      ++line.at;
      continue;
    }
    if (c != '$') line.throw_input_error(from, "$ and the name of a value, such as $TC_DP3[1,1]=");
    const AssignmentTarget target = parse_assignment_target(line);
    const bool is_tool = target.name.starts_with("$TC_"), is_offset = target.name == "$P_UIFR";
    if (is_tool && parser.kind == ControlTableKind::Tools) {
      parse_tool_value(parser, target, edges, line);
    } else if (is_offset && parser.kind == ControlTableKind::Offsets) {
      parse_numbered_offset(parser, target, line);
    } else {
      if (!skip_value(line)) parser.count_unused(target.name);
    }
  }
  return true;
}

/// Reports values of $P_UIFR[0]: G500 switches work offsets off, so a scene has no offset for it.
void check_g500(ControlTableParser& parser) {
  const auto offset = parser.table.offsets.find(0);
  if (offset == parser.table.offsets.end()) return;
  for (const auto& [axis, value] : offset->second.axes)
    if (value.value != 0.0)
      parser.input_errors.add(BadInput(parser.table.file, value.line, value.column,
                                       "0 for $P_UIFR[0], which G500 calls",
                                       fmt::format("{}", value.value)));
  parser.table.offsets.erase(offset);
}

}  // namespace

void read_siemens_table(ControlTableParser& parser) {
  CuttingEdges edges;
  for_each_line(parser, [&](Cursor& line) { return parse_siemens_line(parser, edges, line); });
  // A tool without any $TC_DP of its first edge has only a name.
  for (const auto& [number, edge] : edges)
    if (edge.is_defined)
      parser.table.tools[number] = {edge.length + edge.wear + edge.base,
                                    edge.radius + edge.radius_wear,
                                    edge.wear,
                                    edge.radius_wear,
                                    edge.name,
                                    edge.line};
  check_g500(parser);
}

namespace {

// A table of thousands of tools is smaller than 1 MB; 64 MiB bounds memory.
constexpr std::size_t max_table_bytes = std::size_t(64) << 20;
// The control is detected in the first lines, because headers of files are short.
constexpr int max_lines_for_marker = 2000;

bool is_letter_with_number(std::string_view line, char letter) {
  return line.size() > 1 && upper(line[0]) == letter && is_digit(line[1]);
}

/// Returns the control whose tables contain such a line, or nothing if the line could be of any.
std::optional<Dialect> control_of_line(std::string_view line, ControlTableKind kind) {
  if (line.starts_with("BEGIN ")) return Dialect::Heidenhain;
  for (const std::string_view marker : {"%_N_", "$TC_", "$P_UIFR"})
    if (line.find(marker) != std::string_view::npos) return Dialect::Siemens;
  // Comments, and the % of a tape, occur with every control.
  if (line[0] == ';' || line[0] == '(' || line[0] == '%') return std::nullopt;
  if (line.find("G10") != std::string_view::npos || is_letter_with_number(line, 'O'))
    return Dialect::Fanuc;
  // LinuxCNC is tested last, because a bare number is the weakest evidence.
  const bool is_linuxcnc =
      kind == ControlTableKind::Tools ? is_letter_with_number(line, 'T') : is_digit(line[0]);
  return is_linuxcnc ? std::optional(Dialect::LinuxCnc) : std::nullopt;
}

/// Returns the control that the first conclusive line indicates; nothing if there is no such line.
std::optional<Dialect> detect_control(std::string_view text, ControlTableKind kind) {
  LineReader lines(text);
  while (const auto line = lines.next()) {
    if (lines.number() > max_lines_for_marker) break;
    const std::size_t from = std::min(line->find_first_not_of(" \t"), line->size());
    if (from == line->size()) continue;
    if (const auto control = control_of_line(line->substr(from), kind)) return control;
  }
  return std::nullopt;
}

std::string unused_values_note(const ControlTableParser& parser) {
  std::string names;
  for (const auto& [name, count] : parser.unused)
    names += fmt::format("{}{} ({})", names.empty() ? "" : ", ", name, count);
  return fmt::format("{} has nonzero values that are not used: {}", parser.table.file, names);
}

void read_format(Dialect control, ControlTableParser& parser) {
  parser.table.control = control;
  switch (control) {
    case Dialect::Fanuc:
      return read_fanuc_table(parser);
    case Dialect::Siemens:
      return read_siemens_table(parser);
    case Dialect::Heidenhain:
      return read_heidenhain_table(parser);
    default:
      return read_linuxcnc_table(parser);
  }
}

}  // namespace

std::string offset_name(Dialect control, int offset_key) {
  if (control == Dialect::Heidenhain)
    // The inverse of `preset_offset_key`.
    return fmt::format("preset {}", offset_key > 1000 ? offset_key - 1000 : offset_key);
  if (control == Dialect::Siemens && offset_key > 4)
    // $P_UIFR[5] and [6] are called G505 and G506.
    return fmt::format("G{}", offset_key > g500_base ? offset_key : g500_base + offset_key);
  if (offset_key == 0) return "the external offset";
  if (offset_key > g54_1_base) return fmt::format("G54.1 P{}", offset_key - g54_1_base);
  return offset_key > 6 ? fmt::format("G59.{}", offset_key - 6)
                        : fmt::format("G{}", 53 + offset_key);
}

// A table of another control is only reported, since its offsets may still be intended.
std::vector<std::string> table_warnings(const ControlTable& table, std::string_view read_as,
                                        const std::set<int>& called_offsets) {
  std::vector<std::string> warnings = table.notes;
  const std::string_view control = name_of(table.control);
  if (read_as.empty()) {
    warnings.push_back(fmt::format(
        "{} has no effect: a position-velocity-time table has no tools and offsets", table.file));
    return warnings;
  }
  if (!read_as.starts_with(control)) {
    warnings.push_back(fmt::format("{} is a {} table, but the program is read as {}", table.file,
                                   control, read_as));
    return warnings;
  }
  std::string missing_offsets;
  // A file without offsets is a tool table, which is no reason for a warning.
  for (const int offset_key : called_offsets)
    if (!table.offsets.empty() && !table.offsets.contains(offset_key))
      missing_offsets +=
          (missing_offsets.empty() ? "" : ", ") + offset_name(table.control, offset_key);
  if (!missing_offsets.empty())
    warnings.push_back(fmt::format(
        "{} does not define {}, which the program calls: it is zero unless the program sets it",
        table.file, missing_offsets));
  return warnings;
}

ControlTable read_control_table(std::string_view text, const std::string& file,
                                ControlTableKind kind, std::optional<double> unit) {
  const bool is_tool_table = kind == ControlTableKind::Tools;
  if (text.size() > max_table_bytes)
    throw BadProgram({BadInput(file, 0, 0, fmt::format("at most {} bytes", max_table_bytes),
                               fmt::format("{}", text.size()))});
  const auto control = detect_control(text, kind);
  if (!control)
    throw BadProgram({BadInput(
        file, 1, 1,
        is_tool_table ? "a tool table of LinuxCNC (T1 Z D), Fanuc (G10), Siemens ($TC_DP) or "
                        "Heidenhain (BEGIN)"
                      : "work offsets of LinuxCNC (5221), Fanuc (G10), Siemens ($P_UIFR) or "
                        "Heidenhain (BEGIN)",
        "no line that identifies a format")});
  ControlTableParser parser{text, kind, unit};
  parser.table.file = file;
  read_format(*control, parser);
  // Offsets that could not be read must not count as zero.
  for (const int offset_key : parser.unreadable_offsets) parser.table.offsets.erase(offset_key);
  const bool is_empty = is_tool_table ? parser.table.tools.empty() : parser.table.offsets.empty();
  if (is_empty && parser.input_errors.empty())
    parser.input_errors.add(
        BadInput(file, 1, 1, is_tool_table ? "a tool" : "a work offset", "none"));
  if (!parser.input_errors.empty()) throw BadProgram(parser.input_errors.list());
  if (!parser.unused.empty()) parser.table.notes.push_back(unused_values_note(parser));
  return std::move(parser.table);
}

ControlTable read_control_table_file(const std::filesystem::path& file, ControlTableKind kind,
                                     std::optional<double> unit) {
  return read_control_table(read_text(file, max_table_bytes), file.string(), kind, unit);
}

}  // namespace abbe::sim::dialects
