#include "sim/truth.h"

namespace abbe::sim {

Truth truth_of(const Scene& scene, const Machine& machine) {
  try {
    return {machine.actual,
            errors::scaled(errors::bind(scene.geometric, machine.actual), scene.error_scale)};
  } catch (const std::invalid_argument& fault) {
    throw BadInput(scene.file.string(), 0, 0, "errors that fit the machine", fault.what());
  }
}

Truth without_random(const Truth& truth) {
  return {truth.actual, errors::without_random(truth.geometric)};
}

kinematics::Pose tool_in_workpiece(const Truth& truth, const kinematics::AxisState& state) {
  return truth.actual.tool_in_workpiece(state.q, errors::deviations(truth.geometric, state));
}

}  // namespace abbe::sim
