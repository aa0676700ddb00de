#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <Eigen/LU>

#include "errors/compliance.h"
#include "kinematics/units.h"

// Along the endless wall the deflection is a Fourier integral. For a wave number k (in units of
// 1/c) the deflection over the height obeys (d^2 - k^2)^2 f = delta(y - s), clamped at y = 0, free
// at y = 1, which four coefficients solve; its value under the load, integrated over k, is the
// compliance.

namespace abbe::errors {
namespace {

using Eigen::Matrix4d;
using Eigen::Vector4d;

/// Value and three derivatives.
using Jet = std::array<double, 4>;

/// x cosh x - sinh x and x sinh x, which with their first derivatives vanish at 0, over the height
/// y; divided by k^3 and k^2, so that k = 0 leaves the cubic and the parabola.
std::array<Jet, 2> clamped(double k, double y) {
  const double x = k * y, ch = std::cosh(x), sh = std::sinh(x);
  const double sinhc = x < 1e-3 ? 1.0 + x * x / 6.0 : sh / x;  // sinh x / x
  double odd = 0.0;                                            // (x cosh x - sinh x) / x^3
  if (x < 1.0) {
    double power = 1.0, factorial = 6.0;  // x^2n-2, (2n + 1)!
    for (int n = 1; n <= 9; ++n) {
      odd += power * 2.0 * n / factorial;
      power *= x * x;
      factorial *= (2.0 * n + 2.0) * (2.0 * n + 3.0);
    }
  } else {
    odd = (x * ch - sh) / (x * x * x);
  }
  return {Jet{y * y * y * odd, y * y * sinhc, y * (sinhc + ch), 2.0 * ch + x * sh},
          Jet{y * y * sinhc, y * (sinhc + ch), 2.0 * ch + x * sh, k * (3.0 * sh + x * ch)}};
}

/// The two that leave no moment and no shear at the free end, over the distance t below it; their
/// derivatives count upwards.
std::array<Jet, 2> free_end(double k, double t, double nu) {
  const double x = k * t, ch = std::cosh(x), sh = std::sinh(x);
  const double sinhc = x < 1e-3 ? 1.0 + x * x / 6.0 : sh / x;
  const double a = -0.5 * (1.0 - nu), b = (1.0 - nu) / (1.0 + nu);
  const double k2 = k * k;
  return {
      Jet{ch + a * x * sh, -k * ((1.0 + a) * sh + a * x * ch),
          k2 * ((1.0 + 2.0 * a) * ch + a * x * sh), -k2 * k * ((1.0 + 3.0 * a) * sh + a * x * ch)},
      Jet{t * (sinhc + b * ch), -((1.0 + b) * ch + b * x * sh),
          k * ((1.0 + 2.0 * b) * sh + b * x * ch), -k2 * ((1.0 + 3.0 * b) * ch + b * x * sh)}};
}

/// Long waves: both halves from their own ends, joined at the load.
double long_wave(double k, double s, double nu) {
  const auto below = clamped(k, s);
  const auto above = free_end(k, 1.0 - s, nu);
  Matrix4d A;
  for (int i = 0; i < 4; ++i)
    A.row(i) << -below[0][std::size_t(i)], -below[1][std::size_t(i)], above[0][std::size_t(i)],
        above[1][std::size_t(i)];
  const Vector4d c = A.partialPivLu().solve(Vector4d(0.0, 0.0, 0.0, 1.0));
  return c[0] * below[0][0] + c[1] * below[1][0];
}

/// Short waves: that of an endless plate in both directions, and what each end adds to it, which
/// dies away from there. In units of y = k times the height; the result times k^3.
double short_wave(double k, double s, double nu) {
  const double r0 = k * s, r1 = k - r0, e0 = 0.25 * std::exp(-r0), e1 = 0.25 * std::exp(-r1);
  const double e = std::exp(-k);
  // rows: value and slope at the clamp, moment and shear at the free end
  const auto ends = [&](const Jet& at_foot, const Jet& at_top) {
    return Vector4d(at_foot[0], at_foot[1], at_top[2] - nu * at_top[0],
                    at_top[3] - (2.0 - nu) * at_top[1]);
  };
  Matrix4d A;
  A.col(0) = ends({1, -1, 1, -1}, {e, -e, e, -e});
  A.col(1) = ends({0, 1, -2, 3}, {k * e, (1 - k) * e, (k - 2) * e, (3 - k) * e});
  A.col(2) = ends({e, e, e, e}, {1, 1, 1, 1});
  A.col(3) = ends({k * e, (k - 1) * e, (k - 2) * e, (k - 3) * e}, {0, -1, -2, -3});
  const Vector4d loaded =
      ends({(1 + r0) * e0, r0 * e0, 0, 0}, {(1 + r1) * e1, -r1 * e1, (r1 - 1) * e1, (2 - r1) * e1});
  const Vector4d c = A.partialPivLu().solve(-loaded);
  return 0.25 + 4.0 * (e0 * (c[0] + c[1] * r0) + e1 * (c[2] + c[3] * r1));
}

double under_load(double k, double s, double nu) {
  return k < 3.0 ? long_wave(k, s, nu) : short_wave(k, s, nu) / (k * k * k);
}

/// Integral from a to b by eight Gauss points.
double gauss(double a, double b, double s, double nu) {
  constexpr std::array<double, 4> x{0.1834346424956498, 0.5255324099163290, 0.7966664774136267,
                                    0.9602898564975363};
  constexpr std::array<double, 4> w{0.3626837833783620, 0.3137066458778873, 0.2223810344533745,
                                    0.1012285362903763};
  const double middle = 0.5 * (a + b), half = 0.5 * (b - a);
  double sum = 0.0;
  for (std::size_t i = 0; i < 4; ++i)
    sum +=
        w[i] * (under_load(middle - half * x[i], s, nu) + under_load(middle + half * x[i], s, nu));
  return half * sum;
}

}  // namespace

double cantilever_plate(double s, double nu) {
  if (!(s >= 0.0 && s <= 1.0) || !(nu > -1.0 && nu <= 0.5))
    throw std::invalid_argument(fmt::format(
        "cantilever plate: expected a height 0 .. 1 and a Poisson ratio above -1 and at most 0.5, "
        "seen {} and {}",
        s, nu));
  if (s == 0.0) return 0.0;
  double sum = 0.0, k = 0.0;
  for (const double step = 0.25; k < 6.0; k += step) sum += gauss(k, k + step, s, nu);
  // beyond `far` both ends are far from the load, or it is on the free end: f goes as 1/k^3
  const double above = s < 1.0 ? std::max(1.0 - s, 4e-6) : 1.0;
  const double far = 40.0 / std::min(s, above);
  for (; k < far; k *= 1.25) sum += gauss(k, 1.25 * k, s, nu);
  sum += 0.5 * k * under_load(k, s, nu);
  return sum / pi;
}

}  // namespace abbe::errors
