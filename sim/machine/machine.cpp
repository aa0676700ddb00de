#include "sim/machine/machine.h"

namespace abbe::sim {

bool is_spindle(const Machine& machine, int joint) {
  return machine.workpiece_spindle == joint ||
         machine.nominal.joints()[std::size_t(joint)].motion == kinematics::Motion::Spindle;
}

std::optional<int> spindle_of(const Machine& machine) {
  if (machine.workpiece_spindle) return machine.workpiece_spindle;
  for (int i = 0; i < machine.nominal.size(); ++i)
    if (is_spindle(machine, i)) return i;
  return std::nullopt;
}

bool same(const kinematics::Chain& a, const kinematics::Chain& b) {
  if (a.size() != b.size()) return false;
  if (a.T_bt_home().matrix() != b.T_bt_home().matrix()) return false;
  if (a.T_bw_home().matrix() != b.T_bw_home().matrix()) return false;
  for (int i = 0; i < a.size(); ++i) {
    const auto &x = a.joints()[std::size_t(i)], &y = b.joints()[std::size_t(i)];
    if (x.direction_b != y.direction_b || x.point_b != y.point_b) return false;
  }
  return true;
}

}  // namespace abbe::sim
