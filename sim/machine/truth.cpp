#include "sim/machine/truth.h"

#include <fmt/format.h>

#include "sim/machine/compile.h"
namespace abbe::sim {
namespace {

using kinematics::AxisState;
using kinematics::Pose;

bool acts(const errors::ComplianceModel& model, const errors::Load& load) {
  return !load.on_tool_t.isZero(0.0) || model.gravity_b || model.inertia ||
         !model.clamping_w.isZero(0.0);
}

Eigen::VectorXd temperatures(const Truth& truth, double time_s) {
  return truth.heat ? errors::temperatures(truth.heat->run, time_s) : Eigen::VectorXd();
}

/// A network that no machine can be shows by where it goes.
void refuse_beyond(const errors::ThermalRun& run, const Scene& scene) {
  constexpr double least = ThermalDescription::least_T_C, most = ThermalDescription::most_T_C;
  for (Eigen::Index i = 0; i < run.T_C.rows(); ++i)
    for (Eigen::Index k = 0; k < run.T_C.cols(); ++k)
      if (const double T_C = run.T_C(i, k); !(T_C >= least && T_C <= most))
        throw BadInput(scene.file.string(), 0, 0,
                       fmt::format("a thermal network that stays within {} .. {} C", least, most),
                       fmt::format("thermal.node.{} at {:.4g} C at {:.4g} s of the program",
                                   run.network.nodes[std::size_t(k)].name, T_C,
                                   run.knots[std::size_t(i)].time_s));
}

/// @param T_C  (nodes) at the state's time; empty without heat
errors::ForceDeviations sum_of_sources(const Truth& truth, const AxisState& state,
                                       const errors::Load& load, const Eigen::VectorXd& T_C) {
  errors::ForceDeviations sum;
  if (truth.compliance && acts(*truth.compliance, load)) {
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

Truth truth_of(const Scene& scene, const Machine& machine,
               const std::vector<errors::Activity>& activity) {
  try {
    kinematics::Chain actual = compile_as_built(scene);
    errors::GeometricModel geometric =
        errors::scaled(errors::bind(scene.geometric, actual), scene.error_scale);
    Truth truth{std::move(actual), std::move(geometric), std::nullopt,
                std::nullopt,      std::nullopt,         spindle_of(machine)};
    if (scene.thermal && !activity.empty()) {
      const ThermalDescription& thermal = *scene.thermal;
      truth.heat = {errors::scaled(errors::bind(thermal.errors, machine.nominal,
                                                int(thermal.network.nodes.size())),
                                   thermal.scale),
                    errors::simulate(thermal.network, activity)};
      refuse_beyond(truth.heat->run, scene);
    }
    if (scene.compliance) truth.compliance = errors::bind(*scene.compliance, machine.nominal);
    if (!scene.vibrations.empty())
      truth.vibration = errors::bind(scene.vibrations, machine.nominal);
    return truth;
  } catch (const std::invalid_argument& fault) {
    throw BadInput(scene.file.string(), 0, 0, "errors that fit the machine", fault.what());
  }
}

Truth without_random(const Truth& truth) {
  Truth known = truth;
  known.geometric = errors::without_random(truth.geometric);
  return known;
}

errors::ForceDeviations deviations(const Truth& truth, const AxisState& state,
                                   const errors::Load& load) {
  return sum_of_sources(truth, state, load, temperatures(truth, state.time_s));
}

Pose tool_in_workpiece(const Truth& truth, const AxisState& state, const errors::Load& load) {
  const Eigen::VectorXd T_C = temperatures(truth, state.time_s);
  const errors::ForceDeviations all = sum_of_sources(truth, state, load, T_C);
  Pose T_wt = errors::tool_in_workpiece(truth.actual, state.q, all);
  if (truth.heat && truth.heat->model.workpiece)
    T_wt.translation() = errors::at_20_C(truth.heat->model, T_C, T_wt.translation());
  return T_wt;
}

}  // namespace abbe::sim
