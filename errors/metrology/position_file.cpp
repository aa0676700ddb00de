#include "errors/metrology/position_file.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "kinematics/table_file.h"
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

constexpr double arcsec = units::deg / 3600.0;

struct Unit {
  std::string_view name;
  double size;  ///< of one unit, mm or rad
  bool rotary;
};
constexpr std::array known_units{Unit{"mm", 1.0, false},          Unit{"deg", units::deg, true},
                                 Unit{"um", units::um, false},    Unit{"nm", units::nm, false},
                                 Unit{"urad", units::urad, true}, Unit{"arcsec", arcsec, true},
                                 Unit{"rad", 1.0, true}};

/// Returns the unit of a column head; null if it has none.
const Unit* unit_of(std::string_view head) {
  const auto unit = std::ranges::find(known_units, head.substr(head.find('_') + 1), &Unit::name);
  return unit == known_units.end() ? nullptr : &*unit;
}

std::vector<ColumnName> names_with_units(const std::string& name) {
  std::vector<ColumnName> names;
  for (const Unit& unit : known_units) names.push_back({fmt::format("{}_{}", name, unit.name)});
  return names;
}

/// Indices of the columns; those from `first_run_column` on have the readings of a run each.
enum PositionColumn : std::size_t {
  set_column,
  pos_column,
  target_column,
  direction_column,
  run_column,
  deviation_column,
  position_column,
  first_run_column
};

/// Returns the columns with readings.
std::vector<std::size_t> reading_columns(const TableFile& table) {
  std::vector<std::size_t> columns;
  for (std::size_t k = deviation_column; k < table.columns.size(); ++k)
    if (table.has(k)) columns.push_back(k);
  return columns;
}

/// Throws BadInput unless the columns agree with each other and with the target.
void check_header(const TableFile& table) {
  const std::vector<std::size_t> columns = reading_columns(table);
  if (table.columns.size() > first_run_column) {
    for (const std::size_t k : {run_column, deviation_column, position_column})
      if (table.has(k)) table.throw_column_error(k, "no such column together with j1, j2, ...");
  } else {
    if (!table.has(run_column)) table.throw_missing_column("a column run");
    if (columns.empty()) table.throw_missing_column("one column deviation_um or position_mm");
    if (columns.size() > 1)
      table.throw_column_error(position_column, "either a deviation or a position");
  }
  const bool rotary = unit_of(table.columns[target_column].head)->rotary;
  for (const std::size_t k : columns)
    if (const Unit* unit = unit_of(table.columns[k].head); unit && unit->rotary != rotary)
      table.throw_column_error(k, rotary ? "an angle, because the target is an angle"
                                         : "a length, because the target is a length");
}

TableSchema position_schema(const PositionFileOptions& options) {
  using Content = TableColumn::Content;
  TableSchema schema{.header = "target_mm,direction,run,deviation_um",
                     .separators = ";,",
                     .max_bytes = options.max_bytes,
                     .max_columns = std::size_t(max_runs) + 7,
                     .max_rows = options.max_readings};
  schema.check_header = check_header;
  schema.columns = {{.names = {{"set"}}, .content = Content::Text, .required = false},
                    {.names = {{"pos"}}, .content = Content::Ignored, .required = false},
                    {.names = names_with_units("target")},
                    {.names = {{"direction"}, {"dir"}}, .content = Content::Text},
                    {.names = {{"run"}},
                     .content = Content::Integer,
                     .required = false,
                     .min = 1,
                     .max = max_runs},
                    {.names = names_with_units("deviation"), .required = false},
                    {.names = names_with_units("position"), .required = false}};
  schema.other_columns = [count = 0](std::string_view head) mutable {
    const bool is_next_run = count < max_runs &&
                             head.substr(0, head.find('_')) == fmt::format("j{}", count + 1) &&
                             (head.find('_') == std::string_view::npos || unit_of(head) != nullptr);
    if (is_next_run) ++count;
    return is_next_run ? std::optional(TableColumn{.names = {{std::string(head)}}}) : std::nullopt;
  };
  return schema;
}

bool is_up(const TableFile& table, std::size_t row) {
  const std::string_view text = table.columns[direction_column].texts[row];
  if (text == "up" || text == "+") return true;
  if (text != "down" && text != "-")
    table.throw_cell_error(row, direction_column, "up, down, + or -");
  return false;
}

/// Returns the reading in a column of a row.
PositionReading reading_at(const TableFile& table, std::size_t row, std::size_t column) {
  const double target_unit = unit_of(table.columns[target_column].head)->size;
  const double written_target = table.columns[target_column].numbers[row];
  const double x = table.columns[column].numbers[row];
  const Unit* stated_unit = unit_of(table.columns[column].head);
  const double unit = stated_unit ? stated_unit->size : target_unit;
  PositionReading reading;
  reading.line = table.line[row];
  reading.up = is_up(table, row);
  reading.run = column >= first_run_column ? int(column - first_run_column) + 1
                                           : int(table.value(row, run_column));
  reading.target = written_target * target_unit;
  // With equal units the difference is taken in the unit of the file, before the conversion:
  // decimal fractions then cancel best.
  if (column == deviation_column || (column >= first_run_column && stated_unit))
    reading.deviation = x * unit;
  else if (unit == target_unit)
    reading.deviation = (x - written_target) * unit;
  else
    reading.deviation = x * unit - reading.target;
  return reading;
}

struct NamedReadings {
  std::string name;
  std::vector<PositionReading> readings;
};

}  // namespace

std::vector<PositionSet> read_position_csv(std::string_view text, const std::string& file,
                                           const PositionFileOptions& options) {
  const TableFile table = read_table(text, file, position_schema(options));
  const std::vector<std::size_t> columns = reading_columns(table);
  if (table.rows() * columns.size() > options.max_readings)
    throw BadInput(file, table.line.back(), 0,
                   fmt::format("at most {} readings", options.max_readings), "more");
  std::vector<NamedReadings> sets;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const std::string_view name = table.has(set_column) ? table.columns[set_column].texts[row] : "";
    auto named = std::ranges::find(sets, name, &NamedReadings::name);
    if (named == sets.end()) {
      constexpr std::size_t max_sets = 1000;  // keeps the linear search short
      if (sets.size() == max_sets)
        throw BadInput(file, table.line[row], 0, "at most 1000 sets", "more");
      named = sets.insert(sets.end(), {std::string(name), {}});
    }
    for (const std::size_t k : columns) named->readings.push_back(reading_at(table, row, k));
  }
  const bool rotary = unit_of(table.columns[target_column].head)->rotary;
  std::vector<PositionSet> result;
  for (NamedReadings& named : sets)
    result.push_back({named.name, rotary, assemble_runs(std::move(named.readings), file)});
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
