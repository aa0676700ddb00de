#pragma once

#include <string>
#include <vector>

#include "cutting/mesh.h"
#include "cutting/primitive.h"
#include "cutting/surface.h"

namespace abbe::cutting {

/// One number of form, named as ISO 1101 names it with the way of fitting.
struct FormNumber {
  std::string name;
  double value_mm;
};

/// Form of the machined surface over its cut vertices, where the design is a known surface:
///   rectangle, disc  flatness_lsq, flatness_minimum_zone
///   cylinder         cylindricity_lsq, roundness_lsc (the ring nearest to mid height, across the
///   axis) cone             conicity_lsq (at the nominal apex angle), roundness_lsc up to 45
///   degrees sphere cap       sphericity_lsq;   torus  torus_form_lsq;   profile  profile_form_lsq
/// The `_lsq` numbers are max - min of the residual after the best displacement of the whole and
/// the best uniform allowance (the size) are taken out, least squares weighted by vertex area;
/// first order in the displacement t: t^2 / 2R is left out (20 um on R 50 mm: 4 nm). The minimum
/// zone is the distance of the closest two parallel planes, an upper bound that the method closes
/// to 1e-12 mm. A number for which too few vertices are cut is not in the list.
/// @param design_m  the design in the frame of the primitive
/// @throws std::invalid_argument if sizes differ
std::vector<FormNumber> form(const Primitive& primitive, const Design& design_m,
                             const Surface& surface);

/// Least-squares circle.
struct Circle {
  Eigen::Vector2d centre;  ///< mm
  double radius;           ///< mm
  double roundness;        ///< mm, largest minus smallest distance from the centre
};

/// Circle that makes the sum of squared distances of the points from it smallest (geometric
/// distances, each point counting one).
/// @param points  (n x 2) mm, n >= 3
/// @throws std::invalid_argument for fewer than 3 points, numbers not finite, points on a line
Circle fit_circle(const Eigen::Matrix<double, Eigen::Dynamic, 2>& points);

}  // namespace abbe::cutting
