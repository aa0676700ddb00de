#include "sim/program/chords.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/jacobian.h"
#include "kinematics/units.h"
#include "sim/program/block_axes.h"

namespace abbe::sim::program {

using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Motion;

namespace {

constexpr double far_lever = 1e4;  // mm, more than any machine has

bool is_positioned_turn(const kinematics::Joint& joint) {
  return joint.motion == Motion::Rotary && joint.name != 'S';
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

double turn_in(const Path& path, const Block& block, const Chain& control) {
  double turn = 0.0;
  for (int j = 0; j < control.size(); ++j)
    if (is_positioned_turn(control.joints()[std::size_t(j)])) turn += bends(path, block, j).first;
  return turn;
}

std::size_t chords_of(const Path& path, const Block& block, const Chain& control, double within) {
  const double turn = turn_in(path, block, control);
  double way = 0.0, bend = 0.0;
  for (int j = 0; j < control.size(); ++j) {
    if (control.joints()[std::size_t(j)].motion != Motion::Linear) continue;
    const Bends b = bends(path, block, j);
    way += b.first;
    bend += b.second;
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
  const double parts = std::max(1.0, std::ceil(std::sqrt(bend / allowed)));
  if (!(parts <= max_chords))
    throw BadInput(path.file, block.line, 0,
                   fmt::format("a move of at most {:.0g} chords within {:.4g} um", max_chords,
                               within / units::um),
                   fmt::format("one of {:.3g}; a larger tolerance needs fewer", parts));
  return std::size_t(parts);
}

}  // namespace abbe::sim::program
