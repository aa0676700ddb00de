#include "sim/compensation/correct.h"

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>

#include "kinematics/decompositions.h"
#include "kinematics/inverse_kinematics.h"

namespace abbe::sim::compensation {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::max_joints;
using kinematics::Motion;
using kinematics::Pose;

// Iteration stops below these steps.
constexpr double min_point_step = 1e-8;       // mm (0.01 nm)
constexpr double min_direction_step = 1e-12;  // rad

/// A slide, and its effect on the functional point.
struct Slide {
  int joint = 0;
  Vector3d direction_w;  ///< mm of motion of the point per mm of the slide
  Vector3d response;     ///< mm of the slide per mm of requested motion of the point
};

/// A rotary axis, and its effect on the functional point and the tool axis.
struct RotaryJoint {
  int joint = 0;
  Vector3d point_w;    ///< mm of motion of the point per rad
  Vector2d direction;  ///< rad of tilt of the tool axis per rad, in the plane across that axis
};

/// A list of up to max_joints joints. It allocates no memory, because a correction is computed for
/// every sample.
template <typename Joint>
struct JointList {
  std::array<Joint, max_joints> items;
  int count = 0;

  void add(const Joint& joint) { items[std::size_t(count++)] = joint; }
  const Joint* begin() const { return items.data(); }
  const Joint* end() const { return items.data() + count; }
};

/// Corrections of the rotary joints of a CorrectableJoints, rad.
using RotaryCorrections = Eigen::Matrix<double, max_joints, 1>;

/// The joints that may be corrected, with their effect on the functional point and the tool axis.
struct CorrectableJoints {
  JointList<Slide> slides;
  JointList<RotaryJoint> rotary_joints;
  Eigen::Matrix<double, 2, 3> across;  ///< rows span the plane across the tool axis
};

Vector3d tool_axis(const Pose& T) { return T.linear().col(2); }

/// Returns the slides with their responses to a requested motion, which are the least-squares
/// solution of least length.
JointList<Slide> with_responses(JointList<Slide> slides) {
  auto& s = slides.items;
  if (slides.count == 2 || slides.count == 3) {
    // Two slides are completed by the normal of their plane, in which neither of them moves.
    const Vector3d normal =
        slides.count == 3 ? s[2].direction_w : s[0].direction_w.cross(s[1].direction_w);
    const Vector3d across_first = s[1].direction_w.cross(normal);
    const double volume = s[0].direction_w.dot(across_first);
    // With a volume above 0.01 the slides are at least half a degree apart. Cramer's rule is then
    // exact enough and much faster than the pseudo-inverse.
    if (std::abs(volume) > 0.01) {
      s[0].response = across_first / volume;
      s[1].response = normal.cross(s[0].direction_w) / volume;
      s[2].response = s[0].direction_w.cross(s[1].direction_w) / volume;
      return slides;
    }
  }
  if (slides.count == 0) return slides;
  Eigen::Matrix3Xd directions(3, slides.count);
  for (int k = 0; k < slides.count; ++k) directions.col(k) = s[std::size_t(k)].direction_w;
  const Eigen::MatrixXd responses = pseudo_inverse(directions);
  for (int k = 0; k < slides.count; ++k) s[std::size_t(k)].response = responses.row(k);
  return slides;
}

/// Returns the joints that the strategy may correct at q. `height` is that of the functional point
/// above the tip.
CorrectableJoints correctable_joints(const Chain& chain, const AxisVector& q, const Pose& T_wt,
                                     const CorrectOptions& options, double height) {
  const kinematics::AxisJacobian J = kinematics::axis_jacobian(chain, q);
  const Vector3d u = tool_axis(T_wt);
  CorrectableJoints joints;
  joints.across = T_wt.linear().leftCols<2>().transpose();
  for (int i = 0; i < chain.size(); ++i) {
    if (options.fixed_joints[std::size_t(i)]) continue;
    const Motion motion = chain.joints()[std::size_t(i)].motion;
    if (motion == Motion::Linear) joints.slides.add({i, J.col(i).head<3>(), Vector3d::Zero()});
    if (motion == Motion::Rotary && options.strategy != Strategy::Position) {
      const Vector3d distribute_tilt = J.col(i).tail<3>().cross(u);
      joints.rotary_joints.add(
          {i, J.col(i).head<3>() + height * distribute_tilt, joints.across * distribute_tilt});
    }
  }
  joints.slides = with_responses(joints.slides);
  return joints;
}

/// Eigenvalues of a positive semidefinite symmetric matrix and their vectors.
struct PrincipalAxes {
  Vector2d value;   ///< the larger one first
  Matrix2d vector;  ///< in columns
};

PrincipalAxes principal_axes(const Matrix2d& G) {
  const double mean = 0.5 * (G(0, 0) + G(1, 1));
  const double half_difference = 0.5 * (G(0, 0) - G(1, 1));
  const double radius = std::hypot(half_difference, G(0, 1));
  PrincipalAxes p;
  p.value << mean + radius, std::max(mean - radius, 0.0);
  // The first eigenvector is computed by the one of two forms that does not cancel.
  Vector2d first = half_difference >= 0.0 ? Vector2d(half_difference + radius, G(0, 1))
                                          : Vector2d(G(0, 1), radius - half_difference);
  first = radius > 0.0 ? Vector2d(first.normalized()) : Vector2d::UnitX();
  p.vector << first, Vector2d(-first.y(), first.x());
  return p;
}

/// Returns the corrections of least length with which the free rotary joints produce a tilt of the
/// tool axis. A direction of tilt in which they hardly move the axis is damped, so that its
/// correction fades out towards the pole; any other is corrected in full.
RotaryCorrections distribute_tilt(const JointList<RotaryJoint>& rotary_joints,
                                  std::bitset<max_joints> at_bound, const Vector2d& tilt,
                                  double min_tilt_ratio) {
  Matrix2d G = Matrix2d::Zero();
  for (int k = 0; k < rotary_joints.count; ++k) {
    const Vector2d& direction = rotary_joints.items[std::size_t(k)].direction;
    if (!at_bound[std::size_t(k)]) G += direction * direction.transpose();
  }
  const PrincipalAxes principal = principal_axes(G);
  RotaryCorrections c = RotaryCorrections::Zero();
  for (int i = 0; i < 2; ++i) {
    const double damping = std::max(min_tilt_ratio - std::sqrt(principal.value[i]), 0.0);
    const double damped_value = principal.value[i] + damping * damping;
    // 1e-14 is the rounding of G: a smaller eigenvalue means that there is no second direction.
    if (!(damped_value > 1e-14 * principal.value[0]) || damped_value == 0.0) continue;
    const double amount = principal.vector.col(i).dot(tilt) / damped_value;
    for (int k = 0; k < rotary_joints.count; ++k)
      if (!at_bound[std::size_t(k)])
        c[k] += amount * rotary_joints.items[std::size_t(k)].direction.dot(principal.vector.col(i));
  }
  return c;
}

/// Returns the next total corrections of the rotary joints from the present error. The joint that
/// exceeds the bound most is fixed at the bound and the others take over its remainder, until no
/// joint exceeds the bound.
RotaryCorrections next_rotations(const JointList<RotaryJoint>& rotary_joints, const Vector2d& error,
                                 const RotaryCorrections& current_rotations,
                                 const CorrectOptions& options) {
  if (rotary_joints.count == 0) return RotaryCorrections::Zero();
  Vector2d tilt = -error;
  for (int k = 0; k < rotary_joints.count; ++k)
    tilt += rotary_joints.items[std::size_t(k)].direction * current_rotations[k];
  RotaryCorrections bounded = RotaryCorrections::Zero();
  std::bitset<max_joints> at_bound;
  for (;;) {
    const RotaryCorrections requested =
        distribute_tilt(rotary_joints, at_bound, tilt, options.min_tilt_ratio);
    Eigen::Index largest = 0;
    const bool is_exceeded = requested.cwiseAbs().maxCoeff(&largest) > options.rotary_bound;
    if (!is_exceeded || at_bound[std::size_t(largest)]) return bounded + requested;
    bounded[largest] = std::copysign(options.rotary_bound, requested[largest]);
    tilt -= rotary_joints.items[std::size_t(largest)].direction * bounded[largest];
    at_bound.set(std::size_t(largest));
  }
}

/// Position of the functional point and direction of the tool axis.
struct ToolPlacement {
  Vector3d point_w;
  Vector3d axis_w;
};

ToolPlacement tool_placement(const Pose& T_wt, double height) {
  const Vector3d axis = tool_axis(T_wt);
  return {T_wt.translation() + height * axis, axis};
}

/// A step of a correction.
struct CorrectionStep {
  RotaryCorrections rotations;      ///< total corrections, rad
  RotaryCorrections new_rotations;  ///< change from the previous step, rad
  Vector3d displacement_w;          ///< mm, requested from the slides
  bool is_small = false;            ///< below 0.01 nm and 1e-12 rad
};

CorrectionStep next_step(const CorrectableJoints& joints, const ToolPlacement& error,
                         const RotaryCorrections& current_rotations,
                         const CorrectOptions& options) {
  CorrectionStep step;
  step.rotations = next_rotations(joints.rotary_joints, joints.across * error.axis_w,
                                  current_rotations, options);
  step.new_rotations = step.rotations - current_rotations;
  step.displacement_w = -error.point_w;
  for (int k = 0; k < joints.rotary_joints.count; ++k)
    step.displacement_w -=
        step.new_rotations[k] * joints.rotary_joints.items[std::size_t(k)].point_w;
  // Only the part of the error that the slides can reach counts; the rest may stay large.
  Vector3d reachable_w = Vector3d::Zero();
  for (const Slide& slide : joints.slides)
    reachable_w += slide.response.dot(error.point_w) * slide.direction_w;
  step.is_small = reachable_w.norm() < min_point_step &&
                  step.new_rotations.cwiseAbs().maxCoeff() < min_direction_step;
  return step;
}

/// Returns the axis positions after a step: `command` with the total rotations, and the slides of
/// `q` moved by the step.
AxisVector apply_step(const CorrectionStep& step, const CorrectableJoints& joints,
                      const AxisVector& command, AxisVector q) {
  for (int k = 0; k < joints.rotary_joints.count; ++k) {
    const int joint = joints.rotary_joints.items[std::size_t(k)].joint;
    q[joint] = command[joint] + step.rotations[k];
  }
  for (const Slide& slide : joints.slides)
    q[slide.joint] += slide.response.dot(step.displacement_w);
  return q;
}

/// Returns the unchanged command, the result for a belief that is not a number.
Correction unchanged_command(const AxisVector& command) {
  const double infinite = std::numeric_limits<double>::infinity();
  return {command, infinite, infinite, false};
}

}  // namespace

Correction correct(const Chain& control, const Belief& belief, const Pose& T_wt,
                   const kinematics::AxisState& command, const CorrectOptions& options) {
  const bool is_iterated = options.strategy == Strategy::Iterated;
  const double height = options.strategy == Strategy::Position ? 0.0 : options.functional_height;
  const int max_steps = is_iterated ? options.max_iterations : 1;
  // The Jacobian is computed once. It only determines the steps, and each step removes the error
  // that the previous one left.
  const CorrectableJoints joints = correctable_joints(control, command.q, T_wt, options, height);
  const ToolPlacement target = tool_placement(T_wt, height);

  kinematics::AxisState state = command;
  RotaryCorrections rotations = RotaryCorrections::Zero();
  for (int steps = 0;; ++steps) {
    const ToolPlacement believed = tool_placement(belief(state), height);
    const ToolPlacement error{believed.point_w - target.point_w, believed.axis_w - target.axis_w};
    Correction result{state.q, error.point_w.norm(), error.axis_w.norm(), !is_iterated};
    if (!std::isfinite(result.remaining_point_error + result.remaining_direction_error))
      return unchanged_command(command.q);
    if (!is_iterated && steps == max_steps) return result;
    const CorrectionStep step = next_step(joints, error, rotations, options);
    if (is_iterated) result.converged = step.is_small;
    if (is_iterated && (result.converged || steps >= max_steps)) return result;
    state.q = apply_step(step, joints, command.q, state.q);
    rotations = step.rotations;
  }
}

}  // namespace abbe::sim::compensation
