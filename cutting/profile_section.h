#pragma once

#include <Eigen/Core>

#include "cutting/primitive.h"

namespace abbe::cutting {

/// A piece ready for evaluation. Everything is counted from its start, never from the centre of its
/// arc: so a shallow arc of a large radius loses no digits.
struct Section {
  Eigen::Vector2d from, to;
  Eigen::Vector2d tangent;  ///< unit, at `from`
  double curvature;         ///< 1/mm, > 0 convex: the walk turns to the right
  double length;            ///< mm of arc
};

Section section(const RevolvedProfile::Piece& piece);

/// A place on a profile.
struct Station {
  Eigen::Vector2d point;   ///< (r, z)
  Eigen::Vector2d normal;  ///< outward
};

/// The station `arc` mm from the start; at the nearer end beyond the section.
Station at(const Section& s, double arc);

/// The station at radius r; along a piece the normal's r component grows linearly with r.
Station at_radius(const Section& s, double r);

/// The direction a quarter turn to the left of a tangent: outward.
Eigen::Vector2d left_of(const Eigen::Vector2d& tangent);

}  // namespace abbe::cutting
