#include "sim/program/path.h"

#include <algorithm>
#include <cmath>

#include "kinematics/units.h"

namespace abbe::sim::program {

bool is_feed(const Block& block) {
  return block.interpolation != Interpolation::Rapid && block.interpolation != Interpolation::Dwell;
}

using kinematics::AxisVector;

Eigen::Vector2d position(const Arc& arc, double u) {
  const double angle = arc.start_angle + u * arc.sweep;
  const double radius = arc.radius + u * arc.growth;
  return {arc.centre.x() + radius * std::cos(angle), arc.centre.y() + radius * std::sin(angle)};
}

Arc arc_through(const ArcWords& words) {
  constexpr double same_point = 1e-8;  // mm
  const Eigen::Vector2d from = words.start - words.centre, to = words.end - words.centre;
  Arc arc;
  arc.centre = words.centre;
  arc.radius = from.norm();
  arc.growth = to.norm() - arc.radius;
  arc.start_angle = std::atan2(from.y(), from.x());
  double sweep = std::atan2(from.x() * to.y() - from.y() * to.x(), from.dot(to));
  const bool whole = (words.end - words.start).norm() < same_point;
  if (!words.clockwise && (sweep <= 0 || whole)) sweep = whole ? 2 * pi : sweep + 2 * pi;
  if (words.clockwise && (sweep >= 0 || whole)) sweep = whole ? -2 * pi : sweep - 2 * pi;
  arc.sweep = sweep;
  return arc;
}

namespace {

/// The coordinates of an arc in its plane and across it, changed by `change`.
template <typename Vector, typename Change>
void in_its_plane(const Path& path, const Arc& arc, Vector& q, const Change& change) {
  if (arc.turned < 0) {
    Eigen::Vector3d p(q[arc.first], q[arc.second], 0.0);
    change(p);
    q[arc.first] = p.x();
    q[arc.second] = p.y();
    return;
  }
  const Eigen::Matrix3d& R = path.turns[std::size_t(arc.turned)];
  Eigen::Vector3d p = R.transpose() * Eigen::Vector3d(q[arc.first], q[arc.second], q[arc.third]);
  change(p);
  p = R * p;
  q[arc.first] = p.x();
  q[arc.second] = p.y();
  q[arc.third] = p.z();
}

/// Angles at which one of X Y Z turns back on an arc in a plane that is turned.
std::vector<double> turning_angles(const Path& path, const Block& block, const Arc& arc) {
  const Eigen::Matrix3d& R = path.turns[std::size_t(arc.turned)];
  const Eigen::Vector3d way(block.end[arc.first] - block.start[arc.first],
                            block.end[arc.second] - block.start[arc.second],
                            block.end[arc.third] - block.start[arc.third]);
  const double across = R.col(2).dot(way) / arc.sweep;  // per rad
  std::vector<double> found;
  for (int i = 0; i < 3; ++i) {
    const double reach = arc.radius * std::hypot(R(i, 0), R(i, 1));
    if (!(std::abs(R(i, 2) * across) < reach)) continue;
    const double phase = std::atan2(R(i, 1), R(i, 0));
    const double lag = std::asin(R(i, 2) * across / reach);
    found.push_back(phase + lag);
    found.push_back(phase + pi - lag);
  }
  return found;
}

}  // namespace

// The cubics are written as the line plus what bends it, so that a motion at constant speed stays
// straight to the last bit but one.
AxisVector position(const Path& path, const Block& block, double u) {
  if (u <= 0.0) return block.start;
  if (u >= 1.0) return block.end;
  const AxisVector way = block.end - block.start;
  AxisVector q = block.start + u * way;
  if (block.interpolation == Interpolation::Arc) {
    const Arc& arc = path.arcs[block.shape];
    in_its_plane(path, arc, q, [&](Eigen::Vector3d& p) { p.head<2>() = position(arc, u); });
  } else if (block.interpolation == Interpolation::Cubic) {
    const Cubic& cubic = path.cubics[block.shape];
    const double duration = block.end_s - block.start_s;
    q += u * (1 - u) *
         ((1 - u) * (duration * cubic.start_velocity - way) -
          u * (duration * cubic.end_velocity - way));
  }
  return q;
}

std::vector<double> turning_points(const Path& path, const Block& block) {
  const Arc& arc = path.arcs[block.shape];
  const double quarter = 0.5 * pi;
  const double low = std::min(arc.start_angle, arc.start_angle + arc.sweep);
  const double high = std::max(arc.start_angle, arc.start_angle + arc.sweep);
  std::vector<double> u;
  if (arc.turned < 0)
    for (double k = std::ceil(low / quarter); k * quarter < high; ++k)
      u.push_back((k * quarter - arc.start_angle) / arc.sweep);
  else
    for (const double angle : turning_angles(path, block, arc))
      for (double k = std::ceil((low - angle) / (2 * pi)); angle + 2 * pi * k < high; ++k)
        u.push_back((angle + 2 * pi * k - arc.start_angle) / arc.sweep);
  return u;
}

namespace {

/// Takes over the shape of a block, and no other.
void take_shape(Path& part, Block& block, const Path& path) {
  if (block.interpolation == Interpolation::Arc) {
    Arc arc = path.arcs[block.shape];
    if (arc.turned >= 0) {
      const Eigen::Matrix3d& turn = path.turns[std::size_t(arc.turned)];
      if (part.turns.empty() || part.turns.back() != turn) part.turns.push_back(turn);
      arc.turned = int(part.turns.size()) - 1;
    }
    block.shape = std::uint32_t(part.arcs.size());
    part.arcs.push_back(arc);
  } else if (block.interpolation == Interpolation::Cubic) {
    part.cubics.push_back(path.cubics[block.shape]);
    block.shape = std::uint32_t(part.cubics.size() - 1);
  }
}

}  // namespace

Path stretch_of(const Path& path, std::size_t first, std::size_t last) {
  Path part;
  part.file = path.file;
  part.more_files = path.more_files;
  part.blocks.assign(path.blocks.begin() + std::ptrdiff_t(first),
                     path.blocks.begin() + std::ptrdiff_t(last));
  const auto from = std::ranges::lower_bound(path.asides, first, {}, &Aside::before);
  for (auto aside = from; aside != path.asides.end(); ++aside) {
    if (aside->before >= last && last != path.blocks.size()) break;
    part.asides.push_back({aside->before - first, aside->text});
  }
  part.unit_words = path.unit_words;
  for (Block& block : part.blocks) take_shape(part, block, path);
  for (const Block& block : part.blocks)
    part.motion_blocks += block.interpolation != Interpolation::Dwell;
  return part;
}

AxisVector velocity(const Path& path, const Block& block, double u) {
  const double duration = block.end_s - block.start_s;
  const AxisVector way = block.end - block.start;
  if (!(duration > 0.0)) return AxisVector::Zero(way.size());
  AxisVector rate = way / duration;
  if (block.interpolation == Interpolation::Arc) {
    const Arc& arc = path.arcs[block.shape];
    const double angle = arc.start_angle + u * arc.sweep;
    const double radius = arc.radius + u * arc.growth;
    const double c = std::cos(angle), s = std::sin(angle);
    in_its_plane(path, arc, rate, [&](Eigen::Vector3d& v) {
      v.x() = (arc.growth * c - radius * arc.sweep * s) / duration;
      v.y() = (arc.growth * s + radius * arc.sweep * c) / duration;
    });
  } else if (block.interpolation == Interpolation::Cubic) {
    const Cubic& cubic = path.cubics[block.shape];
    if (u <= 0.0) return cubic.start_velocity;
    if (u >= 1.0) return cubic.end_velocity;
    rate += (1 - u) * (1 - 3 * u) * (cubic.start_velocity - rate) -
            u * (2 - 3 * u) * (cubic.end_velocity - rate);
  }
  return rate;
}

}  // namespace abbe::sim::program
