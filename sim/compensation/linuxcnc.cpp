#include <algorithm>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "sim/compensation/control_file_format.h"

namespace abbe::sim::compensation::control {
namespace {

using kinematics::Chain;

constexpr int most_lines = 256;
constexpr int line_decimals = 8;
constexpr std::size_t most_line = 254;  // bytes that it reads of a line
constexpr std::string_view letters = "XYZABCUVW";

/// Joints as trivkins numbers them.
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

/// What an INI file says of one joint.
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

/// The COMP_FILE lines of an INI file, other sections and keys passed over.
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
    const int index = lines_.count_in(number, 0, 15);
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
      entry.type = lines_.count_in(setting->value, 0, 1);
    }
  }

  TableLines lines_;
  std::vector<int> joints_;
  std::vector<JointEntry> entries_;
  bool in_joint_ = false;
};

/// The motion controller holds trims in single precision.
double held(double trim) { return double(float(trim)); }

AxisTable read_comp(const ControlFile& file, int joint, int type, const Chain& chain) {
  TableLines lines(file.text, file.name, std::nullopt);
  std::vector<double> numbers;
  int last_line = 0;
  while (const auto line = lines.next()) {
    if (line->number != last_line + 1)
      lines.refuse(1, "no empty line before this one, where LinuxCNC stops reading", "one");
    last_line = line->number;
    if (line->text.size() > most_line)
      lines.refuse(int(most_line) + 1, fmt::format("at most {} bytes a line", most_line), "more");
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
  // one line is a constant, which takes a second point to be a table
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
    const Shortened held_table = shortened(table, chain, {most_lines, 1e-6});
    if (held_table.left_out) out.left_out.push_back(*held_table.left_out);
    const std::string name = std::string(1, chain.joints()[std::size_t(table.of)].name) + ".comp";
    out.files.push_back({name, rows(held_table.table, chain)});
    ini += fmt::format("{}[JOINT_{}]\nCOMP_FILE = {}\nCOMP_FILE_TYPE = 1\n",
                       ini.empty() ? "" : "\n", joint - joints.begin(), name);
  }
  if (out.files.empty()) return out;
  out.files.push_back({"compensation.ini", ini});
  out.notes.push_back(
      "the lines of compensation.ini belong to the INI file of the machine, its "
      "joints as trivkins numbers them; BACKLASH of these joints is then not used");
  return out;
}

ParameterTables tables_of_linuxcnc(std::span<const ControlFile> files, const Chain& chain) {
  ParameterTables tables;
  tables.offset = kinematics::AxisVector::Zero(chain.size());
  if (const auto ini = std::find_if(files.begin(), files.end(), is_ini); ini != files.end()) {
    read_ini(*ini, files, chain, tables);
    return tables;
  }
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

}  // namespace abbe::sim::compensation::control
