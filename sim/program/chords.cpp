#include "sim/program/chords.h"

#include <algorithm>
#include <cmath>

#include "kinematics/bad_input.h"
#include "kinematics/inverse.h"
#include "kinematics/jacobian.h"

namespace abbe::sim::program {

using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Motion;

namespace {

constexpr double far_lever = 1e4;   // mm, more than any machine has
constexpr double most_parts = 1e5;  // of a block

bool is_positioned_turn(const kinematics::Joint& joint) {
  return joint.motion == Motion::Rotary && joint.name != 'S';
}

/// Largest first and second derivative of one coordinate of a cubic over u in [0, 1].
struct Bend {
  double first = 0.0, second = 0.0;
};

Bend bend_of(const Cubic& cubic, const Block& block, int j) {
  const double duration = block.end_s - block.start_s;
  const double v0 = cubic.start_velocity[j] * duration, v1 = cubic.end_velocity[j] * duration;
  const double middle = 3 * (block.end[j] - block.start[j]) - v0 - v1;
  return {std::max({std::abs(v0), std::abs(middle), std::abs(v1)}),
          2 * std::max(std::abs(middle - v0), std::abs(v1 - middle))};
}

/// Sum of the levers by which rotary axes move the tip, mm per rad.
double levers(const Chain& chain, const AxisVector& q) {
  const kinematics::AxisJacobian J = kinematics::axis_jacobian(chain, q);
  double sum = 0.0;
  for (int j = 0; j < chain.size(); ++j)
    if (is_positioned_turn(chain.joints()[std::size_t(j)])) sum += J.col(j).head<3>().norm();
  return sum;
}

}  // namespace

AxisVector axes_at(const Path& path, const Block& block, const Chain& control, double u) {
  AxisVector programmed = position(path, block, u);
  if (block.coordinates == Coordinates::Axis) return programmed;
  const auto x = control.find('X'), y = control.find('Y'), z = control.find('Z');
  if (!x || !y || !z)
    throw BadInput(path.file, block.line, 0, "a machine with X Y Z for a tip mode", "another");
  const auto q =
      slides_for_tip(control, programmed, {programmed[*x], programmed[*y], programmed[*z]});
  if (!q)
    throw BadInput(path.file, block.line, 0, "slides that reach the tip",
                   "a tip out of their reach");
  return *q;
}

double turn_in(const Path& path, const Block& block, const Chain& control) {
  double turn = 0.0;
  for (int j = 0; j < control.size(); ++j)
    if (is_positioned_turn(control.joints()[std::size_t(j)]))
      turn += block.interpolation == Interpolation::Cubic
                  ? bend_of(path.cubics[block.shape], block, j).first
                  : std::abs(block.end[j] - block.start[j]);
  return turn;
}

std::size_t chords_of(const Path& path, const Block& block, const Chain& control, double within) {
  const double turn = turn_in(path, block, control);
  double way = 0.0, bend = 0.0;
  for (int j = 0; j < control.size(); ++j) {
    if (control.joints()[std::size_t(j)].motion != Motion::Linear) continue;
    if (block.interpolation == Interpolation::Cubic) {
      const Bend b = bend_of(path.cubics[block.shape], block, j);
      way += b.first;
      bend += b.second;
    } else {
      way += std::abs(block.end[j] - block.start[j]);
    }
  }
  if (block.interpolation == Interpolation::Arc) {
    const Arc& arc = path.arcs[block.shape];
    const double radius = arc.radius + std::abs(arc.growth), sweep = std::abs(arc.sweep);
    way += radius * sweep;
    bend += radius * sweep * sweep;
  }
  const double allowed = 8 * within;
  bend += 2 * way * turn + way * turn * turn;
  if (turn > 0.0 && bend + far_lever * turn * turn > allowed)
    bend += levers(control, axes_at(path, block, control, 0.0)) * turn * turn;
  return std::size_t(std::clamp(std::ceil(std::sqrt(bend / allowed)), 1.0, most_parts));
}

}  // namespace abbe::sim::program
