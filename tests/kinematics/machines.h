#pragma once

#include <random>
#include <string>
#include <vector>

#include "kinematics/chain.h"
#include "kinematics/units.h"

/// Machines that the tests share. Points and clamping are odd on purpose: no lever is zero, so a
/// sign or a frame that is wrong shows.
namespace abbe::machines {

using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;
using kinematics::Pose;
using kinematics::Side;

inline Joint slide(char name, Side side, const Eigen::Vector3d& direction_b,
                   const Eigen::Vector3d& point_b = Eigen::Vector3d::Zero()) {
  return {name, side, Motion::Linear, direction_b, point_b, -2000.0, 2000.0, {}, {}};
}

inline Joint turn(char name, Side side, const Eigen::Vector3d& direction_b,
                  const Eigen::Vector3d& point_b = Eigen::Vector3d::Zero()) {
  return {name, side, Motion::Rotary, direction_b, point_b, -1e4, 1e4, {}, {}};
}

inline Joint nose(const Eigen::Vector3d& point_b) {
  return {'s', Side::Tool, Motion::Spindle, Eigen::Vector3d::UnitZ(), point_b, -1e9, 1e9, {}, {}};
}

inline Pose placed(const Eigen::Vector3d& point_b) {
  Pose T = Pose::Identity();
  T.translation() = point_b;
  return T;
}

inline Pose placed(const Eigen::Vector3d& point_b, double angle, const Eigen::Vector3d& about) {
  Pose T = placed(point_b);
  T.linear() = Eigen::AngleAxisd(angle, about.normalized()).toRotationMatrix();
  return T;
}

inline const Eigen::Vector3d x = Eigen::Vector3d::UnitX();
inline const Eigen::Vector3d y = Eigen::Vector3d::UnitY();
inline const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();

/// w C' b X Y Z A s t, the gantry of Guo et al. 2016.
inline Chain gantry() {
  return Chain(
      {turn('C', Side::Workpiece, z, {12, -7, 0}), slide('X', Side::Tool, x, {-300, 40, 600}),
       slide('Y', Side::Tool, y, {0, 80, 650}), slide('Z', Side::Tool, z, {5, 60, 500}),
       turn('A', Side::Tool, x, {0, 3, 251}), nose({1, 2, 120})},
      placed({10, -8, 25}, 0.4, z), placed({1, 2, 30}));
}

/// w S' X' b Z t, the platform of Peng et al. 2017: spindle about X; the tool points along -z.
inline Chain platform() {
  return Chain(
      {turn('S', Side::Workpiece, x, {0, 4, 150}), slide('X', Side::Workpiece, x, {20, 0, -90}),
       slide('Z', Side::Tool, z, {30, 5, -60})},
      placed({11, 4, 150}), placed({13, 4, 130}));
}

/// w C' A' b X Y Z s t, table on a trunnion.
inline Chain trunnion() {
  return Chain(
      {turn('C', Side::Workpiece, z, {3, -2, 0}), turn('A', Side::Workpiece, x, {0, 1, 55}),
       slide('X', Side::Tool, x, {-80, 0, 400}), slide('Y', Side::Tool, y, {0, 120, 380}),
       slide('Z', Side::Tool, z, {0, 50, 420}), nose({0, 0, 260})},
      placed({5, 6, 15}, 0.5, {1, 2, 3}), placed({0, 0, 140}));
}

/// w b X Y Z C A s t, both rotary axes in the head.
inline Chain head_head() {
  return Chain({slide('X', Side::Tool, x, {0, -300, 900}), slide('Y', Side::Tool, y, {50, 0, 850}),
                slide('Z', Side::Tool, z, {20, 30, 800}), turn('C', Side::Tool, z, {2, 1, 500}),
                turn('A', Side::Tool, x, {0, -4, 300}), nose({1, -3, 200})},
               placed({-40, 20, 10}, -1.1, z), placed({1, -3, 90}));
}

/// w X' Y' b Z s t, three axes with a moving table.
inline Chain moving_table() {
  return Chain(
      {slide('X', Side::Workpiece, x, {0, 30, -50}), slide('Y', Side::Workpiece, y, {20, 0, -90}),
       slide('Z', Side::Tool, z, {0, 200, 350}), nose({0, 0, 220})},
      placed({-15, 25, 30}, 0.2, z), placed({0, 0, 110}));
}

/// w b X Y Z C B s t with B at 45 degrees between Y and Z: a nutating head.
inline Chain nutating_head() {
  return Chain({slide('X', Side::Tool, x, {0, -300, 900}), slide('Y', Side::Tool, y, {50, 0, 850}),
                slide('Z', Side::Tool, z, {20, 30, 800}), turn('C', Side::Tool, z, {0, 0, 500}),
                turn('B', Side::Tool, (y + z).normalized(), {0, 5, 310}), nose({0, 2, 200})},
               placed({30, -20, 12}), placed({0, 2, 80}));
}

/// w C' B' b X Y Z s t with B' at 45 degrees: a nutating table.
inline Chain nutating_table() {
  return Chain({turn('C', Side::Workpiece, z, {1, 2, 0}),
                turn('B', Side::Workpiece, (y - z).normalized(), {0, 40, -30}),
                slide('X', Side::Tool, x, {-80, 0, 400}), slide('Y', Side::Tool, y, {0, 120, 380}),
                slide('Z', Side::Tool, z, {0, 50, 420}), nose({0, 0, 260})},
               placed({5, 6, 15}, 0.7, z), placed({0, 0, 140}));
}

/// w X' B' b Z Y A t with slides between and beyond the rotary axes and every direction oblique.
inline Chain oblique() {
  const auto along = [](double u, double v, double w) -> Eigen::Vector3d {
    return Eigen::Vector3d(u, v, w).normalized();
  };
  return Chain({slide('X', Side::Workpiece, along(1, 0.1, -0.2), {10, 20, 30}),
                turn('B', Side::Workpiece, along(0.2, 1, 0.3), {0, 15, 60}),
                slide('Z', Side::Tool, along(0.1, -0.1, 1), {-40, 0, 300}),
                turn('A', Side::Tool, along(1, -0.2, 0.4), {9, 8, 200}),
                slide('Y', Side::Tool, along(0, 1, 0.2), {0, -60, 350})},
               placed({1, 2, 3}, 0.8, {1, -1, 2}), placed({-6, 4, 90}, 0.3, {2, 1, 0}));
}

struct Named {
  std::string name;
  Chain chain;
};

/// Every machine with three slides and two rotary axes.
inline std::vector<Named> five_axis() {
  return {{"gantry", gantry()},
          {"trunnion", trunnion()},
          {"head_head", head_head()},
          {"nutating_head", nutating_head()},
          {"nutating_table", nutating_table()},
          {"oblique", oblique()}};
}

inline std::vector<Named> all() {
  std::vector<Named> machines = five_axis();
  machines.push_back({"platform", platform()});
  machines.push_back({"moving_table", moving_table()});
  return machines;
}

/// The same machine with every joint asking for these axes and this squareness.
inline Chain with_options(const Chain& chain, kinematics::DeviationAxes axes,
                          kinematics::Squareness squareness) {
  std::vector<Joint> joints = chain.joints();
  for (Joint& joint : joints) {
    joint.deviation_axes = axes;
    joint.squareness = squareness;
  }
  return Chain(joints, chain.T_bw_home(), chain.T_bt_home());
}

/// Random positions: slides within +-`reach` mm, rotary axes within +-`turns` rad.
template <typename Random>
kinematics::AxisVector anywhere(const Chain& chain, Random& random, double reach = 500.0,
                                double turns = pi) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  kinematics::AxisVector q(chain.size());
  for (int i = 0; i < chain.size(); ++i)
    q[i] = unit(random) * (chain.joints()[std::size_t(i)].motion == Motion::Linear ? reach : turns);
  return q;
}

}  // namespace abbe::machines
