#include "sim/program/controlled_axes.h"

#include <cmath>

#include "kinematics/units.h"

namespace abbe::sim::program {

using kinematics::AxisVector;
using kinematics::Motion;

namespace {

/// Calls `visit(joint, axis)` for every axis but the spindles.
template <typename Visit>
void each_positioned(const std::vector<ControlledAxis>& axes, const Visit& visit) {
  const int spindle = spindle_of(axes);
  for (int j = 0; j < int(axes.size()); ++j)
    if (const ControlledAxis& axis = axes[std::size_t(j)];
        axis.motion != Motion::Spindle && j != spindle)
      visit(j, axis);
}

}  // namespace

int spindle_of(const std::vector<ControlledAxis>& axes) {
  int nose = -1;
  for (std::size_t j = 0; j < axes.size(); ++j) {
    if (axes[j].name == 'S' && axes[j].motion == Motion::Rotary) return int(j);
    if (axes[j].motion == Motion::Spindle && nose < 0) nose = int(j);
  }
  return nose;
}

bool turns_workpiece(const std::vector<ControlledAxis>& axes) {
  const int spindle = spindle_of(axes);
  return spindle >= 0 && axes[std::size_t(spindle)].motion == Motion::Rotary;
}

std::array<int, 26> joints_by_letter(const std::vector<ControlledAxis>& axes) {
  std::array<int, 26> joints;
  joints.fill(-1);
  each_positioned(axes, [&](int j, const ControlledAxis& axis) {
    if (axis.name >= 'A' && axis.name <= 'Z') joints[std::size_t(axis.name - 'A')] = j;
  });
  return joints;
}

std::string letters_of(const std::vector<ControlledAxis>& axes) {
  std::string letters;
  each_positioned(axes, [&](int, const ControlledAxis& axis) {
    if (!letters.empty()) letters += ' ';
    letters += axis.name;
  });
  return letters;
}

SquaredWay squared_way(const std::vector<ControlledAxis>& axes, const AxisVector& start,
                       const AxisVector& end) {
  SquaredWay squared;
  each_positioned(axes, [&](int j, const ControlledAxis& axis) {
    const double way = end[j] - start[j];
    double& sum = axis.motion != Motion::Linear ? squared.turns
                  : axis.name >= 'X'            ? squared.xyz
                                                : squared.uvw;
    sum += way * way;
  });
  return squared;
}

Way way_of_feed(const std::vector<ControlledAxis>& axes, const AxisVector& start,
                const AxisVector& end, const Arc* arc, const Eigen::Matrix3d* turn) {
  SquaredWay squared = squared_way(axes, start, end);
  if (arc != nullptr && turn != nullptr) {
    const Eigen::Vector3d way(end[arc->first] - start[arc->first],
                              end[arc->second] - start[arc->second],
                              end[arc->third] - start[arc->third]);
    const double round = (arc->radius + 0.5 * arc->growth) * arc->sweep;
    squared.xyz = squared.xyz - (turn->transpose() * way).head<2>().squaredNorm() + round * round;
  } else if (arc != nullptr) {
    const double chord =
        (end[arc->first] - start[arc->first]) * (end[arc->first] - start[arc->first]) +
        (end[arc->second] - start[arc->second]) * (end[arc->second] - start[arc->second]);
    const double round = (arc->radius + 0.5 * arc->growth) * arc->sweep;
    squared.xyz = squared.xyz - chord + round * round;
  }
  const double mm = std::sqrt(squared.xyz > 0.0 ? squared.xyz : squared.uvw);
  if (mm > 0.0) return {mm, true};
  return {std::sqrt(squared.turns) / units::deg, false};
}

}  // namespace abbe::sim::program
