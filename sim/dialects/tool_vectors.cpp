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
constexpr int max_pieces = 4096;

// Returns the chain with unlimited slides if the machine can orient the tool: directions alone are
// solved, and the tip must never limit them.
std::optional<Chain> pointing_chain(const Chain& chain) {
  std::vector<kinematics::Joint> joints = chain.joints();
  int slides = 0, turns = 0;
  for (kinematics::Joint& joint : joints) {
    if (joint.motion == Motion::Rotary && joint.name != 'S') ++turns;
    if (joint.motion != Motion::Linear) continue;
    ++slides;
    joint.min = -1e9;
    joint.max = 1e9;
  }
  const bool xyz = chain.find('X') && chain.find('Y') && chain.find('Z');
  // A turning spindle S makes the tool direction in the workpiece depend on its angle.
  if (!xyz || slides != 3 || turns < 1 || turns > 2 || chain.find('S')) return std::nullopt;
  return Chain(std::move(joints), chain.T_bw_home(), chain.T_bt_home());
}

// The chain is ordered from the workpiece through the bed to the tool, so workpiece joints are
// visited in reverse.
std::vector<int> rotary_in_order(const Chain& chain) {
  std::vector<int> joints;
  for (int j = 0; j < chain.size(); ++j)
    if (const auto& one = chain.joints()[std::size_t(j)];
        one.motion == Motion::Rotary && one.side == Side::Tool)
      joints.push_back(j);
  for (int j = chain.size() - 1; j >= 0; --j)
    if (const auto& one = chain.joints()[std::size_t(j)];
        one.motion == Motion::Rotary && one.side == Side::Workpiece)
      joints.push_back(j);
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
std::vector<AxisVector> on_the_way(const OrientationKinematics& turning, const GreatCircle& circle,
                                   const AxisVector& from, const AxisVector& to, int pieces) {
  constexpr double same_position = 1e-9;  // rad, rounding of the inverse kinematics
  std::vector<AxisVector> way{from};
  for (int i = 1; i <= pieces; ++i) {
    const auto next = turning.positions(circle.at(double(i) / pieces), way.back());
    if (next.empty()) return {};
    way.push_back(next.front());
  }
  for (const int j : turning.rotary())
    if (std::abs(way.back()[j] - to[j]) > same_position) return {};
  // Exactly the programmed end, so that no rounding accumulates over many lines.
  way.back() = to;
  return way;
}

}  // namespace

OrientationKinematics::OrientationKinematics(const std::optional<Chain>& control) {
  if (!control) return;
  free_ = pointing_chain(*control);
  if (free_) rotary_ = rotary_in_order(*free_);
}

Vector3d OrientationKinematics::direction_w(const AxisVector& q) const {
  return free_->tool_in_workpiece(q).linear().col(2);
}

std::vector<AxisVector> OrientationKinematics::positions(const Vector3d& direction_w,
                                                         const AxisVector& near) const {
  // Slides do not influence the direction; zeros keep their programmed values out of the solution.
  AxisVector here = near;
  for (int j = 0; j < here.size(); ++j)
    if (std::find(rotary_.begin(), rotary_.end(), j) == rotary_.end()) here[j] = 0.0;
  const auto found = kinematics::inverse(*free_, {Vector3d::Zero(), direction_w}, here);
  if (found.reach != kinematics::Reach::Reached && found.reach != kinematics::Reach::Singular)
    return {};
  std::vector<AxisVector> all;
  for (const AxisVector& branch : found.branches) {
    AxisVector q = near;
    for (const int j : rotary_) q[j] = branch[j];
    all.push_back(std::move(q));
  }
  return all;
}

std::vector<OrientationSegment> great_circle_segments(const OrientationKinematics& turning,
                                                      const AxisVector& from, const AxisVector& to,
                                                      double tolerance) {
  GreatCircle circle;
  circle.from = turning.direction_w(from).normalized();
  const Vector3d end = turning.direction_w(to).normalized();
  circle.angle = angle_between(circle.from, end);
  // Below the tolerance no division is needed.
  if (circle.angle < tolerance) return {{1.0, to}};
  // Opposite vectors: their great circle is not defined.
  if (circle.angle > pi - 1e-6) return {};
  circle.across = (end - end.dot(circle.from) * circle.from).normalized();
  for (int pieces = 1; pieces <= max_pieces;) {
    const std::vector<AxisVector> way = on_the_way(turning, circle, from, to, pieces);
    if (way.empty()) {
      if (pieces > 1) return {};
      pieces = 16;  // with few, distant points the nearest solution may be the wrong one
      continue;
    }
    double worst = 0.0;
    for (int i = 0; i < pieces; ++i)
      // The deviation of a segment vanishes at its ends, and is largest near its middle or
      // quarters.
      for (const double within : {0.25, 0.5, 0.75}) {
        const AxisVector q =
            way[std::size_t(i)] + within * (way[std::size_t(i) + 1] - way[std::size_t(i)]);
        worst = std::max(worst, angle_between(turning.direction_w(q).normalized(),
                                              circle.at((i + within) / pieces)));
      }
    if (worst > tolerance) {  // the deviation falls with the square of their number
      const int first = pieces;
      do pieces *= 2;
      while (worst > tolerance * pieces * pieces / (first * first));
      continue;
    }
    std::vector<OrientationSegment> all;
    for (int i = 1; i <= pieces; ++i) all.push_back({double(i) / pieces, way[std::size_t(i)]});
    return all;
  }
  return {};
}

void feed_along_segments(program::Canon& canon, const OrientationKinematics& turning,
                         const std::vector<OrientationSegment>& pieces,
                         const program::Straight& move) {
  const AxisVector start = canon.position();
  const auto feed = canon.feed();
  // Inverse time counts for the whole block: n segments have n times the F each.
  if (feed && canon.feed_mode() == program::FeedMode::InverseTime)
    canon.set_feed(program::Feed{feed->word * double(pieces.size()), feed->unit});
  for (const OrientationSegment& piece : pieces) {
    program::Straight part = move;
    part.end = start + piece.fraction * (move.end - start);
    for (const int j : turning.rotary()) part.end[j] = piece.q[j];
    // The last segment ends at the programmed values, bit for bit.
    if (piece.fraction == 1.0) part.end = move.end;
    canon.straight_feed(std::move(part));
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

constexpr double same_turn = 1e-9;  // rad, below it two solutions count as equal
// Cosine; larger deviations make the formula for the changed end wrong.
constexpr double right_angles = 1e-9;

/// Distance from zero modulo whole turns.
double from_zero(double angle) { return std::abs(std::remainder(angle, 2 * pi)); }

// Returns true if a is preferred to b: less travel axis by axis, then nearer to zero.
bool before(const AxisVector& a, const AxisVector& b, const AxisVector& now,
            const std::vector<int>& ranks) {
  for (const int j : ranks)
    if (const double less = std::abs(a[j] - now[j]) - std::abs(b[j] - now[j]);
        std::abs(less) > same_turn)
      return less < 0;
  for (const int j : ranks)
    if (const double less = from_zero(a[j]) - from_zero(b[j]); std::abs(less) > same_turn)
      return less < 0;
  return false;
}

Vector3d tool_w(const Chain& chain, const AxisVector& q) {
  return chain.tool_in_workpiece(q).linear().col(2).normalized();
}

/// The pole that the great circle between two tool directions passes, and how closely.
struct Passing {
  Vector3d pole;       ///< unit, the end of the axis that the tool passes
  double angle = 0.0;  ///< rad
};

/// Returns nothing if the closest point of the great circle is an end, or the plane is undefined.
std::optional<Passing> passing(const Vector3d& from, const Vector3d& to, const Vector3d& axis) {
  const Vector3d normal = from.cross(to);
  if (!(normal.norm() > same_turn)) return std::nullopt;
  const Vector3d n = normal.normalized();
  for (const Vector3d& pole : {axis, Vector3d(-axis)}) {
    // The closest point is the projection of the pole onto the plane; it must lie between both
    // ends.
    const Vector3d foot = pole - pole.dot(n) * n;
    if (from.cross(foot).dot(n) > 0.0 && foot.cross(to).dot(n) > 0.0)
      return Passing{pole, std::asin(std::min(1.0, std::abs(axis.dot(n))))};
  }
  return std::nullopt;
}

/// Returns the pole of a machine with perpendicular rotary axes. Throws std::invalid_argument for
/// others.
kinematics::Pole right_angled_pole(const Chain& chain, const AxisVector& q) {
  const auto pole = kinematics::nearest_pole(chain, q, q);
  const auto direction = [&](int j) { return chain.joints()[std::size_t(j)].direction_b; };
  const bool right =
      pole && std::abs(direction(pole->axis).dot(direction(pole->other))) < right_angles &&
      std::abs(chain.T_bt_home().linear().col(2).dot(direction(pole->other))) < right_angles;
  if (!right)
    throw std::invalid_argument(
        "a machine with two rotary axes at right angles to each other and to the tool");
  return *pole;
}

}  // namespace

std::vector<int> rotary_judgement_order(const Chain& chain) {
  std::vector<int> table, head;
  for (int j = 0; j < chain.size(); ++j) {
    const kinematics::Joint& joint = chain.joints()[std::size_t(j)];
    if (joint.motion == Motion::Rotary) (joint.side == Side::Tool ? head : table).push_back(j);
  }
  std::reverse(table.begin(), table.end());  // joints of the chain go from the workpiece to the bed
  table.insert(table.end(), head.begin(), head.end());
  return table;
}

const AxisVector& output_judgement(std::span<const AxisVector> branches, const AxisVector& now,
                                   const std::vector<int>& ranks) {
  const AxisVector* best = &branches.front();
  for (const AxisVector& one : branches)
    if (before(one, *best, now, ranks)) best = &one;
  return *best;
}

std::optional<PolePassage> pole_passage(const Chain& chain, const AxisVector& from,
                                        const AxisVector& to, const PoleOptions& limits) {
  const kinematics::Pole pole = right_angled_pole(chain, from);
  const kinematics::Joint& other = chain.joints()[std::size_t(pole.other)];
  const Vector3d axis_w =
      chain.T_bw_home().linear().transpose() * chain.joints()[std::size_t(pole.axis)].direction_b;
  const Vector3d wanted = tool_w(chain, to);
  const auto passed = passing(tool_w(chain, from), wanted, axis_w);
  if (!passed || passed->angle >= limits.near) return std::nullopt;
  const double in_pole = passed->pole.dot(axis_w) > 0.0 ? pole.at : pole.at + pi;
  // Inclination of the start relative to the pole: the sign tells on which side the axis continues.
  const double lean = std::remainder(from[pole.other] - in_pole, 2 * pi);
  const double singular = from[pole.other] - lean;
  const double end = kinematics::angle_between(wanted, passed->pole);
  // A start or an end in the pole is no passage.
  if (std::abs(lean) < same_turn || end < same_turn) return std::nullopt;
  PolePassage passage{to, passed->angle, 0.0, 0.0};
  passage.end[pole.axis] = from[pole.axis];
  // Beyond the pole by the angle of the end, so that the inclination of the tool is preserved.
  passage.end[pole.other] = singular - std::copysign(end, lean);
  const Vector3d reached = tool_w(chain, passage.end);
  passage.turned = kinematics::angle_between(wanted.cross(axis_w), reached.cross(axis_w));
  passage.off = kinematics::angle_between(wanted, reached);
  const bool reachable =
      passage.end[pole.other] >= other.min && passage.end[pole.other] <= other.max;
  if (passage.turned > limits.max_change || !reachable) return std::nullopt;
  return passage;
}

}  // namespace abbe::sim::dialects::fanuc

namespace abbe::sim::dialects {

const OrientationKinematics& VectorLines::turning_of(const Chain& chain) {
  // Most programs use one chain throughout; it is analysed once.
  if (chain_ != &chain) {
    turning_.emplace(chain);
    chain_ = &chain;
  }
  return *turning_;
}

AxisVector VectorLines::fanuc_rotary_axes(const Chain& chain, const Eigen::Vector3d& direction_w,
                                          const program::Cause& cause) {
  const OrientationKinematics& turning = turning_of(chain);
  const AxisVector now = run_.canon.position();
  // On a machine without rotary axes vectors are checked by the caller.
  if (!turning.possible()) return now;
  const auto all = turning.positions(direction_w.normalized(), now);
  if (all.empty())
    run_.canon.refuse(
        cause, "a tool vector that the rotary axes reach",
        fmt::format("{:.6g} {:.6g} {:.6g}", direction_w.x(), direction_w.y(), direction_w.z()));
  return fanuc::output_judgement(all, now, fanuc::rotary_judgement_order(chain));
}

bool VectorLines::lead_through_pole(const Chain& chain, program::Straight& move) {
  std::optional<fanuc::PolePassage> passage;
  try {
    passage = fanuc::pole_passage(chain, run_.canon.position(), move.end, run_.options().pole);
  } catch (const std::invalid_argument& fault) {
    run_.canon.refuse(move.cause, std::string(fault.what()) + ", beside pole = \"fanuc\"",
                      "one with " + run_.canon.letters());
  }
  if (!passage) return false;
  for (const int j : turning_of(chain).rotary()) move.end[j] = passage->end[j];
  ++pole_passages_.blocks;
  pole_passages_.turned = std::max(pole_passages_.turned, passage->turned);
  if (pole_passages_.line == 0 || passage->off > pole_passages_.off)
    pole_passages_.line = run_.canon.line();
  pole_passages_.off = std::max(pole_passages_.off, passage->off);
  return true;
}

bool VectorLines::straight_feed(const Chain& chain, program::Straight move) {
  const OrientationKinematics& turning = turning_of(chain);
  const AxisVector& start = run_.canon.position();
  const bool turns =
      std::ranges::any_of(turning.rotary(), [&](int j) { return move.end[j] != start[j]; });
  // A move without rotation needs no segments.
  if (!turns) return run_.canon.straight_feed(std::move(move)), true;
  if (rule() == PoleRule::Fanuc && turning.rotary().size() == 2 && lead_through_pole(chain, move))
    return run_.canon.straight_feed(std::move(move)), false;
  auto pieces = great_circle_segments(turning, start, move.end, great_circle_tolerance);
  if (pieces.empty())  // the end may be reached by the other solution of the rotary axes
    for (const AxisVector& q : turning.positions(turning.direction_w(move.end), start)) {
      AxisVector end = move.end;
      for (const int j : turning.rotary()) end[j] = q[j];
      pieces = great_circle_segments(turning, start, end, great_circle_tolerance);
      if (pieces.empty()) continue;
      move.end = std::move(end);
      break;
    }
  if (pieces.empty())
    run_.canon.refuse(move.cause,
                      "a turn of the tool on a great circle that the rotary axes follow, beside "
                      "pole = \"fanuc\" or \"siemens\"",
                      "opposite vectors, a pole on the way, or a way beyond their limits");
  feed_along_segments(run_.canon, turning, pieces, move);
  return true;
}

void VectorLines::finish() {
  if (pole_passages_.blocks == 0) return;
  run_.warn_once(fmt::format(
      "{} blocks would pass a pole nearer than {:.6g} deg and are led through it (tool posture "
      "control, parameters 19738 and 19739): their ends are turned about it by up to {:.3g} deg, "
      "and the tool is up to {:.3g} deg off its vector (line {})",
      pole_passages_.blocks, run_.options().pole.near / units::deg,
      pole_passages_.turned / units::deg, pole_passages_.off / units::deg, pole_passages_.line));
}

}  // namespace abbe::sim::dialects
