#include "sim/cut/pose.h"

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/cut/activity.h"
#include "sim/machine/compile.h"
#include "sim/machine/run_out.h"

namespace abbe::sim {
namespace {

using kinematics::Joint;
using kinematics::Motion;

}  // namespace

IdleMachine idle_machine(const Scene& described) {
  Scene scene = with_run_out(described);
  Machine machine = compile(scene);
  Truth truth = truth_of(scene, machine, activity(scene, machine, {}, {}));
  return {std::move(scene), std::move(machine), std::move(truth)};
}

TipPose tip_pose(const IdleMachine& idle, const kinematics::AxisState& state) {
  return {idle.machine.nominal.tool_in_workpiece(state.q), tool_in_workpiece(idle.truth, state)};
}

bool is_positioned(const Joint& joint) { return joint.motion != Motion::Spindle; }

std::string axis_names(const kinematics::Chain& chain) {
  std::string names;
  for (const Joint& joint : chain.joints())
    if (is_positioned(joint)) names += std::string(names.empty() ? "" : " ") + joint.name;
  return names;
}

double position_unit(const Joint& joint) {
  return joint.motion == Motion::Linear ? 1.0 : units::deg;
}

const char* position_word(const Joint& joint) {
  return joint.motion == Motion::Linear ? "mm" : "deg";
}

std::string travel_text(const Joint& joint) {
  const double unit = position_unit(joint);
  return fmt::format("{} between {:.6g} and {:.6g} {}", joint.name, joint.min / unit,
                     joint.max / unit, position_word(joint));
}

}  // namespace abbe::sim
