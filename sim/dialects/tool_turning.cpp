#include "sim/dialects/tool_turning.h"

#include <algorithm>
#include <cmath>

#include "kinematics/inverse.h"
#include "kinematics/turn_between.h"
#include "kinematics/units.h"

namespace abbe::sim::dialects {

using Eigen::Vector3d;
using kinematics::angle_between;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Motion;
using kinematics::Side;

namespace {

constexpr int most_pieces = 4096;

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
  if (!xyz || slides != 3 || turns < 1 || turns > 2 || chain.find('S')) return std::nullopt;
  return Chain(std::move(joints), chain.T_bw_home(), chain.T_bt_home());
}

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

/// Unit directions turned uniformly from one to another.
struct GreatCircle {
  Vector3d from, across;  ///< unit, at right angles
  double angle = 0.0;

  Vector3d at(double fraction) const {
    return std::cos(fraction * angle) * from + std::sin(fraction * angle) * across;
  }
};

/// The rotary axes at equal pieces of the way; empty where they do not pass or the end is another.
std::vector<AxisVector> on_the_way(const RotaryTurning& turning, const GreatCircle& circle,
                                   const AxisVector& from, const AxisVector& to, int pieces) {
  constexpr double same_position = 1e-9;  // rad
  std::vector<AxisVector> way{from};
  for (int i = 1; i <= pieces; ++i) {
    const auto next = turning.positions(circle.at(double(i) / pieces), way.back());
    if (next.empty()) return {};
    way.push_back(next.front());
  }
  for (const int j : turning.rotary())
    if (std::abs(way.back()[j] - to[j]) > same_position) return {};
  way.back() = to;
  return way;
}

}  // namespace

RotaryTurning::RotaryTurning(const std::optional<Chain>& control) {
  if (!control) return;
  free_ = pointing_chain(*control);
  if (free_) rotary_ = rotary_in_order(*free_);
}

Vector3d RotaryTurning::direction_w(const AxisVector& q) const {
  return free_->tool_in_workpiece(q).linear().col(2);
}

std::vector<AxisVector> RotaryTurning::positions(const Vector3d& direction_w,
                                                 const AxisVector& near) const {
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

std::vector<TurningPiece> great_circle_pieces(const RotaryTurning& turning, const AxisVector& from,
                                              const AxisVector& to, double tolerance) {
  GreatCircle circle;
  circle.from = turning.direction_w(from).normalized();
  const Vector3d end = turning.direction_w(to).normalized();
  circle.angle = angle_between(circle.from, end);
  if (circle.angle < tolerance) return {{1.0, to}};
  if (circle.angle > pi - 1e-6) return {};
  circle.across = (end - end.dot(circle.from) * circle.from).normalized();
  for (int pieces = 1; pieces <= most_pieces;) {
    const std::vector<AxisVector> way = on_the_way(turning, circle, from, to, pieces);
    if (way.empty()) {
      if (pieces > 1) return {};
      pieces = 16;  // far apart the nearest position may be the wrong one
      continue;
    }
    double worst = 0.0;
    for (int i = 0; i < pieces; ++i)
      for (const double within : {0.25, 0.5, 0.75}) {
        const AxisVector q =
            way[std::size_t(i)] + within * (way[std::size_t(i) + 1] - way[std::size_t(i)]);
        worst = std::max(worst, angle_between(turning.direction_w(q).normalized(),
                                              circle.at((i + within) / pieces)));
      }
    if (worst > tolerance) {  // it falls with the square of their number
      const int first = pieces;
      do pieces *= 2;
      while (worst > tolerance * pieces * pieces / (first * first));
      continue;
    }
    std::vector<TurningPiece> all;
    for (int i = 1; i <= pieces; ++i) all.push_back({double(i) / pieces, way[std::size_t(i)]});
    return all;
  }
  return {};
}

void feed_in_pieces(program::Canon& canon, const RotaryTurning& turning,
                    const std::vector<TurningPiece>& pieces, const program::Straight& move) {
  const AxisVector start = canon.position();
  const auto feed = canon.feed();
  if (feed && canon.feed_mode() == program::FeedMode::InverseTime)
    canon.set_feed(program::Feed{feed->word * double(pieces.size()), feed->unit});
  for (const TurningPiece& piece : pieces) {
    program::Straight part = move;
    part.end = start + piece.fraction * (move.end - start);
    for (const int j : turning.rotary()) part.end[j] = piece.q[j];
    if (piece.fraction == 1.0) part.end = move.end;
    canon.straight_feed(std::move(part));
  }
  canon.set_feed(feed);
}

}  // namespace abbe::sim::dialects
