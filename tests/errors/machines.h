#pragma once

#include "errors/geometric.h"
#include "kinematics/chain.h"
#include "tests/test.h"

/// Machines and small makers that the tests of this folder share.
namespace abbe::errors {

inline kinematics::Joint joint(char name, kinematics::Side side, kinematics::Motion motion,
                               const Vector3d& direction_b, const Vector3d& point_b) {
  kinematics::Joint j;
  j.name = name;
  j.side = side;
  j.motion = motion;
  j.direction_b = direction_b;
  j.point_b = point_b;
  return j;
}

inline kinematics::Pose at(double x, double y, double z) {
  return kinematics::Pose(Eigen::Translation3d(x, y, z));
}

/// "w C' b X Y Z A s t", every joint's point on a place of its own.
inline kinematics::Chain gantry() {
  using enum kinematics::Side;
  using enum kinematics::Motion;
  const Vector3d ex(1, 0, 0), ey(0, 1, 0), ez(0, 0, 1);
  return kinematics::Chain(
      {joint('C', Workpiece, Rotary, ez, {0, 0, -50}), joint('X', Tool, Linear, ex, {0, -400, 300}),
       joint('Y', Tool, Linear, ey, {100, 0, 350}), joint('Z', Tool, Linear, ez, {0, 50, 400}),
       joint('A', Tool, Rotary, ex, {0, 0, 200}), joint('s', Tool, Spindle, ez, {0, 0, 150})},
      at(0, 0, 0), at(0, 0, 0));
}

/// "w A' Z' Y' X' b C s t": what carries the tool on the gantry carries the workpiece, and back.
inline kinematics::Chain turned_gantry() {
  using enum kinematics::Side;
  using enum kinematics::Motion;
  const Vector3d ex(1, 0, 0), ey(0, 1, 0), ez(0, 0, 1);
  return kinematics::Chain({joint('A', Workpiece, Rotary, ex, {0, 0, 200}),
                            joint('Z', Workpiece, Linear, ez, {0, 50, 400}),
                            joint('Y', Workpiece, Linear, ey, {100, 0, 350}),
                            joint('X', Workpiece, Linear, ex, {0, -400, 300}),
                            joint('C', Tool, Rotary, ez, {500, 300, 250}),
                            joint('s', Tool, Spindle, ez, {500, 380, 50})},
                           at(0, 0, 0), at(500, 400, -50));
}

/// "w S' X' b Z t": a spindle about X on the X slide turns the workpiece.
inline kinematics::Chain platform() {
  using enum kinematics::Side;
  using enum kinematics::Motion;
  const Vector3d ex(1, 0, 0), ez(0, 0, 1);
  return kinematics::Chain(
      {joint('S', Workpiece, Rotary, ex, {0, 0, 0}),
       joint('X', Workpiece, Linear, ex, {10, 0, -30}), joint('Z', Tool, Linear, ez, {20, 0, 100})},
      at(0, 0, 0), at(20, 0, 12));
}

/// An element of one curve.
inline Element element(const std::string& name, Shape shape) {
  return {parse_element_name(name), {Curve{std::move(shape)}}};
}

inline kinematics::AxisState state_at(std::initializer_list<double> q) {
  kinematics::AxisState state;
  state.q.resize(Index(q.size()));
  std::copy(q.begin(), q.end(), state.q.data());
  return state;
}

}  // namespace abbe::errors
