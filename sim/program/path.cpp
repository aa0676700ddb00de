#include "sim/program/path.h"

#include <cmath>

namespace abbe::sim::program {
namespace {

using kinematics::AxisVector;

void put_arc_position(const Arc& arc, double u, AxisVector& q) {
  const double angle = arc.start_angle + u * arc.sweep;
  const double radius = arc.radius + u * arc.growth;
  q[arc.first] = arc.centre.x() + radius * std::cos(angle);
  q[arc.second] = arc.centre.y() + radius * std::sin(angle);
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
    put_arc_position(path.arcs[block.shape], u, q);
  } else if (block.interpolation == Interpolation::Cubic) {
    const Cubic& cubic = path.cubics[block.shape];
    const double duration = block.end_s - block.start_s;
    q += u * (1 - u) *
         ((1 - u) * (duration * cubic.start_velocity - way) -
          u * (duration * cubic.end_velocity - way));
  }
  return q;
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
    rate[arc.first] = (arc.growth * c - radius * arc.sweep * s) / duration;
    rate[arc.second] = (arc.growth * s + radius * arc.sweep * c) / duration;
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
