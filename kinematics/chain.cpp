#include "kinematics/chain.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "kinematics/frame.h"

namespace abbe::kinematics {

namespace {

// Functions that move a frame are always inlined: the frame then stays in registers along the
// chain.

/// Returns R - 1 of a rotation vector. Below 1e-5 rad^2 (3 mrad) three terms of each series are
/// exact to the last bit, at a tenth of the cost of sine and cosine; angles of deviations are that
/// small.
[[gnu::always_inline]] inline Eigen::Matrix3d rotation_minus_identity(const Eigen::Vector3d& v) {
  const double squared_angle = v.squaredNorm();
  if (!(squared_angle < 1e-5)) return rotation(v) - Eigen::Matrix3d::Identity();
  const double s = 1.0 - squared_angle / 6.0 * (1.0 - squared_angle / 20.0);  // sin(a) / a
  const double c =
      0.5 * (1.0 - squared_angle / 12.0 * (1.0 - squared_angle / 30.0));  // (1 - cos a) / a^2
  const Eigen::Vector3d sv = s * v;
  const Eigen::Vector3d cv = c * v;
  Eigen::Matrix3d change;
  change << cv.x() * v.x() - c * squared_angle, cv.x() * v.y() - sv.z(), cv.x() * v.z() + sv.y(),
      cv.y() * v.x() + sv.z(), cv.y() * v.y() - c * squared_angle, cv.y() * v.z() - sv.x(),
      cv.z() * v.x() - sv.y(), cv.z() * v.y() + sv.x(), cv.z() * v.z() - c * squared_angle;
  return change;
}

/// Returns T * motion(deviation, point).
[[gnu::always_inline]] inline Frame apply_deviation(const Frame& T, const Deviation& deviation,
                                                    const Eigen::Vector3d& point) {
  const Eigen::Matrix3d change = rotation_minus_identity(deviation.tail<3>());
  const Eigen::Vector3d shift = deviation.head<3>() - change * point;
  return {T.x + rotate(T, change.col(0)), T.y + rotate(T, change.col(1)),
          T.z + rotate(T, change.col(2)), T.p + rotate(T, shift)};
}

bool is_zero(const Deviation& E) {
  return E[0] == 0.0 && E[1] == 0.0 && E[2] == 0.0 && E[3] == 0.0 && E[4] == 0.0 && E[5] == 0.0;
}

/// A location error, split into what it displaces.
struct LocationDisplacements {
  Deviation frame = Deviation::Zero();
  Deviation carried = Deviation::Zero();
  Eigen::Vector3d axis = Eigen::Vector3d::Zero();  // rotation vector
};

/// Returns a location error, divided according to the rule of its joint.
LocationDisplacements split_location_error(const Deviation& location, const LocationRule& rule) {
  // The rule of most joints: the whole error displaces the frame, so nothing has to be split.
  constexpr LocationRule all_frame{};
  LocationDisplacements result;
  if (rule == all_frame) {
    result.frame = location;
    return result;
  }
  for (int k = 0; k < 6; ++k) {
    switch (rule[std::size_t(k)]) {
      case DisplacedPart::Frame:
        result.frame[k] = location[k];
        break;
      case DisplacedPart::Carried:
        result.carried[k] = -location[k];
        break;
      case DisplacedPart::Axis:
        result.axis[k - 3] = location[k];
        break;
    }
  }
  return result;
}

/// Returns T * location * motion with the deviations in the order that the joint requires.
[[gnu::always_inline]] inline Frame apply_deviation(const Frame& T, const Joint& joint,
                                                    const LocationRule& rule, double travel,
                                                    const JointDeviation& deviation) {
  Frame result = T;
  Eigen::Vector3d direction = joint.direction_b;
  LocationDisplacements location;
  if (!is_zero(deviation.location)) {
    location = split_location_error(deviation.location, rule);
    if (!is_zero(location.frame)) result = apply_deviation(result, location.frame, joint.point_b);
    if (!location.axis.isZero(0.0)) direction += rotation_minus_identity(location.axis) * direction;
  }
  // ISO 230-7 states the error motion of a rotary axis along fixed axes, hence before the rotation.
  // A slide does not turn its axes, so there the order is free; after the motion the joint's point
  // is the one that has travelled.
  const bool has_error_motion = !is_zero(deviation.motion);
  const bool is_before_motion =
      joint.motion == Motion::Rotary && joint.deviation_axes == DeviationAxes::Fixed;
  if (has_error_motion && is_before_motion)
    result = apply_deviation(result, deviation.motion, joint.point_b);
  result = apply_motion(result, joint, direction, travel);
  if (has_error_motion && !is_before_motion)
    result = apply_deviation(result, deviation.motion, joint.point_b);
  if (!is_zero(location.carried)) result = apply_deviation(result, location.carried, joint.point_b);
  return result;
}

/// Returns T moved by joint i, with its deviations if there are any.
[[gnu::always_inline]] inline Frame apply_joint(const Frame& T, const Chain& chain, int i,
                                                double travel,
                                                std::span<const JointDeviation> deviations) {
  const Joint& joint = chain.joints()[std::size_t(i)];
  return deviations.empty() ? apply_motion(T, joint, joint.direction_b, travel)
                            : apply_deviation(T, joint, chain.location_rule(i), travel,
                                              deviations[std::size_t(i)]);
}

/// Returns T_bw, the workpiece in the bed.
Frame workpiece_frame(const Chain& chain, const AxisVector& q,
                      std::span<const JointDeviation> deviations) {
  assert(q.size() == chain.size() &&
         (deviations.empty() || int(deviations.size()) == chain.size()));
  // The code lists the workpiece side towards the bed, the frames chain outwards from it.
  Frame T_bw = identity_frame();
  for (int i = chain.size() - 1; i >= 0; --i)
    if (chain.joints()[std::size_t(i)].side == Side::Workpiece)
      T_bw = apply_joint(T_bw, chain, i, carriage_travel(Side::Workpiece, q[i]), deviations);
  return T_bw * to_frame(chain.T_bw_home());
}

/// Returns T_bt, the tool in the bed.
Frame tool_frame(const Chain& chain, const AxisVector& q,
                 std::span<const JointDeviation> deviations) {
  assert(q.size() == chain.size() &&
         (deviations.empty() || int(deviations.size()) == chain.size()));
  Frame T_bt = identity_frame();
  for (int i = 0; i < chain.size(); ++i)
    if (chain.joints()[std::size_t(i)].side == Side::Tool)
      T_bt = apply_joint(T_bt, chain, i, carriage_travel(Side::Tool, q[i]), deviations);
  return T_bt * to_frame(chain.T_bt_home());
}

[[noreturn]] void throw_joint_error(const Joint& joint, const std::string& expected) {
  throw std::invalid_argument(std::string("axis ") + joint.name + ": expected " + expected);
}

// The conditions are written so that NaN fails them.
void check(const Joint& joint) {
  // 1e-12: far above the rounding of a normalised vector (2e-16), far below any angle of interest.
  if (!(std::abs(joint.direction_b.norm() - 1.0) <= 1e-12))
    throw_joint_error(joint, "a unit direction");
  if (!joint.point_b.allFinite()) throw_joint_error(joint, "a finite point");
  if (!(joint.min <= joint.max))
    throw_joint_error(joint, "a lower travel limit below the upper limit");
}

void check(const Pose& T, const std::string& pose_name) {
  const Eigen::Matrix3d R = T.linear();
  const double skew = (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!T.matrix().allFinite() || !(skew <= 1e-12) || !(R.determinant() > 0.0))
    throw std::invalid_argument(pose_name + ": expected a rigid transform");
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
    // The check admits a length error of 1e-12; after normalisation, rotations about the direction
    // are orthogonal to rounding.
    joints_[i].direction_b.normalize();
    for (std::size_t k = 0; k < i; ++k)
      if (joints_[k].name == joints_[i].name)
        throw std::invalid_argument(std::string("axis ") + joints_[i].name + " is given twice");
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
  return to_pose(apply_motion(identity_frame(), joint, joint.direction_b, travel));
}

Pose Chain::workpiece_in_bed(const AxisVector& q,
                             std::span<const JointDeviation> deviations) const {
  return to_pose(workpiece_frame(*this, q, deviations));
}

Pose Chain::tool_in_bed(const AxisVector& q, std::span<const JointDeviation> deviations) const {
  return to_pose(tool_frame(*this, q, deviations));
}

std::vector<Pose> carriage_poses(const Chain& chain, const AxisVector& q,
                                 std::span<const JointDeviation> deviations) {
  const int n = chain.size();
  assert(q.size() == n && (deviations.empty() || int(deviations.size()) == n));
  std::vector<Pose> T(std::size_t(n), Pose::Identity());
  const auto side = [&](int i) { return chain.joints()[std::size_t(i)].side; };
  Frame T_carriage = identity_frame();
  for (int i = n - 1; i >= 0; --i) {
    if (side(i) != Side::Workpiece) continue;
    T_carriage =
        apply_joint(T_carriage, chain, i, carriage_travel(Side::Workpiece, q[i]), deviations);
    T[std::size_t(i)] = to_pose(T_carriage);
  }
  T_carriage = identity_frame();
  for (int i = 0; i < n; ++i) {
    if (side(i) != Side::Tool) continue;
    T_carriage = apply_joint(T_carriage, chain, i, carriage_travel(Side::Tool, q[i]), deviations);
    T[std::size_t(i)] = to_pose(T_carriage);
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
  if (a.size() != b.size()) throw std::invalid_argument("expected deviations of the same joints");
  for (std::size_t i = 0; i < a.size(); ++i) {
    a[i].motion += b[i].motion;
    a[i].location += b[i].location;
  }
  return a;
}

Topology chain_topology(std::span<const Joint> joints) {
  Topology topology;
  for (const Joint& joint : joints) topology.push_back({joint.name, joint.side});
  return topology;
}

namespace {

using MainSlides = std::array<std::optional<int>, 3>;

// Letters by rank (ISO 841 and the additional slides of a structural code): the first slide that
// travels along a bed axis is the main slide of that axis.
constexpr std::string_view slide_letters = "XYZUVWPQR";
constexpr double min_axis_cosine = 0.5;  // within 60 degrees of a bed axis a slide may be its main
                                         // slide
constexpr double min_axis_sine = 1e-9;   // directions at a smaller sine count as parallel

// Returns the bed axis of which the joint is the main slide; empty for every other joint.
std::optional<int> bed_axis_index(const MainSlides& slides, int joint) {
  for (int k = 0; k < 3; ++k)
    if (slides[std::size_t(k)] == joint) return k;
  return std::nullopt;
}

/// Returns the main slides that can measure a component of another joint, by rank: for an offset
/// the slide along it, for an angle the two slides across it.
std::vector<int> measuring_slides(const MainSlides& slides, int joint, int component) {
  std::vector<int> result;
  for (int k = 0; k < 3; ++k) {
    // Components 0 to 2 are offsets, 3 to 5 angles about the same bed axes.
    const bool can_measure = component < 3 ? k == component : k != component - 3;
    const std::optional<int> slide = slides[std::size_t(k)];
    if (can_measure && slide && *slide != joint) result.push_back(*slide);
  }
  return result;
}

/// @param slides  main slides that can measure the component
DisplacedPart displaced_part(std::span<const Joint> joints, int joint, int component,
                             const std::vector<int>& slides) {
  const bool is_angle = component >= 3;
  if (is_angle && joints[std::size_t(joint)].squareness == Squareness::Travel)
    return DisplacedPart::Axis;
  // If an axis carries all slides by which it is located, displacing its frame would move them too
  // and show no error. If it carries some of them, the error would show only partly, so the axis
  // alone is rotated.
  const auto carried_slides =
      std::ranges::count_if(slides, [&](int slide) { return carries(joints, joint, slide); });
  if (carried_slides == 0) return DisplacedPart::Frame;
  return carried_slides == std::ptrdiff_t(slides.size()) ? DisplacedPart::Carried
                                                         : DisplacedPart::Axis;
}

}  // namespace

bool carries(std::span<const Joint> joints, int carrier, int carried) {
  const Side side = joints[std::size_t(carrier)].side;
  if (joints[std::size_t(carried)].side != side) return false;
  return side == Side::Tool ? carrier < carried : carrier > carried;
}

MainSlides main_slides(std::span<const Joint> joints) {
  MainSlides slides;
  for (const char letter : slide_letters) {
    const auto joint = std::find_if(joints.begin(), joints.end(),
                                    [&](const Joint& slide) { return slide.name == letter; });
    if (joint == joints.end() || joint->motion != Motion::Linear) continue;
    int best = -1;
    double max_cosine = min_axis_cosine;
    // The largest cosine wins. Bed axes that already have a main slide are skipped, so every slide
    // gets its own.
    for (int k = 0; k < 3; ++k) {
      const double cosine = std::abs(joint->direction_b[k]);
      if (slides[std::size_t(k)] || cosine <= max_cosine) continue;
      best = k;
      max_cosine = cosine;
    }
    if (best >= 0) slides[std::size_t(best)] = int(joint - joints.begin());
  }
  return slides;
}

LocationElement location_element(std::span<const Joint> joints, int joint, int component) {
  const Joint& axis = joints[std::size_t(joint)];
  const MainSlides slides = main_slides(joints);
  const std::vector<int> references = measuring_slides(slides, joint, component);
  LocationElement element;
  if (!references.empty()) element.reference = references.front();
  const Eigen::Vector3d unit = Eigen::Vector3d::Unit(component % 3);
  element.defined = !(unit.cross(axis.direction_b).norm() < min_axis_sine);
  // A slide has no position, only a direction; without a reference slide it has no angle either.
  if (axis.motion == Motion::Linear)
    element.defined = element.defined && component >= 3 && !references.empty();
  if (const auto bed_axis = bed_axis_index(slides, joint); bed_axis && element.defined) {
    // The angle of a pair of main slides belongs to the later one, as ISO 230-1 writes EC0Y.
    element.defined =
        references.size() == 1 && *bed_axis_index(slides, references.front()) < *bed_axis;
    if (!element.defined && references.size() == 1) element.later_slide = references.front();
  }
  const bool rotates_travel_only = component >= 3 && axis.squareness == Squareness::Travel;
  if (element.defined || rotates_travel_only)
    element.displaces = displaced_part(joints, joint, component, references);
  return element;
}

}  // namespace abbe::kinematics
