#include "sim/dialects/siemens_frame.h"

#include <cmath>

#include "kinematics/units.h"

namespace abbe::sim::dialects::siemens {

Eigen::Matrix3d turned_about(int axis, double angle_deg) {
  const double quarters = std::round(angle_deg / 90.0);
  const double rest = (angle_deg - 90.0 * quarters) * units::deg;
  double c = std::cos(rest), s = std::sin(rest);
  const int turns = ((int(std::fmod(quarters, 4.0)) % 4) + 4) % 4;
  for (int k = 0; k < turns; ++k) {
    const double turned = -s;
    s = c;
    c = turned;
  }
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  const int i = (axis + 1) % 3, k = (axis + 2) % 3;
  R(i, i) = R(k, k) = c + 0.0;
  R(k, i) = s + 0.0;
  R(i, k) = -s + 0.0;
  return R;
}

Placement behind(const Placement& first, const Placement& second) {
  return {first.rotation * second.shift + first.shift, first.rotation * second.rotation};
}

Eigen::Matrix3d swivel_rotation(SwivelMode mode, const Eigen::Vector3i& order,
                                const Eigen::Vector3d& angles_deg) {
  if (mode == SwivelMode::SolidAngle)
    return turned_about(2, angles_deg[0]) * turned_about(1, angles_deg[1]);
  return turned_about(order[0], angles_deg[0]) * turned_about(order[1], angles_deg[1]) *
         turned_about(order[2], angles_deg[2]);
}

}  // namespace abbe::sim::dialects::siemens
