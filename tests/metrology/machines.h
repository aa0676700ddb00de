#pragma once

#include <string>
#include <vector>

#include "errors/metrology/readings.h"
#include "kinematics/chain.h"
#include "kinematics/units.h"

/// The machines of the scenes with their limits of travel, and what is wrong with them by hand.
namespace abbe::errors::metrology::machines {

using kinematics::Chain;
using kinematics::Joint;
using kinematics::JointDeviation;
using kinematics::Motion;
using kinematics::Pose;
using kinematics::Side;

inline const Eigen::Vector3d x = Eigen::Vector3d::UnitX();
inline const Eigen::Vector3d y = Eigen::Vector3d::UnitY();
inline const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();

inline Joint slide(char name, Side side, const Eigen::Vector3d& direction_b,
                   const Eigen::Vector3d& point_b, double min, double max) {
  return {name, side, Motion::Linear, direction_b, point_b, min, max, {}, {}};
}
inline Joint turn(char name, Side side, const Eigen::Vector3d& direction_b,
                  const Eigen::Vector3d& point_b, double degrees) {
  return {
      name, side, Motion::Rotary, direction_b, point_b, -degrees * units::deg, degrees * units::deg,
      {},   {}};
}
inline Joint nose(double height) {
  return {'s', Side::Tool, Motion::Spindle, z, height * z, -1e9, 1e9, {}, {}};
}
inline Pose at(double px, double py, double pz) { return Pose(Eigen::Translation3d(px, py, pz)); }
/// The tool of a lathe: its axis along +x of the bed.
inline Pose lying_tool() {
  Pose T = Pose::Identity();
  T.linear() << 0, 0, 1, 0, 1, 0, -1, 0, 0;
  return T;
}

inline Chain gantry() {
  using enum Side;
  return Chain(
      {turn('C', Workpiece, z, {0, 0, 0}, 36000), slide('X', Tool, x, {0, 0, 200}, -300, 300),
       slide('Y', Tool, y, {0, 0, 200}, -350, 350), slide('Z', Tool, z, {0, 0, 200}, -50, 350),
       turn('A', Tool, x, {0, 0, 200}, 110), nose(50)},
      at(0, 0, 0), at(0, 0, 20));
}
inline Chain trunnion() {
  using enum Side;
  return Chain(
      {turn('C', Workpiece, z, {0, 0, 0}, 36000), turn('A', Workpiece, x, {0, 0, 0}, 120),
       slide('Y', Tool, y, {0, 0, 200}, -250, 250), slide('X', Tool, x, {0, 0, 200}, -300, 300),
       slide('Z', Tool, z, {0, 0, 200}, -200, 300), nose(200)},
      at(0, 0, 50), at(0, 0, 170));
}
inline Chain head_head() {
  using enum Side;
  return Chain(
      {slide('X', Tool, x, {0, 0, 600}, -1000, 1000), slide('Y', Tool, y, {0, 0, 600}, -600, 600),
       slide('Z', Tool, z, {0, 0, 600}, -450, 400), turn('C', Tool, z, {0, 0, 600}, 360),
       turn('A', Tool, x, {0, 0, 600}, 110), nose(400)},
      at(0, 0, 0), at(0, 0, 360));
}
inline Chain three_axis() {
  using enum Side;
  return Chain({slide('X', Workpiece, x, {0, 0, -50}, -400, 400),
                slide('Y', Workpiece, y, {0, 0, -150}, -250, 250),
                slide('Z', Tool, z, {0, 200, 300}, -100, 400), nose(100)},
               at(0, 0, 0), at(0, 0, 60));
}
inline Chain platform() {
  using enum Side;
  return Chain(
      {turn('S', Workpiece, x, {0, 0, 0}, 1e9), slide('X', Workpiece, x, {-80, -60, 0}, -20, 80),
       slide('Z', Tool, z, {100, -60, -40}, -20, 80)},
      at(0, 0, 0), lying_tool());
}
inline Chain lathe() {
  using enum Side;
  return Chain(
      {turn('S', Workpiece, -z, {0, 0, 0}, 1e9), slide('Z', Tool, z, {200, -100, 0}, -20, 300),
       slide('X', Tool, x, {200, -50, 0}, -5, 200)},
      at(0, 0, 0), lying_tool());
}

struct Named {
  std::string name;
  Chain chain;
};
inline std::vector<Named> all() {
  return {{"gantry", gantry()},         {"trunnion", trunnion()}, {"head_head", head_head()},
          {"three_axis", three_axis()}, {"platform", platform()}, {"lathe", lathe()}};
}

/// A machine with deviations that are a function of the state.
using Deviations = std::function<std::vector<JointDeviation>(const kinematics::AxisState&)>;
inline MachineUnderTest wrong(const Chain& chain, Deviations deviations) {
  return [chain, deviations](const kinematics::AxisState& state) {
    const std::vector<JointDeviation> d = deviations(state);
    return BodyPoses{chain.workpiece_in_bed(state.q, d), chain.tool_in_bed(state.q, d)};
  };
}
inline MachineUnderTest perfect(const Chain& chain) {
  return [chain](const kinematics::AxisState& state) { return nominal_bodies(chain, state.q); };
}
inline std::vector<JointDeviation> none(const Chain& chain) {
  return std::vector<JointDeviation>(std::size_t(chain.size()));
}

}  // namespace abbe::errors::metrology::machines
