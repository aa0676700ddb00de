#include "sim/compensation/machine_belief.h"

#include <Eigen/Geometry>

namespace abbe::sim::compensation {
namespace {

using Eigen::Vector3d;
using kinematics::AxisState;
using kinematics::JointDeviation;
using kinematics::Pose;

/// A displacement that the part shows, in the workpiece as the spindle has turned it.
Vector3d turned(const MachineBelief& belief, const AxisState& state, const Vector3d& move) {
  if (!belief.turns_the_part) return move;
  kinematics::AxisVector still = state.q;
  still[*belief.turns_the_part] = 0.0;
  const Eigen::Matrix3d R_now = belief.chain.workpiece_in_bed(state.q).linear();
  const Eigen::Matrix3d R_still = belief.chain.workpiece_in_bed(still).linear();
  return R_now.transpose() * (R_still * move);
}

}  // namespace

Pose tool_in_workpiece(const MachineBelief& belief, const AxisState& state) {
  return tool_in_workpiece(
      belief, state, belief.force ? load_at(belief.force->load, state.time_s) : errors::Load{});
}

Pose tool_in_workpiece(const MachineBelief& belief, const AxisState& state,
                       const errors::Load& load) {
  std::vector<JointDeviation> joints(std::size_t(belief.chain.size()));
  if (belief.geometric) joints = errors::deviations(*belief.geometric, state);
  if (belief.thermal)
    joints = kinematics::sum(std::move(joints), deviations(*belief.thermal, state));
  errors::ForceDeviations all;
  if (belief.force) all = errors::deviations(belief.force->compliance, state, load);
  all.joints = belief.force ? kinematics::sum(std::move(joints), all.joints) : std::move(joints);
  Pose T_wt = errors::tool_in_workpiece(belief.chain, state.q, all);
  if (belief.bending)
    T_wt.translation() += value_at(*belief.bending, state.time_s)[0] * T_wt.linear().col(2);
  if (belief.part) T_wt.translation() += turned(belief, state, move_at(*belief.part, state.time_s));
  return T_wt;
}

}  // namespace abbe::sim::compensation
