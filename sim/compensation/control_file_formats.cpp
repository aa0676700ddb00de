#include "sim/compensation/control_file_formats.h"

#include <algorithm>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"

namespace abbe::sim::compensation::control {

namespace {

using kinematics::Chain;

constexpr int max_lines = 256;
constexpr int trim_decimals = 8;
constexpr std::size_t max_line_bytes = 254;  // LinuxCNC reads no more of a line
constexpr std::string_view joint_letters = "XYZABCUVW";

/// Returns the joints in the order in which trivkins numbers them.
std::vector<int> numbered_joints(const Chain& chain) {
  std::vector<int> joints;
  for (const char letter : joint_letters)
    if (const auto joint = movable(letter, chain)) joints.push_back(*joint);
  return joints;
}

std::string linuxcnc_rows(const AxisTable& table, const Chain& chain) {
  const double unit = unit_of(chain, table.argument_joint);
  std::string text;
  for (Eigen::Index k = 0; k < table.position.size(); ++k)
    text += fmt::format("{} {} {}\n", decimal(table.position[k] / unit, trim_decimals),
                        decimal(table.upward[k] / unit, trim_decimals),
                        decimal(table.downward[k] / unit, trim_decimals));
  return text;
}

/// The section of a joint in an INI file.
struct JointEntry {
  int joint = 0;
  int section_line = 0;
  std::string file;  // empty if there is no COMP_FILE
  int file_line = 0;
  int file_column = 0;
  std::optional<int> type;
};

struct Setting {
  std::string key;
  Cell value;
};

/// Parses a line "KEY = VALUE" of an INI file.
std::optional<Setting> parse_setting(std::string_view line) {
  const std::size_t equals = line.find('=');
  if (equals == std::string_view::npos) return std::nullopt;
  const std::vector<Cell> key = split_cells(line.substr(0, equals), '=', 1);
  std::vector<Cell> value = split_cells(line.substr(equals + 1), '\n', 1);
  if (key.empty() || value.empty()) return std::nullopt;
  value[0].column += int(equals) + 1;
  return Setting{std::string(key[0].text), value[0]};
}

/// Reads the COMP_FILE lines of an INI file and skips other sections and keys.
class IniReader {
 public:
  IniReader(const ControlFile& file, const Chain& chain)
      : lines_(file.text, file.name), joints_(numbered_joints(chain)) {}

  std::vector<JointEntry> read() {
    while (const auto line = lines_.next()) {
      const std::size_t start = line->text.find_first_not_of(" \t");
      const char first_character = line->text[start];
      if (first_character == ';') continue;
      if (first_character == '[')
        read_section(line->text.substr(start), int(start) + 1);
      else if (in_joint_)
        read_setting(line->text);
    }
    return std::move(entries_);
  }

 private:
  /// Begins the entry of a [JOINT_n] section; the keys of any other section are skipped.
  void read_section(std::string_view text, int column) {
    constexpr std::string_view header = "[JOINT_";
    in_joint_ = text.starts_with(header);
    if (!in_joint_) return;
    const std::size_t end = text.find(']');
    if (end == std::string_view::npos)
      lines_.refuse(column, "a section such as [JOINT_0]", quoted_excerpt(text));
    const Cell number{text.substr(header.size(), end - header.size()), column + int(header.size())};
    const int index = lines_.read_whole_number(number, 0, 15);
    if (index >= int(joints_.size()))
      lines_.refuse(number, fmt::format("a joint from 0 to {}", int(joints_.size()) - 1));
    const int joint = joints_[std::size_t(index)];
    for (const JointEntry& other : entries_)
      if (other.joint == joint) lines_.refuse(number, "each joint only once");
    entries_.push_back({joint, lines_.number(), "", 0, 0, std::nullopt});
  }

  /// Reads COMP_FILE and COMP_FILE_TYPE; skips other keys.
  void read_setting(std::string_view text) {
    const auto setting = parse_setting(text);
    if (!setting) return;
    JointEntry& entry = entries_.back();
    if (setting->key == "COMP_FILE") {
      if (!entry.file.empty()) lines_.refuse(setting->value, "one COMP_FILE per joint");
      if (setting->value.text.empty()) lines_.refuse(setting->value, "a file name");
      entry.file = std::string(setting->value.text);
      entry.file_line = lines_.number();
      entry.file_column = setting->value.column;
    }
    if (setting->key == "COMP_FILE_TYPE") {
      if (entry.type) lines_.refuse(setting->value, "one COMP_FILE_TYPE per joint");
      entry.type = lines_.read_whole_number(setting->value, 0, 1);
    }
  }

  TableLineReader lines_;
  std::vector<int> joints_;
  std::vector<JointEntry> entries_;
  bool in_joint_ = false;
};

/// Rounds a trim to single precision, in which the motion controller stores it.
double to_single_precision(double trim) { return double(float(trim)); }

/// Reads a COMP_FILE. Type 0 states positions, type 1 states trims.
AxisTable read_comp(const ControlFile& file, int joint, int type, const Chain& chain) {
  TableLineReader lines(file.text, file.name, std::nullopt);
  std::vector<double> numbers;
  int last_line = 0;
  // LinuxCNC silently stops reading at the first line that it does not understand. Here such a line
  // is an error.
  while (const auto line = lines.next()) {
    if (line->number != last_line + 1)
      lines.refuse(1, "no empty line before this line, because LinuxCNC stops reading there",
                   "an empty line");
    last_line = line->number;
    if (line->text.size() > max_line_bytes)
      lines.refuse(int(max_line_bytes) + 1,
                   fmt::format("at most {} bytes per line", max_line_bytes), "more");
    if (numbers.size() == 3 * std::size_t(max_lines))
      lines.refuse(1, fmt::format("at most {} lines", max_lines), "more");
    const std::vector<Cell> cells = split_cells(line->text, ' ', 3);
    for (std::size_t i = 0; i < std::min<std::size_t>(cells.size(), 3); ++i)
      numbers.push_back(lines.number_in(cells[i]));
    if (cells.size() < 3)
      lines.refuse(int(line->text.size()) + 1, "nominal forward reverse",
                   fmt::format("{} numbers", cells.size()));
    if (cells.size() > 3) lines.refuse(cells[3], "nothing after nominal forward reverse");
    if (numbers.size() > 3 && !(numbers[numbers.size() - 3] > numbers[numbers.size() - 6]))
      lines.refuse(cells[0], "positions that increase from line to line");
  }
  if (numbers.empty()) lines.refuse(0, "lines of nominal forward reverse", "none");
  // A single line states a constant. A second point makes it a table.
  if (numbers.size() == 3) {
    const double slope = type == 0 ? 1.0 : 0.0;
    numbers.insert(numbers.end(), {numbers[0] + 1.0, numbers[1] + slope, numbers[2] + slope});
  }
  const auto n = Eigen::Index(numbers.size() / 3);
  const double unit = unit_of(chain, joint);
  AxisTable table{joint, joint, Eigen::VectorXd(n), Eigen::VectorXd(n), Eigen::VectorXd(n)};
  for (Eigen::Index k = 0; k < n; ++k) {
    const double* row = numbers.data() + 3 * k;
    table.position[k] = row[0] * unit;
    // Files of type 0 hold positions, files of type 1 trims.
    table.upward[k] = to_single_precision(type == 0 ? row[0] - row[1] : row[1]) * unit;
    table.downward[k] = to_single_precision(type == 0 ? row[0] - row[2] : row[2]) * unit;
  }
  return table;
}

bool is_ini(const ControlFile& file) { return base_name(file.name).ends_with(".INI"); }

/// Returns the joint whose letter is the name of a file, such as X.comp.
int joint_of_file_name(const ControlFile& file, const Chain& chain) {
  const std::string base = base_name(file.name);
  const std::string stem = base.substr(0, base.find('.'));
  if (stem.size() == 1 && joint_letters.find(stem[0]) != std::string_view::npos)
    if (const auto joint = movable(stem[0], chain)) return *joint;
  throw BadInput(file.name, 0, 0,
                 fmt::format("an INI file that names it, or an axis letter ({}) as its name",
                             movable_letters(chain)),
                 quoted_excerpt(file.name));
}

/// Reads the tables that an INI file assigns to joints. Every other file must be named in it.
void read_ini(const ControlFile& ini, std::span<const ControlFile> files, const Chain& chain,
              ParameterTables& tables) {
  std::vector<const ControlFile*> loaded_files{&ini};
  for (const JointEntry& entry : IniReader(ini, chain).read()) {
    // Without COMP_FILE the control loads no table for the joint.
    if (entry.file.empty()) continue;
    if (!entry.type)
      throw BadInput(ini.name, entry.section_line, 1, "a COMP_FILE_TYPE with COMP_FILE", "none");
    const auto file = std::find_if(files.begin(), files.end(), [&entry](const ControlFile& f) {
      return base_name(f.name) == base_name(entry.file);
    });
    if (file == files.end())
      throw BadInput(ini.name, entry.file_line, entry.file_column, "an existing file",
                     quoted_excerpt(entry.file));
    loaded_files.push_back(&*file);
    tables.tables.push_back(read_comp(*file, entry.joint, *entry.type, chain));
  }
  for (const ControlFile& file : files)
    if (std::find(loaded_files.begin(), loaded_files.end(), &file) == loaded_files.end())
      throw BadInput(file.name, 0, 0, "a COMP_FILE line in " + ini.name + " that names it", "none");
}

}  // namespace

ControlExport to_linuxcnc(const ParameterTables& tables, const Chain& chain) {
  ControlExport result;
  result.omissions = offsets_left_out(tables, chain);
  const std::vector<int> joints = numbered_joints(chain);
  std::string ini;
  for (const AxisTable& table : summed(tables.tables)) {
    const auto joint = std::find(joints.begin(), joints.end(), table.argument_joint);
    if (table.argument_joint != table.corrected_joint || joint == joints.end()) {
      result.omissions.push_back(relation(table, chain) +
                                 (joint == joints.end()
                                      ? ": not a LinuxCNC axis"
                                      : ": a COMP_FILE can only correct its own axis"));
      continue;
    }
    const FittedTable fitted = fit_table(table, chain, {max_lines, 1e-6});
    if (fitted.omissions) result.omissions.push_back(*fitted.omissions);
    const std::string name =
        std::string(1, chain.joints()[std::size_t(table.argument_joint)].name) + ".comp";
    result.files.push_back({name, linuxcnc_rows(fitted.table, chain)});
    ini += fmt::format("{}[JOINT_{}]\nCOMP_FILE = {}\nCOMP_FILE_TYPE = 1\n",
                       ini.empty() ? "" : "\n", joint - joints.begin(), name);
  }
  if (result.files.empty()) return result;
  result.files.push_back({"compensation.ini", ini});
  // The user must copy these lines to the INI file of the machine.
  result.notes.push_back(
      "copy the lines of compensation.ini to the INI file of the machine, with joints numbered as "
      "in trivkins; BACKLASH of these joints is then ignored");
  return result;
}

ParameterTables read_linuxcnc_tables(std::span<const ControlFile> files, const Chain& chain) {
  ParameterTables tables;
  tables.offset = kinematics::AxisVector::Zero(chain.size());
  if (const auto ini = std::find_if(files.begin(), files.end(), is_ini); ini != files.end()) {
    read_ini(*ini, files, chain, tables);
    return tables;
  }
  // Without an INI file the names of the files are the letters of the joints.
  for (const ControlFile& file : files) {
    const int joint = joint_of_file_name(file, chain);
    for (const AxisTable& other : tables.tables)
      if (other.argument_joint == joint)
        throw BadInput(file.name, 0, 0, "one file per joint",
                       "a second file for " + file.name.substr(0, 1));
    tables.tables.push_back(read_comp(file, joint, 1, chain));
  }
  return tables;
}

namespace {

constexpr Capacity capacity{256, 1e-3};  // 1e-3 mm or degrees is ten steps of the last decimal
constexpr int text_decimals = 4;
constexpr int column_width = 14;  // characters of a written column
constexpr std::size_t max_columns = 16;
constexpr double error_sign = -1.0;  // columns hold errors, which the control subtracts

/// A table of the control: named columns of text cells.
struct TextGrid {
  std::vector<std::string> names;
  std::vector<std::vector<std::string>> rows;
};

std::string grid_text(const std::string& name, const TextGrid& grid) {
  const auto line = [](const std::vector<std::string>& cells) {
    std::string text;
    for (const std::string& cell : cells) text += fmt::format("{:<{}}", cell, column_width);
    text.erase(text.find_last_not_of(' ') + 1);
    return text + "\n";
  };
  std::string text = "BEGIN " + name + " MM\n" + line(grid.names);
  for (const auto& row : grid.rows) text += line(row);
  return text + "[END]\n";
}

/// Returns all tables over one axis, resampled at common positions within the capacity of a .COM.
/// Appends notes on the differences to `result`.
std::vector<AxisTable> tables_over(const std::vector<AxisTable>& sums, int argument_joint,
                                   const Chain& chain, ControlExport& result) {
  std::vector<AxisTable> selected;
  for (const AxisTable& table : sums)
    if (table.argument_joint == argument_joint) selected.push_back(table);
  // The sum of tables of one pair of axes has the positions of all of them, so all are given one
  // pair.
  std::vector<AxisTable> pair_tables = selected;
  for (AxisTable& table : pair_tables) table.corrected_joint = argument_joint;
  if (selected.empty()) return selected;
  const Eigen::VectorXd positions = summed(pair_tables).front().position;
  for (AxisTable& table : selected) {
    const FittedTable fitted = fit_table(at_positions(table, positions), chain, capacity);
    if (fitted.omissions) result.omissions.push_back(*fitted.omissions);
    table = fitted.table;
  }
  return selected;
}

/// Returns the cells of a .COM with tables over one axis.
TextGrid com_grid(const std::vector<AxisTable>& tables, const Chain& chain) {
  const int argument_joint = tables.front().argument_joint;
  TextGrid grid{{"NR", "AXISPOS"}, {}};
  const auto own_table = std::find_if(
      tables.begin(), tables.end(),
      [argument_joint](const AxisTable& table) { return table.corrected_joint == argument_joint; });
  const bool has_backlash = own_table != tables.end() && !is_direction_independent(*own_table);
  for (const AxisTable& table : tables)
    grid.names.emplace_back(1, axis_letter(chain, table.corrected_joint));
  if (has_backlash) grid.names.push_back("BACKLASH");
  for (Eigen::Index k = 0; k < tables.front().position.size(); ++k) {
    std::vector<std::string> row{
        fmt::format("{}", k),
        decimal(tables.front().position[k] / unit_of(chain, argument_joint), text_decimals)};
    for (const AxisTable& table : tables) {
      // Only the table of the axis over itself has a column for the other direction.
      const double value = table.corrected_joint == argument_joint
                               ? table.upward[k]
                               : 0.5 * (table.upward[k] + table.downward[k]);
      row.push_back(
          decimal(error_sign * value / unit_of(chain, table.corrected_joint), text_decimals));
    }
    if (has_backlash)
      row.push_back(decimal(error_sign * own_table->downward[k] / unit_of(chain, argument_joint),
                            text_decimals));
    grid.rows.push_back(std::move(row));
  }
  return grid;
}

/// Reads the lines of a table of the control. Each column begins at the position of its name.
class GridReader {
 public:
  explicit GridReader(const ControlFile& file) : lines_(file.text, file.name, std::nullopt) {
    const Line first_line = line("BEGIN name MM");
    const std::vector<Cell> first_cells = split_cells(first_line.text, ' ', 3);
    if (first_cells.size() != 3 || first_cells[0].text != "BEGIN")
      lines_.refuse(1, "BEGIN name MM", quoted_excerpt(first_line.text));
    if (first_cells[2].text != "MM") lines_.refuse(first_cells[2], "MM");
    headers_ = split_cells(line("a header such as NR AXISPOS X").text, ' ', max_columns);
    if (headers_.size() > max_columns)
      lines_.refuse(headers_.back(), fmt::format("at most {} columns", max_columns));
    if (headers_.front().text != "NR") lines_.refuse(headers_.front(), "NR as the first column");
    for (std::size_t i = 0; i < headers_.size(); ++i)
      for (std::size_t k = 0; k < i; ++k)
        if (headers_[i].text == headers_[k].text)
          lines_.refuse(headers_[i], "each column only once");
  }

  const std::vector<Cell>& headers() const { return headers_; }
  const TableLineReader& lines() const { return lines_; }

  /// Returns the cells of the next row, one for each column; nothing after the last row.
  std::optional<std::vector<Cell>> next() {
    const Line row = line("a row or [END]");
    if (row.text.find_first_not_of(' ') == row.text.find("[END]")) {
      if (lines_.next()) lines_.refuse(1, "nothing after [END]", "more");
      return std::nullopt;
    }
    std::vector<Cell> cells;
    for (std::size_t i = 0; i < headers_.size(); ++i) {
      const std::size_t start = i == 0 ? 0 : std::size_t(headers_[i].column) - 1;
      const std::size_t end =
          i + 1 < headers_.size() ? std::size_t(headers_[i + 1].column) - 1 : row.text.size();
      Cell cell{"", int(start) + 1};
      if (start < row.text.size() && start < end) {
        const std::vector<Cell> content = split_cells(row.text.substr(start, end - start), '\n', 1);
        if (!content.empty()) cell = {content[0].text, int(start) + content[0].column};
      }
      cells.push_back(cell);
    }
    // Rows are numbered, so a missing one can be detected.
    if (lines_.read_whole_number(cells[0], 0, 9999) != rows_)
      lines_.refuse(cells[0], fmt::format("{}", rows_));
    ++rows_;
    return cells;
  }

 private:
  Line line(const std::string& expected) {
    const auto next = lines_.next();
    if (!next) lines_.refuse(0, expected, "the end");
    return *next;
  }

  TableLineReader lines_;
  std::vector<Cell> headers_;
  int rows_ = 0;
};

/// The columns of a .COM by meaning.
struct ComColumns {
  std::size_t position = 0;
  std::optional<std::size_t> backlash;
  std::vector<std::pair<std::size_t, int>> corrected_joint;  // column, joint
};

/// Finds the columns of a .COM by their names. `argument_joint` is the axis of AXISPOS.
ComColumns com_columns(const GridReader& reader, int argument_joint, const Chain& chain) {
  ComColumns columns;
  bool has_own = false;
  for (std::size_t i = 1; i < reader.headers().size(); ++i) {
    const Cell& header = reader.headers()[i];
    const auto joint = header.text.size() == 1 ? movable(header.text[0], chain) : std::nullopt;
    if (header.text == "AXISPOS")
      columns.position = i;
    else if (header.text == "BACKLASH")
      columns.backlash = i;
    else if (joint)
      columns.corrected_joint.emplace_back(i, *joint);
    else
      reader.lines().refuse(
          header, fmt::format("AXISPOS, BACKLASH or an axis ({})", movable_letters(chain)));
    has_own = has_own || joint == argument_joint;
  }
  if (columns.position == 0) reader.lines().refuse(1, "a column AXISPOS", "none");
  if (columns.corrected_joint.empty()) reader.lines().refuse(1, "a column for an axis", "none");
  if (columns.backlash && !has_own)
    reader.lines().refuse(
        reader.headers()[*columns.backlash],
        fmt::format("BACKLASH with a column {}", axis_letter(chain, argument_joint)));
  return columns;
}

/// Reads the tables of a .COM, one for each corrected axis.
std::vector<AxisTable> read_com(const ControlFile& file, int argument_joint, const Chain& chain) {
  GridReader reader(file);
  const ComColumns columns = com_columns(reader, argument_joint, chain);
  std::vector<std::vector<double>> rows;
  while (const auto cells = reader.next()) {
    if (int(rows.size()) == capacity.max_points)
      reader.lines().refuse(1, fmt::format("at most {} rows", capacity.max_points), "more");
    std::vector<double> row;
    for (std::size_t i = 1; i < cells->size(); ++i)
      row.push_back(reader.lines().number_in((*cells)[i]));
    if (!rows.empty() && !(row[columns.position - 1] > rows.back()[columns.position - 1]))
      reader.lines().refuse((*cells)[columns.position], "positions that increase from row to row");
    rows.push_back(std::move(row));
  }
  if (rows.size() < 2) reader.lines().refuse(0, "at least 2 rows", fmt::format("{}", rows.size()));
  const auto column = [&rows](std::size_t i, double factor) {
    Eigen::VectorXd result(Eigen::Index(rows.size()));
    for (std::size_t k = 0; k < rows.size(); ++k) result[Eigen::Index(k)] = rows[k][i - 1] * factor;
    return result;
  };
  std::vector<AxisTable> tables;
  for (const auto& [i, corrected_joint] : columns.corrected_joint) {
    const double factor = error_sign * unit_of(chain, corrected_joint);
    AxisTable table{argument_joint,
                    corrected_joint,
                    column(columns.position, unit_of(chain, argument_joint)),
                    column(i, factor),
                    {}};
    table.downward = corrected_joint == argument_joint && columns.backlash
                         ? column(*columns.backlash, factor)
                         : table.upward;
    tables.push_back(std::move(table));
  }
  return tables;
}

/// A file that a .CMA assigns to an axis, and the location of its name.
struct AssignedFile {
  int argument_joint = 0;
  std::string file;
  int line = 0;
  int column = 0;
};

/// Returns the assignments in the active line of a .CMA.
std::vector<AssignedFile> read_assignments(const ControlFile& file, const Chain& chain) {
  GridReader reader(file);
  std::optional<std::size_t> active_column;
  for (std::size_t i = 1; i < reader.headers().size(); ++i) {
    const Cell& header = reader.headers()[i];
    if (header.text == "ACTIVE")
      active_column = i;
    else if (header.text.size() != 1 || !movable(header.text[0], chain))
      reader.lines().refuse(header, fmt::format("ACTIVE or an axis ({})", movable_letters(chain)));
  }
  if (!active_column) reader.lines().refuse(1, "a column ACTIVE", "none");
  std::optional<std::vector<AssignedFile>> active_row;
  while (const auto cells = reader.next()) {
    const Cell& active_cell = (*cells)[*active_column];
    if (active_cell.text.empty()) continue;
    if (active_cell.text != "*") reader.lines().refuse(active_cell, "* or nothing");
    if (active_row) reader.lines().refuse(active_cell, "only one active line");
    active_row.emplace();
    for (std::size_t i = 1; i < cells->size(); ++i)
      if (i != *active_column && !(*cells)[i].text.empty())
        active_row->push_back({*movable(reader.headers()[i].text[0], chain),
                               std::string((*cells)[i].text), reader.lines().number(),
                               (*cells)[i].column});
  }
  if (!active_row) reader.lines().refuse(0, "a line with * under ACTIVE", "none");
  return *active_row;
}

bool is_cma(const ControlFile& file) { return base_name(file.name).ends_with(".CMA"); }

/// Returns the joint whose letter is the name of a .COM.
int axis_of_file_name(const ControlFile& file, const Chain& chain) {
  const std::string base = base_name(file.name);
  if (base.size() == 5 && base.ends_with(".COM"))
    if (const auto joint = movable(base[0], chain)) return *joint;
  throw BadInput(file.name, 0, 0,
                 fmt::format("a .CMA file that names it, or an axis letter ({}) as its name",
                             movable_letters(chain)),
                 quoted_excerpt(file.name));
}

}  // namespace

ControlExport to_heidenhain(const ParameterTables& tables, const Chain& chain) {
  ControlExport result;
  result.omissions = offsets_left_out(tables, chain);
  const std::vector<AxisTable> sums = summed(tables.tables);
  TextGrid cma{{"NR"}, {{"0"}}};
  for (int argument_joint = 0; argument_joint < chain.size(); ++argument_joint) {
    const std::vector<AxisTable> axis_tables = tables_over(sums, argument_joint, chain, result);
    if (axis_tables.empty()) continue;
    for (const AxisTable& table : axis_tables)
      if (table.corrected_joint != argument_joint && !is_direction_independent(table))
        result.omissions.push_back(relation(table, chain) +
                                   ": dependence on direction is omitted; the mean is written");
    const std::string name = std::string(1, axis_letter(chain, argument_joint)) + ".COM";
    result.files.push_back({name, grid_text(name, com_grid(axis_tables, chain))});
    cma.names.emplace_back(1, axis_letter(chain, argument_joint));
    cma.rows[0].push_back(name);
  }
  if (result.files.empty()) return result;
  cma.names.push_back("ACTIVE");
  cma.rows[0].push_back("*");
  result.files.push_back({"CONFIG.CMA", grid_text("CONFIG.CMA", cma)});
  result.notes.push_back(
      "Heidenhain-style: columns as named in the technical manuals; the frame of the file and its "
      "4 decimals are assumed, so compare with a table of the control");
  result.notes.push_back(
      "positions count from the machine datum; older controls read a rotary axis from 0 "
      "to 360 degrees only");
  return result;
}

ParameterTables read_heidenhain_tables(std::span<const ControlFile> files, const Chain& chain) {
  ParameterTables tables;
  tables.offset = kinematics::AxisVector::Zero(chain.size());
  const auto add = [&](const ControlFile& file, int argument_joint) {
    for (AxisTable& table : read_com(file, argument_joint, chain))
      tables.tables.push_back(std::move(table));
  };
  const auto cma = std::find_if(files.begin(), files.end(), is_cma);
  if (cma == files.end()) {
    for (const ControlFile& file : files) add(file, axis_of_file_name(file, chain));
    return tables;
  }
  for (const AssignedFile& assignment : read_assignments(*cma, chain)) {
    const auto file = std::find_if(files.begin(), files.end(), [&](const ControlFile& f) {
      return base_name(f.name) == base_name(assignment.file) && !is_cma(f);
    });
    if (file == files.end())
      throw BadInput(cma->name, assignment.line, assignment.column, "an existing file",
                     quoted_excerpt(assignment.file));
    add(*file, assignment.argument_joint);
  }
  return tables;
}

}  // namespace abbe::sim::compensation::control
