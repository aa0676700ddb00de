#include "sim/machine/compile.h"

#include "sim/scene/scene_tools.h"

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

/// @throws BadInput naming the scene
[[noreturn]] void refuse(const Scene& scene, const std::string& seen) {
  throw BadInput(scene.file.string(), 0, 0, "a machine that makes a chain", seen);
}

/// The chain of a scene's machine.
/// @throws BadInput naming the scene
kinematics::Chain chain_of(const Scene& scene, const std::vector<kinematics::Joint>& joints,
                           const Pose& T_bw, const Pose& T_st) {
  try {
    return {joints, T_bw, scene.machine.T_bs * T_st};
  } catch (const std::invalid_argument& fault) {
    refuse(scene, fault.what());
  }
}

}  // namespace

Machine compile(const Scene& scene) {
  const MachineDescription& machine = scene.machine;
  const double length = scene.tool.length;
  const auto& believed = scene.control.joints.empty() ? machine.joints : scene.control.joints;
  const Pose T_st = tool_on_nose(length, {0.0, 0.0});
  const Pose T_st_believed = tool_on_nose(believed_length(scene, scene.tool), {0.0, 0.0});
  Machine compiled{chain_of(scene, machine.joints, machine.T_bw, T_st),
                   chain_of(scene, believed, machine.T_bw, T_st_believed), std::nullopt};
  if (std::holds_alternative<cutting::Nose>(scene.tool.nominal)) {
    const auto& first = machine.joints.front();
    if (first.name != 'S' || first.motion != kinematics::Motion::Rotary)
      refuse(scene, "a turning tool needs the spindle S' right after w");
    compiled.workpiece_spindle = 0;
  }
  return compiled;
}

kinematics::Chain compile_as_built(const Scene& scene) {
  const MachineDescription& machine = scene.machine;
  const ToolDescription& tool = scene.tool;
  const Pose T_st = tool_on_nose(tool.actual_length, {tool.centring_offset, tool.centring_height});
  const Pose T_bw = machine.T_bw * kinematics::motion(scene.setup, Eigen::Vector3d::Zero());
  return chain_of(scene, machine.joints, T_bw, T_st);
}

}  // namespace abbe::sim
