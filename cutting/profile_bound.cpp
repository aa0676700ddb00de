#include "cutting/profile_bound.h"

#include <algorithm>
#include <cmath>

#include "cutting/nose_bound.h"
#include "kinematics/numbers.h"

namespace abbe::cutting {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

constexpr double rounding = 1e-9;  // mm

Matrix3d turned_to(const NoseInterval& interval, double u) {
  if (interval.turn == 0.0) return interval.R;
  return interval.R * Eigen::AngleAxisd(u * interval.turn, interval.turn_axis).toRotationMatrix();
}

/// Across the spindle line, in the rake plane and to the side of the tool.
Vector3d up_in(const Matrix3d& R, const Vector3d& centre) {
  const Vector3d across = Vector3d::UnitX().cross(R.col(1));
  if (across.norm() < 0.5) return Vector3d::UnitY();  // then the bound is wide, but holds
  return (across.dot(centre) < 0.0 ? -1.0 : 1.0) * across.normalized();
}

}  // namespace

ProfileBound::ProfileBound(const EdgeProfile& profile, const NoseSweep& sweep)
    : R_(sweep.intervals.empty() ? Matrix3d(Matrix3d::Identity()) : sweep.intervals.front().R),
      up_(up_in(R_, sweep.intervals.empty() ? Vector3d(Vector3d::Zero())
                                            : sweep.intervals.front().centre)),
      beside_(Vector3d::UnitX().cross(up_)),
      outer_radius_(profile.outer_radius) {
  // of the point (x, z) of the profile in the meridian half-plane
  Eigen::Matrix2d meridian;
  meridian << R_(0, 0), R_(0, 2), up_.dot(R_.col(0)), up_.dot(R_.col(2));
  const auto reach = [&](const Vector2d& direction_t) {
    return direction_t.dot(foremost(profile, direction_t));
  };
  const auto add = [&](const Vector2d& normal_t) {
    const Vector2d normal = (meridian * normal_t).normalized();
    sides_.push_back({normal, reach(meridian.transpose() * normal)});
  };
  constexpr double between = 0.25;  // rad, of the tangents of an arc: 1% of its radius off it
  for (const OutlinePiece& piece : profile.pieces) {
    if (!piece.is_arc) add(piece.normal_from);
    if (!piece.is_arc || piece.radius == 0.0) continue;
    const double angle = std::acos(std::clamp(piece.normal_from.dot(piece.normal_to), -1.0, 1.0));
    const int parts = int(std::ceil(angle / between));
    for (int i = 0; i <= parts; ++i)
      add(Eigen::Rotation2Dd(angle * i / std::max(parts, 1)) * piece.normal_from);
  }
  down_ = reach(meridian.transpose() * Vector2d(0, -1));
  const Vector2d sideways(beside_.dot(R_.col(0)), beside_.dot(R_.col(2)));
  wide_ = std::max(reach(sideways), reach(-sideways));

  extents_.resize(sweep.nodes.size());
  for (std::size_t i = sweep.nodes.size(); i-- > 0;) {  // children come after their parents
    const NoseNode& node = sweep.nodes[i];
    if (node.count == 1) {
      extents_[i] = extent_of(sweep, sweep.pieces[std::size_t(node.first)]);
      continue;
    }
    const Extent &a = extents_[i + 1], &b = extents_[std::size_t(node.right)];
    extents_[i] = {std::min(a.up_low, b.up_low), std::max(a.up_high, b.up_high),
                   std::max(a.off, b.off), std::max(a.beside, b.beside)};
  }
}

ProfileBound::Extent ProfileBound::extent_of(const NoseSweep& sweep, const NosePiece& piece) const {
  const NoseInterval& interval = sweep.intervals[std::size_t(piece.interval)];
  Extent extent{infinity, -infinity, 0.0, 0.0};
  for (const double u : {piece.u0, piece.u1}) {
    const Vector3d centre = interval.centre + u * interval.centre_step;
    extent.up_low = std::min(extent.up_low, up_.dot(centre));
    extent.up_high = std::max(extent.up_high, up_.dot(centre));
    extent.beside = std::max(extent.beside, std::abs(beside_.dot(centre)));
    extent.off = std::max(extent.off, (turned_to(interval, u) - R_).norm());
  }
  extent.off = outer_radius_ * (extent.off + interval.turn * (piece.u1 - piece.u0));
  extent.beside += wide_ + extent.off;
  return extent;
}

// A point of a tool at (x, up, beside) comes by turning to the meridian at the radius
// hypot(up, beside): not below `up`, and not above it by more than `beside` and twice what the tool
// reaches beyond the spindle line.
double ProfileBound::first_reach(int index, const NoseNode& node, const NoseStretch& ray) const {
  if (!may_face(node, ray)) return infinity;
  const Extent& extent = extents_[std::size_t(index)];
  const double past = std::max(0.0, down_ + extent.off - extent.up_low);
  const double above = 2.0 * past + extent.beside + ray.sag;
  double enter = ray.from, leave = ray.to;
  for (const Side& side : sides_) {
    const Vector2d& n = side.normal;
    const double most =
        side.reach + extent.off + rounding + n.x() * (n.x() > 0.0 ? node.x_high : node.x_low) +
        n.y() * (n.y() > 0.0 ? extent.up_high : extent.up_low) + std::max(0.0, n.y()) * above;
    const double off = n.x() * ray.q.x() + n.y() * ray.radius0 - most;
    const double away = n.x() * ray.n.x() + n.y() * ray.radius_step;
    if (std::abs(away) < 1e-14) {
      if (off > 0.0) return infinity;
    } else if (away > 0.0) {
      leave = std::min(leave, -off / away);
    } else {
      enter = std::max(enter, -off / away);
    }
  }
  return enter > leave ? infinity : enter - rounding;
}

}  // namespace abbe::cutting
