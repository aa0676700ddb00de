#include "sim/machine/machine.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "errors/element.h"
#include "kinematics/chain.h"
#include "kinematics/pose.h"
#include "kinematics/units.h"

namespace abbe::sim {

bool is_spindle(const Machine& machine, int joint) {
  return machine.workpiece_spindle == joint ||
         machine.nominal.joints()[std::size_t(joint)].motion == kinematics::Motion::Spindle;
}

std::optional<int> find_spindle(const Machine& machine) {
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

namespace {

using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::DisplacedPart;
using kinematics::Joint;
using kinematics::JointDeviation;
using kinematics::Motion;
using kinematics::Pose;

constexpr double no_end = 1e8;       // mm or rad: a larger limit of travel was not stated
constexpr double no_change = 1e-10;  // rad: rounding of the angle between two poses

const Joint& joint_at(const Chain& chain, int joint) { return chain.joints()[std::size_t(joint)]; }

// Returns the positions with one axis at q and the others at zero.
AxisVector alone(const Chain& chain, int joint, double q) {
  AxisVector result = AxisVector::Zero(chain.size());
  result[joint] = q;
  return result;
}

/// Returns the direction of travel or of rotation in the workpiece, with the other axes at zero.
/// The spindle nose moves nothing; its direction is that of the tool.
Vector3d direction_w(const Chain& chain, const std::vector<JointDeviation>& wrong, int joint) {
  const Motion motion = joint_at(chain, joint).motion;
  if (motion == Motion::Spindle) {
    const Eigen::Matrix3d R_wt = chain.tool_in_workpiece(alone(chain, joint, 0.0), wrong).linear();
    return R_wt * chain.T_bt_home().linear().transpose() * joint_at(chain, joint).direction_b;
  }
  // mm or rad; long steps, as the direction of a difference is more exact the longer it is.
  const double step = motion == Motion::Linear ? 100.0 : 0.5;
  const Pose from = chain.tool_in_workpiece(alone(chain, joint, -step), wrong);
  const Pose to = chain.tool_in_workpiece(alone(chain, joint, step), wrong);
  if (motion == Motion::Linear) return (to.translation() - from.translation()).normalized();
  return kinematics::rotation_vector(to.linear() * from.linear().transpose()).normalized();
}

/// Returns the main slides in the order of the bed axes, then all other joints in the order of the
/// chain.
std::vector<int> in_order(const Chain& chain) {
  std::vector<int> axes;
  for (const std::optional<int>& slide : kinematics::main_slides(chain.joints()))
    if (slide) axes.push_back(*slide);
  for (int j = 0; j < chain.size(); ++j)
    if (std::find(axes.begin(), axes.end(), j) == axes.end()) axes.push_back(j);
  return axes;
}

std::vector<LocationEffect::Angle> angles(const Chain& chain,
                                          const std::vector<JointDeviation>& wrong) {
  const std::vector<int> axes = in_order(chain);
  std::vector<LocationEffect::Angle> result;
  for (std::size_t b = 1; b < axes.size(); ++b)
    for (std::size_t a = 0; a < b; ++a) {
      const auto between = [&](const std::vector<JointDeviation>& deviations) {
        return kinematics::angle_between(direction_w(chain, deviations, axes[a]),
                                         direction_w(chain, deviations, axes[b]));
      };
      const double change = between(wrong) - between({});
      if (std::abs(change) > no_change)
        result.push_back(
            {fmt::format("{}-{}", joint_at(chain, axes[a]).name, joint_at(chain, axes[b]).name),
             change});
    }
  return result;
}

/// Returns the displaced bodies: the axis itself if its frame is displaced, and what it carries.
std::vector<std::string> bodies(const Chain& chain, int joint, DisplacedPart displaces) {
  const std::string own(1, joint_at(chain, joint).name);
  if (displaces == DisplacedPart::Axis) return {own};
  std::vector<std::string> result;
  if (displaces == DisplacedPart::Frame) result.push_back(own);
  const bool on_tool = joint_at(chain, joint).side == kinematics::Side::Tool;
  for (int j = joint + (on_tool ? 1 : -1); j >= 0 && j < chain.size(); j += on_tool ? 1 : -1)
    result.emplace_back(1, joint_at(chain, j).name);
  result.push_back(on_tool ? "tool" : "workpiece");
  return result;
}

// Returns the ends of travel of a joint. A rotary axis is limited to half a turn, as a full one
// repeats the start.
std::vector<double> ends(const Joint& joint) {
  if (joint.motion == Motion::Spindle) return {};
  const bool turns = joint.motion == Motion::Rotary;
  std::vector<double> result;
  for (const double limit : {joint.min, joint.max}) {
    const double q = turns ? std::clamp(limit, -pi, pi) : limit;
    if (std::abs(q) < no_end && q != 0.0) result.push_back(q);
  }
  return result;
}

std::vector<LocationEffect::Tip> tip(const Chain& chain, const std::vector<JointDeviation>& wrong,
                                     const std::vector<int>& axes) {
  const auto moved = [&](const AxisVector& q) -> Vector3d {
    return chain.tool_in_workpiece(q, wrong).translation() -
           chain.tool_in_workpiece(q).translation();
  };
  std::vector<LocationEffect::Tip> result = {{"zero", moved(AxisVector::Zero(chain.size()))}};
  for (const int j : axes) {
    const Joint& joint = joint_at(chain, j);
    const bool turns = joint.motion == Motion::Rotary;
    for (const double q : ends(joint))
      result.push_back({fmt::format("{} {:.6g} {}", joint.name, turns ? q / units::deg : q,
                                    turns ? "deg" : "mm"),
                        moved(alone(chain, j, q))});
  }
  return result;
}

}  // namespace

LocationEffect location_effect(const errors::Element& element, const Chain& chain) {
  const errors::GeometricModel model = errors::bind({{element}, {}}, chain);
  const int joint = model.elements[0].joint, component = model.elements[0].component;
  kinematics::AxisState zero;
  zero.q = AxisVector::Zero(chain.size());
  const std::vector<JointDeviation> wrong = errors::deviations(model, zero);
  const kinematics::LocationElement location_element =
      kinematics::location_element(chain.joints(), joint, component);
  LocationEffect effect;
  effect.meaning = errors::meaning(element.name, chain, joint);
  effect.displaces = location_element.displaces;
  effect.bodies = bodies(chain, joint, location_element.displaces);
  effect.amount = wrong[std::size_t(joint)].location[component] *
                  // If what the axis carries is displaced in place of the axis, the displacement is
                  // the opposite.
                  (location_element.displaces == DisplacedPart::Carried ? -1.0 : 1.0);
  effect.angles = angles(chain, wrong);
  std::vector<int> axes = {joint};
  if (location_element.reference) axes.push_back(*location_element.reference);
  effect.tip = tip(chain, wrong, axes);
  return effect;
}

}  // namespace abbe::sim
