#include "errors/metrology/position_file.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {

namespace {

using Eigen::Index;

constexpr int max_runs = 10000;

/// Reading as a deviation, with its line in the file.
struct PositionReading {
  bool up = true;
  int run = 1;
  double target = 0.0;
  double deviation = 0.0;
  int line = 0;

  auto order() const { return std::tuple(up, run, target); }
};

std::string reading_text(const PositionReading& r) {
  return fmt::format("run {} {} at target {}", r.run, r.up ? "up" : "down", r.target);
}

/// Returns the readings of one direction as (targets x runs). Throws unless every run has every
/// target.
/// @param readings  sorted by `order`
Eigen::MatrixXd table(const std::vector<PositionReading>& readings, bool up,
                      const Eigen::VectorXd& target, const std::string& file) {
  std::vector<PositionReading> selected;
  std::copy_if(readings.begin(), readings.end(), std::back_inserter(selected),
               [&](const PositionReading& r) { return r.up == up; });
  const Index target_count = target.size();
  for (std::size_t i = 0; i < selected.size(); ++i) {
    PositionReading expected = selected[i - i % std::size_t(target_count)];
    expected.target = target[Index(i) % target_count];
    if (selected[i].order() != expected.order())
      throw BadInput(file, selected[i].line, 1, reading_text(expected), reading_text(selected[i]));
  }
  if (selected.size() % std::size_t(target_count) != 0)
    throw BadInput(file, selected.back().line, 1,
                   fmt::format("{} targets in run {}", target_count, selected.back().run),
                   fmt::format("{}", selected.size() % std::size_t(target_count)));
  Eigen::MatrixXd result(target_count, Index(selected.size()) / target_count);
  for (std::size_t i = 0; i < selected.size(); ++i)
    result(Index(i) % target_count, Index(i) / target_count) = selected[i].deviation;
  return result;
}

/// Returns the readings as runs.
/// @throws BadInput unless every run of a direction has every target once
PositionRuns assemble_runs(std::vector<PositionReading> readings, const std::string& file) {
  // The file may have any order.
  std::stable_sort(
      readings.begin(), readings.end(),
      [](const PositionReading& a, const PositionReading& b) { return a.order() < b.order(); });
  std::vector<double> targets;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    if (i > 0 && readings[i].order() == readings[i - 1].order())
      throw BadInput(file, readings[i].line, 1, "each reading only once",
                     reading_text(readings[i]) + " again");
    targets.push_back(readings[i].target);
  }
  std::sort(targets.begin(), targets.end());
  targets.erase(std::unique(targets.begin(), targets.end()), targets.end());
  if (targets.size() < 2) throw BadInput(file, readings.back().line, 0, "at least 2 targets", "1");
  PositionRuns runs;
  runs.target = Eigen::Map<const Eigen::VectorXd>(targets.data(), Index(targets.size()));
  runs.up = table(readings, true, runs.target, file);
  runs.down = table(readings, false, runs.target, file);
  return runs;
}

void check_size(std::string_view text, const std::string& file,
                const PositionFileOptions& options) {
  if (text.size() > options.max_bytes)
    throw BadInput(file, 0, 0, fmt::format("at most {} bytes", options.max_bytes),
                   fmt::format("{}", text.size()));
}

constexpr std::size_t max_cells = max_runs + 8;
constexpr double arcsec = units::deg / 3600.0;

struct Unit {
  std::string_view name;
  double size;  ///< of one unit, mm or rad
  bool rotary;
};
constexpr std::array known_units{Unit{"nm", units::nm, false}, Unit{"um", units::um, false},
                                 Unit{"mm", 1.0, false},       Unit{"urad", units::urad, true},
                                 Unit{"arcsec", arcsec, true}, Unit{"deg", units::deg, true},
                                 Unit{"rad", 1.0, true}};

const Unit* find_unit(std::string_view name) {
  const auto unit = std::find_if(known_units.begin(), known_units.end(),
                                 [&](const Unit& u) { return u.name == name; });
  return unit == known_units.end() ? nullptr : &*unit;
}

/// Meaning of a column.
enum class Role { Set, Ordinal, Target, Direction, Run, Deviation, Position };

struct Column {
  Role role;
  const Unit* unit = nullptr;
  int run = 0;  ///< for j1, j2, ... their number; 0: the row states the run
};

/// Parser of the header of a table.
class HeaderReader {
 public:
  HeaderReader(const TableLineReader& lines, const Line& line) : lines_(lines), line_(line) {}

  struct Head {
    std::vector<Column> columns;
    char separator = ',';
    bool rotary = false;
  };

  Head read() {
    head_.separator = line_.text.find(';') != std::string_view::npos ? ';' : ',';
    const std::vector<Cell> cells = split_cells(line_.text, head_.separator, max_cells - 1);
    if (cells.size() == max_cells)
      lines_.refuse(cells.back(), fmt::format("at most {} runs", max_runs));
    for (const Cell& cell : cells) add(cell);
    require_column(Role::Target, "a column target_mm or target_deg");
    require_column(Role::Direction, "a column direction");
    if (run_column_count_ == 0) {
      require_column(Role::Run, "a column run");
      if (count(Role::Deviation) + count(Role::Position) != 1)
        lines_.refuse(int(line_.text.size()) + 1, "one column deviation_um or position_mm", "none");
    }
    resolve_units(cells);
    return std::move(head_);
  }

 private:
  int count(Role role) const {
    return int(std::count_if(head_.columns.begin(), head_.columns.end(),
                             [&](const Column& c) { return c.role == role; }));
  }
  void require_column(Role role, const std::string& what) const {
    if (count(role) == 0) lines_.refuse(int(line_.text.size()) + 1, what, "none");
  }

  void add(const Cell& cell) {
    const std::size_t underscore = cell.text.find('_');
    const std::string_view name = cell.text.substr(0, underscore);
    const Unit* unit = nullptr;
    if (underscore != std::string_view::npos) {
      unit = find_unit(cell.text.substr(underscore + 1));
      if (unit == nullptr) lines_.refuse(cell, "a unit such as mm, um, deg or arcsec");
    }
    Column column{role_of(cell, name, unit), unit};
    // There is one column j1, j2, ... for each run; all other columns are unique.
    if (name.front() == 'j') {
      column.run = ++run_column_count_;
    } else if (count(column.role) > 0 ||
               (is_reading(column.role) && count(Role::Deviation) + count(Role::Position) > 0)) {
      lines_.refuse(cell, "each column only once");
    }
    head_.columns.push_back(column);
  }

  static bool is_reading(Role role) { return role == Role::Deviation || role == Role::Position; }

  Role role_of(const Cell& cell, std::string_view name, const Unit* unit) const {
    const auto without_unit = [&](Role role) {
      if (unit != nullptr) lines_.refuse(cell, "a column without a unit");
      return role;
    };
    const auto with_unit = [&](Role role) {
      if (unit == nullptr)
        lines_.refuse(cell, "a column name with a unit, as in target_mm and deviation_um");
      return role;
    };
    if (name == "set") return without_unit(Role::Set);
    if (name == "pos") return without_unit(Role::Ordinal);
    if (name == "direction" || name == "dir") return without_unit(Role::Direction);
    if (name == "run") return without_unit(Role::Run);
    if (name == "target") return with_unit(Role::Target);
    if (name == "deviation") return with_unit(Role::Deviation);
    if (name == "position") return with_unit(Role::Position);
    if (name == fmt::format("j{}", run_column_count_ + 1) && run_column_count_ < max_runs)
      return unit == nullptr ? Role::Position : Role::Deviation;
    lines_.refuse(cell, "a column name of a header such as target_mm,direction,run,deviation_um");
  }

  /// Sets the unit of positions without one to that of the target, and checks that all columns are
  /// lengths or all are angles.
  void resolve_units(const std::vector<Cell>& cells) {
    const auto target = std::find_if(head_.columns.begin(), head_.columns.end(),
                                     [](const Column& c) { return c.role == Role::Target; });
    const Unit* target_unit = target->unit;
    head_.rotary = target_unit->rotary;
    for (std::size_t i = 0; i < head_.columns.size(); ++i) {
      Column& column = head_.columns[i];
      if (run_column_count_ > 0 &&
          (column.role == Role::Run || (is_reading(column.role) && column.run == 0)))
        lines_.refuse(cells[i], "no such column together with j1, j2, ...");
      if (column.role == Role::Position && column.unit == nullptr) column.unit = target_unit;
      if (column.unit != nullptr && column.unit->rotary != head_.rotary)
        lines_.refuse(cells[i], head_.rotary ? "an angle, because the target is an angle"
                                             : "a length, because the target is a length");
    }
  }

  const TableLineReader& lines_;
  const Line& line_;
  Head head_;
  int run_column_count_ = 0;
};

using Head = HeaderReader::Head;

bool is_up(const TableLineReader& lines, const Cell& cell) {
  if (cell.text == "up" || cell.text == "+") return true;
  if (cell.text != "down" && cell.text != "-") lines.refuse(cell, "up, down, + or -");
  return false;
}

/// Row of a table.
struct Row {
  std::string set;  ///< name of its set
  std::vector<PositionReading> readings;
};

Row read_row(const TableLineReader& lines, const Line& line, const Head& head) {
  const std::vector<Cell> cells = split_cells(line.text, head.separator, head.columns.size());
  const std::string expected = fmt::format("{} cells, as in the header", head.columns.size());
  if (cells.size() < head.columns.size())
    lines.refuse(int(line.text.size()) + 1, expected, fmt::format("{}", cells.size()));
  if (cells.size() > head.columns.size()) lines.refuse(cells.back().column, expected, "more");
  Row row;
  PositionReading common;
  common.line = line.number;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Column& column = head.columns[i];
    if (column.role == Role::Set) row.set = std::string(cells[i].text);
    if (column.role == Role::Direction) common.up = is_up(lines, cells[i]);
    if (column.role == Role::Run) common.run = lines.read_whole_number(cells[i], 1, max_runs);
    if (column.role == Role::Target) common.target = lines.number_in(cells[i]);
  }
  // The column of the target may be right of the readings, so its unit is determined first.
  double unit = 1.0;
  for (const Column& column : head.columns)
    if (column.role == Role::Target) unit = column.unit->size;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Column& column = head.columns[i];
    if (column.role != Role::Deviation && column.role != Role::Position) continue;
    PositionReading reading = common;
    if (column.run > 0) reading.run = column.run;
    const double x = lines.number_in(cells[i]);

    reading.deviation = column.role == Role::Deviation
                            ? x * column.unit->size
                            : x * column.unit->size - common.target * unit;
    // With equal units the difference is taken in the unit of the file, before the conversion:
    // decimal fractions then cancel best.
    if (column.role == Role::Position && column.unit->size == unit)
      reading.deviation = (x - common.target) * unit;
    row.readings.push_back(reading);
  }
  // Targets are converted last, since the deviations above need them in the unit of the file.
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
  TableLineReader lines(text, file);
  const auto first = lines.next();
  if (!first) lines.refuse(0, "a header such as target_mm,direction,run,deviation_um", "nothing");
  const Head head = HeaderReader(lines, *first).read();
  std::vector<NamedReadings> sets;
  std::size_t count = 0;
  while (const auto line = lines.next()) {
    Row row = read_row(lines, *line, head);
    count += row.readings.size();
    if (count > options.max_readings)
      lines.refuse(0, fmt::format("at most {} readings", options.max_readings), "more");
    auto set = std::find_if(sets.begin(), sets.end(),
                            [&](const NamedReadings& s) { return s.name == row.set; });
    if (set == sets.end()) {
      constexpr std::size_t max_sets = 1000;  // keeps the linear search short
      if (sets.size() == max_sets) lines.refuse(0, "at most 1000 sets", "more");
      set = sets.insert(sets.end(), {row.set, {}});
    }
    set->readings.insert(set->readings.end(), row.readings.begin(), row.readings.end());
  }
  if (sets.empty()) lines.refuse(0, "at least one reading", "none");
  std::vector<PositionSet> result;
  for (NamedReadings& set : sets)
    result.push_back({set.name, head.rotary, assemble_runs(std::move(set.readings), file)});
  return result;
}

namespace {

/// Parser of an .rtl file. It reads one section after the other.
class RtlReader {
 public:
  RtlReader(std::string_view text, const std::string& file, const PositionFileOptions& options)
      : lines_(text, file, std::nullopt), file_(file), options_(options) {}

  PositionSet read() {
    line_ = lines_.next();
    if (!line_ || content() != "HEADER::") throw_line_error("HEADER:: as the first line");
    while (line_ && content() != "EOF::") {
      const std::string_view section = content();
      line_ = lines_.next();
      if (section == "HEADER::") read_header();
      if (section == "TARGET DATA::") read_targets();
      if (section == "USER-TEXT::") read_user_text();
      if (section == "RUNS::") read_runs();
      if (section == "DEVIATIONS::") read_deviations();
      skip_section();
    }
    if (readings_.empty()) lines_.refuse(0, "a section DEVIATIONS::", "none");
    remove_filler_runs();
    return {title_.empty() ? axis_ : title_, false, assemble_runs(std::move(readings_), file_)};
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
  [[noreturn]] void throw_line_error(const std::string& expected) const {
    if (!line_) lines_.refuse(0, expected, "the end of the file");
    lines_.refuse(cell(), expected);
  }
  bool in_section() const { return line_ && !content().ends_with("::"); }
  void skip_section() {
    while (in_section()) line_ = lines_.next();
  }

  /// Returns the key and the value of a line "key : value", or nothing if there is no colon.
  std::optional<Entry> entry() const {
    const Cell content_cell = cell();
    const std::size_t colon = content_cell.text.find(':');
    if (colon == std::string_view::npos) return std::nullopt;
    std::string_view key = content_cell.text.substr(0, colon);
    while (key.ends_with(' ') || key.ends_with('\t')) key.remove_suffix(1);
    std::string_view value = content_cell.text.substr(colon + 1);
    const std::size_t blank = std::min(value.find_first_not_of(" \t"), value.size());
    value.remove_prefix(blank);
    return Entry{key, {value, content_cell.column + int(colon + 1 + blank)}};
  }

  void read_header() {
    for (; in_section(); line_ = lines_.next()) {
      const auto e = entry();
      if (!e) continue;
      if (e->key == "File type" && e->value.text != "rtl")
        lines_.refuse(e->value, "rtl as the file type");
      if (e->key != "Owner") continue;
      if (e->value.text != "Linear")
        lines_.refuse(e->value, "Linear as the owner (readings in um)");
      is_linear_ = true;
    }
    if (!is_linear_) throw_line_error("a line Owner : Linear in the header");
  }

  void read_targets() {
    if (!targets_.empty()) throw_line_error("only one section TARGET DATA::");
    int count = 0;
    for (; in_section(); line_ = lines_.next()) {
      const auto e = entry();
      if (!e)
        throw_line_error(count == 0 ? "a line of the form key: value"
                                    : fmt::format("{} targets", count));
      if (e->key == "Target-count") count = lines_.read_whole_number(e->value, 2, 100000);
      if (e->key == "Flags") read_flags(e->value);
      if (e->key != "Targets") continue;
      if (count == 0) throw_line_error("Target-count before Targets");
      read_target_numbers(count);
    }
    if (targets_.empty()) throw_line_error("Targets in the section TARGET DATA::");
  }

  /// Reads the targets. The current line is then the last one with targets.
  void read_target_numbers(int count) {
    while (int(targets_.size()) < count) {
      line_ = lines_.next();
      if (!in_section()) throw_line_error(fmt::format("{} targets", count));
      for (const Cell& number : split_cells(line_->text, ' ', std::size_t(count))) {
        if (int(targets_.size()) == count) lines_.refuse(number, fmt::format("{} targets", count));
        targets_.push_back(lines_.number_in(number));
      }
    }
  }

  void read_flags(const Cell& cell) {
    const std::vector<Cell> flags = split_cells(cell.text, ' ', 1);
    is_one_directional_ = flags.size() == 2 && flags[1].text == "1";
  }

  void read_user_text() {
    for (; in_section(); line_ = lines_.next()) {
      const auto e = entry();
      // 100 characters suffice for a title.
      if (e && e->key == "Axis") axis_ = std::string(e->value.text.substr(0, 100));
      if (e && e->key == "TITLE") title_ = std::string(e->value.text.substr(0, 100));
    }
  }

  void read_runs() {
    for (; in_section(); line_ = lines_.next()) {
      const auto e = entry();
      if (e && e->key == "Run-count") runs_ = lines_.read_whole_number(e->value, 1, max_runs);
    }
    if (runs_ == 0) throw_line_error("Run-count in the section RUNS::");
    if (std::size_t(runs_) * targets_.size() > options_.max_readings)
      throw_line_error(fmt::format("at most {} readings", options_.max_readings));
  }

  void read_deviations() {
    if (targets_.empty() || runs_ == 0)
      throw_line_error("TARGET DATA:: and RUNS:: before DEVIATIONS::");
    if (!readings_.empty()) throw_line_error("only one section DEVIATIONS::");
    if (!in_section() || content() != "Run Target Data:") throw_line_error("Run Target Data:");
    const std::size_t reading_count = std::size_t(runs_) * targets_.size();
    std::vector<int> last_target(std::size_t(runs_), -1);
    std::vector<int> direction(std::size_t(runs_), 0);
    while (readings_.size() < reading_count) {
      line_ = lines_.next();
      if (!in_section())
        throw_line_error(fmt::format("{} readings, seen {}", reading_count, readings_.size()));
      add_reading(last_target, direction);
    }
    for (PositionReading& r : readings_) r.up = direction[std::size_t(r.run - 1)] > 0;
    line_ = lines_.next();
    if (in_section()) throw_line_error("a new section after the last reading");
  }

  /// Reads one row. `last_target` has the last target of each run, `direction` its direction.
  void add_reading(std::vector<int>& last_target, std::vector<int>& direction) {
    const std::vector<Cell> cells = split_cells(line_->text, ' ', 3);
    if (cells.size() != 3) throw_line_error("a row of run, target and deviation");
    const int run = lines_.read_whole_number(cells[0], 1, runs_);
    const int target = lines_.read_whole_number(cells[1], 1, int(targets_.size()));
    const std::size_t i = std::size_t(run - 1);
    const double position = targets_[std::size_t(target - 1)];
    if (last_target[i] >= 0) {
      const double step = position - targets_[std::size_t(last_target[i])];
      const int step_direction = step > 0.0 ? 1 : (step < 0.0 ? -1 : 0);
      if (step_direction == 0 || (direction[i] != 0 && step_direction != direction[i]))
        lines_.refuse(cells[1], "a run that keeps its direction from target to target");
      direction[i] = step_direction;
    }
    last_target[i] = target - 1;
    readings_.push_back(
        {true, run, position, lines_.number_in(cells[2]) * units::um, line_->number});
  }

  /// Removes backward runs with nothing but zeros if the file states a single direction.
  void remove_filler_runs() {
    if (!is_one_directional_) return;
    const bool has_zero_filler =
        std::all_of(readings_.begin(), readings_.end(),
                    [](const PositionReading& r) { return r.up || r.deviation == 0.0; });
    const bool has_forward_run = std::any_of(readings_.begin(), readings_.end(),
                                             [](const PositionReading& r) { return r.up; });
    if (has_zero_filler && has_forward_run)
      readings_.erase(std::remove_if(readings_.begin(), readings_.end(),
                                     [](const PositionReading& r) { return !r.up; }),
                      readings_.end());
  }

  TableLineReader lines_;
  const std::string& file_;
  const PositionFileOptions& options_;
  std::optional<Line> line_;
  bool is_linear_ = false;
  bool is_one_directional_ = false;
  std::vector<double> targets_;
  std::string axis_, title_;
  int runs_ = 0;
  std::vector<PositionReading> readings_;
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

}  // namespace abbe::errors::metrology
