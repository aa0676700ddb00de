#pragma once

#include <array>
#include <optional>
#include <vector>

#include "errors/curve.h"

namespace abbe::errors {

/// P_0, P_1 ... one after the other, the Legendre polynomials at a place.
struct LegendreAt {
  double t;             ///< (q - centre) / half_range
  double before = 0.0;  ///< P_{k-1}
  double P = 1.0;       ///< P_k
  int k = 0;

  void next() {
    const double after = (double(2 * k + 1) * t * P - double(k) * before) / double(k + 1);
    before = P;
    P = after;
    ++k;
  }
};

/// Cosine and sine of an angle, twice the angle ..., without a call for each.
struct HarmonicAt {
  explicit HarmonicAt(double angle);

  double c, s;              ///< of the harmonic
  double first_c, first_s;  ///< of the angle

  void next() {
    const double c_next = c * first_c - s * first_s;
    s = s * first_c + c * first_s;
    c = c_next;
  }
};

/// What Legendre or Fourier series of one argument and range share: their functions, whatever the
/// coefficients are.
struct SeriesBasis {
  enum class Kind {
    Legendre,   ///< P_0, P_1 ...
    Harmonics,  ///< cos, sin, cos of twice the angle ...
  };
  static constexpr int most_functions = 24;

  Kind kind = Kind::Legendre;
  Argument argument = Argument::Command;
  double centre = 0.0;  ///< mm or rad, of Legendre series
  double range = 1.0;   ///< mm or rad: half range, period
  int functions = 0;    ///< the most that a series uses

  /// True of series that need the same functions, few or many of them.
  bool shares(const SeriesBasis& other) const;
};

/// None of another shape, nor of a series with more than most_functions.
std::optional<SeriesBasis> basis_of(const Curve& curve);

/// Series of one basis, evaluated side by side.
struct SeriesGroup {
  static constexpr int most = 8;
  using Sums = std::array<double, most>;

  SeriesBasis basis;
  int count = 0;
  std::vector<double> coefficients = {};  ///< (functions x most), function by function
};

/// Puts a curve of the group's basis into a group that is not full. @return its place there
int add(const Curve& curve, SeriesGroup& group);

/// Every series to the last bit as `value` of its curve with a scale of 1, not negated.
SeriesGroup::Sums sums(const SeriesGroup& group, const CurveState& state);

/// By what a curve multiplies its shape: its scale, with the sign of the source.
double factor(const Curve& curve);

}  // namespace abbe::errors
