#include "errors/metrology/position_rtl.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {
namespace {

/// Reader of an .rtl, section by section.
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
    PositionSet set{title_.empty() ? axis_ : title_, false, assembled(std::move(all_), file_)};
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

  /// "key : value" of the line; nothing where there is no colon.
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
      if (e->key == "Target-count") count = lines_.count_in(e->value, 2, 100000);
      if (e->key == "Flags") read_flags(e->value);
      if (e->key != "Targets") continue;
      if (count == 0) refuse_line("Target-count before Targets");
      read_target_numbers(count);
    }
    if (targets_.empty()) refuse_line("Targets in the section TARGET DATA::");
  }

  /// Leaves the reader on the last line of numbers.
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
      if (e && e->key == "Axis") axis_ = std::string(e->value.text.substr(0, 100));
      if (e && e->key == "TITLE") title_ = std::string(e->value.text.substr(0, 100));
    }
  }

  void read_runs() {
    for (; in_section(); line_ = lines_.next()) {
      const auto e = entry();
      if (e && e->key == "Run-count") runs_ = lines_.count_in(e->value, 1, most_runs);
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

  /// One row; `before` holds the last target of each run, `way` where the run is going.
  void add_reading(std::vector<int>& before, std::vector<int>& way) {
    const std::vector<Cell> cells = cells_of(line_->text, ' ', 3);
    if (cells.size() != 3) refuse_line("a row: run, target, deviation");
    const int run = lines_.count_in(cells[0], 1, runs_);
    const int target = lines_.count_in(cells[1], 1, int(targets_.size()));
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

  /// Runs back that were only filled with zeros, where the file says that it has one direction.
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

PositionSet read_rtl(std::string_view text, const std::string& file,
                     const PositionFileOptions& options) {
  check_size(text, file, options);
  return RtlReader(text, file, options).read();
}

}  // namespace abbe::errors::metrology
