#include "sim/compensation/correct.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Dense>

#include "kinematics/jacobian.h"

namespace abbe::sim::compensation {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Motion;
using kinematics::Pose;

constexpr double point_step = 1e-8;       // mm: 0.01 nm
constexpr double direction_step = 1e-12;  // rad

/// The joints that may be corrected, and how they move the functional point and the tool axis.
struct Reach {
  std::vector<int> slides;
  std::vector<int> turns;
  Eigen::Matrix<double, 3, Eigen::Dynamic> point_by_slide;     // (3 x slides)
  Eigen::Matrix<double, 3, Eigen::Dynamic> point_by_turn;      // (3 x turns)
  Eigen::Matrix<double, 2, Eigen::Dynamic> direction_by_turn;  // (2 x turns), across the tool axis
  Eigen::Matrix<double, 2, 3> across;  // (2 x 3) rows span the plane across it
};

Vector3d axis_of(const Pose& T) { return T.linear().col(2); }

Vector3d functional_point(const Pose& T, double height) {
  return T.translation() + height * axis_of(T);
}

Reach reach_at(const Chain& chain, const AxisVector& q, const Pose& T_wt,
               const CorrectOptions& options, double height) {
  const Eigen::MatrixXd J = kinematics::axis_jacobian(chain, q);
  const Vector3d u = axis_of(T_wt);
  Reach reach;
  for (int i = 0; i < chain.size(); ++i) {
    const kinematics::Joint& joint = chain.joints()[std::size_t(i)];
    if (options.idle_joint == i) continue;
    if (joint.motion == Motion::Linear) reach.slides.push_back(i);
    if (joint.motion == Motion::Rotary && options.strategy != Strategy::Position)
      reach.turns.push_back(i);
  }
  reach.across.row(0) = T_wt.linear().col(0).transpose();
  reach.across.row(1) = T_wt.linear().col(1).transpose();
  reach.point_by_slide.resize(3, Eigen::Index(reach.slides.size()));
  reach.point_by_turn.resize(3, Eigen::Index(reach.turns.size()));
  reach.direction_by_turn.resize(2, Eigen::Index(reach.turns.size()));
  for (std::size_t k = 0; k < reach.slides.size(); ++k)
    reach.point_by_slide.col(Eigen::Index(k)) = J.col(reach.slides[k]).head<3>();
  for (std::size_t k = 0; k < reach.turns.size(); ++k) {
    const Vector3d turn = J.col(reach.turns[k]).tail<3>();
    reach.point_by_turn.col(Eigen::Index(k)) =
        J.col(reach.turns[k]).head<3>() + turn.cross(height * u);
    reach.direction_by_turn.col(Eigen::Index(k)) = reach.across * turn.cross(u);
  }
  return reach;
}

/// Damping that is zero where the least sensitive turn still moves the axis well, and grows
/// smoothly towards the pole, where that turn would have to be enormous.
double damping(const Reach& reach, double singular_sine) {
  double least = 1.0;
  for (Eigen::Index k = 0; k < reach.direction_by_turn.cols(); ++k)
    least = std::min(least, reach.direction_by_turn.col(k).norm());
  if (least >= singular_sine) return 0.0;
  const double depth = 1.0 - least / singular_sine;
  return singular_sine * depth;
}

/// Next total correction of the turns: minimises |error + J (c - c_now)|^2 + damping^2 |c|^2 within
/// the bound, coordinate by coordinate at the bound.
Eigen::VectorXd turns_step(const Reach& reach, const Vector2d& error, const Eigen::VectorXd& c_now,
                           const CorrectOptions& options) {
  const auto& J = reach.direction_by_turn;
  const double mu = damping(reach, options.singular_sine);
  const Eigen::Index n = J.cols();
  Eigen::VectorXd c = Eigen::VectorXd::Zero(n);
  if (n == 0) return c;
  const Vector2d wanted = J * c_now - error;
  std::vector<bool> held(std::size_t(n), false);
  for (Eigen::Index round = 0; round <= n; ++round) {
    std::vector<Eigen::Index> free;
    Vector2d rest = wanted;
    for (Eigen::Index k = 0; k < n; ++k) {
      if (held[std::size_t(k)])
        rest -= J.col(k) * c[k];
      else
        free.push_back(k);
    }
    if (free.empty()) break;
    const Eigen::Index m = Eigen::Index(free.size());
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(2 + m, m);
    Eigen::VectorXd b = Eigen::VectorXd::Zero(2 + m);
    b.head<2>() = rest;
    for (Eigen::Index k = 0; k < m; ++k) {
      A.col(k).head<2>() = J.col(free[std::size_t(k)]);
      A(2 + k, k) = mu;
    }
    const Eigen::VectorXd solved = A.completeOrthogonalDecomposition().solve(b);
    bool inside = true;
    for (Eigen::Index k = 0; k < m; ++k) {
      const Eigen::Index i = free[std::size_t(k)];
      c[i] = std::clamp(solved[k], -options.rotary_bound, options.rotary_bound);
      if (c[i] != solved[k]) {
        held[std::size_t(i)] = true;
        inside = false;
      }
    }
    if (inside) break;
  }
  return c;
}

}  // namespace

Correction correct(const Chain& control, const Belief& belief, const Pose& T_wt,
                   const kinematics::AxisState& command, const CorrectOptions& options) {
  const double height = options.strategy == Strategy::Position ? 0.0 : options.functional_height;
  const Reach reach = reach_at(control, command.q, T_wt, options, height);
  const Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> slides(reach.point_by_slide);
  const Vector3d u = axis_of(T_wt);
  const Vector3d point = functional_point(T_wt, height);

  Correction result;
  result.converged = options.strategy != Strategy::Iterated;
  Eigen::VectorXd turns = Eigen::VectorXd::Zero(Eigen::Index(reach.turns.size()));
  kinematics::AxisState state = command;
  const int steps = options.strategy == Strategy::Iterated ? options.most_iterations : 1;
  for (int step = 0; step <= steps; ++step) {
    const Pose believed = belief(state);
    const Vector3d point_error = functional_point(believed, height) - point;
    const Vector3d direction_error = axis_of(believed) - u;
    result.point_left = point_error.norm();
    result.direction_left = direction_error.norm();
    if (step == steps || (step > 0 && result.converged && options.strategy == Strategy::Iterated))
      break;

    const Eigen::VectorXd next = turns_step(reach, reach.across * direction_error, turns, options);
    const Eigen::VectorXd turned = next - turns;
    const Eigen::VectorXd wanted = -(point_error + reach.point_by_turn * turned);
    const Eigen::VectorXd moved = slides.solve(wanted);
    turns = next;
    for (std::size_t k = 0; k < reach.turns.size(); ++k)
      state.q[reach.turns[k]] = command.q[reach.turns[k]] + turns[Eigen::Index(k)];
    for (std::size_t k = 0; k < reach.slides.size(); ++k)
      state.q[reach.slides[k]] += moved[Eigen::Index(k)];
    const double largest_turn = turned.size() > 0 ? turned.cwiseAbs().maxCoeff() : 0.0;
    const double largest_move = moved.size() > 0 ? moved.cwiseAbs().maxCoeff() : 0.0;
    if (options.strategy == Strategy::Iterated)
      result.converged = largest_move < point_step && largest_turn < direction_step;
  }
  result.q = state.q;
  return result;
}

}  // namespace abbe::sim::compensation
