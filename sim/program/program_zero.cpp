#include "sim/program/program_zero.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace abbe::sim::program {

using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;

std::optional<Vector3d> tip_at_zero(const Chain& chain) {
  constexpr double along = 1e-9;  // mm by mm
  std::array<int, 3> xyz{-1, -1, -1};
  for (int j = 0; j < chain.size(); ++j) {
    const kinematics::Joint& joint = chain.joints()[std::size_t(j)];
    if (joint.name >= 'X' && joint.name <= 'Z' && joint.motion == kinematics::Motion::Linear)
      xyz[std::size_t(joint.name - 'X')] = j;
  }
  const AxisVector zero = AxisVector::Zero(chain.size());
  const Vector3d tip_w = chain.tool_in_workpiece(zero).translation();
  for (int k = 0; k < 3; ++k) {
    if (xyz[std::size_t(k)] < 0) return std::nullopt;
    AxisVector q = zero;
    q[xyz[std::size_t(k)]] = 1.0;
    const Vector3d way = chain.tool_in_workpiece(q).translation() - tip_w;
    if ((way - Vector3d::Unit(k)).norm() > along) return std::nullopt;
  }
  return tip_w;
}

std::optional<AxisVector> tip_shift(const Chain& chain) {
  constexpr double right_angle = 1e-9;  // cosine
  const AxisVector zero = AxisVector::Zero(chain.size());
  const Vector3d tip_w = chain.tool_in_workpiece(zero).translation();
  AxisVector shift = zero;
  std::vector<Vector3d> directions;
  for (int j = 0; j < chain.size(); ++j) {
    const kinematics::Joint& joint = chain.joints()[std::size_t(j)];
    if (joint.name < 'X' || joint.name > 'Z' || joint.motion != kinematics::Motion::Linear)
      continue;
    AxisVector q = zero;
    q[j] = 1.0;
    const Vector3d way_w = chain.tool_in_workpiece(q).translation() - tip_w;
    for (const Vector3d& other : directions)
      if (std::abs(other.dot(way_w)) > right_angle) return std::nullopt;
    directions.push_back(way_w);
    shift[j] = -way_w.dot(tip_w);
  }
  return shift;
}

// G43 adds the length to Z, so the nose is that much above the tip in Z, wherever the tool points
// with the axes at zero.
std::optional<ProgramZero> known_zero(const NcOptions& options) {
  const bool several = !options.control_of_h.empty();
  if (!several && !options.control) return std::nullopt;
  const Chain& chain = several ? options.control_of_h.begin()->second : *options.control;
  auto length = options.tool_length.find(several ? options.control_of_h.begin()->first : 1);
  if (length == options.tool_length.end()) length = options.tool_length.begin();
  const auto tip_w = tip_at_zero(chain);
  if (!tip_w) return std::nullopt;
  const double mm = length == options.tool_length.end() ? 0.0 : length->second;
  const auto& joints = chain.joints();
  const bool turns = std::any_of(joints.begin(), joints.end(), [](const kinematics::Joint& joint) {
    return joint.motion == kinematics::Motion::Rotary;
  });
  return ProgramZero{*tip_w + mm * Vector3d::UnitZ(), turns};
}

std::optional<ProgramZero> program_zero(const NcOptions& options) {
  const auto& offsets = options.work_offset;
  const bool stated = !options.more_offset.empty() ||
                      std::any_of(offsets.begin(), offsets.end(),
                                  [](const AxisVector& offset) { return offset.size() > 0; });
  return stated ? known_zero(options) : std::nullopt;
}

Vector3d on_top_of_offset(const std::optional<ProgramZero>& zero, Coordinates coordinates) {
  const bool differs = zero && zero->places == (coordinates == Coordinates::Axis);
  if (!differs) return Vector3d::Zero();
  return zero->places ? Vector3d(-zero->nose_w) : zero->nose_w;
}

}  // namespace abbe::sim::program
