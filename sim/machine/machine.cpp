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

bool have_same_poses(const kinematics::Chain& a, const kinematics::Chain& b) {
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

constexpr double min_unstated_limit = 1e8;  // mm or rad; a larger limit of travel was not stated
constexpr double min_angle_change = 1e-10;  // rad; a smaller change is rounding of the poses

const Joint& joint_at(const Chain& chain, int joint) { return chain.joints()[std::size_t(joint)]; }

/// Returns the positions with one axis at q and all others at zero.
AxisVector single_axis_position(const Chain& chain, int joint, double q) {
  AxisVector result = AxisVector::Zero(chain.size());
  result[joint] = q;
  return result;
}

/// Returns the direction of travel or of rotation in the workpiece, with the other axes at zero.
/// The nominal motion of a spindle nose is none, so its direction is that of the tool.
Vector3d direction_w(const Chain& chain, const std::vector<JointDeviation>& deviations, int joint) {
  const Motion motion = joint_at(chain, joint).motion;
  if (motion == Motion::Spindle) {
    const Eigen::Matrix3d R_wt =
        chain.tool_in_workpiece(single_axis_position(chain, joint, 0.0), deviations).linear();
    return R_wt * chain.T_bt_home().linear().transpose() * joint_at(chain, joint).direction_b;
  }
  // mm or rad; the longer the step, the more accurate the direction of the difference.
  const double step = motion == Motion::Linear ? 100.0 : 0.5;
  const Pose from = chain.tool_in_workpiece(single_axis_position(chain, joint, -step), deviations);
  const Pose to = chain.tool_in_workpiece(single_axis_position(chain, joint, step), deviations);
  if (motion == Motion::Linear) return (to.translation() - from.translation()).normalized();
  return kinematics::rotation_vector(to.linear() * from.linear().transpose()).normalized();
}

/// Returns the main slides in the order of the bed axes, then all other joints in the order of the
/// chain.
std::vector<int> axes_by_rank(const Chain& chain) {
  std::vector<int> axes;
  for (const std::optional<int>& slide : kinematics::main_slides(chain.joints()))
    if (slide) axes.push_back(*slide);
  for (int j = 0; j < chain.size(); ++j)
    if (std::find(axes.begin(), axes.end(), j) == axes.end()) axes.push_back(j);
  return axes;
}

/// Returns the changed angles between all pairs of axes.
std::vector<LocationEffect::Angle> angles(const Chain& chain,
                                          const std::vector<JointDeviation>& deviations) {
  const std::vector<int> axes = axes_by_rank(chain);
  std::vector<LocationEffect::Angle> result;
  for (std::size_t b = 1; b < axes.size(); ++b)
    for (std::size_t a = 0; a < b; ++a) {
      const auto axis_angle = [&](const std::vector<JointDeviation>& errors) {
        return kinematics::angle_between(direction_w(chain, errors, axes[a]),
                                         direction_w(chain, errors, axes[b]));
      };
      const double change = axis_angle(deviations) - axis_angle({});
      if (std::abs(change) > min_angle_change)
        result.push_back(
            {fmt::format("{}-{}", joint_at(chain, axes[a]).name, joint_at(chain, axes[b]).name),
             change});
    }
  return result;
}

/// Returns the displaced bodies: the axis itself if its frame is displaced, and those it carries.
std::vector<std::string> bodies(const Chain& chain, int joint, DisplacedPart displaces) {
  const std::string axis_name(1, joint_at(chain, joint).name);
  if (displaces == DisplacedPart::Axis) return {axis_name};
  std::vector<std::string> result;
  if (displaces == DisplacedPart::Frame) result.push_back(axis_name);
  const bool is_on_tool_side = joint_at(chain, joint).side == kinematics::Side::Tool;
  for (int j = joint + (is_on_tool_side ? 1 : -1); j >= 0 && j < chain.size();
       j += is_on_tool_side ? 1 : -1)
    result.emplace_back(1, joint_at(chain, j).name);
  result.push_back(is_on_tool_side ? "tool" : "workpiece");
  return result;
}

/// Returns the ends of travel of a joint. A rotary axis is limited to half a turn, because a full
/// turn repeats the start.
std::vector<double> ends(const Joint& joint) {
  if (joint.motion == Motion::Spindle) return {};
  const bool is_rotary = joint.motion == Motion::Rotary;
  std::vector<double> result;
  for (const double limit : {joint.min, joint.max}) {
    const double q = is_rotary ? std::clamp(limit, -pi, pi) : limit;
    if (std::abs(q) < min_unstated_limit && q != 0.0) result.push_back(q);
  }
  return result;
}

/// Returns the displacement of the tip at zero and at the ends of travel of some axes.
std::vector<LocationEffect::Tip> tip(const Chain& chain,
                                     const std::vector<JointDeviation>& deviations,
                                     const std::vector<int>& axes) {
  const auto tip_displacement = [&](const AxisVector& q) -> Vector3d {
    return chain.tool_in_workpiece(q, deviations).translation() -
           chain.tool_in_workpiece(q).translation();
  };
  std::vector<LocationEffect::Tip> result = {
      {"zero", tip_displacement(AxisVector::Zero(chain.size()))}};
  for (const int j : axes) {
    const Joint& joint = joint_at(chain, j);
    const bool is_rotary = joint.motion == Motion::Rotary;
    for (const double q : ends(joint))
      result.push_back({fmt::format("{} {:.6g} {}", joint.name, is_rotary ? q / units::deg : q,
                                    is_rotary ? "deg" : "mm"),
                        tip_displacement(single_axis_position(chain, j, q))});
  }
  return result;
}

}  // namespace

LocationEffect location_effect(const errors::Element& element, const Chain& chain) {
  const errors::GeometricModel model = errors::bind({{element}, {}}, chain);
  const int joint = model.elements[0].joint, component = model.elements[0].component;
  kinematics::AxisState zero;
  zero.q = AxisVector::Zero(chain.size());
  const std::vector<JointDeviation> deviations = errors::deviations(model, zero);
  const kinematics::LocationElement location_element =
      kinematics::location_element(chain.joints(), joint, component);
  LocationEffect effect;
  effect.meaning = errors::meaning(element.name, chain, joint);
  effect.displaces = location_element.displaces;
  effect.bodies = bodies(chain, joint, location_element.displaces);
  // The bodies that an axis carries are displaced in the opposite direction to the axis itself.
  effect.amount = deviations[std::size_t(joint)].location[component] *
                  (location_element.displaces == DisplacedPart::Carried ? -1.0 : 1.0);
  effect.angles = angles(chain, deviations);
  std::vector<int> axes = {joint};
  if (location_element.reference) axes.push_back(*location_element.reference);
  effect.tip = tip(chain, deviations, axes);
  return effect;
}

}  // namespace abbe::sim
