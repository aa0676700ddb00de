#include "cutting/tool_path.h"

#include <cmath>
#include <numbers>
#include <stdexcept>

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

/// What two axes differ by is mostly rounding where they differ by little, and that need not lie
/// across them.
Vector3d across_axis(const Vector3d& v, const Vector3d& axis) {
  return (v - v.dot(axis) * axis).normalized();
}

}  // namespace

ToolPath::ToolPath(const Stock& stock, const StockMove& move) {
  const Eigen::Isometry3d T_kw = stock.T_wk.inverse();
  const Eigen::Isometry3d from = T_kw * move.from_T_wt, to = T_kw * move.to_T_wt;
  tip_ = from.translation() - stock.origin_k;
  step_ = to.translation() - from.translation();
  const Vector3d axis = from.linear().col(2).normalized();
  const Vector3d target = to.linear().col(2).normalized();
  if (!tip_.allFinite() || !step_.allFinite() || !axis.allFinite() || !target.allFinite())
    throw std::invalid_argument("stock move: expected finite poses");
  const Vector3d across = target - target.dot(axis) * axis;
  const double sine = across.norm();
  angle_ = sine < 1e-12 ? 0.0 : std::atan2(sine, target.dot(axis));
  if (target.dot(axis) < 0.0 && std::numbers::pi - std::atan2(sine, target.dot(axis)) < 1e-9)
    throw std::invalid_argument("stock move: expected an axis that turns by less than half a turn");
  R_.row(2) = axis;
  R_.row(0) = angle_ > 0.0 ? across_axis(across / sine, axis) : axis.unitOrthogonal();
  R_.row(1) = axis.cross(Vector3d(R_.row(0)));
}

ToolPose ToolPath::at(double t) const {
  const double sine = std::sin(t * angle_), cosine = std::cos(t * angle_);
  ToolPose pose{tip_ + t * step_, R_};
  pose.R.row(0) = cosine * R_.row(0) - sine * R_.row(2);
  pose.R.row(2) = sine * R_.row(0) + cosine * R_.row(2);
  return pose;
}

}  // namespace abbe::cutting
