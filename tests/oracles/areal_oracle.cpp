#include "tests/oracles/areal_oracle.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace abbe::test {

BruteFilter brute_filter(const ArealValues& values, const Eigen::Vector3d& point,
                         const Eigen::Vector3d& normal, double cutoff, double reach) {
  using real = long double;
  const real pi = 3.14159265358979323846264338327950288L;
  const real alpha = std::sqrt(std::log(real(2)) / pi);
  const Eigen::Vector3d across =
      normal.cross(std::abs(normal.x()) < 0.6 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY())
          .normalized();
  const Eigen::Vector3d along = normal.cross(across);
  BruteFilter filter;
  filter.low = std::numeric_limits<double>::infinity();
  filter.high = -filter.low;
  real weights = 0, squares = 0, mean = 0, u = 0, v = 0;
  std::vector<real> weight(values.point.size());
  for (std::size_t i = 0; i < weight.size(); ++i) {
    const Eigen::Vector3d d = values.point[i] - point;
    const real x = d.norm() / (alpha * cutoff);
    weight[i] = d.norm() < reach ? values.area[i] * std::exp(-pi * x * x) : real(0);
    if (d.norm() < reach) {
      filter.low = std::min(filter.low, values.value[i]);
      filter.high = std::max(filter.high, values.value[i]);
    }
    weights += weight[i];
    squares += weight[i] * weight[i];
    mean += weight[i] * values.value[i];
    u += weight[i] * d.dot(across);
    v += weight[i] * d.dot(along);
  }
  mean /= weights, u /= weights, v /= weights;
  // the plane about the middle of the values, by its two slopes
  real uu = 0, uv = 0, vv = 0, ur = 0, vr = 0;
  for (std::size_t i = 0; i < weight.size(); ++i) {
    const Eigen::Vector3d d = values.point[i] - point;
    const real a = d.dot(across) - u, b = d.dot(along) - v, r = values.value[i] - mean;
    uu += weight[i] * a * a, uv += weight[i] * a * b, vv += weight[i] * b * b;
    ur += weight[i] * a * r, vr += weight[i] * b * r;
  }
  const real determinant = uu * vv - uv * uv;
  const real slope_u = determinant > 0 ? (vv * ur - uv * vr) / determinant : real(0);
  const real slope_v = determinant > 0 ? (uu * vr - uv * ur) / determinant : real(0);
  filter.mean = double(mean);
  filter.plane = double(mean - slope_u * u - slope_v * v);
  filter.carried_by = double(weights * weights / squares);
  return filter;
}

}  // namespace abbe::test
