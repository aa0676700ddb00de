#include "sim/datum.h"

#include <Eigen/Dense>

#include "kinematics/jacobian.h"

namespace abbe::sim {
namespace {

using Eigen::Vector3d;
using kinematics::AxisVector;

/// Actual minus wanted tip when the control goes to `point_w` with the rotary axes at zero.
Vector3d tip_deviation(const Vector3d& point_w, double time_s, const Machine& machine,
                       const Truth& truth) {
  const AxisVector zero = AxisVector::Zero(machine.nominal.size());
  const auto command = [&](const kinematics::Chain& chain) {
    kinematics::AxisState state;
    const Vector3d tip_at_zero = chain.tool_in_workpiece(zero).translation();
    state.q = slides_of_offset(chain, point_w - tip_at_zero);
    state.time_s = time_s;
    return state;
  };
  // what the slides cannot reach nominally is no deviation
  const Vector3d wanted =
      machine.nominal.tool_in_workpiece(command(machine.nominal).q).translation();
  return tool_in_workpiece(truth, command(machine.control)).translation() - wanted;
}

}  // namespace

AxisVector slides_of_offset(const kinematics::Chain& chain, const Vector3d& offset_w) {
  AxisVector q = AxisVector::Zero(chain.size());
  const Eigen::MatrixXd J = kinematics::axis_jacobian(chain, q);
  Eigen::MatrixXd by_slide = Eigen::MatrixXd::Zero(3, chain.size());
  for (int i = 0; i < chain.size(); ++i)
    if (chain.joints()[std::size_t(i)].motion == kinematics::Motion::Linear)
      by_slide.col(i) = J.col(i).head<3>();
  q = by_slide.completeOrthogonalDecomposition().solve(offset_w);
  return q;
}

Vector3d datum_offset(const DatumDescription& datum, const Machine& machine, const Truth& truth) {
  using Kind = DatumDescription::Kind;
  if (datum.kind == Kind::None) return Vector3d::Zero();
  if (datum.kind == Kind::Ideal) {
    Vector3d offset = Vector3d::Zero();
    // the deviation itself depends on where the tip is sent, so the last step only mends nanometres
    for (int i = 0; i < 3; ++i)
      offset = -tip_deviation(datum.point_w + offset, datum.time_s, machine, truth);
    return offset;
  }
  const Eigen::Index n = Eigen::Index(datum.touches.size());
  Eigen::MatrixXd directions(n, 3);
  Eigen::VectorXd learnt(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const DatumDescription::Touch& touch = datum.touches[std::size_t(i)];
    directions.row(i) = touch.direction_w.transpose();
    learnt[i] = -touch.direction_w.dot(tip_deviation(touch.point_w, datum.time_s, machine, truth));
  }
  return directions.completeOrthogonalDecomposition().solve(learnt);
}

}  // namespace abbe::sim
