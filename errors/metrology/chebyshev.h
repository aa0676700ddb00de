#pragma once

#include <vector>

#include <Eigen/Core>

namespace abbe::errors::metrology {

/// Best uniform fit of linear terms: the coefficients that make the largest |y - terms * x| as
/// small as it can be.
struct ChebyshevFit {
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
  double half_width = 0.0;  ///< largest |residual| at `x`
  double lower = 0.0;       ///< no x has less: half_width - lower is what may be missing
  std::vector<Eigen::Index> upper_points;  ///< that touch +half_width
  std::vector<Eigen::Index> lower_points;  ///< that touch -half_width
};

/// By exchange of one point of a reference of four. The third term is a constant, so `terms` has
/// two columns; they and `y` should be centred and scaled to about 1. Source: Stiefel 1959; Watson
/// 1980, ch. 2.
ChebyshevFit chebyshev_fit(const Eigen::MatrixX2d& terms, const Eigen::VectorXd& y);

/// How fast a difference of extremes grows away from its minimum: the least over unit directions d
/// of max over upper points of -d.u minus min over lower points of -d.u; at most 0 where the points
/// do not hold the minimum from all sides.
/// @param upper, lower  (n x 2), (k x 2), n and k >= 1
double sharpness(const Eigen::MatrixX2d& upper, const Eigen::MatrixX2d& lower);

}  // namespace abbe::errors::metrology
