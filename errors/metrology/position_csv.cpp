#include "errors/metrology/position_csv.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {
namespace {

constexpr std::size_t most_cells = most_runs + 8;
constexpr double arcsec = units::deg / 3600.0;

struct Unit {
  std::string_view name;
  double size;  ///< mm or rad
  bool rotary;
};
constexpr std::array known_units{Unit{"nm", units::nm, false}, Unit{"um", units::um, false},
                                 Unit{"mm", 1.0, false},       Unit{"urad", units::urad, true},
                                 Unit{"arcsec", arcsec, true}, Unit{"deg", units::deg, true},
                                 Unit{"rad", 1.0, true}};

const Unit* unit_named(std::string_view name) {
  const auto found = std::find_if(known_units.begin(), known_units.end(),
                                  [&](const Unit& u) { return u.name == name; });
  return found == known_units.end() ? nullptr : &*found;
}

enum class Role { Set, Ordinal, Target, Direction, Run, Deviation, Position };

struct Column {
  Role role;
  const Unit* unit = nullptr;
  int run = 0;  ///< of j1, j2, ...; 0: the row says
};

/// Reader of the head of a table.
class HeadReader {
 public:
  HeadReader(const TableLines& lines, const Line& line) : lines_(lines), line_(line) {}

  struct Head {
    std::vector<Column> columns;
    char separator = ',';
    bool rotary = false;
  };

  Head read() {
    head_.separator = line_.text.find(';') != std::string_view::npos ? ';' : ',';
    const std::vector<Cell> cells = cells_of(line_.text, head_.separator, most_cells - 1);
    if (cells.size() == most_cells)
      lines_.refuse(cells.back(), fmt::format("at most {} runs", most_runs));
    for (const Cell& cell : cells) add(cell);
    need(Role::Target, "a column target_mm or target_deg");
    need(Role::Direction, "a column direction");
    if (wide_ == 0) {
      need(Role::Run, "a column run");
      if (count(Role::Deviation) + count(Role::Position) != 1)
        lines_.refuse(int(line_.text.size()) + 1, "one column deviation_um or position_mm", "none");
    }
    settle_units(cells);
    return std::move(head_);
  }

 private:
  int count(Role role) const {
    return int(std::count_if(head_.columns.begin(), head_.columns.end(),
                             [&](const Column& c) { return c.role == role; }));
  }
  void need(Role role, const std::string& what) const {
    if (count(role) == 0) lines_.refuse(int(line_.text.size()) + 1, what, "none");
  }

  void add(const Cell& cell) {
    const std::size_t at = cell.text.find('_');
    const std::string_view name = cell.text.substr(0, at);
    const Unit* unit = nullptr;
    if (at != std::string_view::npos) {
      unit = unit_named(cell.text.substr(at + 1));
      if (unit == nullptr) lines_.refuse(cell, "a unit such as mm, um, deg or arcsec");
    }
    Column column{role_of(cell, name, unit), unit};
    if (name.front() == 'j') {
      column.run = ++wide_;
    } else if (count(column.role) > 0 ||
               (is_reading(column.role) && count(Role::Deviation) + count(Role::Position) > 0)) {
      lines_.refuse(cell, "every column once");
    }
    head_.columns.push_back(column);
  }

  static bool is_reading(Role role) { return role == Role::Deviation || role == Role::Position; }

  Role role_of(const Cell& cell, std::string_view name, const Unit* unit) const {
    const auto plain = [&](Role role) {
      if (unit != nullptr) lines_.refuse(cell, "a column without a unit");
      return role;
    };
    const auto measured = [&](Role role) {
      if (unit == nullptr) lines_.refuse(cell, "a unit, as in target_mm and deviation_um");
      return role;
    };
    if (name == "set") return plain(Role::Set);
    if (name == "pos") return plain(Role::Ordinal);
    if (name == "direction" || name == "dir") return plain(Role::Direction);
    if (name == "run") return plain(Role::Run);
    if (name == "target") return measured(Role::Target);
    if (name == "deviation") return measured(Role::Deviation);
    if (name == "position") return measured(Role::Position);
    if (name == fmt::format("j{}", wide_ + 1) && wide_ < most_runs)
      return unit == nullptr ? Role::Position : Role::Deviation;
    lines_.refuse(cell, "a column of a head such as target_mm,direction,run,deviation_um");
  }

  /// Positions without a unit take that of the target; all must be lengths or all angles.
  void settle_units(const std::vector<Cell>& cells) {
    const auto target = std::find_if(head_.columns.begin(), head_.columns.end(),
                                     [](const Column& c) { return c.role == Role::Target; });
    const Unit* of_target = target->unit;
    head_.rotary = of_target->rotary;
    for (std::size_t i = 0; i < head_.columns.size(); ++i) {
      Column& column = head_.columns[i];
      if (wide_ > 0 && (column.role == Role::Run || (is_reading(column.role) && column.run == 0)))
        lines_.refuse(cells[i], "no such column beside j1, j2, ...");
      if (column.role == Role::Position && column.unit == nullptr) column.unit = of_target;
      if (column.unit != nullptr && column.unit->rotary != head_.rotary)
        lines_.refuse(cells[i], head_.rotary ? "an angle, as the target is one"
                                             : "a length, as the target is one");
    }
  }

  const TableLines& lines_;
  const Line& line_;
  Head head_;
  int wide_ = 0;
};

using Head = HeadReader::Head;

bool is_up(const TableLines& lines, const Cell& cell) {
  if (cell.text == "up" || cell.text == "+") return true;
  if (cell.text != "down" && cell.text != "-") lines.refuse(cell, "up, down, + or -");
  return false;
}

/// A row of a table: its set and one reading or several.
struct Row {
  std::string set;
  std::vector<PositionReading> readings;
};

Row read_row(const TableLines& lines, const Line& line, const Head& head) {
  const std::vector<Cell> cells = cells_of(line.text, head.separator, head.columns.size());
  const std::string wanted = fmt::format("{} cells, as the head has", head.columns.size());
  if (cells.size() < head.columns.size())
    lines.refuse(int(line.text.size()) + 1, wanted, fmt::format("{}", cells.size()));
  if (cells.size() > head.columns.size()) lines.refuse(cells.back().column, wanted, "more");
  Row row;
  PositionReading common;
  common.line = line.number;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Column& column = head.columns[i];
    if (column.role == Role::Set) row.set = std::string(cells[i].text);
    if (column.role == Role::Direction) common.up = is_up(lines, cells[i]);
    if (column.role == Role::Run) common.run = lines.count_in(cells[i], 1, most_runs);
    if (column.role == Role::Target) common.target = lines.number_in(cells[i]);
  }
  double unit = 1.0;
  for (const Column& column : head.columns)
    if (column.role == Role::Target) unit = column.unit->size;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Column& column = head.columns[i];
    if (column.role != Role::Deviation && column.role != Role::Position) continue;
    PositionReading reading = common;
    if (column.run > 0) reading.run = column.run;
    const double x = lines.number_in(cells[i]);
    // in the file's own unit, where most decimal fractions cancel exactly enough
    reading.deviation = column.role == Role::Deviation
                            ? x * column.unit->size
                            : x * column.unit->size - common.target * unit;
    if (column.role == Role::Position && column.unit->size == unit)
      reading.deviation = (x - common.target) * unit;
    row.readings.push_back(reading);
  }
  for (PositionReading& reading : row.readings) reading.target *= unit;
  return row;
}

struct NamedReadings {
  std::string name;
  std::vector<PositionReading> readings;
};

}  // namespace

std::vector<PositionSet> read_position_csv(std::string_view text, const std::string& file,
                                           const PositionFileOptions& options) {
  check_size(text, file, options);
  TableLines lines(text, file);
  const auto first = lines.next();
  if (!first) lines.refuse(0, "a head such as target_mm,direction,run,deviation_um", "nothing");
  const Head head = HeadReader(lines, *first).read();
  std::vector<NamedReadings> sets;
  std::size_t count = 0;
  while (const auto line = lines.next()) {
    Row row = read_row(lines, *line, head);
    count += row.readings.size();
    if (count > options.max_readings)
      lines.refuse(0, fmt::format("at most {} readings", options.max_readings), "more");
    auto found = std::find_if(sets.begin(), sets.end(),
                              [&](const NamedReadings& s) { return s.name == row.set; });
    if (found == sets.end()) {
      constexpr std::size_t most_sets = 1000;  // so that the search stays short
      if (sets.size() == most_sets) lines.refuse(0, "at most 1000 sets", "more");
      found = sets.insert(sets.end(), {row.set, {}});
    }
    found->readings.insert(found->readings.end(), row.readings.begin(), row.readings.end());
  }
  if (sets.empty()) lines.refuse(0, "at least one reading", "none");
  std::vector<PositionSet> result;
  for (NamedReadings& one : sets)
    result.push_back({one.name, head.rotary, assembled(std::move(one.readings), file)});
  return result;
}

}  // namespace abbe::errors::metrology
