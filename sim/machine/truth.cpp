#include "sim/machine/truth.h"

#include <fmt/format.h>

#include "sim/scene/scene.h"

// The nominal machine of a scene, and the true machine with its errors.

namespace abbe::sim {

namespace {

using kinematics::Pose;

/// Returns the pose of the tip relative to the nose: displaced along the tool axis by the length
/// and, for a turning tool, by its offset from the centre.
Pose nose_to_tip_pose(double length, const Eigen::Vector2d& centring) {
  Pose T_st = Pose::Identity();
  T_st.translation() = Eigen::Vector3d(centring.x(), centring.y(), -length);
  return T_st;
}

/// Throws an input error that names the file of the scene.
[[noreturn]] void throw_chain_error(const Scene& scene, const std::string& seen) {
  throw BadInput(scene.file.string(), 0, 0, "a valid kinematic chain", seen);
}

/// Returns the chain of the machine of a scene.
/// @throws BadInput naming the scene if the joints do not form a chain
kinematics::Chain make_chain(const Scene& scene, const std::vector<kinematics::Joint>& joints,
                             const Pose& T_bw, const Pose& T_st) {
  try {
    return {joints, T_bw, scene.machine.T_bs * T_st};
  } catch (const std::invalid_argument& error) {
    throw_chain_error(scene, error.what());
  }
}

}  // namespace

Machine make_machine(const Scene& scene) {
  const MachineDescription& machine = scene.machine;
  const double length = scene.tool.length;
  const auto& control_joints = scene.control.joints.empty() ? machine.joints : scene.control.joints;
  const Pose T_st = nose_to_tip_pose(length, {0.0, 0.0});
  const Pose T_st_control = nose_to_tip_pose(control_tool_length(scene, scene.tool), {0.0, 0.0});
  Machine result{make_chain(scene, machine.joints, machine.T_bw, T_st),
                 make_chain(scene, control_joints, machine.T_bw, T_st_control), std::nullopt};
  if (std::holds_alternative<cutting::Nose>(scene.tool.nominal)) {
    // The sweep of a turning tool rotates the part about the first joint.
    const auto& first_joint = machine.joints.front();
    if (first_joint.name != 'S' || first_joint.motion != kinematics::Motion::Rotary)
      throw_chain_error(scene, "a turning tool needs the spindle S' directly after w");
    result.workpiece_spindle = 0;
  }
  return result;
}

namespace {

using kinematics::AxisState;

/// Returns the machine as built, with the actual tool and clamping of the part but without errors.
kinematics::Chain make_actual_chain(const Scene& scene) {
  const MachineDescription& machine = scene.machine;
  const ToolDescription& tool = scene.tool;
  const Pose T_st =
      nose_to_tip_pose(tool.actual_length, {tool.centring_offset, tool.centring_height});
  const Pose T_bw = machine.T_bw * kinematics::motion(scene.setup, Eigen::Vector3d::Zero());
  return make_chain(scene, machine.joints, T_bw, T_st);
}

/// Returns true if a cutting force, a weight, an inertia force or a clamping force acts on the
/// compliance.
bool is_active(const errors::ComplianceModel& model, const errors::Load& load) {
  return !load.tool_wrench_t.isZero(0.0) || model.gravity_b || model.inertia ||
         !model.clamping_w.isZero(0.0);
}

Eigen::VectorXd temperatures(const Truth& truth, double time_s) {
  return truth.heat ? errors::temperatures(truth.heat->run, time_s) : Eigen::VectorXd();
}

/// Throws BadInput if a temperature leaves the range that a scene may state: the thermal network
/// must then be wrong.
void check_temperatures(const errors::ThermalRun& run, const Scene& scene) {
  constexpr double min_T_C = ThermalDescription::min_T_C, max_T_C = ThermalDescription::max_T_C;
  for (Eigen::Index i = 0; i < run.T_C.rows(); ++i)
    for (Eigen::Index k = 0; k < run.T_C.cols(); ++k)
      if (const double T_C = run.T_C(i, k); !(T_C >= min_T_C && T_C <= max_T_C))
        throw BadInput(
            scene.file.string(), 0, 0,
            fmt::format("a thermal network that stays between {} and {} C", min_T_C, max_T_C),
            fmt::format("thermal.node.{} at {:.4g} C at {:.4g} s of the program",
                        run.network.nodes[std::size_t(k)].name, T_C,
                        run.knots[std::size_t(i)].time_s));
}

/// Returns the sum of the deviations of all error sources.
/// @param T_C  (nodes) at the time of the state; empty without heat
errors::ForceDeviations summed_deviations(const Truth& truth, const AxisState& state,
                                          const errors::Load& load, const Eigen::VectorXd& T_C) {
  errors::ForceDeviations sum;
  // Inactive sources are not added, so that the result stays bit-identical to that without them.
  if (truth.compliance && is_active(*truth.compliance, load)) {
    sum = errors::deviations(*truth.compliance, state, load);
    sum.joints = kinematics::sum(std::move(sum.joints), errors::deviations(truth.geometric, state));
  } else {
    sum.joints = errors::deviations(truth.geometric, state);
  }
  if (truth.heat)
    sum.joints =
        kinematics::sum(std::move(sum.joints), errors::deviations(truth.heat->model, state.q, T_C));
  if (truth.vibration)
    sum.joints = kinematics::sum(std::move(sum.joints),
                                 errors::deviations(*truth.vibration, state.spindle_speed,
                                                    truth.spindle ? state.q[*truth.spindle] : 0.0));
  return sum;
}

}  // namespace

Truth make_truth(const Scene& scene, const Machine& machine,
                 const std::vector<errors::Activity>& activity) {
  try {
    kinematics::Chain actual = make_actual_chain(scene);
    errors::GeometricModel geometric =
        errors::scaled(errors::bind(scene.geometric, actual), scene.error_scale);
    Truth truth{std::move(actual), std::move(geometric), std::nullopt,
                std::nullopt,      std::nullopt,         find_spindle(machine)};
    if (scene.thermal && !activity.empty()) {
      const ThermalDescription& thermal = *scene.thermal;
      truth.heat = {errors::scaled(errors::bind(thermal.errors, machine.nominal,
                                                int(thermal.network.nodes.size())),
                                   thermal.scale),
                    errors::simulate(thermal.network, activity)};
      check_temperatures(truth.heat->run, scene);
    }
    if (scene.compliance) truth.compliance = errors::bind(*scene.compliance, machine.nominal);
    if (!scene.vibrations.empty())
      truth.vibration = errors::bind(scene.vibrations, machine.nominal);
    return truth;
  } catch (const std::invalid_argument& error) {
    throw BadInput(scene.file.string(), 0, 0, "errors that match the machine", error.what());
  }
}

Truth without_random_errors(const Truth& truth) {
  Truth result = truth;
  result.geometric = errors::without_random_errors(truth.geometric);
  return result;
}

errors::ForceDeviations deviations(const Truth& truth, const AxisState& state,
                                   const errors::Load& load) {
  return summed_deviations(truth, state, load, temperatures(truth, state.time_s));
}

Pose tool_in_workpiece(const Truth& truth, const AxisState& state, const errors::Load& load) {
  const Eigen::VectorXd T_C = temperatures(truth, state.time_s);
  const errors::ForceDeviations total_deviations = summed_deviations(truth, state, load, T_C);
  Pose T_wt = errors::tool_in_workpiece(truth.actual, state.q, total_deviations);
  if (truth.heat && truth.heat->model.workpiece)
    T_wt.translation() = errors::position_at_20_C(truth.heat->model, T_C, T_wt.translation());
  return T_wt;
}

}  // namespace abbe::sim
