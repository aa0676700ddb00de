#include "sim/compensation/correct.h"

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>

#include "kinematics/decompositions.h"
#include "kinematics/jacobian.h"

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

constexpr double point_step = 1e-8;       // mm: 0.01 nm
constexpr double direction_step = 1e-12;  // rad

// A slide, and its effect on the functional point.
struct Slide {
  int joint = 0;
  Vector3d direction_w;  ///< of the point, mm per mm
  Vector3d reply;        ///< mm of this slide per mm of wanted motion of the point
};

struct Turn {
  int joint = 0;
  Vector3d point_w;    ///< mm of motion of the point per rad
  Vector2d direction;  ///< rad of tilt of the tool axis per rad, across the axis
};

// A list of up to max_joints joints without allocation; a correction is computed for every sample.
template <typename Joint>
struct Few {
  std::array<Joint, max_joints> all;
  int count = 0;

  void add(const Joint& joint) { all[std::size_t(count++)] = joint; }
  const Joint* begin() const { return all.data(); }
  const Joint* end() const { return all.data() + count; }
};

using TurnVector =
    Eigen::Matrix<double, max_joints, 1>;  // one number per turn that may be corrected

/// The joints that may be corrected, with their effect on the functional point and the tool axis.
struct Reach {
  Few<Slide> slides;
  Few<Turn> turns;
  Eigen::Matrix<double, 2, 3> across;  ///< rows span the plane across the tool axis
};

Vector3d axis_of(const Pose& T) { return T.linear().col(2); }

/// Returns the slides with their replies to a wanted motion: the least-squares solution of least
/// length.
Few<Slide> with_replies(Few<Slide> slides) {
  auto& s = slides.all;
  if (slides.count == 2 || slides.count == 3) {
    // two slides get a third direction that neither of them reaches
    const Vector3d third =
        slides.count == 3 ? s[2].direction_w : s[0].direction_w.cross(s[1].direction_w);
    const Vector3d across_first = s[1].direction_w.cross(third);
    const double volume = s[0].direction_w.dot(across_first);
    // A volume above 0.01 means slides at least half a degree apart; Cramer's rule is then exact
    // enough and much faster than the pseudo-inverse.
    if (std::abs(volume) > 0.01) {
      s[0].reply = across_first / volume;
      s[1].reply = third.cross(s[0].direction_w) / volume;
      s[2].reply = s[0].direction_w.cross(s[1].direction_w) / volume;
      return slides;
    }
  }
  if (slides.count == 0) return slides;
  Eigen::Matrix3Xd directions(3, slides.count);
  for (int k = 0; k < slides.count; ++k) directions.col(k) = s[std::size_t(k)].direction_w;
  const Eigen::MatrixXd replies = pseudo_inverse(directions);
  for (int k = 0; k < slides.count; ++k) s[std::size_t(k)].reply = replies.row(k);
  return slides;
}

Reach reach_at(const Chain& chain, const AxisVector& q, const Pose& T_wt,
               const CorrectOptions& options, double height) {
  const kinematics::AxisJacobian J = kinematics::axis_jacobian(chain, q);
  const Vector3d u = axis_of(T_wt);
  Reach reach;
  reach.across = T_wt.linear().leftCols<2>().transpose();
  for (int i = 0; i < chain.size(); ++i) {
    if (options.still[std::size_t(i)]) continue;
    const Motion motion = chain.joints()[std::size_t(i)].motion;
    if (motion == Motion::Linear) reach.slides.add({i, J.col(i).head<3>(), Vector3d::Zero()});
    if (motion == Motion::Rotary && options.strategy != Strategy::Position) {
      const Vector3d lean = J.col(i).tail<3>().cross(u);
      reach.turns.add({i, J.col(i).head<3>() + height * lean, reach.across * lean});
    }
  }
  reach.slides = with_replies(reach.slides);
  return reach;
}

/// Eigenvalues of a positive semidefinite symmetric matrix and their vectors.
struct PrincipalAxes {
  Vector2d value;   ///< the larger one first
  Matrix2d vector;  ///< in columns
};

PrincipalAxes principal_axes(const Matrix2d& G) {
  const double mean = 0.5 * (G(0, 0) + G(1, 1));
  const double half = 0.5 * (G(0, 0) - G(1, 1));
  const double radius = std::hypot(half, G(0, 1));
  PrincipalAxes p;
  p.value << mean + radius, std::max(mean - radius, 0.0);
  // of the two forms the one without cancellation
  Vector2d first =
      half >= 0.0 ? Vector2d(half + radius, G(0, 1)) : Vector2d(G(0, 1), radius - half);
  first = radius > 0.0 ? Vector2d(first.normalized()) : Vector2d::UnitX();
  p.vector << first, Vector2d(-first.y(), first.x());
  return p;
}

/// Returns the corrections of the free turns that tilt the tool axis as wanted, of least length. A
/// direction of tilt in which they hardly move the axis is damped, so that its correction fades out
/// towards the pole; any other is served in full.
TurnVector lean(const Few<Turn>& turns, std::bitset<max_joints> held, const Vector2d& wanted,
                double singular_sine) {
  Matrix2d G = Matrix2d::Zero();
  for (int k = 0; k < turns.count; ++k) {
    const Vector2d& direction = turns.all[std::size_t(k)].direction;
    if (!held[std::size_t(k)]) G += direction * direction.transpose();
  }
  const PrincipalAxes way = principal_axes(G);
  TurnVector c = TurnVector::Zero();
  for (int i = 0; i < 2; ++i) {
    const double damping = std::max(singular_sine - std::sqrt(way.value[i]), 0.0);
    const double strength = way.value[i] + damping * damping;
    // 1e-14: below the rounding of G there is no second direction
    if (!(strength > 1e-14 * way.value[0]) || strength == 0.0) continue;
    const double part = way.vector.col(i).dot(wanted) / strength;
    for (int k = 0; k < turns.count; ++k)
      if (!held[std::size_t(k)])
        c[k] += part * turns.all[std::size_t(k)].direction.dot(way.vector.col(i));
  }
  return c;
}

/// Returns the next total correction of the turns from the present error. The turn that exceeds the
/// bound most is held there, and the others take the rest; repeated until none exceeds it.
TurnVector next_turns(const Few<Turn>& turns, const Vector2d& error, const TurnVector& now,
                      const CorrectOptions& options) {
  if (turns.count == 0) return TurnVector::Zero();
  Vector2d wanted = -error;
  for (int k = 0; k < turns.count; ++k) wanted += turns.all[std::size_t(k)].direction * now[k];
  TurnVector at_bound = TurnVector::Zero();
  std::bitset<max_joints> held;
  for (;;) {
    const TurnVector asked = lean(turns, held, wanted, options.singular_sine);
    Eigen::Index most = 0;
    const bool beyond = asked.cwiseAbs().maxCoeff(&most) > options.rotary_bound;
    if (!beyond || held[std::size_t(most)]) return at_bound + asked;
    at_bound[most] = std::copysign(options.rotary_bound, asked[most]);
    wanted -= turns.all[std::size_t(most)].direction * at_bound[most];
    held.set(std::size_t(most));
  }
}

/// Position of the functional point and direction of the tool axis.
struct Place {
  Vector3d point_w;
  Vector3d axis_w;
};

Place place(const Pose& T_wt, double height) {
  const Vector3d axis = axis_of(T_wt);
  return {T_wt.translation() + height * axis, axis};
}

/// The next step of a correction.
struct Step {
  TurnVector turns;       ///< total, rad
  TurnVector turned;      ///< the new part of it
  Vector3d wanted_w;      ///< mm, motion of the point wanted from the slides
  bool is_small = false;  ///< below 0.01 nm and 1e-12 rad
};

Step next_step(const Reach& reach, const Place& error, const TurnVector& now,
               const CorrectOptions& options) {
  Step step;
  step.turns = next_turns(reach.turns, reach.across * error.axis_w, now, options);
  step.turned = step.turns - now;
  step.wanted_w = -error.point_w;
  for (int k = 0; k < reach.turns.count; ++k)
    step.wanted_w -= step.turned[k] * reach.turns.all[std::size_t(k)].point_w;
  // only what the slides can still move counts: an error across them may stay large
  Vector3d moved_w = Vector3d::Zero();
  for (const Slide& slide : reach.slides)
    moved_w += slide.reply.dot(error.point_w) * slide.direction_w;
  step.is_small = moved_w.norm() < point_step && step.turned.cwiseAbs().maxCoeff() < direction_step;
  return step;
}

/// Returns the command with the total turns, and the slides of q one step further.
AxisVector taken(const Step& step, const Reach& reach, const AxisVector& command, AxisVector q) {
  for (int k = 0; k < reach.turns.count; ++k) {
    const int joint = reach.turns.all[std::size_t(k)].joint;
    q[joint] = command[joint] + step.turns[k];
  }
  for (const Slide& slide : reach.slides) q[slide.joint] += slide.reply.dot(step.wanted_w);
  return q;
}

/// Returns the correction of a belief that is not a number: the unchanged command.
Correction nothing_known(const AxisVector& command) {
  const double all = std::numeric_limits<double>::infinity();
  return {command, all, all, false};
}

}  // namespace

Correction correct(const Chain& control, const Belief& belief, const Pose& T_wt,
                   const kinematics::AxisState& command, const CorrectOptions& options) {
  const bool iterated = options.strategy == Strategy::Iterated;
  const double height = options.strategy == Strategy::Position ? 0.0 : options.functional_height;
  const int max_steps = iterated ? options.max_iterations : 1;
  // The Jacobian is taken once: it only sets the steps, and the next one removes what it misses.
  const Reach reach = reach_at(control, command.q, T_wt, options, height);
  const Place target = place(T_wt, height);

  kinematics::AxisState state = command;
  TurnVector turns = TurnVector::Zero();
  for (int steps = 0;; ++steps) {
    const Place believed = place(belief(state), height);
    const Place error{believed.point_w - target.point_w, believed.axis_w - target.axis_w};
    Correction here{state.q, error.point_w.norm(), error.axis_w.norm(), !iterated};
    if (!std::isfinite(here.point_left + here.direction_left)) return nothing_known(command.q);
    if (!iterated && steps == max_steps) return here;
    const Step step = next_step(reach, error, turns, options);
    if (iterated) here.converged = step.is_small;
    if (iterated && (here.converged || steps >= max_steps)) return here;
    state.q = taken(step, reach, command.q, state.q);
    turns = step.turns;
  }
}

}  // namespace abbe::sim::compensation
