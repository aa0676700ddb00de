// Where a gantry w b X Y Z s t brings its tool if Y carries X at a wrong angle.
#include <cstdio>

#include "errors/geometric.h"
#include "kinematics/chain.h"

int main() {
  using namespace abbe;
  using kinematics::Joint;
  const auto slide = [](char name, const Eigen::Vector3d& direction) {
    Joint joint;
    joint.name = name;
    joint.motion = kinematics::Motion::Linear;
    joint.direction_b = direction;
    return joint;
  };
  const kinematics::Chain chain(
      {slide('X', Eigen::Vector3d::UnitX()), slide('Y', Eigen::Vector3d::UnitY()),
       slide('Z', Eigen::Vector3d::UnitZ())},
      kinematics::Pose::Identity(), kinematics::Pose::Identity());
  errors::GeometricErrors wrong;
  wrong.elements = {{errors::parse_element_name("EC0Y"), {{errors::Constant{100e-6}}}}};
  const errors::GeometricModel model = errors::bind(wrong, chain);
  kinematics::AxisState state;
  state.q = Eigen::Vector3d(100, 200, 50);
  const kinematics::Pose T = chain.tool_in_workpiece(state.q, errors::deviations(model, state));
  std::printf("tip off by %.3f um along X\n", 1e3 * (T.translation().x() - 100));
}
