#include "sim/machine/machine.h"

namespace abbe::sim {
namespace {

using kinematics::Pose;

/// The tip seen from the nose: along the tool axis by the length; a turning tool may also be off
/// centre.
Pose tool_on_nose(double length, const Eigen::Vector2d& centring) {
  Pose T_st = Pose::Identity();
  T_st.translation() = Eigen::Vector3d(centring.x(), centring.y(), -length);
  return T_st;
}

}  // namespace

Machine compile(const Scene& scene) {
  const MachineDescription& machine = scene.machine;
  const ToolDescription& tool = scene.tool;
  const auto& believed = scene.control.joints.empty() ? machine.joints : scene.control.joints;
  const Pose T_st = tool_on_nose(tool.length, {0.0, 0.0});
  const Pose T_st_believed =
      tool_on_nose(scene.control.tool_length.value_or(tool.length), {0.0, 0.0});
  const Pose T_st_actual =
      tool_on_nose(tool.actual_length, {tool.centring_offset, tool.centring_height});
  const Pose T_bw_actual = machine.T_bw * kinematics::motion(scene.setup, Eigen::Vector3d::Zero());
  try {
    Machine compiled{
        kinematics::Chain(machine.joints, machine.T_bw, machine.T_bs * T_st),
        kinematics::Chain(believed, machine.T_bw, machine.T_bs * T_st_believed),
        kinematics::Chain(machine.joints, T_bw_actual, machine.T_bs * T_st_actual),
        std::nullopt,
    };
    if (std::holds_alternative<cutting::Nose>(tool.nominal)) {
      const auto& first = machine.joints.front();
      if (first.name != 'S' || first.motion != kinematics::Motion::Rotary)
        throw std::invalid_argument("a turning tool needs the spindle S' right after w");
      compiled.workpiece_spindle = 0;
    }
    return compiled;
  } catch (const std::invalid_argument& fault) {
    throw BadInput(scene.file.string(), 0, 0, "a machine that makes a chain", fault.what());
  }
}

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
