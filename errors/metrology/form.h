#pragma once

#include <Eigen/Core>

namespace abbe::errors::metrology {

/// Least-squares circle through points.
struct LeastSquaresCircle {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  ///< mm
  double radius = 0.0;                               ///< mm
  double circularity = 0.0;  ///< mm, largest minus smallest distance from the centre
};

/// Returns the circle with the smallest sum of squared distances of the points, by Gauss-Newton on
/// the distances. The remaining mean gradient is below 1e-12 of the radius if the circle lies
/// within ten radii of the origin.
/// Source: ISO 12181-1, least squares reference circle.
/// @param points   (n x 2) mm, n >= 3; may be an arc
/// @param weights  (n) > 0, e.g. `arc_weights`; empty: equal weights
/// @throws std::invalid_argument for fewer than 3 points, numbers that are not finite, points on a
/// line, invalid weights, or if a line fits better than every circle
LeastSquaresCircle least_squares_circle(const Eigen::MatrixX2d& points,
                                        const Eigen::VectorXd& weights = {});

/// The two concentric circles closest to each other that enclose the points.
struct MinimumZoneCircles {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  ///< mm
  double inner = 0.0;                                ///< mm
  double outer = 0.0;                                ///< mm
  double circularity = 0.0;                          ///< mm, outer - inner
  double gap = 0.0;        ///< mm; to first order no neighbouring centre is better by more
  bool is_proven = false;  ///< true: no centre within half of `inner` is better by 1e-7 of the
                           ///< circularity
};

/// Returns the minimum zone circles by successive uniform linear fits, to within 1e-9 of the
/// circularity or 1e-14 of the radius. `is_proven` states a proof: the width grows away from the
/// centre faster, by its contact points, than the curvature of the distances can lower it. It is
/// true for full circles whose circularity is small compared with the radius. It is false for short
/// arcs, for fewer than four points, and if the contact points do not fix the centre.
/// Source: ISO 12181-1, minimum zone reference circles.
/// @throws std::invalid_argument as `least_squares_circle`
MinimumZoneCircles minimum_zone_circles(const Eigen::MatrixX2d& points);

/// Least-squares plane: normal . p = offset.
struct LeastSquaresPlane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< unit, its largest component positive
  double offset = 0.0;                                ///< mm
  double flatness = 0.0;                              ///< mm, largest minus smallest distance
};

/// Returns the plane with the smallest sum of squared distances along its normal.
/// Source: ISO 12781-1, least squares reference plane.
/// @param points   (n x 3) mm, n >= 3
/// @param weights  (n) > 0; empty: equal weights
/// @throws std::invalid_argument for fewer than 3 points, numbers that are not finite, points on a
///         line, or invalid weights
LeastSquaresPlane least_squares_plane(const Eigen::MatrixX3d& points,
                                      const Eigen::VectorXd& weights = {});

/// The two parallel planes closest to each other that enclose the points: lower <= normal . p <=
/// upper.
struct MinimumZonePlanes {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< unit, its largest component positive
  double lower = 0.0;                                 ///< mm
  double upper = 0.0;                                 ///< mm
  double flatness = 0.0;                              ///< mm, upper - lower
  double gap = 0.0;  ///< mm; to first order no planes of nearly the same direction are better by
                     ///< more
  bool is_proven = false;  ///< true: no direction is better by 1e-7 of the flatness
};

/// Returns the minimum zone planes (the width of the convex hull) by successive uniform linear
/// fits, to within 1e-9 of the flatness or 1e-14 of the size. `is_proven` is false if the points
/// are as thick as they are wide, or if the contact points do not fix the tilt of the planes.
/// Source: ISO 12781-1, minimum zone reference planes.
/// @throws std::invalid_argument as `least_squares_plane`
MinimumZonePlanes minimum_zone_planes(const Eigen::MatrixX3d& points);

}  // namespace abbe::errors::metrology
