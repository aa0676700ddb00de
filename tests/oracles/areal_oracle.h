#pragma once

#include <vector>

#include <Eigen/Core>

/// The areal Gaussian filter a second time: sums over all values, without cells and without any
/// code of the modules.
namespace abbe::test {

/// Values on a surface, with the areas that they stand for.
struct ArealValues {
  std::vector<Eigen::Vector3d> point;  ///< mm
  std::vector<double> value, area;
};

/// The filtered value at a point, by order 0 (weighted mean) and order 1 (plane), and how many
/// values carry it.
struct BruteFilter {
  double mean = 0.0, plane = 0.0;
  double carried_by = 0.0;       ///< (sum of weights)^2 / sum of squared weights
  double low = 0.0, high = 0.0;  ///< of the values within `reach`
};
BruteFilter brute_filter(const ArealValues& values, const Eigen::Vector3d& point,
                         const Eigen::Vector3d& normal, double cutoff, double reach);

}  // namespace abbe::test
