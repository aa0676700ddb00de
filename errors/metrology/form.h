#pragma once

#include <Eigen/Core>

namespace abbe::errors::metrology {

/// Circle through points as least squares see it.
struct LeastSquaresCircle {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  ///< mm
  double radius = 0.0;                               ///< mm
  double circularity = 0.0;  ///< mm, largest minus smallest distance from the centre
};

/// Circle that makes the sum of squared distances of the points from it smallest, by Gauss-Newton
/// on the distances themselves; the mean gradient left over is below 1e-12 of the radius where the
/// circle is within ten radii of the origin. Source: ISO 12181-1, least squares reference circle.
/// @param points   (n x 2) mm, n >= 3; an arc will do
/// @param weights  (n) > 0, how much each counts; none: all the same (circular.h)
/// @throws std::invalid_argument for fewer than 3 points, numbers not finite, points on a line,
///         other weights, or where no circle is best
LeastSquaresCircle least_squares_circle(const Eigen::MatrixX2d& points,
                                        const Eigen::VectorXd& weights = {});

/// The two concentric circles that enclose the points with the least distance between them.
struct MinimumZoneCircles {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  ///< mm
  double inner = 0.0;                                ///< mm
  double outer = 0.0;                                ///< mm
  double circularity = 0.0;                          ///< mm, outer - inner
  double gap = 0.0;     ///< mm: to first order no centre near this one does better by more
  bool proven = false;  ///< none within half of `inner` of it does better by 1e-7 of circularity
};

/// Minimum zone circles by uniform linear fits about the centre reached, to within 1e-9 of the
/// circularity or 1e-14 of the radius. `proven` is a proof, not a hope: the touching points hold
/// the centre more sharply than distances can curve. It holds for whole circles whose circularity
/// is small beside the radius; it is false for short arcs, for fewer than four points and where
/// points tie so that the centre may slide. Source: ISO 12181-1, minimum zone reference circles.
/// @throws std::invalid_argument as `least_squares_circle`
MinimumZoneCircles minimum_zone_circles(const Eigen::MatrixX2d& points);

/// Plane as least squares see it: normal . p = offset.
struct LeastSquaresPlane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< unit, its largest component positive
  double offset = 0.0;                                ///< mm
  double flatness = 0.0;                              ///< mm, largest minus smallest distance
};

/// Plane that makes the sum of squared distances along its normal smallest.
/// Source: ISO 12781-1, least squares reference plane.
/// @param points   (n x 3) mm, n >= 3
/// @param weights  (n) > 0, how much each counts; none: all the same
/// @throws std::invalid_argument for fewer than 3 points, numbers not finite, points on a line, or
///         other weights
LeastSquaresPlane least_squares_plane(const Eigen::MatrixX3d& points,
                                      const Eigen::VectorXd& weights = {});

/// The two parallel planes that enclose the points with the least distance between them:
/// lower <= normal . p <= upper.
struct MinimumZonePlanes {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< unit, its largest component positive
  double lower = 0.0;                                 ///< mm
  double upper = 0.0;                                 ///< mm
  double flatness = 0.0;                              ///< mm, upper - lower
  double gap = 0.0;     ///< mm: to first order no plane nearly parallel does better by more
  bool proven = false;  ///< no direction whatever does better by 1e-7 of flatness
};

/// Minimum zone planes, the width of the convex hull, by uniform linear fits in the frame of the
/// plane reached, to within 1e-9 of the flatness or 1e-14 of the size. `proven` is false where the
/// points are as thick as they are wide, or tie so that the planes may tilt.
/// Source: ISO 12781-1, minimum zone reference planes.
/// @throws std::invalid_argument as `least_squares_plane`
MinimumZonePlanes minimum_zone_planes(const Eigen::MatrixX3d& points);

}  // namespace abbe::errors::metrology
