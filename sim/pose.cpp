#include "sim/pose.h"

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/activity.h"
#include "sim/run_out.h"

namespace abbe::sim {
namespace {

using kinematics::Joint;
using kinematics::Motion;

/// Half of what a curve differs by between its two ways of approach, mm or rad.
double half_reversal(const errors::Curve& curve) {
  double half = 0.0;
  if (const auto* backlash = std::get_if<errors::Backlash>(&curve.shape))
    half = std::abs(backlash->half);
  if (const auto* both = std::get_if<errors::UpDown>(&curve.shape))
    for (const double q : both->up.q)
      if (q >= both->down.q[0] && q <= both->down.q[both->down.q.size() - 1])
        half = std::max(half, 0.5 * std::abs(errors::value({both->up}, {q, q}) -
                                             errors::value({both->down}, {q, q})));
  return half * std::abs(curve.scale);
}

double chance(const errors::Curve& curve) {
  const auto* random = std::get_if<errors::Repeatability>(&curve.shape);
  return random != nullptr ? random->sigma * std::abs(curve.scale) : 0.0;
}

/// "EXX 1.5 um, EAX 2 urad" of the elements of which `size` is not zero.
template <typename Size>
std::string figures_of(const errors::GeometricModel& model, const Size& size) {
  std::string text;
  for (const auto& bound : model.elements) {
    double sum = 0.0;
    for (const errors::Curve& curve : bound.element.curves) sum += size(curve);
    if (sum == 0.0) continue;
    const bool angle = bound.element.name.is_angle();
    text += fmt::format("{}{} {:.3g} {}", text.empty() ? "" : ", ", to_string(bound.element.name),
                        sum / (angle ? units::urad : units::um), angle ? "urad" : "um");
  }
  return text;
}

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

std::vector<std::string> left_out_at_rest(const IdleMachine& idle) {
  std::vector<std::string> left;
  if (const std::string halves = figures_of(idle.truth.geometric, half_reversal); !halves.empty())
    left.push_back("poses are half way between their two approaches; reversal adds or takes: " +
                   halves);
  if (const std::string sigmas = figures_of(idle.truth.geometric, chance); !sigmas.empty())
    left.push_back("poses have one draw of the repeatability, whose standard deviation is: " +
                   sigmas);
  return left;
}

}  // namespace abbe::sim
