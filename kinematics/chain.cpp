#include "kinematics/chain.h"

#include <cassert>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "kinematics/frame.h"
#include "kinematics/location.h"

namespace abbe::kinematics {
namespace {

// What moves a frame is inlined: a frame then stays in registers all along the chain.

/// R - 1 of a rotation vector. Angles of deviations are small: three terms of each sine in it are
/// then exact to the last bit, at a tenth of the price.
[[gnu::always_inline]] inline Eigen::Matrix3d rotation_change(const Eigen::Vector3d& v) {
  const double angle2 = v.squaredNorm();
  if (!(angle2 < 1e-5)) return rotation(v) - Eigen::Matrix3d::Identity();
  const double s = 1.0 - angle2 / 6.0 * (1.0 - angle2 / 20.0);           // sin(a) / a
  const double c = 0.5 * (1.0 - angle2 / 12.0 * (1.0 - angle2 / 30.0));  // (1 - cos a) / a^2
  const Eigen::Vector3d sv = s * v;
  const Eigen::Vector3d cv = c * v;
  Eigen::Matrix3d change;
  change << cv.x() * v.x() - c * angle2, cv.x() * v.y() - sv.z(), cv.x() * v.z() + sv.y(),
      cv.y() * v.x() + sv.z(), cv.y() * v.y() - c * angle2, cv.y() * v.z() - sv.x(),
      cv.z() * v.x() - sv.y(), cv.z() * v.y() + sv.x(), cv.z() * v.z() - c * angle2;
  return change;
}

/// T * motion(deviation, point)
[[gnu::always_inline]] inline Frame displaced(const Frame& T, const Deviation& deviation,
                                              const Eigen::Vector3d& point) {
  const Eigen::Matrix3d change = rotation_change(deviation.tail<3>());
  const Eigen::Vector3d shift = deviation.head<3>() - change * point;
  return {T.x + turned(T, change.col(0)), T.y + turned(T, change.col(1)),
          T.z + turned(T, change.col(2)), T.p + turned(T, shift)};
}

bool is_none(const Deviation& E) {
  return E[0] == 0.0 && E[1] == 0.0 && E[2] == 0.0 && E[3] == 0.0 && E[4] == 0.0 && E[5] == 0.0;
}

/// A location error, parted by what it displaces.
struct LocationParts {
  Deviation frame = Deviation::Zero();
  Deviation carried = Deviation::Zero();
  Eigen::Vector3d axis = Eigen::Vector3d::Zero();  // rotation vector
};

LocationParts parts(const Deviation& location, const LocationRule& rule) {
  constexpr LocationRule all_frame{};
  LocationParts result;
  if (rule == all_frame) {
    result.frame = location;
    return result;
  }
  for (int k = 0; k < 6; ++k) {
    switch (rule[std::size_t(k)]) {
      case Displaces::Frame:
        result.frame[k] = location[k];
        break;
      case Displaces::Carried:
        result.carried[k] = -location[k];
        break;
      case Displaces::Axis:
        result.axis[k - 3] = location[k];
        break;
    }
  }
  return result;
}

/// T * location * motion with its error motion, as the joint asks for them
[[gnu::always_inline]] inline Frame displaced(const Frame& T, const Joint& joint,
                                              const LocationRule& rule, double travel,
                                              const JointDeviation& deviation) {
  Frame result = T;
  Eigen::Vector3d direction = joint.direction_b;
  LocationParts location;
  if (!is_none(deviation.location)) {
    location = parts(deviation.location, rule);
    if (!is_none(location.frame)) result = displaced(result, location.frame, joint.point_b);
    if (!location.axis.isZero(0.0)) direction += rotation_change(location.axis) * direction;
  }
  const bool moves = !is_none(deviation.motion);
  const bool before =
      joint.motion == Motion::Rotary && joint.deviation_axes == DeviationAxes::Fixed;
  if (moves && before) result = displaced(result, deviation.motion, joint.point_b);
  result = moved(result, joint, direction, travel);
  if (moves && !before) result = displaced(result, deviation.motion, joint.point_b);
  if (!is_none(location.carried)) result = displaced(result, location.carried, joint.point_b);
  return result;
}

/// T and the motion of joint i, with its deviations if there are any.
[[gnu::always_inline]] inline Frame carried(const Frame& T, const Chain& chain, int i,
                                            double travel,
                                            std::span<const JointDeviation> deviations) {
  const Joint& joint = chain.joints()[std::size_t(i)];
  return deviations.empty()
             ? moved(T, joint, joint.direction_b, travel)
             : displaced(T, joint, chain.location_rule(i), travel, deviations[std::size_t(i)]);
}

/// The workpiece, or the tool, in the bed.
Frame workpiece_frame(const Chain& chain, const AxisVector& q,
                      std::span<const JointDeviation> deviations) {
  assert(q.size() == chain.size() &&
         (deviations.empty() || int(deviations.size()) == chain.size()));
  Frame T_bw = identity_frame();
  for (int i = chain.size() - 1; i >= 0; --i)
    if (chain.joints()[std::size_t(i)].side == Side::Workpiece)
      T_bw = carried(T_bw, chain, i, carriage_travel(Side::Workpiece, q[i]), deviations);
  return T_bw * to_frame(chain.T_bw_home());
}

Frame tool_frame(const Chain& chain, const AxisVector& q,
                 std::span<const JointDeviation> deviations) {
  assert(q.size() == chain.size() &&
         (deviations.empty() || int(deviations.size()) == chain.size()));
  Frame T_bt = identity_frame();
  for (int i = 0; i < chain.size(); ++i)
    if (chain.joints()[std::size_t(i)].side == Side::Tool)
      T_bt = carried(T_bt, chain, i, carriage_travel(Side::Tool, q[i]), deviations);
  return T_bt * to_frame(chain.T_bt_home());
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
  rules_.resize(joints_.size());
  for (int i = 0; i < size(); ++i)
    for (int k = 0; k < 6; ++k)
      rules_[std::size_t(i)][std::size_t(k)] = location_element(joints_, i, k).displaces;
}

std::optional<int> Chain::find(char name) const {
  for (int i = 0; i < size(); ++i)
    if (joints_[std::size_t(i)].name == name) return i;
  return std::nullopt;
}

Pose carriage_displacement(const Joint& joint, double travel) {
  return to_pose(moved(identity_frame(), joint, joint.direction_b, travel));
}

Pose Chain::workpiece_in_bed(const AxisVector& q,
                             std::span<const JointDeviation> deviations) const {
  return to_pose(workpiece_frame(*this, q, deviations));
}

Pose Chain::tool_in_bed(const AxisVector& q, std::span<const JointDeviation> deviations) const {
  return to_pose(tool_frame(*this, q, deviations));
}

std::vector<Pose> carriages_in_bed(const Chain& chain, const AxisVector& q,
                                   std::span<const JointDeviation> deviations) {
  const int n = chain.size();
  assert(q.size() == n && (deviations.empty() || int(deviations.size()) == n));
  std::vector<Pose> T(std::size_t(n), Pose::Identity());
  const auto side = [&](int i) { return chain.joints()[std::size_t(i)].side; };
  Frame last = identity_frame();
  for (int i = n - 1; i >= 0; --i) {
    if (side(i) != Side::Workpiece) continue;
    last = carried(last, chain, i, carriage_travel(Side::Workpiece, q[i]), deviations);
    T[std::size_t(i)] = to_pose(last);
  }
  last = identity_frame();
  for (int i = 0; i < n; ++i) {
    if (side(i) != Side::Tool) continue;
    last = carried(last, chain, i, carriage_travel(Side::Tool, q[i]), deviations);
    T[std::size_t(i)] = to_pose(last);
  }
  return T;
}

Pose Chain::tool_in_workpiece(const AxisVector& q,
                              std::span<const JointDeviation> deviations) const {
  return to_pose(inverse(workpiece_frame(*this, q, deviations)) * tool_frame(*this, q, deviations));
}

Pose error_transform(const Pose& T_wt_nominal, const Pose& T_wt_actual) {
  return T_wt_nominal.inverse() * T_wt_actual;
}

std::vector<JointDeviation> sum(std::vector<JointDeviation> a, std::span<const JointDeviation> b) {
  if (a.size() != b.size())
    throw std::invalid_argument("expected deviations of the same joints to add");
  for (std::size_t i = 0; i < a.size(); ++i) {
    a[i].motion += b[i].motion;
    a[i].location += b[i].location;
  }
  return a;
}

Topology topology_of(std::span<const Joint> joints) {
  Topology topology;
  for (const Joint& joint : joints) topology.push_back({joint.name, joint.side});
  return topology;
}

}  // namespace abbe::kinematics
