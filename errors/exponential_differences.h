#pragma once

#include <array>
#include <cmath>
#include <utility>

/// Divided differences of exp, by which one mode answers linear heat; inline, for they are asked of
/// every mode at every knot.
namespace abbe::errors {

/// Divided difference of exp over `zeros` zeros, -x and -y: sum of (-1)^k h_k(x, y) / (k + zeros +
/// 1)!, h_k the complete homogeneous polynomial.
inline double series(int zeros, double x, double y) {
  constexpr int terms = 20;  // the last is below 1e-19 where both arguments are at most 1
  double coefficient = 1.0;
  for (int k = 2; k <= zeros + 1; ++k) coefficient /= k;
  double h = 1.0, power = 1.0, sum = coefficient;
  for (int k = 1; k < terms; ++k) {
    power *= -x;
    h = -y * h + power;
    coefficient /= k + zeros + 1;
    sum += coefficient * h;
  }
  return sum;
}

// phi1 = (1 - e^-x) / x, phi2 = (1 - phi1) / x, phi3 = (1/2 - phi2) / x, x >= 0; below 1 the
// differences would cancel.
inline double phi1(double x) { return x > 0.0 ? -std::expm1(-x) / x : 1.0; }
inline double phi2(double x) { return x < 1.0 ? series(1, x, 0.0) : (1.0 - phi1(x)) / x; }
inline double phi3(double x) { return x < 1.0 ? series(2, x, 0.0) : (0.5 - phi2(x)) / x; }

/// Divided differences of exp over (-x, -y), (0, -x, -y) and (0, 0, -x, -y), x and y >= 0.
inline std::array<double, 3> lagged(double x, double y) {
  if (x > y) std::swap(x, y);
  const double first = std::exp(-x) * phi1(y - x);
  if (y < 1.0) return {first, series(1, x, y), series(2, x, y)};
  const double second = (phi1(x) - first) / y;
  return {first, second, (phi2(x) - second) / y};
}

}  // namespace abbe::errors
