#include "sim/program/path_meter.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kinematics/inverse_kinematics.h"
#include "kinematics/units.h"
#include "sim/program/block_motion.h"
#include "sim/program/nc_options.h"

namespace abbe::sim::program {

using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Motion;

namespace {

constexpr double min_rotation = 1e-9;  // rad; a move of less counts as one without rotation
// mm or rad; a smaller gap between blocks is the rounding of a conversion between axes and tip.
constexpr double min_gap_after_conversion = 1e-9;
constexpr double search_tolerance = 1e-8;     // rad, of rotation at the minimum
constexpr double min_extreme_height = 1e-10;  // mm or rad; a smaller difference is no extreme
constexpr double golden_ratio = 0.6180339887498949;  // ratio of the golden section search

/// Returns the smallest singular value of the change of direction by two rotary axes, as an angle.
/// The product of both singular values is the norm of the cross product.
double min_direction_change(const Vector3d& first, const Vector3d& second) {
  const double a = first.squaredNorm(), b = second.squaredNorm(), c = first.dot(second);
  const double largest = 0.5 * (a + b + std::hypot(a - b, 2 * c));
  if (!(largest > 0.0)) return 0.0;
  return std::asin(std::min(1.0, first.cross(second).norm() / std::sqrt(largest)));
}

/// Returns the number of parts in which path lengths are within the tolerance and no coordinate of
/// an arc or cubic reverses twice, so that three consecutive points show every extreme.
std::size_t extreme_search_parts(const Path& path, const Block& block, const Chain& control) {
  const std::size_t n = chords_of(path, block, control, path_meter_tolerance);
  // A derivative of a cubic is a parabola: at most two reversals, which eight parts separate unless
  // they nearly coincide.
  if (block.interpolation == Interpolation::Cubic) return std::max<std::size_t>(n, 8);
  if (block.interpolation != Interpolation::Arc) return n;
  // Eighths of a turn: the reversals of one coordinate of a circle are half a turn apart.
  const double eighths = std::ceil(std::abs(path.arcs[block.shape].sweep) / (0.25 * pi));
  return std::max(n, std::size_t(std::max(2.0, eighths)));
}

}  // namespace

PathMeter::PathMeter(const Chain& control, const AxisLimits& limits,
                     const std::map<int, Chain>* control_by_h)
    : control_(&control),
      control_of_h_(control_by_h),
      limits_(limits),
      spindle_(find_spindle(controlled_axes(control))) {
  figures_.axes.resize(std::size_t(control.size()));
  for (int k = 0; k < 3; ++k) xyz_[std::size_t(k)] = control.find(char('X' + k)).value_or(-1);
  for (int j = 0; j < control.size(); ++j)
    if (motion(j) == Motion::Rotary && !is_spindle(j)) rotary_.push_back(j);
  // Only the joint next to the workpiece has an axis that is fixed in the workpiece frame.
  if (spindle_ == 0 && motion(0) == Motion::Rotary) {
    const kinematics::Pose T_wb = control.T_bw_home().inverse();
    const kinematics::Joint& joint = control.joints().front();
    spindle_line_w_.emplace(T_wb * joint.point_b, T_wb.linear() * joint.direction_b);
  }
}

void PathMeter::record_radius() {
  if (!spindle_line_w_) return;
  const double radius = spindle_line_w_->distance(tip_w_);
  auto& range = figures_.radius_at_feed;
  if (!range) range = std::array{radius, radius};
  range = std::array{std::min((*range)[0], radius), std::max((*range)[1], radius)};
}

double PathMeter::limit(int j) const {
  return motion(j) == Motion::Linear ? limits_.rapid_speed : limits_.rapid_rotation_speed;
}

void PathMeter::record_position(const Block& block, const AxisVector& q) {
  for (int j = 0; j < control_->size(); ++j) {
    if (is_spindle(j)) continue;
    AxisFigures& axis = figures_.axes[std::size_t(j)];
    if (!axis.has_position || q[j] < axis.lowest.value)
      axis.lowest = {q[j], block.line, block.file};
    if (!axis.has_position || q[j] > axis.highest.value)
      axis.highest = {q[j], block.line, block.file};
    axis.has_position = true;
  }
}

void PathMeter::record_speeds(const Block& block, const AxisVector& step, double seconds) {
  if (!(seconds > 0.0)) return;
  for (int j = 0; j < control_->size(); ++j) {
    if (is_spindle(j)) continue;
    const double speed = std::abs(step[j]) / seconds;
    AxisFigures& axis = figures_.axes[std::size_t(j)];
    if (speed > axis.fastest.value) axis.fastest = {speed, block.line, block.file};
    if (speed / limit(j) > max_speed_ratio_) {
      max_speed_ratio_ = speed / limit(j);
      figures_.fastest_axis = j;
    }
  }
}

void PathMeter::record_slow_down(const Block& block, double factor) {
  constexpr double rounding = 1e-9;  // relative; a move at exactly the limit is not slowed
  if (!(factor > 1.0 + rounding)) return;
  ++figures_.slowed_moves;
  if (factor > figures_.max_slow_down.value)
    figures_.max_slow_down = {factor, block.line, block.file};
}

MoveFigures& PathMeter::figures_of_type(const Block& block) {
  switch (block.interpolation) {
    case Interpolation::Rapid:
      return figures_.rapids;
    case Interpolation::Line:
      return figures_.lines;
    case Interpolation::Arc:
      return figures_.arcs;
    case Interpolation::Cubic:
      return figures_.cubics;
    case Interpolation::Dwell:
      break;
  }
  return figures_.dwells;
}

/// Returns the position of the tip. Under a tip mode it is the programmed one, which is free of the
/// rounding of the slides.
Vector3d PathMeter::tip_position(const Path& path, const Block& block, const AxisVector& q,
                                 double u) const {
  if (block.coordinates == Coordinates::Axis) return control_->tool_in_workpiece(q).translation();
  const AxisVector programmed = position(path, block, u);
  return {programmed[xyz_[0]], programmed[xyz_[1]], programmed[xyz_[2]]};
}

/// Selects the chain of the tool whose length is in force, if there is one. Returns true if the
/// chain changes.
bool PathMeter::select_chain(const Block& block) {
  if (control_of_h_ == nullptr) return false;
  const auto tool_chain = control_of_h_->find(block.tool_length);
  if (tool_chain == control_of_h_->end() || control_ == &tool_chain->second) return false;
  control_ = &tool_chain->second;
  return true;
}

/// Begins a block at the end of the previous one, unless the tool or the coordinates change.
void PathMeter::begin(const Path& path, const Block& block) {
  const bool same_tool = !select_chain(block);
  const bool continues_previous =
      same_tool && figures_.blocks > 0 && block.coordinates == coordinates_ &&
      (block.start - programmed_).cwiseAbs().maxCoeff() < min_gap_after_conversion;
  if (!continues_previous) {
    q_ = axes_at(path, block, *control_, 0.0);
    tip_w_ = control_->tool_in_workpiece(q_).translation();
    record_position(block, q_);
    // A gap is drawn as a rapid.
    if (on_tip_point) on_tip_point(tip_w_, true);
  }
  coordinates_ = block.coordinates;
  programmed_ = block.end;
}

PathMeter::SampledPoint PathMeter::point_at(const Path& path, const Block& block, double u) const {
  SampledPoint point{u, axes_at(path, block, *control_, u), {}};
  point.tip_w = tip_position(path, block, point.q, u);
  return point;
}

void PathMeter::record_point(const Block& block, const SampledPoint& point) {
  record_position(block, point.q);
  figures_.tip_extent_w.extend(point.tip_w);
  if (block.interpolation != Interpolation::Rapid) figures_.feed_extent_w.extend(point.tip_w);
}

double PathMeter::coordinate(const SampledPoint& point, int k) const {
  return k < control_->size() ? point.q[k] : point.tip_w[k - control_->size()];
}

/// Returns true if coordinate k is not linear over the move. Called for arcs, cubics and moves with
/// rotation: with the axes commanded the tip is curved, with the tip commanded the slides are.
bool PathMeter::is_curved(const Block& block, int k) const {
  if (block.interpolation == Interpolation::Arc || block.interpolation == Interpolation::Cubic)
    return true;
  const bool is_tip = k >= control_->size();
  if (block.coordinates == Coordinates::Axis) return is_tip;
  return !is_tip && motion(k) == Motion::Linear;
}

/// Returns true if a curved coordinate may exceed all extremes so far close to an end of the move.
bool PathMeter::has_extreme_near_end(const Path& path, const Block& block) const {
  for (const SampledPoint& end : {point_at(path, block, 0.0), point_at(path, block, 1.0)})
    for (int k = 0; k < control_->size() + 3; ++k)
      for (const double sign : {1.0, -1.0})
        if (is_curved(block, k) && can_be_new_extreme(block, coordinate(end, k), k, sign))
          return true;
  return false;
}

/// Returns true if an extreme next to a point with that value of coordinate k may exceed all
/// extremes so far: chords miss an extreme by at most `path_meter_tolerance`. `sign` is 1 for
/// maxima, -1 for minima.
bool PathMeter::can_be_new_extreme(const Block& block, double value, int k, double sign) const {
  const auto exceeds = [&](double low, double high) {
    return sign * value + path_meter_tolerance > (sign > 0.0 ? high : -low);
  };
  if (k < control_->size()) {
    const AxisFigures& axis = figures_.axes[std::size_t(k)];
    return !is_spindle(k) && exceeds(axis.lowest.value, axis.highest.value);
  }
  const int i = k - control_->size();
  const bool feeds = block.interpolation != Interpolation::Rapid;
  return exceeds(figures_.tip_extent_w.min()[i], figures_.tip_extent_w.max()[i]) ||
         (feeds && exceeds(figures_.feed_extent_w.min()[i], figures_.feed_extent_w.max()[i]));
}

/// Searches the extreme of every coordinate whose middle point of three is beyond both others.
void PathMeter::search_extremes(const Path& path, const Block& block,
                                const std::array<SampledPoint, 3>& triple) {
  for (int k = 0; k < control_->size() + 3; ++k)
    for (const double sign : {1.0, -1.0}) {
      if (!is_curved(block, k)) continue;
      const double before = sign * coordinate(triple[0], k),
                   middle = sign * coordinate(triple[1], k),
                   after = sign * coordinate(triple[2], k);
      if (middle < before || middle < after ||
          std::max(middle - before, middle - after) < min_extreme_height)
        continue;
      if (!can_be_new_extreme(block, sign * middle, k, sign)) continue;
      const auto value = [&](double u) { return sign * coordinate(point_at(path, block, u), k); };
      double a = triple[0].u, b = triple[2].u;
      // Golden section: one evaluation for each step, and no derivative is needed.
      double c = b - golden_ratio * (b - a), d = a + golden_ratio * (b - a);
      double at_c = value(c), at_d = value(d);
      // Close to an extreme the value changes with the square of the distance: 44 steps leave 6e-10
      // of the interval, and 4e-19 of the second derivative.
      for (int step = 0; step < 44 && b > a; ++step)
        if (at_c > at_d) {
          b = d, d = c, at_d = at_c;
          at_c = value(c = b - golden_ratio * (b - a));
        } else {
          a = c, c = d, at_c = at_d;
          at_d = value(d = a + golden_ratio * (b - a));
        }
      record_point(block, point_at(path, block, at_c > at_d ? c : d));
    }
}

/// Samples close to both ends reveal an extreme within the first or the last part.
void PathMeter::search_all_extremes(const Path& path, const Block& block, std::size_t chords) {
  // A thousandth of a part is far above rounding and still close enough to the end to show the
  // slope there.
  const double part = 1.0 / double(chords), small_step = 1e-3 * part;
  std::array<SampledPoint, 3> triple;
  triple[0] = point_at(path, block, 0.0);
  triple[1] = point_at(path, block, small_step);
  const auto advance = [&](double u) {
    triple[2] = point_at(path, block, u);
    search_extremes(path, block, triple);
    triple[0] = std::exchange(triple[1], triple[2]);
  };
  for (std::size_t k = 1; k < chords; ++k) advance(double(k) * part);
  advance(1.0 - small_step);
  advance(1.0);
}

void PathMeter::move(const Path& path, const Block& block) {
  const bool rapid = block.interpolation == Interpolation::Rapid;
  const double rotation = total_rotation(path, block, *control_);
  const std::size_t n = extreme_search_parts(path, block, *control_);
  const double seconds = (block.end_s - block.start_s) / double(n);
  MoveFigures& moves = figures_of_type(block);
  double limited_s = 0.0;
  figures_.tip_extent_w.extend(tip_w_);
  if (!rapid) figures_.feed_extent_w.extend(tip_w_);
  if (!rapid) record_radius();
  for (std::size_t k = 1; k <= n; ++k) {
    const AxisVector q = axes_at(path, block, *control_, k == n ? 1.0 : double(k) / double(n));
    const AxisVector step = q - q_;
    // Time of the part at the speed limits; at feed it is never shorter than programmed.
    double min_seconds = 0.0;
    for (int j = 0; j < control_->size(); ++j)
      if (!is_spindle(j)) min_seconds = std::max(min_seconds, std::abs(step[j]) / limit(j));
    limited_s += rapid ? min_seconds : std::max(min_seconds, seconds);
    if (!rapid) record_speeds(block, step, seconds);
    if (!rapid && limits_.pole > 0.0) record_pole(block, q, seconds);
    q_ = q;
    const Vector3d tip_w = tip_position(path, block, q, k == n ? 1.0 : double(k) / double(n));
    moves.path_length += (tip_w - tip_w_).norm();
    tip_w_ = tip_w;
    record_position(block, q);
    figures_.tip_extent_w.extend(tip_w);
    if (!rapid) figures_.feed_extent_w.extend(tip_w);
    if (!rapid) record_radius();
    if (on_tip_point) on_tip_point(tip_w, rapid);
  }
  // A single chord without rotation is a straight line and has no inner extreme.
  if (n > 1 || (rotation > min_rotation && has_extreme_near_end(path, block)))
    search_all_extremes(path, block, n);
  moves.limited_s += limited_s;
  if (!rapid && block.end_s > block.start_s)
    record_slow_down(block, limited_s / (block.end_s - block.start_s));
  if (!rapid && rotation > min_rotation && rotary_.size() == 2)
    for (std::size_t k = 0; k < n; ++k)
      search_singular_pose(path, block, double(k) / double(n), double(k + 1) / double(n),
                           rotation / double(n));
}

/// Records the approach to a pole between the current position and `to`.
void PathMeter::record_pole(const Block& block, const AxisVector& to, double seconds) {
  if (block.coordinates != Coordinates::Tip || rotary_.size() != 2) return;
  if (!(std::abs(to[rotary_[0]] - q_[rotary_[0]]) > min_rotation)) return;
  const auto pole = kinematics::nearest_pole(*control_, q_, to);
  if (!pole || pole->angle >= limits_.pole) return;
  const double rotation = std::abs(to[pole->axis] - q_[pole->axis]);
  if (!figures_.pole) figures_.pole = PoleApproach{limits_.pole, pole->axis, pole->other};
  PoleApproach& closest = *figures_.pole;
  if (pole->angle < closest.angle) {
    closest.angle = pole->angle;
    // Poles repeat every half turn of the other axis; the one next to the programmed position is
    // reported.
    closest.pole_position = pole->at + pi * std::round((to[pole->other] - pole->at) / pi);
    closest.line = block.line;
    closest.file = block.file;
  }
  closest.rotation += rotation;
  if (seconds > 0.0) closest.max_speed = std::max(closest.max_speed, rotation / seconds);
}

double PathMeter::singular_angle(const Path& path, const Block& block, double u) const {
  const AxisVector q = position(path, block, u);  // linear axes do not rotate the tool
  Vector3d axes[2];
  Eigen::Matrix3d R = control_->T_bw_home().linear().transpose();
  std::size_t k = 0;
  for (int j = 0; j < control_->size(); ++j) {
    // Composes the rotations from the workpiece to the tool to get both axis lines and the tool
    // axis in one frame.
    if (motion(j) != Motion::Rotary) continue;
    const Vector3d& direction = control_->joints()[std::size_t(j)].direction_b;
    if (!is_spindle(j)) axes[k++] = R * direction;
    R = R * Eigen::AngleAxisd(q[j], direction);
  }
  const Vector3d tool = R * control_->T_bt_home().linear().col(2);
  return min_direction_change(axes[0].cross(tool), axes[1].cross(tool));
}

void PathMeter::record_singular_angle(const Path& path, const Block& block, double u) {
  const double angle = singular_angle(path, block, u);
  if (figures_.singular && angle >= figures_.singular->angle) return;
  figures_.singular = {angle, axes_at(path, block, *control_, u), block.line, block.file};
}

/// Searches the smallest singular angle between two fractions of a move. The angle changes by at
/// most twice the rotation, so most moves cannot fall below the known minimum. If one may, the
/// minimum is searched only if the angle falls at the beginning of the part and rises at its end.
void PathMeter::search_singular_pose(const Path& path, const Block& block, double from, double to,
                                     double rotation) {
  const double angle_at_end = singular_angle(path, block, to);
  if (figures_.singular && angle_at_end - 2 * rotation >= figures_.singular->angle) return;
  if (from == 0.0) record_singular_angle(path, block, 0.0);
  record_singular_angle(path, block, to);
  const double small_step = 1e-3 * (to - from);
  const auto angle_at = [&](double u) { return singular_angle(path, block, u); };
  if (angle_at(from + small_step) >= angle_at(from) || angle_at(to - small_step) >= angle_at_end)
    return;
  double a = from, b = to;
  double c = b - golden_ratio * (b - a), d = a + golden_ratio * (b - a);
  double at_c = angle_at(c), at_d = angle_at(d);
  // Stops once the remaining interval rotates the axes by less than 1e-8 rad.
  while ((b - a) * rotation > search_tolerance * (to - from)) {
    if (at_c < at_d) {
      b = d, d = c, at_d = at_c;
      at_c = angle_at(c = b - golden_ratio * (b - a));
    } else {
      a = c, c = d, at_c = at_d;
      at_d = angle_at(d = a + golden_ratio * (b - a));
    }
  }
  record_singular_angle(path, block, at_c < at_d ? c : d);
}

void PathMeter::add(const Path& path) {
  for (const Block& block : path.blocks) {
    begin(path, block);
    MoveFigures& moves = figures_of_type(block);
    ++moves.count;
    moves.seconds += block.end_s - block.start_s;
    if (block.interpolation == Interpolation::Dwell)
      moves.limited_s += block.end_s - block.start_s;
    else
      move(path, block);
    ++figures_.blocks;
    ++figures_.offsets[block.work_offset];
    ++figures_.lengths[block.tool_length];
    figures_.tip_blocks += block.coordinates == Coordinates::Tip;
  }
}

PathFigures PathMeter::figures() const {
  PathFigures figures = figures_;
  for (int j = 0; j < control_->size(); ++j) {
    const kinematics::Joint& joint = control_->joints()[std::size_t(j)];
    AxisFigures& axis = figures.axes[std::size_t(j)];
    axis.remaining_travel = std::min(axis.lowest.value - joint.min, joint.max - axis.highest.value);
  }
  return figures;
}

std::string line_label(const std::vector<std::string>& subprogram_files, int line,
                       std::uint16_t file) {
  const std::string text = "line " + std::to_string(line);
  return file == 0 ? text : text + " of " + subprogram_files[std::size_t(file) - 1];
}

}  // namespace abbe::sim::program
