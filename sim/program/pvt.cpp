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
constexpr double max_value = 1e12;

/// The quantity, the axis and the unit (in mm, rad or s) of a column.
struct Column {
  enum class Kind { Time, Position, Velocity } kind = Kind::Time;
  int joint = 0;
  double unit = 1.0;
};

/// Reads a PVT file line by line. Every row after the first completes a cubic block.
class PvtReader {
 public:
  PvtReader(const std::string& file, const NcOptions& options)
      : options_(options), start_(initial_position(options)) {
    path_.file = file;
  }

  void read_line(std::string_view text, int line);
  Path finish(int last_line);

 private:
  [[noreturn]] void throw_input_error(const Cell& cell, std::string expected) const {
    throw BadInput(path_.file, line_, cell.column, std::move(expected),
                   cell.text.empty() ? "nothing" : shown(cell.text));
  }
  void read_header(const std::vector<Cell>& header);
  Column column(const Cell& cell) const;
  void check_header(const std::vector<Cell>& header) const;
  void read_row(std::string_view text);
  double number(const Cell& cell) const;
  void append(PvtRow row);
  std::string known_columns() const;

  const NcOptions& options_;
  Path path_;
  int line_ = 0;
  AxisVector start_;
  std::vector<Column> columns_;
  std::optional<PvtRow> last_row_;
};

std::string PvtReader::known_columns() const {
  std::string names = "time_s";
  for (const ControlledAxis& axis : options_.axes)
    names += fmt::format(" {0}_{1} {0}_{1}_per_s", axis.name,
                         axis.motion == Motion::Linear ? "mm" : "deg");
  return names;
}

// A column is named after its axis and unit, such as X_mm or S_deg_per_s.
Column PvtReader::column(const Cell& cell) const {
  if (cell.text == "time_s") return {Column::Kind::Time, -1, 1.0};
  for (std::size_t j = 0; j < options_.axes.size(); ++j) {
    const ControlledAxis& axis = options_.axes[j];
    if (cell.text.size() < 4 || cell.text[0] != axis.name || cell.text[1] != '_') continue;
    std::string_view unit = cell.text.substr(2);
    const bool is_velocity = unit.ends_with("_per_s");
    if (is_velocity) unit.remove_suffix(6);
    const auto kind = is_velocity ? Column::Kind::Velocity : Column::Kind::Position;
    if (axis.motion == Motion::Linear && unit == "mm") return {kind, int(j), 1.0};
    if (axis.motion != Motion::Linear && unit == "deg") return {kind, int(j), units::deg};
    if (axis.motion != Motion::Linear && unit == "rad") return {kind, int(j), 1.0};
  }
  throw_input_error(cell, "a column of " + known_columns());
}

// Each axis needs a position and a velocity column, without which its cubic is undefined.
void PvtReader::check_header(const std::vector<Cell>& header) const {
  bool has_time = false;
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    has_time = has_time || columns_[i].kind == Column::Kind::Time;
    bool has_partner = columns_[i].kind == Column::Kind::Time;
    for (std::size_t k = 0; k < columns_.size(); ++k) {
      if (columns_[k].joint != columns_[i].joint) continue;
      if (k < i && columns_[k].kind == columns_[i].kind)
        throw_input_error(header[i], "every column once");
      has_partner = has_partner || columns_[k].kind != columns_[i].kind;
    }
    if (!has_partner)
      throw_input_error(header[i], "a position and a velocity column for each axis");
  }
  if (!has_time) throw_input_error(header.front(), "a column time_s");
  if (columns_.size() < 3) throw_input_error(header.front(), "columns for at least one axis");
}

void PvtReader::read_header(const std::vector<Cell>& header) {
  // No header can have more cells. Reading stops here before a hostile line is split further.
  if (header.size() > 1 + 2 * options_.axes.size())
    throw_input_error(header[1 + 2 * options_.axes.size()], "the end of the line");
  for (const Cell& cell : header) columns_.push_back(column(cell));
  check_header(header);
}

double PvtReader::number(const Cell& cell) const {
  double value = 0.0;
  const char* end = cell.text.data() + cell.text.size();
  const auto result = std::from_chars(cell.text.data(), end, value);
  if (cell.text.empty() || result.ec != std::errc() || result.ptr != end)
    throw_input_error(cell, "a number");
  if (!(std::abs(value) <= max_value)) throw_input_error(cell, "a number of at most 1e12");
  return value;
}

void PvtReader::read_row(std::string_view text) {
  // Axes without columns stay at their start.
  PvtRow row{0.0, start_, AxisVector::Zero(start_.size())};
  const std::vector<Cell> cells = split_cells(text, ',', columns_.size());
  if (cells.size() != columns_.size())
    throw BadInput(path_.file, line_, cells.back().column,
                   fmt::format("{} numbers", columns_.size()),
                   cells.size() < columns_.size() ? fmt::format("{}", cells.size()) : "more");
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    const double value = number(cells[i]) * columns_[i].unit;
    switch (columns_[i].kind) {
      case Column::Kind::Time:
        row.time_s = value;
        if (last_row_ && !(value > last_row_->time_s))
          throw_input_error(cells[i], fmt::format("a time after {} s", last_row_->time_s));
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

void PvtReader::append(PvtRow row) {
  if (last_row_) {
    Block block;
    block.line = line_;
    block.interpolation = Interpolation::Cubic;
    // Positions are those of the axes: no work offset applies.
    block.work_offset = -1;
    block.start_s = last_row_->time_s;
    block.end_s = row.time_s;
    block.start = last_row_->position;
    block.end = row.position;
    block.shape = std::uint32_t(path_.cubics.size());
    path_.blocks.push_back(std::move(block));
    path_.cubics.push_back({last_row_->velocity, row.velocity});
    ++path_.motion_blocks;
  }
  last_row_ = std::move(row);
}

void PvtReader::read_line(std::string_view text, int line) {
  line_ = line;
  // As part of a cell a NUL byte would not be visible in the message.
  if (const std::size_t nul = text.find('\0'); nul != std::string_view::npos)
    throw BadInput(path_.file, line, int(nul) + 1, "text", "a NUL byte");
  const std::size_t first_character = text.find_first_not_of(" \t");
  if (first_character == std::string_view::npos || text[first_character] == '#') return;
  if (columns_.empty())
    read_header(split_cells(text, ',', 1 + 2 * options_.axes.size()));
  else
    read_row(text);
}

Path PvtReader::finish(int last_line) {
  if (columns_.empty())
    throw BadInput(path_.file, std::max(last_line, 1), 1, "a head time_s,...",
                   "the end of the file");
  if (path_.blocks.empty())
    throw BadInput(path_.file, last_line, 1, "at least two rows", "the end of the file");
  return std::move(path_);
}

/// Returns the mean rate between two rows.
AxisVector mean_rate(const PvtRow& a, const PvtRow& b) {
  return (b.position - a.position) / (b.time_s - a.time_s);
}

}  // namespace

// The parabola through three rows weights each chord with the length of the other interval. At the
// ends its slope is twice the chord minus the inner slope, and two rows have only their chord.
std::vector<AxisVector> parabola_rates(std::span<const PvtRow> rows) {
  const std::size_t n = rows.size();
  std::vector<AxisVector> velocities(n, AxisVector::Zero(rows.front().position.size()));
  for (std::size_t k = 1; k + 1 < n; ++k) {
    const double before = rows[k].time_s - rows[k - 1].time_s,
                 after = rows[k + 1].time_s - rows[k].time_s;
    velocities[k] =
        (mean_rate(rows[k - 1], rows[k]) * after + mean_rate(rows[k], rows[k + 1]) * before) /
        (before + after);
  }
  if (n == 2) velocities[0] = velocities[1] = mean_rate(rows[0], rows[1]);
  if (n > 2) {
    velocities[0] = 2 * mean_rate(rows[0], rows[1]) - velocities[1];
    velocities[n - 1] = 2 * mean_rate(rows[n - 2], rows[n - 1]) - velocities[n - 2];
  }
  return velocities;
}

// The cubic is written as the line plus its deviation, so that motion at constant speed stays
// straight up to the last bit.
AxisVector hermite_position(const PvtRow& a, const PvtRow& b, double u) {
  const double duration = b.time_s - a.time_s;
  const AxisVector displacement = b.position - a.position;
  return a.position + u * displacement +
         u * (1 - u) *
             ((1 - u) * (duration * a.velocity - displacement) -
              u * (duration * b.velocity - displacement));
}

Path read_pvt(std::string_view text, const std::string& file, const NcOptions& options) {
  if (text.size() > options.max_bytes)
    throw BadInput(file, 0, 0, fmt::format("at most {} bytes", options.max_bytes),
                   fmt::format("{}", text.size()));
  check_encoding(text, file);
  PvtReader reader(file, options);
  LineReader lines(text);
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

/// Returns the distance between two positions, mm, spindles excluded. Rotary axes count with
/// `lever`.
double weighted_distance(const Chain& control, const AxisVector& a, const AxisVector& b,
                         double lever) {
  double squared = 0.0;
  for (int j = 0; j < control.size(); ++j) {
    const auto& joint = control.joints()[std::size_t(j)];
    if (joint.motion == Motion::Spindle || joint.name == 'S') continue;
    const double displacement = (b[j] - a[j]) * (joint.motion == Motion::Linear ? 1.0 : lever);
    squared += displacement * displacement;
  }
  return std::sqrt(squared);
}

/// A block, its number of equal parts and its speed at start and end, mm/s.
struct BlockDivision {
  std::size_t block = 0, n = 1;
  double seconds = 0.0, first_speed = 0.0, last_speed = 0.0;
};

std::vector<BlockDivision> divide_blocks(const Path& path, const Chain& control,
                                         const PvtConversionOptions& options) {
  std::vector<BlockDivision> divisions;
  double rows = 1.0;
  for (std::size_t i = 0; i < path.blocks.size(); ++i) {
    const Block& block = path.blocks[i];
    // A block without duration has no rows; the cubic to the next row covers its jump.
    if (!(block.end_s > block.start_s)) continue;
    BlockDivision division{i, chords_of(path, block, control, options.within),
                           block.end_s - block.start_s};
    const double n = double(division.n);
    // Two further rows are next to the corners at the ends.
    rows += n + 2.0;
    if (rows > double(options.max_rows))
      throw BadInput(path.file, block.line, 0,
                     fmt::format("a program of at most {} rows within {:.4g} um", options.max_rows,
                                 options.within / units::um),
                     "more; a larger tolerance needs fewer");
    const auto speed = [&](double from, double to) {
      return weighted_distance(control, axes_at(path, block, control, from),
                               axes_at(path, block, control, to), options.lever) *
             n / division.seconds;
    };
    if (block.interpolation != Interpolation::Dwell) {
      division.first_speed = speed(0.0, 1.0 / n);
      division.last_speed = speed(1.0 - 1.0 / n, 1.0);
    }
    divisions.push_back(division);
  }
  return divisions;
}

/// Returns the fraction of a block between a corner and the adjacent row. In that time the tool
/// moves at most by `within` at the higher speed of the two moves that meet.
double corner_margin(const BlockDivision& division, double speed_before, double speed_after,
                     double within) {
  const double speed = std::max(speed_before, speed_after);
  // At most a quarter of a part, so that the rows of both ends keep their order.
  const double max_fraction = 0.25 / double(division.n);
  return speed > 0.0 ? std::min(max_fraction, within / speed / division.seconds) : max_fraction;
}

/// Returns the fractions of a block at which it has rows, in ascending order; the last one is 1.
std::vector<double> row_fractions(const std::vector<BlockDivision>& divisions, std::size_t i,
                                  double within) {
  const BlockDivision& division = divisions[i];
  const double before = i > 0 ? divisions[i - 1].last_speed : 0.0;
  const double after = i + 1 < divisions.size() ? divisions[i + 1].first_speed : 0.0;
  std::vector<double> u{corner_margin(division, before, division.first_speed, within)};
  for (std::size_t k = 1; k < division.n; ++k) u.push_back(double(k) / double(division.n));
  u.push_back(1.0 - corner_margin(division, division.last_speed, after, within));
  u.push_back(1.0);
  return u;
}

}  // namespace

PvtConversion convert_to_pvt(const Path& path, const Chain& control,
                             const PvtConversionOptions& options) {
  PvtConversion conversion;
  std::vector<std::size_t> row_blocks;  // block of the interval that ends at each row
  const std::vector<BlockDivision> divisions = divide_blocks(path, control, options);
  for (std::size_t i = 0; i < divisions.size(); ++i) {
    const Block& block = path.blocks[divisions[i].block];
    if (i == 0) {
      conversion.rows.push_back({block.start_s, axes_at(path, block, control, 0.0), {}});
      row_blocks.push_back(divisions[i].block);
    }
    for (const double u : row_fractions(divisions, i, options.within)) {
      const double time_s = u == 1.0 ? block.end_s : block.start_s + u * divisions[i].seconds;
      // A row at the time of the last one is dropped, because a file needs increasing times.
      if (!(time_s > conversion.rows.back().time_s)) continue;
      conversion.rows.push_back({time_s, axes_at(path, block, control, u), {}});
      row_blocks.push_back(divisions[i].block);
    }
  }
  if (conversion.rows.size() < 2) throw BadInput(path.file, 0, 0, "a program that moves", "none");
  const std::vector<AxisVector> velocities = parabola_rates(conversion.rows);
  for (std::size_t k = 0; k < conversion.rows.size(); ++k)
    conversion.rows[k].velocity = velocities[k];
  for (std::size_t k = 1; k < conversion.rows.size(); ++k) {
    const PvtRow &a = conversion.rows[k - 1], &b = conversion.rows[k];
    const Block& block = path.blocks[row_blocks[k]];
    // The deviation of a cubic from its curve is largest near its middle or quarters; the ends are
    // exact.
    for (const double u : {0.25, 0.5, 0.75}) {
      const double time_s = a.time_s + u * (b.time_s - a.time_s);
      const double block_fraction = (time_s - block.start_s) / (block.end_s - block.start_s);
      conversion.max_deviation =
          std::max(conversion.max_deviation,
                   weighted_distance(control, axes_at(path, block, control, block_fraction),
                                     hermite_position(a, b, u), options.lever));
    }
  }
  return conversion;
}

}  // namespace abbe::sim::program
