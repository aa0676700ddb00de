#pragma once

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <string>

#include "kinematics/chain.h"
#include "kinematics/units.h"
#include "sim/program/nc_reader.h"
#include "sim/program/path.h"

/// Machines that the tests of programs share.
namespace abbe::sim::program::test {

using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;
using kinematics::Pose;
using kinematics::Side;

inline Joint joint(char name, Side side, Motion motion, const Eigen::Vector3d& direction,
                   const Eigen::Vector3d& point = Eigen::Vector3d::Zero()) {
  Joint joint;
  joint.name = name;
  joint.side = side;
  joint.motion = motion;
  joint.direction_b = direction;
  joint.point_b = point;
  return joint;
}

inline const Eigen::Vector3d ex = Eigen::Vector3d::UnitX();
inline const Eigen::Vector3d ey = Eigen::Vector3d::UnitY();
inline const Eigen::Vector3d ez = Eigen::Vector3d::UnitZ();

/// w C' b X Y Z A s t: table about the origin, head that swivels 250 mm above the tip.
inline Chain gantry() {
  return Chain(
      {joint('C', Side::Workpiece, Motion::Rotary, ez), joint('X', Side::Tool, Motion::Linear, ex),
       joint('Y', Side::Tool, Motion::Linear, ey), joint('Z', Side::Tool, Motion::Linear, ez),
       joint('A', Side::Tool, Motion::Rotary, ex, {0, 0, 250}),
       joint('s', Side::Tool, Motion::Spindle, ez, {0, 0, 100})},
      Pose::Identity(), Pose::Identity());
}

/// w C' A' b X Y Z t: a table on a trunnion, both axes through the origin; at zero the nose stands
/// there, and a tool of 100 mm reaches below.
inline Chain trunnion() {
  Pose T_bt = Pose::Identity();
  T_bt.translation() = Eigen::Vector3d(0, 0, -100);
  return Chain(
      {joint('C', Side::Workpiece, Motion::Rotary, ez),
       joint('A', Side::Workpiece, Motion::Rotary, ex), joint('X', Side::Tool, Motion::Linear, ex),
       joint('Y', Side::Tool, Motion::Linear, ey), joint('Z', Side::Tool, Motion::Linear, ez)},
      Pose::Identity(), T_bt);
}

inline Chain three_axis() {
  return Chain(
      {joint('X', Side::Workpiece, Motion::Linear, ex), joint('Y', Side::Tool, Motion::Linear, ey),
       joint('Z', Side::Tool, Motion::Linear, ez)},
      Pose::Identity(), Pose::Identity());
}

/// w S' X' b Z t: the spindle along bed X carries the workpiece (its z axis), the X slide carries
/// the spindle, Z feeds across. The tool's x-z plane is the plane of X and Z.
inline Chain platform() {
  Pose T_bw = Pose::Identity();
  T_bw.linear().col(0) = ey;
  T_bw.linear().col(1) = ez;
  T_bw.linear().col(2) = ex;
  Pose T_bt = Pose::Identity();
  T_bt.translation() = Eigen::Vector3d(1.0, 0.0, 15.0);
  return Chain(
      {joint('S', Side::Workpiece, Motion::Rotary, ex),
       joint('X', Side::Workpiece, Motion::Linear, ex), joint('Z', Side::Tool, Motion::Linear, ez)},
      T_bw, T_bt);
}

inline NcOptions options_for(const Chain& chain) {
  NcOptions options;
  for (const Joint& j : chain.joints()) options.axes.push_back({j.name, j.motion});
  options.start = AxisVector::Zero(chain.size());
  options.tool_length = {{1, 100.0}, {2, 50.0}};
  options.rapid_speed = 100.0;
  options.rapid_rotation_speed = 1.0;
  options.control = chain;
  return options;
}

/// A path as text, one line a block.
inline std::string listing(const Path& path, const NcOptions& options) {
  static constexpr const char* names[] = {"rapid", "line", "arc", "cubic", "dwell"};
  std::string text;
  for (const Block& block : path.blocks) {
    text += fmt::format(
        "line {} {} {} from {:.9g} to {:.9g} s:", block.line, names[int(block.interpolation)],
        block.coordinates == Coordinates::Tip ? "tip" : "axis", block.start_s, block.end_s);
    for (int j = 0; j < int(block.end.size()); ++j) {
      const bool linear = options.axes[std::size_t(j)].motion == Motion::Linear;
      const double value = linear ? block.end[j] : block.end[j] / units::deg;
      text += fmt::format(" {}{:.9g}", options.axes[std::size_t(j)].name,
                          std::abs(value) < 1e-12 ? 0.0 : value);
    }
    if (block.interpolation == Interpolation::Arc) {
      const Arc& arc = path.arcs[block.shape];
      text += fmt::format(" | centre {:.9g} {:.9g} radius {:.9g} growth {:.3g} sweep {:.9g} deg",
                          arc.centre.x() + 0.0, arc.centre.y() + 0.0, arc.radius,
                          std::abs(arc.growth) < 1e-12 ? 0.0 : arc.growth, arc.sweep / units::deg);
    }
    text += '\n';
  }
  return text + fmt::format("{} moves\n", path.motion_blocks);
}

inline std::string file_text(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace abbe::sim::program::test
