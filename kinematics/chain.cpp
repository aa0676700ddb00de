#include "kinematics/chain.h"

#include <cassert>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

namespace abbe::kinematics {
namespace {

Pose turn(const Eigen::Vector3d& direction, const Eigen::Vector3d& point, double angle) {
  Pose T = Pose::Identity();
  T.linear() = Eigen::AngleAxisd(angle, direction).toRotationMatrix();
  T.translation() = point - T.linear() * point;
  return T;
}

const JointDeviation& at(std::span<const JointDeviation> deviations, int joint) {
  static const JointDeviation none;
  return deviations.empty() ? none : deviations[std::size_t(joint)];
}

[[noreturn]] void refuse(const Joint& joint, const std::string& expected) {
  throw std::invalid_argument(std::string("axis ") + joint.name + ": expected " + expected);
}

// Conditions are written so that NaN fails them.
void check(const Joint& joint) {
  if (!(std::abs(joint.direction_b.norm() - 1.0) <= 1e-12)) refuse(joint, "a unit direction");
  if (!joint.point_b.allFinite()) refuse(joint, "a finite point");
  if (!(joint.min <= joint.max)) refuse(joint, "the lower limit of travel below the upper");
}

void check(const Pose& T, const std::string& what) {
  const Eigen::Matrix3d R = T.linear();
  const double skew = (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!T.matrix().allFinite() || !(skew <= 1e-12) || !(R.determinant() > 0.0))
    throw std::invalid_argument(what + ": expected a rigid transform");
}

}  // namespace

Chain::Chain(std::vector<Joint> joints, const Pose& T_bw_home, const Pose& T_bt_home)
    : joints_(std::move(joints)), T_bw_home_(T_bw_home), T_bt_home_(T_bt_home) {
  if (joints_.size() > std::size_t(max_joints))
    throw std::invalid_argument("expected at most " + std::to_string(max_joints) +
                                " joints, seen " + std::to_string(joints_.size()));
  check(T_bw_home_, "workpiece at zero");
  check(T_bt_home_, "tool at zero");
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    check(joints_[i]);
    joints_[i].direction_b.normalize();
    for (std::size_t k = 0; k < i; ++k)
      if (joints_[k].name == joints_[i].name)
        throw std::invalid_argument(std::string("axis ") + joints_[i].name + " comes twice");
    if (i > 0 && joints_[i].side == Side::Workpiece && joints_[i - 1].side == Side::Tool)
      throw std::invalid_argument(std::string("axis ") + joints_[i].name +
                                  " carries the workpiece but follows a tool-side axis");
  }
}

std::optional<int> Chain::find(char name) const {
  for (int i = 0; i < size(); ++i)
    if (joints_[std::size_t(i)].name == name) return i;
  return std::nullopt;
}

Pose carriage_displacement(const Joint& joint, double travel, const JointDeviation& deviation) {
  Pose T = Pose::Identity();
  Eigen::Vector3d direction = joint.direction_b;
  if (!deviation.location.isZero(0.0)) {
    if (joint.squareness == Squareness::Frame) {
      T = motion(deviation.location, joint.point_b);
    } else {
      T.translation() = deviation.location.head<3>();
      direction = rotation(deviation.location.tail<3>()) * direction;
    }
  }
  const bool moves = !deviation.motion.isZero(0.0);
  switch (joint.motion) {
    case Motion::Linear: {
      T = T * Eigen::Translation3d(travel * direction);
      if (moves) T = T * motion(deviation.motion, joint.point_b);
      break;
    }
    case Motion::Rotary: {
      const bool after = joint.deviation_axes == DeviationAxes::Turning;
      if (moves && !after) T = T * motion(deviation.motion, joint.point_b);
      T = T * turn(direction, joint.point_b, travel);
      if (moves && after) T = T * motion(deviation.motion, joint.point_b);
      break;
    }
    case Motion::Spindle:
      if (moves) T = T * motion(deviation.motion, joint.point_b);
      break;
  }
  return T;
}

Pose Chain::workpiece_in_bed(const AxisVector& q,
                             std::span<const JointDeviation> deviations) const {
  assert(q.size() == size() && (deviations.empty() || int(deviations.size()) == size()));
  Pose T_bw = Pose::Identity();
  for (int i = size() - 1; i >= 0; --i) {
    const Joint& joint = joints_[std::size_t(i)];
    if (joint.side != Side::Workpiece) continue;
    const double travel = carriage_travel(joint.side, q[i]);
    T_bw = T_bw * carriage_displacement(joint, travel, at(deviations, i));
  }
  return T_bw * T_bw_home_;
}

Pose Chain::tool_in_bed(const AxisVector& q, std::span<const JointDeviation> deviations) const {
  assert(q.size() == size() && (deviations.empty() || int(deviations.size()) == size()));
  Pose T_bt = Pose::Identity();
  for (int i = 0; i < size(); ++i) {
    const Joint& joint = joints_[std::size_t(i)];
    if (joint.side != Side::Tool) continue;
    const double travel = carriage_travel(joint.side, q[i]);
    T_bt = T_bt * carriage_displacement(joint, travel, at(deviations, i));
  }
  return T_bt * T_bt_home_;
}

Pose Chain::tool_in_workpiece(const AxisVector& q,
                              std::span<const JointDeviation> deviations) const {
  return workpiece_in_bed(q, deviations).inverse() * tool_in_bed(q, deviations);
}

Pose error_transform(const Pose& T_wt_nominal, const Pose& T_wt_actual) {
  return T_wt_nominal.inverse() * T_wt_actual;
}

}  // namespace abbe::kinematics
