#include "sim/dialects/tool_vectors.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/inverse_kinematics.h"
#include "kinematics/pose.h"
#include "kinematics/units.h"

namespace abbe::sim::dialects {

using Eigen::Vector3d;
using kinematics::angle_between;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Motion;
using kinematics::Side;

namespace {

// A segment then turns by less than 0.05 deg.
constexpr int max_segments = 4096;

// Returns the chain with unlimited slides if the machine can orient the tool.
std::optional<Chain> orientation_chain(const Chain& chain) {
  int slide_count = 0, rotary_count = 0;
  for (const kinematics::Joint& joint : chain.joints()) {
    rotary_count += joint.motion == Motion::Rotary && joint.name != 'S';
    slide_count += joint.motion == Motion::Linear;
  }
  const bool has_xyz = chain.find('X') && chain.find('Y') && chain.find('Z');
  // A turning spindle S makes the tool direction in the workpiece depend on its angle.
  if (!has_xyz || slide_count != 3 || rotary_count < 1 || rotary_count > 2 || chain.find('S'))
    return std::nullopt;
  return with_free_slides(chain);
}

/// Returns the rotary joints from the bed on, those of one side first.
std::vector<int> rotary_joints_from_bed(const Chain& chain, Side first_side) {
  std::vector<int> joints;
  for (const Side side : {first_side, first_side == Side::Tool ? Side::Workpiece : Side::Tool})
    for (int k = 0; k < chain.size(); ++k) {
      // The chain is ordered from the workpiece through the bed to the tool.
      const int j = side == Side::Tool ? k : chain.size() - 1 - k;
      if (const auto& joint = chain.joints()[std::size_t(j)];
          joint.motion == Motion::Rotary && joint.side == side)
        joints.push_back(j);
    }
  return joints;
}

/// Unit vectors that move uniformly along a great circle.
struct GreatCircle {
  Vector3d from, across;  ///< unit, perpendicular to each other
  double angle = 0.0;

  Vector3d at(double fraction) const {
    return std::cos(fraction * angle) * from + std::sin(fraction * angle) * across;
  }
};

/// Returns the rotary axes at equal steps of the great circle, or an empty list if the axes cannot
/// follow it or end in another solution.
std::vector<AxisVector> positions_on_circle(const OrientationKinematics& orientation,
                                            const GreatCircle& circle, const AxisVector& from,
                                            const AxisVector& to, int segment_count) {
  constexpr double same_position = 1e-9;  // rad, rounding of the inverse kinematics
  std::vector<AxisVector> positions{from};
  for (int i = 1; i <= segment_count; ++i) {
    const auto solutions =
        orientation.positions(circle.at(double(i) / segment_count), positions.back());
    if (solutions.empty()) return {};
    positions.push_back(solutions.front());
  }
  for (const int j : orientation.rotary_joints())
    if (std::abs(positions.back()[j] - to[j]) > same_position) return {};
  // Exactly the programmed end, so that no rounding accumulates over many lines.
  positions.back() = to;
  return positions;
}

}  // namespace

Chain with_free_slides(const Chain& chain) {
  std::vector<kinematics::Joint> joints = chain.joints();
  for (kinematics::Joint& joint : joints)
    if (joint.motion == Motion::Linear) {
      joint.min = -1e9;
      joint.max = 1e9;
    }
  return {std::move(joints), chain.T_bw_home(), chain.T_bt_home()};
}

OrientationKinematics::OrientationKinematics(const std::optional<Chain>& control) {
  if (!control) return;
  free_ = orientation_chain(*control);
  if (free_) rotary_ = rotary_joints_from_bed(*free_, Side::Tool);
}

Vector3d OrientationKinematics::direction_w(const AxisVector& q) const {
  return free_->tool_in_workpiece(q).linear().col(2);
}

std::vector<AxisVector> OrientationKinematics::positions(const Vector3d& direction_w,
                                                         const AxisVector& near) const {
  // Slides do not influence the direction. At zero their programmed values cannot enter the
  // solution.
  AxisVector start = near;
  for (int j = 0; j < start.size(); ++j)
    if (std::find(rotary_.begin(), rotary_.end(), j) == rotary_.end()) start[j] = 0.0;
  const auto solution = kinematics::inverse(*free_, {Vector3d::Zero(), direction_w}, start);
  if (solution.reach != kinematics::Reachability::Reached &&
      solution.reach != kinematics::Reachability::Singular)
    return {};
  std::vector<AxisVector> positions;
  for (const AxisVector& branch : solution.branches) {
    AxisVector q = near;
    for (const int j : rotary_) q[j] = branch[j];
    positions.push_back(std::move(q));
  }
  return positions;
}

std::vector<OrientationSegment> great_circle_segments(const OrientationKinematics& orientation,
                                                      const AxisVector& from, const AxisVector& to,
                                                      double tolerance) {
  GreatCircle circle;
  circle.from = orientation.direction_w(from).normalized();
  const Vector3d end = orientation.direction_w(to).normalized();
  circle.angle = angle_between(circle.from, end);
  // Below the tolerance one segment is enough.
  if (circle.angle < tolerance) return {{1.0, to}};
  // Opposite vectors: their great circle is not defined.
  if (circle.angle > pi - 1e-6) return {};
  circle.across = (end - end.dot(circle.from) * circle.from).normalized();
  for (int segment_count = 1; segment_count <= max_segments;) {
    const std::vector<AxisVector> positions =
        positions_on_circle(orientation, circle, from, to, segment_count);
    if (positions.empty()) {
      if (segment_count > 1) return {};
      segment_count = 16;  // with few, distant points the nearest solution may be the wrong one
      continue;
    }
    double max_deviation = 0.0;
    for (int i = 0; i < segment_count; ++i)
      // The deviation of a segment vanishes at its ends, and is largest near its middle or
      // quarters.
      for (const double segment_fraction : {0.25, 0.5, 0.75}) {
        const AxisVector q =
            positions[std::size_t(i)] +
            segment_fraction * (positions[std::size_t(i) + 1] - positions[std::size_t(i)]);
        max_deviation = std::max(max_deviation,
                                 angle_between(orientation.direction_w(q).normalized(),
                                               circle.at((i + segment_fraction) / segment_count)));
      }
    if (max_deviation > tolerance) {  // the deviation falls with the square of their number
      const int tried_count = segment_count;
      do segment_count *= 2;
      while (max_deviation >
             tolerance * segment_count * segment_count / (tried_count * tried_count));
      continue;
    }
    std::vector<OrientationSegment> segments;
    for (int i = 1; i <= segment_count; ++i)
      segments.push_back({double(i) / segment_count, positions[std::size_t(i)]});
    return segments;
  }
  return {};
}

void feed_along_segments(program::Canon& canon, const OrientationKinematics& orientation,
                         const std::vector<OrientationSegment>& segments,
                         const program::Straight& move) {
  const AxisVector start = canon.position();
  const auto feed = canon.feed();
  // Inverse time counts for the whole block: n segments have n times the F each.
  if (feed && canon.feed_mode() == program::FeedMode::InverseTime)
    canon.set_feed(program::Feed{feed->word * double(segments.size()), feed->unit});
  for (const OrientationSegment& segment : segments) {
    program::Straight segment_move = move;
    segment_move.end = start + segment.fraction * (move.end - start);
    for (const int j : orientation.rotary_joints()) segment_move.end[j] = segment.q[j];
    // The last segment ends at the programmed values, bit for bit.
    if (segment.fraction == 1.0) segment_move.end = move.end;
    canon.straight_feed(std::move(segment_move));
  }
  canon.set_feed(feed);
}

}  // namespace abbe::sim::dialects

namespace abbe::sim::dialects::fanuc {

using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Motion;
using kinematics::Side;

namespace {

constexpr double angle_tolerance = 1e-9;  // rad, below it two solutions count as equal
// Cosine; larger deviations make the formula for the changed end wrong.
constexpr double max_right_angle_cosine = 1e-9;

/// Distance from zero modulo whole turns.
double distance_from_zero(double angle) { return std::abs(std::remainder(angle, 2 * pi)); }

// Returns true if a is preferred to b: less travel axis by axis, then nearer to zero.
bool is_preferred(const AxisVector& a, const AxisVector& b, const AxisVector& position,
                  const std::vector<int>& ranks) {
  for (const int j : ranks)
    if (const double difference = std::abs(a[j] - position[j]) - std::abs(b[j] - position[j]);
        std::abs(difference) > angle_tolerance)
      return difference < 0;
  for (const int j : ranks)
    if (const double difference = distance_from_zero(a[j]) - distance_from_zero(b[j]);
        std::abs(difference) > angle_tolerance)
      return difference < 0;
  return false;
}

Vector3d tool_w(const Chain& chain, const AxisVector& q) {
  return chain.tool_in_workpiece(q).linear().col(2).normalized();
}

/// The pole that the great circle between two tool directions passes.
struct PolePass {
  Vector3d pole;          ///< unit, the end of the axis that the tool passes
  double distance = 0.0;  ///< rad, between the pole and the great circle
};

/// Returns the pole of a rotary axis that the tool passes between two directions. Returns nothing
/// if the closest point of the great circle is one of its ends, or the plane is undefined.
std::optional<PolePass> closest_pole(const Vector3d& from, const Vector3d& to,
                                     const Vector3d& axis) {
  const Vector3d normal = from.cross(to);
  if (!(normal.norm() > angle_tolerance)) return std::nullopt;
  const Vector3d n = normal.normalized();
  for (const Vector3d& pole : {axis, Vector3d(-axis)}) {
    // The projection of the pole onto the plane must lie between both ends.
    const Vector3d foot = pole - pole.dot(n) * n;
    if (from.cross(foot).dot(n) > 0.0 && foot.cross(to).dot(n) > 0.0)
      return PolePass{pole, std::asin(std::min(1.0, std::abs(axis.dot(n))))};
  }
  return std::nullopt;
}

/// Returns the pole of the machine. Throws std::invalid_argument unless its rotary axes are at
/// right angles to each other and to the tool.
kinematics::Pole right_angled_pole(const Chain& chain, const AxisVector& q) {
  const auto pole = kinematics::nearest_pole(chain, q, q);
  const auto direction = [&](int j) { return chain.joints()[std::size_t(j)].direction_b; };
  const bool is_right_angled =
      pole &&
      std::abs(direction(pole->axis).dot(direction(pole->other))) < max_right_angle_cosine &&
      std::abs(chain.T_bt_home().linear().col(2).dot(direction(pole->other))) <
          max_right_angle_cosine;
  if (!is_right_angled)
    throw std::invalid_argument(
        "a machine with two rotary axes perpendicular to each other and to the tool");
  return *pole;
}

}  // namespace

std::vector<int> rotary_judgement_order(const Chain& chain) {
  return rotary_joints_from_bed(chain, Side::Workpiece);
}

const AxisVector& output_judgement(std::span<const AxisVector> branches, const AxisVector& position,
                                   const std::vector<int>& ranks) {
  const AxisVector* best = &branches.front();
  for (const AxisVector& branch : branches)
    if (is_preferred(branch, *best, position, ranks)) best = &branch;
  return *best;
}

std::optional<PolePassage> pole_passage(const Chain& chain, const AxisVector& from,
                                        const AxisVector& to, const PoleOptions& limits) {
  const kinematics::Pole pole = right_angled_pole(chain, from);
  const kinematics::Joint& other = chain.joints()[std::size_t(pole.other)];
  const Vector3d axis_w =
      chain.T_bw_home().linear().transpose() * chain.joints()[std::size_t(pole.axis)].direction_b;
  const Vector3d programmed_w = tool_w(chain, to);
  const auto pass = closest_pole(tool_w(chain, from), programmed_w, axis_w);
  if (!pass || pass->distance >= limits.near_angle) return std::nullopt;
  const double pole_position = pass->pole.dot(axis_w) > 0.0 ? pole.at : pole.at + pi;
  // Inclination of the start relative to the pole; its sign gives the side to which the axis goes
  // on.
  const double inclination = std::remainder(from[pole.other] - pole_position, 2 * pi);
  const double nearest_pole_position = from[pole.other] - inclination;
  const double end = kinematics::angle_between(programmed_w, pass->pole);
  // A block that begins or ends in the pole does not pass it.
  if (std::abs(inclination) < angle_tolerance || end < angle_tolerance) return std::nullopt;
  PolePassage passage{to, pass->distance, 0.0, 0.0};
  passage.end[pole.axis] = from[pole.axis];
  // Beyond the pole by the angle of the programmed end, which keeps the inclination of the tool.
  passage.end[pole.other] = nearest_pole_position - std::copysign(end, inclination);
  const Vector3d changed_w = tool_w(chain, passage.end);
  passage.end_rotation =
      kinematics::angle_between(programmed_w.cross(axis_w), changed_w.cross(axis_w));
  passage.vector_error = kinematics::angle_between(programmed_w, changed_w);
  const bool reachable =
      passage.end[pole.other] >= other.min && passage.end[pole.other] <= other.max;
  if (passage.end_rotation > limits.max_rotation_about_pole || !reachable) return std::nullopt;
  return passage;
}

}  // namespace abbe::sim::dialects::fanuc

namespace abbe::sim::dialects {

const OrientationKinematics& VectorLines::orientation_kinematics(const Chain& chain) {
  // Most programs use one chain throughout, so one analysis is enough.
  if (chain_ != &chain) {
    orientation_.emplace(chain);
    chain_ = &chain;
  }
  return *orientation_;
}

AxisVector VectorLines::fanuc_rotary_axes(const Chain& chain, const Eigen::Vector3d& direction_w,
                                          const program::Cause& cause) {
  const OrientationKinematics& kinematics = orientation_kinematics(chain);
  const AxisVector position = run_.canon.position();
  // On a machine without rotary axes the caller checks the vector.
  if (!kinematics.is_possible()) return position;
  const auto solutions = kinematics.positions(direction_w.normalized(), position);
  if (solutions.empty())
    run_.canon.throw_input_error(
        cause, "a tool vector that the rotary axes can reach",
        fmt::format("{:.6g} {:.6g} {:.6g}", direction_w.x(), direction_w.y(), direction_w.z()));
  return fanuc::output_judgement(solutions, position, fanuc::rotary_judgement_order(chain));
}

bool VectorLines::lead_through_pole(const Chain& chain, program::Straight& move) {
  std::optional<fanuc::PolePassage> passage;
  try {
    passage = fanuc::pole_passage(chain, run_.canon.position(), move.end, run_.options().pole);
  } catch (const std::invalid_argument& error) {
    run_.canon.throw_input_error(move.cause, std::string(error.what()) + ", with pole = \"fanuc\"",
                                 "one with " + run_.canon.letters());
  }
  if (!passage) return false;
  for (const int j : orientation_kinematics(chain).rotary_joints()) move.end[j] = passage->end[j];
  ++pole_passages_.blocks;
  pole_passages_.max_end_rotation =
      std::max(pole_passages_.max_end_rotation, passage->end_rotation);
  if (pole_passages_.line == 0 || passage->vector_error > pole_passages_.max_vector_error)
    pole_passages_.line = run_.canon.line();
  pole_passages_.max_vector_error =
      std::max(pole_passages_.max_vector_error, passage->vector_error);
  return true;
}

bool VectorLines::straight_feed(const Chain& chain, program::Straight move) {
  const OrientationKinematics& kinematics = orientation_kinematics(chain);
  const AxisVector& start = run_.canon.position();
  const bool is_rotating = std::ranges::any_of(kinematics.rotary_joints(),
                                               [&](int j) { return move.end[j] != start[j]; });
  if (!is_rotating) return run_.canon.straight_feed(std::move(move)), true;
  if (rule() == PoleRule::Fanuc && kinematics.rotary_joints().size() == 2 &&
      lead_through_pole(chain, move))
    return run_.canon.straight_feed(std::move(move)), false;
  auto segments = great_circle_segments(kinematics, start, move.end, great_circle_tolerance);
  if (segments.empty())  // the end may be reached by the other solution of the rotary axes
    for (const AxisVector& q : kinematics.positions(kinematics.direction_w(move.end), start)) {
      AxisVector end = move.end;
      for (const int j : kinematics.rotary_joints()) end[j] = q[j];
      segments = great_circle_segments(kinematics, start, end, great_circle_tolerance);
      if (segments.empty()) continue;
      move.end = std::move(end);
      break;
    }
  if (segments.empty())
    run_.canon.throw_input_error(
        move.cause,
        "a tool rotation on a great circle that the rotary axes can follow, with pole = \"fanuc\" "
        "or \"siemens\"",
        "opposite vectors, a pole on the path, or a path beyond their limits");
  feed_along_segments(run_.canon, kinematics, segments, move);
  return true;
}

void VectorLines::finish() {
  if (pole_passages_.blocks == 0) return;
  run_.warn_once(fmt::format(
      "{} blocks would pass a pole closer than {:.6g} deg and are led through it (tool posture "
      "control, parameters 19738 and 19739): their ends are rotated about it by up to {:.3g} deg, "
      "and the tool deviates from its vector by up to {:.3g} deg (line {})",
      pole_passages_.blocks, run_.options().pole.near_angle / units::deg,
      pole_passages_.max_end_rotation / units::deg, pole_passages_.max_vector_error / units::deg,
      pole_passages_.line));
}

}  // namespace abbe::sim::dialects
