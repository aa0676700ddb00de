#include "sim/compensation/control_file_formats.h"

#include <algorithm>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"

namespace abbe::sim::compensation::control {

namespace {

using kinematics::Chain;

constexpr int most_lines = 256;
constexpr int line_decimals = 8;
constexpr std::size_t max_line = 254;  // bytes that LinuxCNC reads of a line
constexpr std::string_view letters = "XYZABCUVW";

/// Returns the joints as trivkins numbers them.
std::vector<int> numbered_joints(const Chain& chain) {
  std::vector<int> joints;
  for (const char letter : letters)
    if (const auto joint = movable(letter, chain)) joints.push_back(*joint);
  return joints;
}

std::string rows(const AxisTable& table, const Chain& chain) {
  const double unit = unit_of(chain, table.of);
  std::string text;
  for (Eigen::Index k = 0; k < table.position.size(); ++k)
    text += fmt::format("{} {} {}\n", decimal(table.position[k] / unit, line_decimals),
                        decimal(table.upward[k] / unit, line_decimals),
                        decimal(table.downward[k] / unit, line_decimals));
  return text;
}

/// The entry of a joint in an INI file.
struct JointEntry {
  int joint = 0;
  int section_line = 0;
  std::string file;  // empty: none
  int file_line = 0;
  int file_column = 0;
  std::optional<int> type;
};

struct Setting {
  std::string key;
  Cell value;
};

std::optional<Setting> setting_of(std::string_view line) {
  const std::size_t equals = line.find('=');
  if (equals == std::string_view::npos) return std::nullopt;
  const std::vector<Cell> key = cells_of(line.substr(0, equals), '=', 1);
  std::vector<Cell> value = cells_of(line.substr(equals + 1), '\n', 1);
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
      const char first = line->text[start];
      if (first == ';') continue;
      if (first == '[')
        read_section(line->text.substr(start), int(start) + 1);
      else if (in_joint_)
        read_setting(line->text);
    }
    return std::move(entries_);
  }

 private:
  void read_section(std::string_view text, int column) {
    constexpr std::string_view head = "[JOINT_";
    in_joint_ = text.starts_with(head);
    if (!in_joint_) return;
    const std::size_t end = text.find(']');
    if (end == std::string_view::npos)
      lines_.refuse(column, "a section such as [JOINT_0]", in_quotes(text));
    const Cell number{text.substr(head.size(), end - head.size()), column + int(head.size())};
    const int index = lines_.whole_number_in(number, 0, 15);
    if (index >= int(joints_.size()))
      lines_.refuse(number, fmt::format("a joint from 0 to {}", int(joints_.size()) - 1));
    const int joint = joints_[std::size_t(index)];
    for (const JointEntry& other : entries_)
      if (other.joint == joint) lines_.refuse(number, "every joint once");
    entries_.push_back({joint, lines_.number(), "", 0, 0, std::nullopt});
  }

  void read_setting(std::string_view text) {
    const auto setting = setting_of(text);
    if (!setting) return;
    JointEntry& entry = entries_.back();
    if (setting->key == "COMP_FILE") {
      if (!entry.file.empty()) lines_.refuse(setting->value, "one COMP_FILE a joint");
      if (setting->value.text.empty()) lines_.refuse(setting->value, "the name of a file");
      entry.file = std::string(setting->value.text);
      entry.file_line = lines_.number();
      entry.file_column = setting->value.column;
    }
    if (setting->key == "COMP_FILE_TYPE") {
      if (entry.type) lines_.refuse(setting->value, "one COMP_FILE_TYPE a joint");
      entry.type = lines_.whole_number_in(setting->value, 0, 1);
    }
  }

  TableLines lines_;
  std::vector<int> joints_;
  std::vector<JointEntry> entries_;
  bool in_joint_ = false;
};

/// Returns a trim as the motion controller holds it, in single precision.
double held(double trim) { return double(float(trim)); }

AxisTable read_comp(const ControlFile& file, int joint, int type, const Chain& chain) {
  TableLines lines(file.text, file.name, std::nullopt);
  std::vector<double> numbers;
  int last_line = 0;
  // LinuxCNC stops reading silently at the first line it does not understand; here that is an
  // error.
  while (const auto line = lines.next()) {
    if (line->number != last_line + 1)
      lines.refuse(1, "no empty line before this one, where LinuxCNC stops reading", "one");
    last_line = line->number;
    if (line->text.size() > max_line)
      lines.refuse(int(max_line) + 1, fmt::format("at most {} bytes a line", max_line), "more");
    if (numbers.size() == 3 * std::size_t(most_lines))
      lines.refuse(1, fmt::format("at most {} lines", most_lines), "more");
    const std::vector<Cell> cells = cells_of(line->text, ' ', 3);
    for (std::size_t i = 0; i < std::min<std::size_t>(cells.size(), 3); ++i)
      numbers.push_back(lines.number_in(cells[i]));
    if (cells.size() < 3)
      lines.refuse(int(line->text.size()) + 1, "nominal forward reverse",
                   fmt::format("{} of them", cells.size()));
    if (cells.size() > 3) lines.refuse(cells[3], "nothing after nominal forward reverse");
    if (numbers.size() > 3 && !(numbers[numbers.size() - 3] > numbers[numbers.size() - 6]))
      lines.refuse(cells[0], "positions that increase from line to line");
  }
  if (numbers.empty()) lines.refuse(0, "lines of nominal forward reverse", "none");
  // A single line is a constant; a table needs a second point.
  if (numbers.size() == 3) {
    const double shift = type == 0 ? 1.0 : 0.0;
    numbers.insert(numbers.end(), {numbers[0] + 1.0, numbers[1] + shift, numbers[2] + shift});
  }
  const auto n = Eigen::Index(numbers.size() / 3);
  const double unit = unit_of(chain, joint);
  AxisTable table{joint, joint, Eigen::VectorXd(n), Eigen::VectorXd(n), Eigen::VectorXd(n)};
  for (Eigen::Index k = 0; k < n; ++k) {
    const double* row = numbers.data() + 3 * k;
    table.position[k] = row[0] * unit;
    // Type 0 states positions, type 1 trims.
    table.upward[k] = held(type == 0 ? row[0] - row[1] : row[1]) * unit;
    table.downward[k] = held(type == 0 ? row[0] - row[2] : row[2]) * unit;
  }
  return table;
}

bool is_ini(const ControlFile& file) { return base_name(file.name).ends_with(".INI"); }

int joint_of_name(const ControlFile& file, const Chain& chain) {
  const std::string base = base_name(file.name);
  const std::string stem = base.substr(0, base.find('.'));
  if (stem.size() == 1 && letters.find(stem[0]) != std::string_view::npos)
    if (const auto joint = movable(stem[0], chain)) return *joint;
  throw BadInput(file.name, 0, 0,
                 fmt::format("an INI file that names it, or the letter of an axis ({}) as its name",
                             movable_letters(chain)),
                 in_quotes(file.name));
}

void read_ini(const ControlFile& ini, std::span<const ControlFile> files, const Chain& chain,
              ParameterTables& tables) {
  std::vector<const ControlFile*> loaded{&ini};
  for (const JointEntry& entry : IniReader(ini, chain).read()) {
    // without COMP_FILE the control loads no table for the joint
    if (entry.file.empty()) continue;
    if (!entry.type)
      throw BadInput(ini.name, entry.section_line, 1, "a COMP_FILE_TYPE beside COMP_FILE", "none");
    const auto file = std::find_if(files.begin(), files.end(), [&entry](const ControlFile& f) {
      return base_name(f.name) == base_name(entry.file);
    });
    if (file == files.end())
      throw BadInput(ini.name, entry.file_line, entry.file_column, "a file that is there",
                     in_quotes(entry.file));
    loaded.push_back(&*file);
    tables.tables.push_back(read_comp(*file, entry.joint, *entry.type, chain));
  }
  for (const ControlFile& file : files)
    if (std::find(loaded.begin(), loaded.end(), &file) == loaded.end())
      throw BadInput(file.name, 0, 0, "a COMP_FILE line in " + ini.name + " that names it", "none");
}

}  // namespace

Export to_linuxcnc(const ParameterTables& tables, const Chain& chain) {
  Export out;
  out.left_out = offsets_left_out(tables, chain);
  const std::vector<int> joints = numbered_joints(chain);
  std::string ini;
  for (const AxisTable& table : summed(tables.tables)) {
    const auto joint = std::find(joints.begin(), joints.end(), table.of);
    if (table.of != table.moves || joint == joints.end()) {
      out.left_out.push_back(relation(table, chain) +
                             (joint == joints.end() ? ": no axis of LinuxCNC"
                                                    : ": a COMP_FILE holds the own axis only"));
      continue;
    }
    const FittedTable held_table = fit_table(table, chain, {most_lines, 1e-6});
    if (held_table.left_out) out.left_out.push_back(*held_table.left_out);
    const std::string name = std::string(1, chain.joints()[std::size_t(table.of)].name) + ".comp";
    out.files.push_back({name, rows(held_table.table, chain)});
    ini += fmt::format("{}[JOINT_{}]\nCOMP_FILE = {}\nCOMP_FILE_TYPE = 1\n",
                       ini.empty() ? "" : "\n", joint - joints.begin(), name);
  }
  if (out.files.empty()) return out;
  out.files.push_back({"compensation.ini", ini});
  // the user must copy these lines to the INI file of the machine
  out.notes.push_back(
      "the lines of compensation.ini belong to the INI file of the machine, its "
      "joints as trivkins numbers them; BACKLASH of these joints is then not used");
  return out;
}

ParameterTables read_linuxcnc_tables(std::span<const ControlFile> files, const Chain& chain) {
  ParameterTables tables;
  tables.offset = kinematics::AxisVector::Zero(chain.size());
  if (const auto ini = std::find_if(files.begin(), files.end(), is_ini); ini != files.end()) {
    read_ini(*ini, files, chain, tables);
    return tables;
  }
  // without an INI file the names of the files tell the joints
  for (const ControlFile& file : files) {
    const int joint = joint_of_name(file, chain);
    for (const AxisTable& other : tables.tables)
      if (other.of == joint)
        throw BadInput(file.name, 0, 0, "one file a joint",
                       "the second of " + file.name.substr(0, 1));
    tables.tables.push_back(read_comp(file, joint, 1, chain));
  }
  return tables;
}

namespace {

// 256 rows; 1e-3 mm or degrees is ten steps of the fourth decimal
constexpr Capacity capacity{256, 1e-3};
constexpr int text_decimals = 4;
constexpr int width = 14;  // width of a written column
constexpr std::size_t max_columns = 16;
constexpr double error_sign = -1.0;  // columns hold errors, which the control subtracts

/// A table of the control: text cells under names.
struct TextTable {
  std::vector<std::string> names;
  std::vector<std::vector<std::string>> rows;
};

std::string text_of(const std::string& name, const TextTable& grid) {
  const auto line = [](const std::vector<std::string>& cells) {
    std::string text;
    for (const std::string& cell : cells) text += fmt::format("{:<{}}", cell, width);
    text.erase(text.find_last_not_of(' ') + 1);
    return text + "\n";
  };
  std::string text = "BEGIN " + name + " MM\n" + line(grid.names);
  for (const auto& row : grid.rows) text += line(row);
  return text + "[END]\n";
}

/// Returns all tables over one axis at the same positions, within the capacity of a .COM.
std::vector<AxisTable> together(const std::vector<AxisTable>& sums, int of, const Chain& chain,
                                Export& out) {
  std::vector<AxisTable> all;
  for (const AxisTable& table : sums)
    if (table.of == of) all.push_back(table);
  // Taken as tables of one pair of axes, their sum has the positions of all.
  std::vector<AxisTable> as_one = all;
  for (AxisTable& table : as_one) table.moves = of;
  if (all.empty()) return all;
  const Eigen::VectorXd positions = summed(as_one).front().position;
  for (AxisTable& table : all) {
    const FittedTable fitting = fit_table(at_positions(table, positions), chain, capacity);
    if (fitting.left_out) out.left_out.push_back(*fitting.left_out);
    table = fitting.table;
  }
  return all;
}

TextTable com_grid(const std::vector<AxisTable>& tables, const Chain& chain) {
  const int of = tables.front().of;
  TextTable grid{{"NR", "AXISPOS"}, {}};
  const auto own = std::find_if(tables.begin(), tables.end(),
                                [of](const AxisTable& table) { return table.moves == of; });
  const bool has_backlash = own != tables.end() && !is_direction_independent(*own);
  for (const AxisTable& table : tables) grid.names.emplace_back(1, axis_letter(chain, table.moves));
  if (has_backlash) grid.names.push_back("BACKLASH");
  for (Eigen::Index k = 0; k < tables.front().position.size(); ++k) {
    std::vector<std::string> row{
        fmt::format("{}", k),
        decimal(tables.front().position[k] / unit_of(chain, of), text_decimals)};
    for (const AxisTable& table : tables) {
      // only the own axis has a column for the other direction
      const double value =
          table.moves == of ? table.upward[k] : 0.5 * (table.upward[k] + table.downward[k]);
      row.push_back(decimal(error_sign * value / unit_of(chain, table.moves), text_decimals));
    }
    if (has_backlash)
      row.push_back(decimal(error_sign * own->downward[k] / unit_of(chain, of), text_decimals));
    grid.rows.push_back(std::move(row));
  }
  return grid;
}

/// Reads the lines of a table of the control; its columns begin where their names do.
class GridReader {
 public:
  explicit GridReader(const ControlFile& file) : lines_(file.text, file.name, std::nullopt) {
    const Line begin = line("BEGIN name MM");
    const std::vector<Cell> words = cells_of(begin.text, ' ', 3);
    if (words.size() != 3 || words[0].text != "BEGIN")
      lines_.refuse(1, "BEGIN name MM", in_quotes(begin.text));
    if (words[2].text != "MM") lines_.refuse(words[2], "MM");
    heads_ = cells_of(line("a head such as NR AXISPOS X").text, ' ', max_columns);
    if (heads_.size() > max_columns)
      lines_.refuse(heads_.back(), fmt::format("at most {} columns", max_columns));
    if (heads_.front().text != "NR") lines_.refuse(heads_.front(), "NR as the first column");
    for (std::size_t i = 0; i < heads_.size(); ++i)
      for (std::size_t k = 0; k < i; ++k)
        if (heads_[i].text == heads_[k].text) lines_.refuse(heads_[i], "every column once");
  }

  const std::vector<Cell>& heads() const { return heads_; }
  const TableLines& lines() const { return lines_; }

  /// Returns the cells of the next row, one for each head; none after the last row.
  std::optional<std::vector<Cell>> next() {
    const Line row = line("a row or [END]");
    if (row.text.find_first_not_of(' ') == row.text.find("[END]")) {
      if (lines_.next()) lines_.refuse(1, "nothing after [END]", "more");
      return std::nullopt;
    }
    std::vector<Cell> cells;
    for (std::size_t i = 0; i < heads_.size(); ++i) {
      const std::size_t start = i == 0 ? 0 : std::size_t(heads_[i].column) - 1;
      const std::size_t end =
          i + 1 < heads_.size() ? std::size_t(heads_[i + 1].column) - 1 : row.text.size();
      Cell cell{"", int(start) + 1};
      if (start < row.text.size() && start < end) {
        const std::vector<Cell> found = cells_of(row.text.substr(start, end - start), '\n', 1);
        if (!found.empty()) cell = {found[0].text, int(start) + found[0].column};
      }
      cells.push_back(cell);
    }
    // the rows are numbered, so a missing one is found
    if (lines_.whole_number_in(cells[0], 0, 9999) != rows_)
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

  TableLines lines_;
  std::vector<Cell> heads_;
  int rows_ = 0;
};

/// The meaning of the columns of a .COM.
struct ComColumns {
  std::size_t position = 0;
  std::optional<std::size_t> backlash;
  std::vector<std::pair<std::size_t, int>> moves;  // column, joint
};

ComColumns com_columns(const GridReader& reader, int of, const Chain& chain) {
  ComColumns columns;
  bool has_own = false;
  for (std::size_t i = 1; i < reader.heads().size(); ++i) {
    const Cell& head = reader.heads()[i];
    const auto joint = head.text.size() == 1 ? movable(head.text[0], chain) : std::nullopt;
    if (head.text == "AXISPOS")
      columns.position = i;
    else if (head.text == "BACKLASH")
      columns.backlash = i;
    else if (joint)
      columns.moves.emplace_back(i, *joint);
    else
      reader.lines().refuse(
          head, fmt::format("AXISPOS, BACKLASH or an axis ({})", movable_letters(chain)));
    has_own = has_own || joint == of;
  }
  if (columns.position == 0) reader.lines().refuse(1, "a column AXISPOS", "none");
  if (columns.moves.empty()) reader.lines().refuse(1, "a column of an axis", "none");
  if (columns.backlash && !has_own)
    reader.lines().refuse(reader.heads()[*columns.backlash],
                          fmt::format("BACKLASH beside a column {}", axis_letter(chain, of)));
  return columns;
}

std::vector<AxisTable> read_com(const ControlFile& file, int of, const Chain& chain) {
  GridReader reader(file);
  const ComColumns columns = com_columns(reader, of, chain);
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
    Eigen::VectorXd out(Eigen::Index(rows.size()));
    for (std::size_t k = 0; k < rows.size(); ++k) out[Eigen::Index(k)] = rows[k][i - 1] * factor;
    return out;
  };
  std::vector<AxisTable> tables;
  for (const auto& [i, moves] : columns.moves) {
    const double factor = error_sign * unit_of(chain, moves);
    AxisTable table{of, moves, column(columns.position, unit_of(chain, of)), column(i, factor), {}};
    table.downward =
        moves == of && columns.backlash ? column(*columns.backlash, factor) : table.upward;
    tables.push_back(std::move(table));
  }
  return tables;
}

struct Assigned {
  int of = 0;
  std::string file;
  int line = 0;
  int column = 0;
};

/// Returns the entries of the line of a .CMA that is in force.
std::vector<Assigned> read_cma(const ControlFile& file, const Chain& chain) {
  GridReader reader(file);
  std::optional<std::size_t> active;
  for (std::size_t i = 1; i < reader.heads().size(); ++i) {
    const Cell& head = reader.heads()[i];
    if (head.text == "ACTIVE")
      active = i;
    else if (head.text.size() != 1 || !movable(head.text[0], chain))
      reader.lines().refuse(head, fmt::format("ACTIVE or an axis ({})", movable_letters(chain)));
  }
  if (!active) reader.lines().refuse(1, "a column ACTIVE", "none");
  std::optional<std::vector<Assigned>> in_force;
  while (const auto cells = reader.next()) {
    const Cell& mark = (*cells)[*active];
    if (mark.text.empty()) continue;
    if (mark.text != "*") reader.lines().refuse(mark, "* or nothing");
    if (in_force) reader.lines().refuse(mark, "one line in force");
    in_force.emplace();
    for (std::size_t i = 1; i < cells->size(); ++i)
      if (i != *active && !(*cells)[i].text.empty())
        in_force->push_back({*movable(reader.heads()[i].text[0], chain),
                             std::string((*cells)[i].text), reader.lines().number(),
                             (*cells)[i].column});
  }
  if (!in_force) reader.lines().refuse(0, "a line with * under ACTIVE", "none");
  return *in_force;
}

bool is_cma(const ControlFile& file) { return base_name(file.name).ends_with(".CMA"); }

int axis_of_name(const ControlFile& file, const Chain& chain) {
  const std::string base = base_name(file.name);
  if (base.size() == 5 && base.ends_with(".COM"))
    if (const auto joint = movable(base[0], chain)) return *joint;
  throw BadInput(file.name, 0, 0,
                 fmt::format("a .CMA that names it, or the letter of an axis ({}) as its name",
                             movable_letters(chain)),
                 in_quotes(file.name));
}

}  // namespace

Export to_heidenhain(const ParameterTables& tables, const Chain& chain) {
  Export out;
  out.left_out = offsets_left_out(tables, chain);
  const std::vector<AxisTable> sums = summed(tables.tables);
  TextTable cma{{"NR"}, {{"0"}}};
  for (int of = 0; of < chain.size(); ++of) {
    const std::vector<AxisTable> over = together(sums, of, chain, out);
    if (over.empty()) continue;
    for (const AxisTable& table : over)
      if (table.moves != of && !is_direction_independent(table))
        out.left_out.push_back(relation(table, chain) +
                               ": the direction of motion; its mean is written");
    const std::string name = std::string(1, axis_letter(chain, of)) + ".COM";
    out.files.push_back({name, text_of(name, com_grid(over, chain))});
    cma.names.emplace_back(1, axis_letter(chain, of));
    cma.rows[0].push_back(name);
  }
  if (out.files.empty()) return out;
  cma.names.push_back("ACTIVE");
  cma.rows[0].push_back("*");
  out.files.push_back({"CONFIG.CMA", text_of("CONFIG.CMA", cma)});
  out.notes.push_back(
      "Heidenhain-style: columns as the technical manuals name them, the frame of the "
      "file and its 4 decimals are assumed; compare with a table of the control");
  out.notes.push_back(
      "positions count from the machine datum; older controls read a rotary axis from 0 "
      "to 360 degrees only");
  return out;
}

ParameterTables read_heidenhain_tables(std::span<const ControlFile> files, const Chain& chain) {
  ParameterTables tables;
  tables.offset = kinematics::AxisVector::Zero(chain.size());
  const auto add = [&](const ControlFile& file, int of) {
    for (AxisTable& table : read_com(file, of, chain)) tables.tables.push_back(std::move(table));
  };
  const auto cma = std::find_if(files.begin(), files.end(), is_cma);
  if (cma == files.end()) {
    for (const ControlFile& file : files) add(file, axis_of_name(file, chain));
    return tables;
  }
  for (const Assigned& assigned : read_cma(*cma, chain)) {
    const auto file = std::find_if(files.begin(), files.end(), [&](const ControlFile& f) {
      return base_name(f.name) == base_name(assigned.file) && !is_cma(f);
    });
    if (file == files.end())
      throw BadInput(cma->name, assigned.line, assigned.column, "a file that is there",
                     in_quotes(assigned.file));
    add(*file, assigned.of);
  }
  return tables;
}

}  // namespace abbe::sim::compensation::control
