#include "sim/program/pvt.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/program/block_motion.h"

namespace abbe::sim::program {

using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Motion;

namespace {

// mm, rad, s and their rates; products of two such values stay finite
constexpr double largest_value = 1e12;

/// Content of a column: one quantity of one axis, and its unit in mm, rad or s.
struct Column {
  enum class Kind { Time, Position, Velocity } kind = Kind::Time;
  int joint = 0;
  double unit = 1.0;
};

// Reads a PVT file line by line; every row after the first completes a cubic block.
class Reader {
 public:
  Reader(const std::string& file, const NcOptions& options)
      : options_(options), start_(start_of(options)) {
    path_.file = file;
  }

  void read_line(std::string_view text, int line);
  Path finish(int last_line);

 private:
  [[noreturn]] void refuse(const Cell& cell, std::string expected) const {
    throw BadInput(path_.file, line_, cell.column, std::move(expected),
                   cell.text.empty() ? "nothing" : shown(cell.text));
  }
  void read_head(const std::vector<Cell>& head);
  Column column(const Cell& cell) const;
  void check_head(const std::vector<Cell>& head) const;
  void read_row(std::string_view text);
  double number(const Cell& cell) const;
  void append(PvtRow row);
  std::string known_columns() const;

  const NcOptions& options_;
  Path path_;
  int line_ = 0;
  AxisVector start_;
  std::vector<Column> columns_;
  std::optional<PvtRow> last_;
};

std::string Reader::known_columns() const {
  std::string names = "time_s";
  for (const ControlledAxis& axis : options_.axes)
    names += fmt::format(" {0}_{1} {0}_{1}_per_s", axis.name,
                         axis.motion == Motion::Linear ? "mm" : "deg");
  return names;
}

Column Reader::column(const Cell& cell) const {
  if (cell.text == "time_s") return {Column::Kind::Time, -1, 1.0};
  for (std::size_t j = 0; j < options_.axes.size(); ++j) {
    const ControlledAxis& axis = options_.axes[j];
    if (cell.text.size() < 4 || cell.text[0] != axis.name || cell.text[1] != '_') continue;
    std::string_view unit = cell.text.substr(2);
    const bool rate = unit.ends_with("_per_s");
    if (rate) unit.remove_suffix(6);
    const auto kind = rate ? Column::Kind::Velocity : Column::Kind::Position;
    if (axis.motion == Motion::Linear && unit == "mm") return {kind, int(j), 1.0};
    if (axis.motion != Motion::Linear && unit == "deg") return {kind, int(j), units::deg};
    if (axis.motion != Motion::Linear && unit == "rad") return {kind, int(j), 1.0};
  }
  refuse(cell, "a column of " + known_columns());
}

// Each axis needs both a position and a velocity column: without one the cubic is undefined.
void Reader::check_head(const std::vector<Cell>& head) const {
  bool time = false;
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    time = time || columns_[i].kind == Column::Kind::Time;
    bool partner = columns_[i].kind == Column::Kind::Time;
    for (std::size_t k = 0; k < columns_.size(); ++k) {
      if (columns_[k].joint != columns_[i].joint) continue;
      if (k < i && columns_[k].kind == columns_[i].kind) refuse(head[i], "every column once");
      partner = partner || columns_[k].kind != columns_[i].kind;
    }
    if (!partner) refuse(head[i], "a position and a velocity column for each axis");
  }
  if (!time) refuse(head.front(), "a column time_s");
  if (columns_.size() < 3) refuse(head.front(), "columns for at least one axis");
}

void Reader::read_head(const std::vector<Cell>& head) {
  // More cells than any header can have: stops before a hostile line is taken apart.
  if (head.size() > 1 + 2 * options_.axes.size())
    refuse(head[1 + 2 * options_.axes.size()], "the end of the line");
  for (const Cell& cell : head) columns_.push_back(column(cell));
  check_head(head);
}

double Reader::number(const Cell& cell) const {
  double value = 0.0;
  const char* end = cell.text.data() + cell.text.size();
  const auto read = std::from_chars(cell.text.data(), end, value);
  if (cell.text.empty() || read.ec != std::errc() || read.ptr != end) refuse(cell, "a number");
  if (!(std::abs(value) <= largest_value)) refuse(cell, "a number of at most 1e12");
  return value;
}

void Reader::read_row(std::string_view text) {
  // Axes without columns rest at their start.
  PvtRow row{0.0, start_, AxisVector::Zero(start_.size())};
  const std::vector<Cell> row_cells = cells_of(text, ',', columns_.size());
  if (row_cells.size() != columns_.size())
    throw BadInput(
        path_.file, line_, row_cells.back().column, fmt::format("{} numbers", columns_.size()),
        row_cells.size() < columns_.size() ? fmt::format("{}", row_cells.size()) : "more");
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    const double value = number(row_cells[i]) * columns_[i].unit;
    switch (columns_[i].kind) {
      case Column::Kind::Time:
        row.time_s = value;
        if (last_ && !(value > last_->time_s))
          refuse(row_cells[i], fmt::format("a time after {} s", last_->time_s));
        break;
      case Column::Kind::Position:
        row.position[columns_[i].joint] = value;
        break;
      case Column::Kind::Velocity:
        row.velocity[columns_[i].joint] = value;
        break;
    }
  }
  append(std::move(row));
}

void Reader::append(PvtRow row) {
  if (last_) {
    Block block;
    block.line = line_;
    block.interpolation = Interpolation::Cubic;
    // Positions are those of the axes: no work offset applies.
    block.work_offset = -1;
    block.start_s = last_->time_s;
    block.end_s = row.time_s;
    block.start = last_->position;
    block.end = row.position;
    block.shape = std::uint32_t(path_.cubics.size());
    path_.blocks.push_back(std::move(block));
    path_.cubics.push_back({last_->velocity, row.velocity});
    ++path_.motion_blocks;
  }
  last_ = std::move(row);
}

void Reader::read_line(std::string_view text, int line) {
  line_ = line;
  // A NUL byte is reported as such; as part of a cell it would not be visible in the message.
  if (const std::size_t nul = text.find('\0'); nul != std::string_view::npos)
    throw BadInput(path_.file, line, int(nul) + 1, "text", "a NUL byte");
  const std::size_t first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos || text[first] == '#') return;
  if (columns_.empty())
    read_head(cells_of(text, ',', 1 + 2 * options_.axes.size()));
  else
    read_row(text);
}

Path Reader::finish(int last_line) {
  if (columns_.empty())
    throw BadInput(path_.file, std::max(last_line, 1), 1, "a head time_s,...",
                   "the end of the file");
  if (path_.blocks.empty())
    throw BadInput(path_.file, last_line, 1, "at least two rows", "the end of the file");
  return std::move(path_);
}

// Mean rate between two rows.
AxisVector chord(const PvtRow& a, const PvtRow& b) {
  return (b.position - a.position) / (b.time_s - a.time_s);
}

}  // namespace

// The parabola through three rows weights each chord with the length of the other interval. At the
// ends its slope is twice the chord minus the inner slope, and two rows have only their chord.
std::vector<AxisVector> rates(std::span<const PvtRow> rows) {
  const std::size_t n = rows.size();
  std::vector<AxisVector> rates(n, AxisVector::Zero(rows.front().position.size()));
  for (std::size_t k = 1; k + 1 < n; ++k) {
    const double before = rows[k].time_s - rows[k - 1].time_s,
                 after = rows[k + 1].time_s - rows[k].time_s;
    rates[k] = (chord(rows[k - 1], rows[k]) * after + chord(rows[k], rows[k + 1]) * before) /
               (before + after);
  }
  if (n == 2) rates[0] = rates[1] = chord(rows[0], rows[1]);
  if (n > 2) {
    rates[0] = 2 * chord(rows[0], rows[1]) - rates[1];
    rates[n - 1] = 2 * chord(rows[n - 2], rows[n - 1]) - rates[n - 2];
  }
  return rates;
}

Path read_pvt(std::string_view text, const std::string& file, const NcOptions& options) {
  if (text.size() > options.max_bytes)
    throw BadInput(file, 0, 0, fmt::format("at most {} bytes", options.max_bytes),
                   fmt::format("{}", text.size()));
  check_encoding(text, file);
  Reader reader(file, options);
  Lines lines(text);
  while (const auto line = lines.next()) reader.read_line(*line, lines.number());
  return reader.finish(lines.number());
}

Path read_pvt_file(const std::filesystem::path& file, const NcOptions& options) {
  return read_pvt(read_text(file, options.max_bytes), file.string(), options);
}

std::string write_pvt(std::span<const PvtRow> rows, std::span<const ControlledAxis> axes,
                      std::span<const int> columns) {
  const auto unit = [&](int j) {
    return axes[std::size_t(j)].motion == Motion::Linear ? "mm" : "rad";
  };
  std::string text = "time_s";
  for (const int j : columns) text += fmt::format(",{}_{}", axes[std::size_t(j)].name, unit(j));
  for (const int j : columns)
    text += fmt::format(",{}_{}_per_s", axes[std::size_t(j)].name, unit(j));
  text += '\n';
  for (const PvtRow& row : rows) {
    text += fmt::format("{}", row.time_s);
    for (const int j : columns) text += fmt::format(",{}", row.position[j]);
    for (const int j : columns) text += fmt::format(",{}", row.velocity[j]);
    text += '\n';
  }
  return text;
}

std::vector<PvtRow> pvt_rows(const Path& path) {
  std::vector<PvtRow> rows;
  for (const Block& block : path.blocks) {
    if (block.interpolation != Interpolation::Cubic)
      throw std::invalid_argument("expected a path of cubics only");
    const Cubic& cubic = path.cubics[block.shape];
    if (rows.empty()) rows.push_back({block.start_s, block.start, cubic.start_velocity});
    rows.push_back({block.end_s, block.end, cubic.end_velocity});
  }
  return rows;
}

namespace {

/// Distance between two positions, mm, spindles excluded.
double distance(const Chain& control, const AxisVector& a, const AxisVector& b, double lever) {
  double squared = 0.0;
  for (int j = 0; j < control.size(); ++j) {
    const auto& joint = control.joints()[std::size_t(j)];
    if (joint.motion == Motion::Spindle || joint.name == 'S') continue;
    const double way = (b[j] - a[j]) * (joint.motion == Motion::Linear ? 1.0 : lever);
    squared += way * way;
  }
  return std::sqrt(squared);
}

/// A block with its number of equal parts and its speed at start and end, mm/s.
struct Parts {
  std::size_t block = 0, n = 1;
  double seconds = 0.0, first_speed = 0.0, last_speed = 0.0;
};

std::vector<Parts> parts_of(const Path& path, const Chain& control,
                            const PvtConversionOptions& options) {
  std::vector<Parts> all;
  double rows = 1.0;
  for (std::size_t i = 0; i < path.blocks.size(); ++i) {
    const Block& block = path.blocks[i];
    // Blocks without duration have no rows; a jump is covered by the cubic to the next row.
    if (!(block.end_s > block.start_s)) continue;
    Parts parts{i, chords_of(path, block, control, options.within), block.end_s - block.start_s};
    const double n = double(parts.n);
    // Two additional rows stand beside the corners at the ends.
    rows += n + 2.0;
    if (rows > double(options.max_rows))
      throw BadInput(path.file, block.line, 0,
                     fmt::format("a program of at most {} rows within {:.4g} um", options.max_rows,
                                 options.within / units::um),
                     "more; a larger tolerance needs fewer");
    const auto speed = [&](double from, double to) {
      return distance(control, axes_at(path, block, control, from),
                      axes_at(path, block, control, to), options.lever) *
             n / parts.seconds;
    };
    if (block.interpolation != Interpolation::Dwell) {
      parts.first_speed = speed(0.0, 1.0 / n);
      parts.last_speed = speed(1.0 - 1.0 / n, 1.0);
    }
    all.push_back(parts);
  }
  return all;
}

/// Returns the fraction of a block between a corner and the adjacent row: in that time the tool
/// moves at most by `within`, at the higher speed of the two moves that meet.
double beside(const Parts& parts, double speed_before, double speed_after, double within) {
  const double speed = std::max(speed_before, speed_after);
  // At most a quarter of a part, so that the rows of both ends keep their order.
  const double most = 0.25 / double(parts.n);
  return speed > 0.0 ? std::min(most, within / speed / parts.seconds) : most;
}

/// Fractions of a block at which rows stand, ascending, the last one 1.
std::vector<double> row_fractions(const std::vector<Parts>& all, std::size_t i, double within) {
  const Parts& parts = all[i];
  const double before = i > 0 ? all[i - 1].last_speed : 0.0;
  const double after = i + 1 < all.size() ? all[i + 1].first_speed : 0.0;
  std::vector<double> u{beside(parts, before, parts.first_speed, within)};
  for (std::size_t k = 1; k < parts.n; ++k) u.push_back(double(k) / double(parts.n));
  u.push_back(1.0 - beside(parts, parts.last_speed, after, within));
  u.push_back(1.0);
  return u;
}

/// Position on the Hermite cubic between two rows at fraction u of their time.
AxisVector cubic_at(const PvtRow& a, const PvtRow& b, double u) {
  const double T = b.time_s - a.time_s;
  const AxisVector way = b.position - a.position;
  return a.position + u * way +
         u * (1 - u) * ((1 - u) * (T * a.velocity - way) - u * (T * b.velocity - way));
}

}  // namespace

PvtConversion convert_to_pvt(const Path& path, const Chain& control,
                             const PvtConversionOptions& options) {
  PvtConversion made;
  std::vector<std::size_t> block_of;  // of the interval that ends at a row
  const std::vector<Parts> parts = parts_of(path, control, options);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const Block& block = path.blocks[parts[i].block];
    if (i == 0) {
      made.rows.push_back({block.start_s, axes_at(path, block, control, 0.0), {}});
      block_of.push_back(parts[i].block);
    }
    for (const double u : row_fractions(parts, i, options.within)) {
      const double time_s = u == 1.0 ? block.end_s : block.start_s + u * parts[i].seconds;
      // Rows at the same time as the last are dropped: a file needs increasing times.
      if (!(time_s > made.rows.back().time_s)) continue;
      made.rows.push_back({time_s, axes_at(path, block, control, u), {}});
      block_of.push_back(parts[i].block);
    }
  }
  if (made.rows.size() < 2) throw BadInput(path.file, 0, 0, "a program that moves", "none");
  const std::vector<AxisVector> velocities = rates(made.rows);
  for (std::size_t k = 0; k < made.rows.size(); ++k) made.rows[k].velocity = velocities[k];
  for (std::size_t k = 1; k < made.rows.size(); ++k) {
    const PvtRow &a = made.rows[k - 1], &b = made.rows[k];
    const Block& block = path.blocks[block_of[k]];
    // The deviation of a cubic from its curve is largest near its middle or quarters; the ends are
    // exact.
    for (const double u : {0.25, 0.5, 0.75}) {
      const double time_s = a.time_s + u * (b.time_s - a.time_s);
      const double at = (time_s - block.start_s) / (block.end_s - block.start_s);
      made.off = std::max(made.off, distance(control, axes_at(path, block, control, at),
                                             cubic_at(a, b, u), options.lever));
    }
  }
  return made;
}

}  // namespace abbe::sim::program
