#include "sim/program/program_writers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "kinematics/table_file.h"
#include "kinematics/units.h"
#include "sim/program/block_motion.h"

namespace abbe::sim::program {

using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Motion;

std::string nc_number(double value, int decimals) {
  std::string text = fmt::format("{:.{}f}", value, decimals);
  if (text.find('.') != std::string::npos) {
    text.erase(text.find_last_not_of('0') + 1);
    if (text.back() == '.') text.pop_back();
  }
  // A rounded negative zero would be written as a motion to "-0".
  return text == "-0" ? "0" : text;
}

std::string nc_number(double value) {
  const std::string shortest = fmt::format("{}", value);
  if (shortest.find('e') == std::string::npos) return shortest;
  // 17 significant digits preserve the bits of any double, however small.
  int decimals = 17;
  for (double size = std::abs(value); size < 1.0 && size > 0.0; size *= 10) ++decimals;
  return nc_number(value, decimals);
}

std::string nc_significant(double value, int digits) {
  if (value == 0.0) return "0";
  const int integer_digits = int(std::floor(std::log10(std::abs(value)))) + 1;
  // Surplus digits before the decimal point are rounded to zeros.
  if (integer_digits <= digits) return nc_number(value, digits - integer_digits);
  const double step = std::pow(10.0, integer_digits - digits);
  return nc_number(std::round(value / step) * step, 0);
}

std::string write_nc(std::span<const NcItem> items, std::span<const ControlledAxis> axes,
                     const NcWriteOptions& options) {
  std::string text;
  std::vector<std::string> words_in_force(axes.size());
  std::string feed_in_force;
  const auto write = [&](const NcMove& move) {
    text += move.rapid ? "G0" : !move.arc ? "G1" : move.arc->clockwise ? "G2" : "G3";
    for (std::size_t j = 0; j < axes.size(); ++j) {
      const bool linear = axes[j].motion == kinematics::Motion::Linear;
      if (axes[j].motion == kinematics::Motion::Spindle || axes[j].name == 'S') continue;
      const double value = linear ? move.to[int(j)] : move.to[int(j)] / units::deg;
      std::string word =
          nc_number(value, linear ? options.format.decimals_mm : options.format.decimals_deg);
      if (word == words_in_force[j]) continue;
      text += fmt::format(" {}{}", axes[j].name, word);
      words_in_force[j] = std::move(word);
    }
    if (move.arc)
      for (std::size_t k = 0; k < 2; ++k)
        text += fmt::format(" {}{}", move.arc->letters[k],
                            nc_number(move.arc->centre[int(k)], options.format.decimals_mm));
    if (!move.rapid) {
      std::string feed = options.feed_digits > 0 ? nc_significant(move.feed, options.feed_digits)
                                                 : nc_number(move.feed);
      if (options.inverse_time || feed != feed_in_force) text += " F" + feed;
      feed_in_force = std::move(feed);
    }
    text += '\n';
  };
  for (const NcItem& item : items) {
    // After a line of text, which may change units or modes, every word is stated again.
    if (const auto* line = std::get_if<std::string>(&item)) {
      text += *line + '\n';
      words_in_force.assign(axes.size(), {});
      feed_in_force.clear();
    } else {
      write(std::get<NcMove>(item));
    }
  }
  return text;
}

namespace {

constexpr double min_tip_travel = 1e-9;         // mm; with less the tip is at rest
constexpr double max_radius_difference = 1e-7;  // mm, tolerance for equal radii along an arc
constexpr double max_still_rotation = 1e-12;    // rad
constexpr double min_rpm = 1e-6;                // smallest spindle speed that is written as turning

std::string vector_text(const Vector3d& v, int decimals) {
  return nc_number(v.x(), decimals) + "," + nc_number(v.y(), decimals) + "," +
         nc_number(v.z(), decimals);
}

/// A circle in the workpiece.
struct Circle {
  Vector3d centre, axis;
  double radius = 0.0;
};

/// Returns the circle through points at equal steps of `angle`, rad; nothing if they are on no
/// circle. Second differences of such points point to the centre.
std::optional<Circle> fit_circle(const std::array<Vector3d, 4>& p, double angle) {
  const double curvature_factor = 2 - 2 * std::cos(angle);
  const Vector3d arm = (2 * p[1] - p[0] - p[2]) / curvature_factor;
  const Vector3d next_arm = (2 * p[2] - p[1] - p[3]) / curvature_factor;
  const Vector3d normal = arm.cross(next_arm);
  if (!(normal.norm() > 0.0) || std::abs(arm.norm() - next_arm.norm()) > max_radius_difference)
    return std::nullopt;
  return Circle{p[1] - arm, normal.normalized(), arm.norm()};
}

}  // namespace

LocationWriter::LocationWriter(const kinematics::Chain& control, const LocationOptions& options)
    : control_(control), options_(options), axes_(controlled_axes(control)) {
  spindle_ = find_spindle(axes_);
  text_ = is_table() ? "x,y,z,i,j,k,feed\n" : "UNITS/MM\nMULTAX/ON\n";
}

std::string LocationWriter::take() { return std::exchange(text_, {}); }

LocationWriter::TipPose LocationWriter::tip_pose(const Path& path, const Block& block,
                                                 double u) const {
  const kinematics::Pose T_wt = control_.tool_in_workpiece(axes_at(path, block, control_, u));
  return {T_wt.translation(), T_wt.linear().col(2)};
}

/// Returns true if the tip moves on a straight line, whatever the rotary axes do.
bool LocationWriter::is_straight(const Path& path, const Block& block) const {
  if (block.interpolation != Interpolation::Line && block.interpolation != Interpolation::Rapid)
    return false;
  return block.coordinates == Coordinates::Tip ||
         total_rotation(path, block, control_) < max_still_rotation;
}

void LocationWriter::write_auxiliary_words(const Path& path, std::size_t block_index,
                                           std::size_t& next_word) {
  for (; next_word < path.auxiliary_words.size() &&
         path.auxiliary_words[next_word].before <= block_index;
       ++next_word) {
    const std::string& text = path.auxiliary_words[next_word].text;
    if (is_table()) {
      ++words_;
      continue;
    }
    // CL statements separate the selection of a tool from its change.
    const bool changes_tool = text.find("M6") != std::string::npos;
    if (text.starts_with('T'))
      text_ += (changes_tool ? "LOADTL/" : "SELCTL/") + text.substr(1, text.find(' ') - 1) + "\n";
    for (const auto& [word, statement] : {std::pair{"M7", "COOLNT/MIST\n"},
                                          {"M8", "COOLNT/ON\n"},
                                          {"M9", "COOLNT/OFF\n"},
                                          {"M0", "STOP\n"},
                                          {"M1", "OPSTOP\n"}})
      if (text.find(word) != std::string::npos) text_ += statement;
  }
}

void LocationWriter::spindle(const Block& block) {
  if (spindle_ < 0 || is_table() || !(block.end_s > block.start_s)) return;
  const double rpm =
      (block.end[spindle_] - block.start[spindle_]) / (block.end_s - block.start_s) / units::rpm;
  const std::string speed =
      std::abs(rpm) < min_rpm
          ? "SPINDL/OFF"
          : fmt::format("SPINDL/{:.6g},RPM,{}", std::abs(rpm), rpm > 0 ? "CLW" : "CCLW");
  // A program that never turns the spindle gets no statement about it.
  if (speed == speed_ || (speed_.empty() && speed == "SPINDL/OFF")) return;
  speed_ = speed;
  text_ += speed + "\n";
}

void LocationWriter::feed(const std::string& word) {
  if (word != feed_ && !is_table()) text_ += "FEDRAT/" + word + ",MMPM\n";
  feed_ = word;
}

void LocationWriter::point(const TipPose& pose) {
  const std::string tip = vector_text(pose.tip, options_.decimals_mm);
  const std::string vector = vector_text(pose.axis, options_.decimals_vector);
  if (is_table()) {
    text_ += tip + "," + vector + "," + feed_ + "\n";
    return;
  }
  text_ += "GOTO/" + tip + (vector == vector_ ? "" : "," + vector) + "\n";
  vector_ = vector;
}

/// Returns the value of F: the speed of the tip, or of the rotary axes in degrees if the tip is at
/// rest.
std::string LocationWriter::feed_word(const Path& path, const Block& block, double from, double to,
                                      double tip_travel) {
  if (!(tip_travel > min_tip_travel)) {
    kinematics::AxisVector a = position(path, block, from), b = position(path, block, to);
    for (int j = 0; j < int(a.size()); ++j)
      if (axes_[std::size_t(j)].motion == Motion::Linear) b[j] = a[j];
    tip_travel = feed_length(axes_, a, b).length;
  }
  const double minutes = (to - from) * (block.end_s - block.start_s) / 60.0;
  // 1e-6 keeps the feed positive; 9 digits preserve the time to 1e-9.
  return nc_significant(std::max(tip_travel / minutes, 1e-6), 9);
}

void LocationWriter::write_line(const Path& path, const Block& block, double from, double to) {
  const TipPose pose = tip_pose(path, block, to);
  if (block.interpolation == Interpolation::Rapid) {
    if (!is_table()) text_ += "RAPID\n";
    // A row of a rapid has "rapid" in the feed column and leaves the feed in force.
    const std::string feed_in_force = std::exchange(feed_, is_table() ? "rapid" : feed_);
    point(pose);
    feed_ = feed_in_force;
    return;
  }
  const double tip_travel = (pose.tip - tip_pose(path, block, from).tip).norm();
  feed(feed_word(path, block, from, to, tip_travel));
  point(pose);
}

/// Writes MOVARC/ if the tip moves on a circle or a helix. Returns false and writes nothing if not.
bool LocationWriter::arc(const Path& path, const Block& block) {
  const Arc& arc = path.arcs[block.shape];
  const bool has_rotation = block.coordinates == Coordinates::Axis &&
                            total_rotation(path, block, control_) >= max_still_rotation;
  if (is_table() || has_rotation || std::abs(arc.growth) > max_radius_difference) return false;
  const double sweep = std::abs(arc.sweep);
  // An arc that bends by less than a thousandth of the tolerance is a line.
  if (arc.radius * sweep * sweep < 8 * options_.within * 1e-3) return false;
  // Steps of at most 0.5 rad, so that the second differences stay well conditioned.
  const double step = std::min(0.5, 0.33 * sweep);
  std::array<Vector3d, 4> p;
  for (std::size_t k = 0; k < 4; ++k) p[k] = tip_pose(path, block, double(k) * step / sweep).tip;
  const auto circle = fit_circle(p, step);
  if (!circle) return false;
  const Vector3d rise = circle->axis * circle->axis.dot(tip_pose(path, block, 1.0).tip - p[0]);
  const double tip_travel = std::hypot(circle->radius * sweep, rise.norm());
  feed(feed_word(path, block, 0.0, 1.0, tip_travel));
  text_ += "MOVARC/" + vector_text(circle->centre, options_.decimals_mm) + "," +
           vector_text(circle->axis, options_.decimals_vector) + "," +
           nc_number(circle->radius, options_.decimals_mm) + ",ANGLE," +
           nc_number(sweep / units::deg, options_.decimals_vector) + "\n";
  point(tip_pose(path, block, 1.0));
  return true;
}

// Arcs stay arcs if the format has them; other curved moves are divided into chords.
void LocationWriter::block(const Path& path, const Block& block) {
  spindle(block);
  if (block.interpolation == Interpolation::Dwell) {
    if (is_table())
      ++dwells_;
    else
      text_ += "DELAY/" + nc_significant(block.end_s - block.start_s, 12) + "\n";
    return;
  }
  if (block.interpolation == Interpolation::Arc && arc(path, block)) return;
  const std::size_t n =
      is_straight(path, block) ? 1 : chords_of(path, block, control_, options_.within);
  for (std::size_t k = 0; k < n; ++k) {
    write_line(path, block, double(k) / double(n), k + 1 == n ? 1.0 : double(k + 1) / double(n));
    if (text_.size() > options_.max_bytes)
      throw BadInput(path.file, block.line, 0,
                     fmt::format("at most {} bytes of cutter locations within {:.4g} um",
                                 options_.max_bytes, options_.within / units::um),
                     "more; a larger tolerance gives fewer");
  }
}

void LocationWriter::add(const Path& path) {
  std::size_t next_word = 0;
  for (std::size_t i = 0; i < path.blocks.size(); ++i) {
    write_auxiliary_words(path, i, next_word);
    block(path, path.blocks[i]);
  }
  write_auxiliary_words(path, path.blocks.size(), next_word);
}

namespace {

void check_pvt_header(const TableFile& header) {
  if (header.order.size() < 2) header.throw_missing_column("columns for at least one axis");
  // Each axis needs a position and a velocity column, without which its cubic is undefined.
  for (const std::size_t column : header.order)
    if (column > 0 && !header.has(column % 2 == 1 ? column + 1 : column - 1))
      header.throw_column_error(column, "a position and a velocity column for each axis");
}

/// Returns the schema of a PVT file: time_s, then the position and the velocity of each axis.
TableSchema pvt_schema(const NcOptions& options) {
  // 1e12: products of two such numbers stay finite.
  TableSchema schema{.header = "time_s",
                     .separators = ",",
                     .max_exponent = 12,
                     .max_bytes = options.max_bytes,
                     .min_rows = 2};
  schema.check_header = check_pvt_header;
  schema.columns.push_back({.names = {{"time_s"}}, .increasing = true});
  for (const ControlledAxis& axis : options.axes)
    for (const char* rate : {"", "_per_s"}) {
      TableColumn column{.required = false};
      if (axis.motion == Motion::Linear)
        column.names = {{fmt::format("{}_mm{}", axis.name, rate)}};
      else
        column.names = {{fmt::format("{}_deg{}", axis.name, rate), units::deg},
                        {fmt::format("{}_rad{}", axis.name, rate)}};
      schema.header += "," + column.names.front().head;
      schema.columns.push_back(std::move(column));
    }
  return schema;
}

/// Returns the row of a table. Axes without columns stay at their start.
PvtRow pvt_row(const TableFile& table, std::size_t i, const AxisVector& start) {
  PvtRow row{table.value(i, 0), start, AxisVector::Zero(start.size())};
  for (Eigen::Index j = 0; j < start.size(); ++j) {
    const std::size_t column = 1 + 2 * std::size_t(j);
    if (!table.has(column)) continue;
    row.position[j] = table.value(i, column);
    row.velocity[j] = table.value(i, column + 1);
  }
  return row;
}

Block pvt_block(const PvtRow& from, const PvtRow& to, int line) {
  Block block;
  block.line = line;
  block.interpolation = Interpolation::Cubic;
  // Positions are those of the axes: no work offset applies.
  block.work_offset = -1;
  block.start_s = from.time_s;
  block.end_s = to.time_s;
  block.start = from.position;
  block.end = to.position;
  return block;
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
  const TableFile table = read_table(text, file, pvt_schema(options));
  Path path;
  path.file = file;
  const AxisVector start = initial_position(options);
  PvtRow last_row = pvt_row(table, 0, start);
  for (std::size_t i = 1; i < table.rows(); ++i) {
    PvtRow row = pvt_row(table, i, start);
    Block block = pvt_block(last_row, row, table.line[i]);
    block.shape = std::uint32_t(path.cubics.size());
    path.blocks.push_back(std::move(block));
    path.cubics.push_back({last_row.velocity, row.velocity});
    ++path.motion_blocks;
    last_row = std::move(row);
  }
  return path;
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
                     "more; a larger tolerance gives fewer");
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
  if (conversion.rows.size() < 2) throw BadInput(path.file, 0, 0, "a program with motion", "none");
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
