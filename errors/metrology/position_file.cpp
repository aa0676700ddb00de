#include "errors/metrology/position_file.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {

namespace {

using Eigen::Index;

std::string place_of(const PositionReading& r) {
  return fmt::format("run {} {} at target {}", r.run, r.up ? "up" : "down", r.target);
}

/// Returns the sorted readings of one direction as (targets x runs); every run must have every
/// target.
Eigen::MatrixXd table(const std::vector<PositionReading>& all, bool up,
                      const Eigen::VectorXd& target, const std::string& file) {
  std::vector<PositionReading> mine;
  std::copy_if(all.begin(), all.end(), std::back_inserter(mine),
               [&](const PositionReading& r) { return r.up == up; });
  const Index m = target.size();
  for (std::size_t i = 0; i < mine.size(); ++i) {
    PositionReading wanted = mine[i - i % std::size_t(m)];
    wanted.target = target[Index(i) % m];
    if (mine[i].order() != wanted.order())
      throw BadInput(file, mine[i].line, 1, place_of(wanted), place_of(mine[i]));
  }
  if (mine.size() % std::size_t(m) != 0)
    throw BadInput(file, mine.back().line, 1,
                   fmt::format("{} targets in run {}", m, mine.back().run),
                   fmt::format("{}", mine.size() % std::size_t(m)));
  Eigen::MatrixXd x(m, Index(mine.size()) / m);
  for (std::size_t i = 0; i < mine.size(); ++i) x(Index(i) % m, Index(i) / m) = mine[i].deviation;
  return x;
}

}  // namespace

PositionRuns assemble_runs(std::vector<PositionReading> all, const std::string& file) {
  // Sorted by direction, run and target, whatever the order of the file.
  std::stable_sort(all.begin(), all.end(), [](const PositionReading& a, const PositionReading& b) {
    return a.order() < b.order();
  });
  std::vector<double> targets;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (i > 0 && all[i].order() == all[i - 1].order())
      throw BadInput(file, all[i].line, 1, "every reading once", place_of(all[i]) + " again");
    targets.push_back(all[i].target);
  }
  std::sort(targets.begin(), targets.end());
  targets.erase(std::unique(targets.begin(), targets.end()), targets.end());
  if (targets.size() < 2) throw BadInput(file, all.back().line, 0, "at least 2 targets", "1");
  PositionRuns runs;
  runs.target = Eigen::Map<const Eigen::VectorXd>(targets.data(), Index(targets.size()));
  runs.up = table(all, true, runs.target, file);
  runs.down = table(all, false, runs.target, file);
  return runs;
}

void check_size(std::string_view text, const std::string& file,
                const PositionFileOptions& options) {
  if (text.size() > options.max_bytes)
    throw BadInput(file, 0, 0, fmt::format("at most {} bytes", options.max_bytes),
                   fmt::format("{}", text.size()));
}

namespace {

constexpr std::size_t max_cells = max_runs + 8;
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
  int run = 0;  ///< of j1, j2, ...; 0: given by the row
};

/// Parser of the header of a table.
class HeaderReader {
 public:
  HeaderReader(const TableLines& lines, const Line& line) : lines_(lines), line_(line) {}

  struct Head {
    std::vector<Column> columns;
    char separator = ',';
    bool rotary = false;
  };

  Head read() {
    head_.separator = line_.text.find(';') != std::string_view::npos ? ';' : ',';
    const std::vector<Cell> cells = cells_of(line_.text, head_.separator, max_cells - 1);
    if (cells.size() == max_cells)
      lines_.refuse(cells.back(), fmt::format("at most {} runs", max_runs));
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
    // Columns j1, j2, ... repeat on purpose, one for each run; all others are unique.
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
    if (name == fmt::format("j{}", wide_ + 1) && wide_ < max_runs)
      return unit == nullptr ? Role::Position : Role::Deviation;
    lines_.refuse(cell, "a column of a head such as target_mm,direction,run,deviation_um");
  }

  /// Gives positions without a unit that of the target; all must be lengths or all angles.
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

using Head = HeaderReader::Head;

bool is_up(const TableLines& lines, const Cell& cell) {
  if (cell.text == "up" || cell.text == "+") return true;
  if (cell.text != "down" && cell.text != "-") lines.refuse(cell, "up, down, + or -");
  return false;
}

/// A row of a table: its set and one or several readings.
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
    if (column.role == Role::Run) common.run = lines.whole_number_in(cells[i], 1, max_runs);
    if (column.role == Role::Target) common.target = lines.number_in(cells[i]);
  }
  // The column of the target may follow the readings, so its unit is found first.
  double unit = 1.0;
  for (const Column& column : head.columns)
    if (column.role == Role::Target) unit = column.unit->size;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Column& column = head.columns[i];
    if (column.role != Role::Deviation && column.role != Role::Position) continue;
    PositionReading reading = common;
    if (column.run > 0) reading.run = column.run;
    const double x = lines.number_in(cells[i]);
    // Computed in the unit of the file, in which most decimal fractions cancel exactly enough.
    reading.deviation = column.role == Role::Deviation
                            ? x * column.unit->size
                            : x * column.unit->size - common.target * unit;
    // With equal units the subtraction comes before the conversion.
    if (column.role == Role::Position && column.unit->size == unit)
      reading.deviation = (x - common.target) * unit;
    row.readings.push_back(reading);
  }
  // Targets are converted last, because the deviations above need them in the unit of the file.
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
  const Head head = HeaderReader(lines, *first).read();
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
      constexpr std::size_t max_sets = 1000;  // keeps the linear search short
      if (sets.size() == max_sets) lines.refuse(0, "at most 1000 sets", "more");
      found = sets.insert(sets.end(), {row.set, {}});
    }
    found->readings.insert(found->readings.end(), row.readings.begin(), row.readings.end());
  }
  if (sets.empty()) lines.refuse(0, "at least one reading", "none");
  std::vector<PositionSet> result;
  for (NamedReadings& one : sets)
    result.push_back({one.name, head.rotary, assemble_runs(std::move(one.readings), file)});
  return result;
}

namespace {

/// Parser of an .rtl file, section by section.
class RtlReader {
 public:
  RtlReader(std::string_view text, const std::string& file, const PositionFileOptions& options)
      : lines_(text, file, std::nullopt), file_(file), options_(options) {}

  PositionSet read() {
    line_ = lines_.next();
    if (!line_ || content() != "HEADER::") refuse_line("HEADER:: first");
    while (line_ && content() != "EOF::") {
      const std::string_view section = content();
      line_ = lines_.next();
      if (section == "HEADER::") read_header();
      if (section == "TARGET DATA::") read_targets();
      if (section == "USER-TEXT::") read_user_text();
      if (section == "RUNS::") read_runs();
      if (section == "DEVIATIONS::") read_deviations();
      pass_section();
    }
    if (all_.empty()) lines_.refuse(0, "a section DEVIATIONS::", "none");
    drop_fill();
    PositionSet set{title_.empty() ? axis_ : title_, false, assemble_runs(std::move(all_), file_)};
    return set;
  }

 private:
  struct Entry {
    std::string_view key;
    Cell value;
  };

  std::string_view content() const { return cell().text; }
  Cell cell() const {
    const std::size_t first = std::min(line_->text.find_first_not_of(" \t"), line_->text.size());
    const std::size_t last = line_->text.find_last_not_of(" \t");
    return {line_->text.substr(first, last - first + 1), int(first) + 1};
  }
  [[noreturn]] void refuse_line(const std::string& expected) const {
    if (!line_) lines_.refuse(0, expected, "the end of the file");
    lines_.refuse(cell(), expected);
  }
  bool in_section() const { return line_ && !content().ends_with("::"); }
  void pass_section() {
    while (in_section()) line_ = lines_.next();
  }

  /// Returns "key : value" of the line; empty if there is no colon.
  std::optional<Entry> entry() const {
    const Cell whole = cell();
    const std::size_t at = whole.text.find(':');
    if (at == std::string_view::npos) return std::nullopt;
    std::string_view key = whole.text.substr(0, at);
    while (key.ends_with(' ') || key.ends_with('\t')) key.remove_suffix(1);
    std::string_view value = whole.text.substr(at + 1);
    const std::size_t blank = std::min(value.find_first_not_of(" \t"), value.size());
    value.remove_prefix(blank);
    return Entry{key, {value, whole.column + int(at + 1 + blank)}};
  }

  void read_header() {
    for (; in_section(); line_ = lines_.next()) {
      const auto e = entry();
      if (!e) continue;
      if (e->key == "File type" && e->value.text != "rtl")
        lines_.refuse(e->value, "rtl as the type of the file");
      if (e->key != "Owner") continue;
      if (e->value.text != "Linear")
        lines_.refuse(e->value, "Linear as the owner, whose readings are um");
      linear_ = true;
    }
    if (!linear_) refuse_line("a line Owner : Linear in the header");
  }

  void read_targets() {
    if (!targets_.empty()) refuse_line("TARGET DATA:: once");
    int count = 0;
    for (; in_section(); line_ = lines_.next()) {
      const auto e = entry();
      if (!e) refuse_line(count == 0 ? "a line key: value" : fmt::format("{} targets", count));
      if (e->key == "Target-count") count = lines_.whole_number_in(e->value, 2, 100000);
      if (e->key == "Flags") read_flags(e->value);
      if (e->key != "Targets") continue;
      if (count == 0) refuse_line("Target-count before Targets");
      read_target_numbers(count);
    }
    if (targets_.empty()) refuse_line("Targets in the section TARGET DATA::");
  }

  /// Leaves the parser on the last line of numbers.
  void read_target_numbers(int count) {
    while (int(targets_.size()) < count) {
      line_ = lines_.next();
      if (!in_section()) refuse_line(fmt::format("{} targets", count));
      for (const Cell& number : cells_of(line_->text, ' ', std::size_t(count))) {
        if (int(targets_.size()) == count) lines_.refuse(number, fmt::format("{} targets", count));
        targets_.push_back(lines_.number_in(number));
      }
    }
  }

  void read_flags(const Cell& cell) {
    const std::vector<Cell> flags = cells_of(cell.text, ' ', 1);
    one_way_ = flags.size() == 2 && flags[1].text == "1";
  }

  void read_user_text() {
    for (; in_section(); line_ = lines_.next()) {
      const auto e = entry();
      // 100 characters: enough for a title; a longer text is not one.
      if (e && e->key == "Axis") axis_ = std::string(e->value.text.substr(0, 100));
      if (e && e->key == "TITLE") title_ = std::string(e->value.text.substr(0, 100));
    }
  }

  void read_runs() {
    for (; in_section(); line_ = lines_.next()) {
      const auto e = entry();
      if (e && e->key == "Run-count") runs_ = lines_.whole_number_in(e->value, 1, max_runs);
    }
    if (runs_ == 0) refuse_line("Run-count in the section RUNS::");
    if (std::size_t(runs_) * targets_.size() > options_.max_readings)
      refuse_line(fmt::format("at most {} readings", options_.max_readings));
  }

  void read_deviations() {
    if (targets_.empty() || runs_ == 0) refuse_line("TARGET DATA:: and RUNS:: before DEVIATIONS::");
    if (!all_.empty()) refuse_line("DEVIATIONS:: once");
    if (!in_section() || content() != "Run Target Data:") refuse_line("Run Target Data:");
    const std::size_t wanted = std::size_t(runs_) * targets_.size();
    std::vector<int> before(std::size_t(runs_), -1);
    std::vector<int> way(std::size_t(runs_), 0);
    while (all_.size() < wanted) {
      line_ = lines_.next();
      if (!in_section()) refuse_line(fmt::format("{} readings, seen {}", wanted, all_.size()));
      add_reading(before, way);
    }
    for (PositionReading& r : all_) r.up = way[std::size_t(r.run - 1)] > 0;
    line_ = lines_.next();
    if (in_section()) refuse_line("a new section after the last reading");
  }

  /// Reads one row; `before` holds the last target of each run, `way` its direction.
  void add_reading(std::vector<int>& before, std::vector<int>& way) {
    const std::vector<Cell> cells = cells_of(line_->text, ' ', 3);
    if (cells.size() != 3) refuse_line("a row: run, target, deviation");
    const int run = lines_.whole_number_in(cells[0], 1, runs_);
    const int target = lines_.whole_number_in(cells[1], 1, int(targets_.size()));
    const std::size_t i = std::size_t(run - 1);
    const double here = targets_[std::size_t(target - 1)];
    if (before[i] >= 0) {
      const double step = here - targets_[std::size_t(before[i])];
      const int turn = step > 0.0 ? 1 : (step < 0.0 ? -1 : 0);
      if (turn == 0 || (way[i] != 0 && turn != way[i]))
        lines_.refuse(cells[1], "a run that goes on one way from target to target");
      way[i] = turn;
    }
    before[i] = target - 1;
    all_.push_back({true, run, here, lines_.number_in(cells[2]) * units::um, line_->number});
  }

  /// Removes backward runs that contain only zeros, if the file states a single direction.
  void drop_fill() {
    if (!one_way_) return;
    const bool filled = std::all_of(all_.begin(), all_.end(), [](const PositionReading& r) {
      return r.up || r.deviation == 0.0;
    });
    const bool any_up =
        std::any_of(all_.begin(), all_.end(), [](const PositionReading& r) { return r.up; });
    if (filled && any_up)
      all_.erase(
          std::remove_if(all_.begin(), all_.end(), [](const PositionReading& r) { return !r.up; }),
          all_.end());
  }

  TableLines lines_;
  const std::string& file_;
  const PositionFileOptions& options_;
  std::optional<Line> line_;
  bool linear_ = false;
  bool one_way_ = false;
  std::vector<double> targets_;
  std::string axis_, title_;
  int runs_ = 0;
  std::vector<PositionReading> all_;
};

}  // namespace

PositionSet read_position_rtl(std::string_view text, const std::string& file,
                              const PositionFileOptions& options) {
  check_size(text, file, options);
  return RtlReader(text, file, options).read();
}

std::vector<PositionSet> read_positions(std::string_view text, const std::string& file,
                                        const PositionFileOptions& options) {
  const std::size_t start = text.find_first_not_of("\xef\xbb\xbf \t\r\n");
  if (start != std::string_view::npos && text.substr(start).starts_with("HEADER::"))
    return {read_position_rtl(text, file, options)};
  return read_position_csv(text, file, options);
}

std::vector<PositionSet> read_position_file(const std::filesystem::path& file,
                                            const PositionFileOptions& options) {
  return read_positions(read_text(file, options.max_bytes), file.string(), options);
}

}  // namespace abbe::errors::metrology
