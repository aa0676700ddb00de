#pragma once

#include <Eigen/Core>

/// Minimum zones by trying every candidate: slow, for a few points.
namespace abbe::oracles {

/// Least difference of radii of two concentric circles that enclose the points, over centres within
/// `reach` of the mean of the points: at a best centre three points touch one circle or two touch
/// each. All such centres are tried. O(n^5).
double brute_circularity(const Eigen::MatrixX2d& points, double reach);

/// Least distance of two parallel planes that enclose the points: at the best three points touch
/// one plane or two touch each. All such directions are tried. O(n^5).
double brute_flatness(const Eigen::MatrixX3d& points);

}  // namespace abbe::oracles
