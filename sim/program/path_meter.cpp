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

constexpr double turn_threshold = 1e-9;  // rad; below it a move counts as one without rotation
constexpr double one_place = 1e-9;       // mm or rad, rounding of a conversion between axes and tip
constexpr double angle_within = 1e-8;    // tolerance of the minimisation, in u times the rotation
constexpr double level = 1e-10;          // mm or rad; values that differ by less show no extreme
constexpr double golden = 0.6180339887498949;  // ratio of the golden section search

std::vector<ControlledAxis> axes_named(const Chain& chain) {
  std::vector<ControlledAxis> axes;
  for (const auto& joint : chain.joints()) axes.push_back({joint.name, joint.motion});
  return axes;
}

/// Smallest singular value of the change of direction by two rotary axes, as an angle. The product
/// of both singular values is the norm of the cross product.
double min_change(const Vector3d& first, const Vector3d& second) {
  const double a = first.squaredNorm(), b = second.squaredNorm(), c = first.dot(second);
  const double largest = 0.5 * (a + b + std::hypot(a - b, 2 * c));
  if (!(largest > 0.0)) return 0.0;
  return std::asin(std::min(1.0, first.cross(second).norm() / std::sqrt(largest)));
}

/// Number of parts in which path lengths are within the tolerance and no coordinate of an arc or
/// cubic reverses twice, so that three consecutive points show every extreme.
std::size_t extreme_search_parts(const Path& path, const Block& block, const Chain& control) {
  const std::size_t n = chords_of(path, block, control, path_meter_within);
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
                     const std::map<int, Chain>* control_of_h)
    : control_(&control),
      control_of_h_(control_of_h),
      limits_(limits),
      spindle_(find_spindle(axes_named(control))) {
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

void PathMeter::note_radius() {
  if (!spindle_line_w_) return;
  const double radius = spindle_line_w_->distance(tip_w_);
  auto& range = figures_.radius_at_feed;
  if (!range) range = std::array{radius, radius};
  range = std::array{std::min((*range)[0], radius), std::max((*range)[1], radius)};
}

double PathMeter::limit(int j) const {
  return motion(j) == Motion::Linear ? limits_.rapid_speed : limits_.rapid_turn;
}

void PathMeter::note_position(const Block& block, const AxisVector& q) {
  for (int j = 0; j < control_->size(); ++j) {
    if (is_spindle(j)) continue;
    AxisFigures& axis = figures_.axes[std::size_t(j)];
    if (!axis.positioned || q[j] < axis.least.value) axis.least = {q[j], block.line, block.file};
    if (!axis.positioned || q[j] > axis.most.value) axis.most = {q[j], block.line, block.file};
    axis.positioned = true;
  }
}

void PathMeter::note_speeds(const Block& block, const AxisVector& step, double seconds) {
  if (!(seconds > 0.0)) return;
  for (int j = 0; j < control_->size(); ++j) {
    if (is_spindle(j)) continue;
    const double speed = std::abs(step[j]) / seconds;
    AxisFigures& axis = figures_.axes[std::size_t(j)];
    if (speed > axis.fastest.value) axis.fastest = {speed, block.line, block.file};
    if (speed / limit(j) > fastest_share_) {
      fastest_share_ = speed / limit(j);
      figures_.fastest_axis = j;
    }
  }
}

void PathMeter::note_slowed(const Block& block, double factor) {
  constexpr double rounding = 1e-9;  // relative; a move at exactly the limit is not slowed
  if (!(factor > 1.0 + rounding)) return;
  ++figures_.slowed;
  if (factor > figures_.max_slowed.value) figures_.max_slowed = {factor, block.line, block.file};
}

MoveFigures& PathMeter::kind(const Block& block) {
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

/// Position of the tip; under a tip mode it is the programmed one, without the rounding of the
/// slides.
Vector3d PathMeter::tip_position(const Path& path, const Block& block, const AxisVector& q,
                                 double u) const {
  if (block.coordinates == Coordinates::Axis) return control_->tool_in_workpiece(q).translation();
  const AxisVector programmed = position(path, block, u);
  return {programmed[xyz_[0]], programmed[xyz_[1]], programmed[xyz_[2]]};
}

/// Selects the chain to the tip of the tool whose length is in force, if it has one. Returns true
/// if the chain changes.
bool PathMeter::take_chain_of(const Block& block) {
  if (control_of_h_ == nullptr) return false;
  const auto own = control_of_h_->find(block.tool_length);
  if (own == control_of_h_->end() || control_ == &own->second) return false;
  control_ = &own->second;
  return true;
}

/// Start of a block: the end of the previous one, unless the tool or the coordinates change.
void PathMeter::begin(const Path& path, const Block& block) {
  const bool same_tool = !take_chain_of(block);
  const bool goes_on = same_tool && figures_.blocks > 0 && block.coordinates == coordinates_ &&
                       (block.start - programmed_).cwiseAbs().maxCoeff() < one_place;
  if (!goes_on) {
    q_ = axes_at(path, block, *control_, 0.0);
    tip_w_ = control_->tool_in_workpiece(q_).translation();
    note_position(block, q_);
    // A gap is drawn as a rapid.
    if (on_tip_point) on_tip_point(tip_w_, true);
  }
  coordinates_ = block.coordinates;
  programmed_ = block.end;
}

PathMeter::MeterPoint PathMeter::place_at(const Path& path, const Block& block, double u) const {
  MeterPoint place{u, axes_at(path, block, *control_, u), {}};
  place.tip_w = tip_position(path, block, place.q, u);
  return place;
}

void PathMeter::note_point(const Block& block, const MeterPoint& place) {
  note_position(block, place.q);
  figures_.all_w.extend(place.tip_w);
  if (block.interpolation != Interpolation::Rapid) figures_.feed_w.extend(place.tip_w);
}

double PathMeter::coordinate(const MeterPoint& place, int k) const {
  return k < control_->size() ? place.q[k] : place.tip_w[k - control_->size()];
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
  for (const MeterPoint& end : {place_at(path, block, 0.0), place_at(path, block, 1.0)})
    for (int k = 0; k < control_->size() + 3; ++k)
      for (const double sign : {1.0, -1.0})
        if (is_curved(block, k) && can_be_new_extreme(block, coordinate(end, k), k, sign))
          return true;
  return false;
}

/// Returns true if an extreme next to a point with that value of coordinate k may exceed all so
/// far: chords miss an extreme by at most `path_meter_within`. `sign` is 1 for maxima, -1 for
/// minima.
bool PathMeter::can_be_new_extreme(const Block& block, double value, int k, double sign) const {
  const auto exceeds = [&](double low, double high) {
    return sign * value + path_meter_within > (sign > 0.0 ? high : -low);
  };
  if (k < control_->size()) {
    const AxisFigures& axis = figures_.axes[std::size_t(k)];
    return !is_spindle(k) && exceeds(axis.least.value, axis.most.value);
  }
  const int i = k - control_->size();
  const bool feeds = block.interpolation != Interpolation::Rapid;
  return exceeds(figures_.all_w.min()[i], figures_.all_w.max()[i]) ||
         (feeds && exceeds(figures_.feed_w.min()[i], figures_.feed_w.max()[i]));
}

/// Searches the extreme between three points whose middle one is beyond both others.
void PathMeter::note_extremes(const Path& path, const Block& block,
                              const std::array<MeterPoint, 3>& three) {
  for (int k = 0; k < control_->size() + 3; ++k)
    for (const double sign : {1.0, -1.0}) {
      if (!is_curved(block, k)) continue;
      const double before = sign * coordinate(three[0], k), at = sign * coordinate(three[1], k),
                   after = sign * coordinate(three[2], k);
      if (at < before || at < after || std::max(at - before, at - after) < level) continue;
      if (!can_be_new_extreme(block, sign * at, k, sign)) continue;
      const auto value = [&](double u) { return sign * coordinate(place_at(path, block, u), k); };
      double a = three[0].u, b = three[2].u;
      // Golden section: one evaluation for each step, and no derivative is needed.
      double c = b - golden * (b - a), d = a + golden * (b - a);
      double at_c = value(c), at_d = value(d);
      // Close to an extreme the value changes with the square of the distance: 44 steps leave 6e-10
      // of the interval, and 4e-19 of the second derivative.
      for (int step = 0; step < 44 && b > a; ++step)
        if (at_c > at_d) {
          b = d, d = c, at_d = at_c;
          at_c = value(c = b - golden * (b - a));
        } else {
          a = c, c = d, at_c = at_d;
          at_d = value(d = a + golden * (b - a));
        }
      note_point(block, place_at(path, block, at_c > at_d ? c : d));
    }
}

/// Samples close to both ends reveal an extreme within the first or the last part.
void PathMeter::note_all_extremes(const Path& path, const Block& block, std::size_t chords) {
  // A thousandth of a part: far beyond rounding, and still close enough to show the slope at the
  // end.
  const double part = 1.0 / double(chords), little = 1e-3 * part;
  std::array<MeterPoint, 3> three;
  three[0] = place_at(path, block, 0.0);
  three[1] = place_at(path, block, little);
  const auto next = [&](double u) {
    three[2] = place_at(path, block, u);
    note_extremes(path, block, three);
    three[0] = std::exchange(three[1], three[2]);
  };
  for (std::size_t k = 1; k < chords; ++k) next(double(k) * part);
  next(1.0 - little);
  next(1.0);
}

void PathMeter::move(const Path& path, const Block& block) {
  const bool rapid = block.interpolation == Interpolation::Rapid;
  const double turn = rotary_turn_sum(path, block, *control_);
  const std::size_t n = extreme_search_parts(path, block, *control_);
  const double seconds = (block.end_s - block.start_s) / double(n);
  MoveFigures& moves = kind(block);
  double limited = 0.0;
  figures_.all_w.extend(tip_w_);
  if (!rapid) figures_.feed_w.extend(tip_w_);
  if (!rapid) note_radius();
  for (std::size_t k = 1; k <= n; ++k) {
    const AxisVector q = axes_at(path, block, *control_, k == n ? 1.0 : double(k) / double(n));
    const AxisVector step = q - q_;
    // Time of the part at the speed limits; at feed it is never shorter than programmed.
    double least = 0.0;
    for (int j = 0; j < control_->size(); ++j)
      if (!is_spindle(j)) least = std::max(least, std::abs(step[j]) / limit(j));
    limited += rapid ? least : std::max(least, seconds);
    if (!rapid) note_speeds(block, step, seconds);
    if (!rapid && limits_.pole > 0.0) note_pole(block, q, seconds);
    q_ = q;
    const Vector3d at = tip_position(path, block, q, k == n ? 1.0 : double(k) / double(n));
    moves.way += (at - tip_w_).norm();
    tip_w_ = at;
    note_position(block, q);
    figures_.all_w.extend(at);
    if (!rapid) figures_.feed_w.extend(at);
    if (!rapid) note_radius();
    if (on_tip_point) on_tip_point(at, rapid);
  }
  // A single chord without rotation is a straight line and has no inner extreme.
  if (n > 1 || (turn > turn_threshold && has_extreme_near_end(path, block)))
    note_all_extremes(path, block, n);
  moves.limited_s += limited;
  if (!rapid && block.end_s > block.start_s)
    note_slowed(block, limited / (block.end_s - block.start_s));
  if (!rapid && turn > turn_threshold && rotary_.size() == 2)
    for (std::size_t k = 0; k < n; ++k)
      note_singular(path, block, double(k) / double(n), double(k + 1) / double(n),
                    turn / double(n));
}

/// Records the approach to a pole between the current position and `to`.
void PathMeter::note_pole(const Block& block, const AxisVector& to, double seconds) {
  if (block.coordinates != Coordinates::Tip || rotary_.size() != 2) return;
  if (!(std::abs(to[rotary_[0]] - q_[rotary_[0]]) > turn_threshold)) return;
  const auto pole = kinematics::nearest_pole(*control_, q_, to);
  if (!pole || pole->angle >= limits_.pole) return;
  const double turned = std::abs(to[pole->axis] - q_[pole->axis]);
  if (!figures_.pole) figures_.pole = NearPole{limits_.pole, pole->axis, pole->other};
  NearPole& near = *figures_.pole;
  if (pole->angle < near.angle) {
    near.angle = pole->angle;
    // Poles repeat every half turn of the other axis; the one next to the programmed position is
    // reported.
    near.at = pole->at + pi * std::round((to[pole->other] - pole->at) / pi);
    near.line = block.line;
    near.file = block.file;
  }
  near.turned += turned;
  if (seconds > 0.0) near.fastest = std::max(near.fastest, turned / seconds);
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
  return min_change(axes[0].cross(tool), axes[1].cross(tool));
}

void PathMeter::look_at(const Path& path, const Block& block, double u) {
  const double angle = singular_angle(path, block, u);
  if (figures_.singular && angle >= figures_.singular->angle) return;
  figures_.singular = {angle, axes_at(path, block, *control_, u), block.line, block.file};
}

/// The angle changes by at most twice the rotation, so most moves cannot come nearer than the known
/// minimum. Where one may, the minimum is searched if the angle falls at the beginning of the part
/// and rises at its end.
void PathMeter::note_singular(const Path& path, const Block& block, double from, double to,
                              double turn) {
  const double at_end = singular_angle(path, block, to);
  if (figures_.singular && at_end - 2 * turn >= figures_.singular->angle) return;
  if (from == 0.0) look_at(path, block, 0.0);
  look_at(path, block, to);
  const double little = 1e-3 * (to - from);
  const auto at = [&](double u) { return singular_angle(path, block, u); };
  if (at(from + little) >= at(from) || at(to - little) >= at_end) return;
  double a = from, b = to;
  double c = b - golden * (b - a), d = a + golden * (b - a);
  double at_c = at(c), at_d = at(d);
  // Stops once the remaining interval rotates the axes by less than 1e-8 rad.
  while ((b - a) * turn > angle_within * (to - from)) {
    if (at_c < at_d) {
      b = d, d = c, at_d = at_c;
      at_c = at(c = b - golden * (b - a));
    } else {
      a = c, c = d, at_c = at_d;
      at_d = at(d = a + golden * (b - a));
    }
  }
  look_at(path, block, at_c < at_d ? c : d);
}

void PathMeter::add(const Path& piece) {
  for (const Block& block : piece.blocks) {
    begin(piece, block);
    MoveFigures& moves = kind(block);
    ++moves.count;
    moves.seconds += block.end_s - block.start_s;
    if (block.interpolation == Interpolation::Dwell)
      moves.limited_s += block.end_s - block.start_s;
    else
      move(piece, block);
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
    axis.left = std::min(axis.least.value - joint.min, joint.max - axis.most.value);
  }
  return figures;
}

std::string line_text(const std::vector<std::string>& more_files, int line, std::uint16_t file) {
  const std::string text = "line " + std::to_string(line);
  return file == 0 ? text : text + " of " + more_files[std::size_t(file) - 1];
}

}  // namespace abbe::sim::program
