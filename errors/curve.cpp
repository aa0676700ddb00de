#include "errors/curve.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/hash.h"

namespace abbe::errors {

namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// The state as a curve uses it: its argument, and the direction in terms of that argument.
struct CurveInput {
  double q = 0.0;
  int direction = 0;
  int stroke = 0;
  double per_command = 1.0;  ///< dq / dcommand
};

CurveInput curve_input(const Curve& curve, const CurveState& state) {
  if (curve.argument == Argument::Command)
    return {state.command, state.direction, state.stroke, 1.0};
  const int sign = state.primed ? -1 : 1;
  return {state.carriage, sign * state.direction, state.stroke, double(sign)};
}

// Tables

/// Position within a table: the segment between two rows.
struct TableSegment {
  Index i = 0;              ///< between rows i and i + 1
  double h = 1.0;           ///< distance of the rows
  double t = 0.0;           ///< 0 at row i, 1 at row i + 1
  bool is_outside = false;  ///< beyond the ends, where the last value holds
};

[[noreturn]] void throw_position_error(const Table& table, double q) {
  throw std::out_of_range(fmt::format("position {} is outside the table ({} to {})", q, table.q[0],
                                      table.q[table.q.size() - 1]));
}

/// Returns the row at or before a position, at most the last but one.
Index row_before(const VectorXd& q, double x) {
  const Index last = q.size() - 2;
  // Most tables are evenly spaced, so the row is estimated first and searched only if the estimate
  // is wrong.
  const double guess = (x - q[0]) / (q[last + 1] - q[0]) * double(last + 1);
  const Index i = std::clamp<Index>(Index(guess), 0, last);
  if (q[i] <= x && (i == last || x < q[i + 1])) return i;
  const Index above = std::upper_bound(q.begin(), q.end(), x) - q.begin();
  return std::clamp<Index>(above - 1, 0, last);
}

/// Returns the segment at a position. Throws std::out_of_range outside a table that is not held.
TableSegment table_segment(const Table& table, double q) {
  const double low = table.q[0];
  const double high = table.q[table.q.size() - 1];
  TableSegment p;
  if (!(q >= low && q <= high)) {
    if (table.outside == TableExtrapolation::Refuse || std::isnan(q))
      throw_position_error(table, q);
    p.is_outside = true;
    q = std::clamp(q, low, high);
  }
  p.i = row_before(table.q, q);
  p.h = table.q[p.i + 1] - table.q[p.i];
  p.t = (q - table.q[p.i]) / p.h;
  return p;
}

double shape_value(const Table& table, double q) {
  const TableSegment p = table_segment(table, q);
  const double b = p.t;
  const double a = 1.0 - b;  // this form is exact at both rows
  const double line = a * table.value[p.i] + b * table.value[p.i + 1];
  if (table.between == TableInterpolation::Linear) return line;
  return line + ((a * a * a - a) * table.second[p.i] + (b * b * b - b) * table.second[p.i + 1]) *
                    (p.h * p.h / 6.0);
}

double shape_slope(const Table& table, double q) {
  const TableSegment p = table_segment(table, q);
  if (p.is_outside) return 0.0;
  const double chord = (table.value[p.i + 1] - table.value[p.i]) / p.h;
  if (table.between == TableInterpolation::Linear) return chord;
  const double b = p.t;
  const double a = 1.0 - b;
  return chord +
         ((1.0 - 3.0 * a * a) * table.second[p.i] + (3.0 * b * b - 1.0) * table.second[p.i + 1]) *
             (p.h / 6.0);
}

/// Returns the second derivatives of the natural cubic spline: a tridiagonal system, solved by
/// elimination row by row.
VectorXd natural_spline(const VectorXd& q, const VectorXd& y) {
  const Index n = q.size();
  VectorXd second = VectorXd::Zero(n);
  VectorXd upper = VectorXd::Zero(n);
  for (Index i = 1; i + 1 < n; ++i) {
    const double width_before = q[i] - q[i - 1];
    const double width_after = q[i + 1] - q[i];
    const double second_difference =
        (y[i + 1] - y[i]) / width_after - (y[i] - y[i - 1]) / width_before;
    const double pivot = 2.0 * (width_before + width_after) - width_before * upper[i - 1];
    upper[i] = width_after / pivot;
    second[i] = (6.0 * second_difference - width_before * second[i - 1]) / pivot;
  }
  for (Index i = n - 2; i >= 1; --i) second[i] -= upper[i] * second[i + 1];
  return second;
}

// Shapes

/// Recurrence of the Legendre polynomials P_0, P_1 ... at one argument.
struct LegendreRecurrence {
  double t;               ///< (q - centre) / half_range
  double P_before = 0.0;  ///< P_{k-1}
  double P = 1.0;         ///< P_k
  int k = 0;

  void next() {
    const double P_after = (double(2 * k + 1) * t * P - double(k) * P_before) / double(k + 1);
    P_before = P;
    P = P_after;
    ++k;
  }
};

/// Recurrence of cosine and sine of multiples of an angle, without a library call for each.
struct HarmonicRecurrence {
  explicit HarmonicRecurrence(double angle)
      : c(std::cos(angle)), s(std::sin(angle)), first_c(c), first_s(s) {}

  double c, s;              ///< of the current harmonic
  double first_c, first_s;  ///< of the angle itself

  void next() {
    const double c_next = c * first_c - s * first_s;
    s = s * first_c + c * first_s;
    c = c_next;
  }
};

double shape_value(const Constant& shape, const CurveInput&) { return shape.value; }
double shape_slope(const Constant&, const CurveInput&) { return 0.0; }

double shape_value(const Polynomial& shape, const CurveInput& input) {
  const double t = (input.q - shape.centre) / shape.half_range;
  // Horner's scheme.
  double sum = 0.0;
  for (Index k = shape.c.size() - 1; k >= 0; --k) sum = sum * t + shape.c[k];
  return sum;
}

double shape_slope(const Polynomial& shape, const CurveInput& input) {
  const double t = (input.q - shape.centre) / shape.half_range;
  double sum = 0.0;
  for (Index k = shape.c.size() - 1; k >= 1; --k) sum = sum * t + double(k) * shape.c[k];
  return sum / shape.half_range;
}

double shape_value(const Legendre& shape, const CurveInput& input) {
  LegendreRecurrence recurrence{(input.q - shape.centre) / shape.half_range};
  double sum = 0.0;
  for (Index k = 0; k < shape.c.size(); ++k, recurrence.next()) sum += shape.c[k] * recurrence.P;
  return sum;
}

double shape_slope(const Legendre& shape, const CurveInput& input) {
  LegendreRecurrence recurrence{(input.q - shape.centre) / shape.half_range};
  double sum = 0.0;
  double slope_before = 0.0;
  double slope_P = 0.0;
  for (Index k = 0; k < shape.c.size(); ++k, recurrence.next()) {
    sum += shape.c[k] * slope_P;
    // P'_{k+1} = P'_{k-1} + (2 k + 1) P_k, so the derivatives need no division by 1 - t^2 at the
    // ends.
    const double slope_next = slope_before + double(2 * k + 1) * recurrence.P;
    slope_before = slope_P;
    slope_P = slope_next;
  }
  return sum / shape.half_range;
}

double shape_value(const Fourier& shape, const CurveInput& input) {
  HarmonicRecurrence h(2.0 * std::numbers::pi * (input.q / shape.period));
  double sum = 0.0;
  for (Index k = 0; k < shape.a.size(); ++k, h.next()) sum += shape.a[k] * h.c + shape.b[k] * h.s;
  return sum;
}

double shape_slope(const Fourier& shape, const CurveInput& input) {
  const double rate = 2.0 * std::numbers::pi / shape.period;
  HarmonicRecurrence h(2.0 * std::numbers::pi * (input.q / shape.period));
  double sum = 0.0;
  for (Index k = 0; k < shape.a.size(); ++k, h.next())
    sum += double(k + 1) * rate * (shape.b[k] * h.c - shape.a[k] * h.s);
  return sum;
}

double shape_value(const Table& shape, const CurveInput& input) {
  return shape_value(shape, input.q);
}
double shape_slope(const Table& shape, const CurveInput& input) {
  return shape_slope(shape, input.q);
}

double shape_value(const Backlash& shape, const CurveInput& input) {
  return shape.half * input.direction;
}
double shape_slope(const Backlash&, const CurveInput&) { return 0.0; }

double shape_value(const DirectionalTables& shape, const CurveInput& input) {
  if (input.direction > 0) return shape_value(shape.up, input.q);
  if (input.direction < 0) return shape_value(shape.down, input.q);
  return 0.5 * (shape_value(shape.up, input.q) + shape_value(shape.down, input.q));
}

double shape_slope(const DirectionalTables& shape, const CurveInput& input) {
  if (input.direction > 0) return shape_slope(shape.up, input.q);
  if (input.direction < 0) return shape_slope(shape.down, input.q);
  return 0.5 * (shape_slope(shape.up, input.q) + shape_slope(shape.down, input.q));
}

// Asynchronous error motion

constexpr int wave_count = 32;

/// One cosine of an asynchronous error motion.
struct Wave {
  double order = 0.0;  ///< per rad of the spindle's angle: cosines per turn
  double phase = 0.0;  ///< rad
};

double uniform(std::uint64_t seed, std::uint64_t counter);

/// Returns wave k of a stream. Its order is uniform within its own part of the range but never a
/// whole number, which would repeat every turn and thus be synchronous.
Wave wave(const Asynchronous& shape, int k) {
  const double width = (shape.highest_order - shape.lowest_order) / wave_count;
  const double clearance = std::min(0.02 * width, 0.02);  // distance from whole numbers
  std::uint64_t counter = std::uint64_t(k) << 32;
  const double phase = 2.0 * std::numbers::pi * uniform(shape.seed, counter);
  for (;;) {  // 1.05 attempts on average
    // 0.1 .. 0.9 leaves a gap between the parts, so that no two orders coincide.
    const double in_part = 0.1 + 0.8 * uniform(shape.seed, ++counter);
    const double order = shape.lowest_order + width * (k + in_part);
    if (std::abs(order - std::round(order)) > clearance) return {order, phase};
  }
}

// The mean square of a cosine is 1/2, and the mean squares of different orders add up.
double amplitude(const Asynchronous& shape) { return shape.rms * std::sqrt(2.0 / wave_count); }

double shape_value(const Asynchronous& shape, const CurveInput& input) {
  double sum = 0.0;
  for (int k = 0; k < wave_count; ++k) {
    const Wave w = wave(shape, k);
    sum += std::cos(w.order * input.q + w.phase);
  }
  return amplitude(shape) * sum;
}

double shape_slope(const Asynchronous& shape, const CurveInput& input) {
  double sum = 0.0;
  for (int k = 0; k < wave_count; ++k) {
    const Wave w = wave(shape, k);
    sum -= w.order * std::sin(w.order * input.q + w.phase);
  }
  return amplitude(shape) * sum;
}

// Repeatability: one draw per stroke

double shape_value(const Repeatability& shape, const CurveInput& input) {
  return shape.sigma * normal_deviate(shape.seed, std::uint32_t(input.stroke));
}
double shape_slope(const Repeatability&, const CurveInput&) { return 0.0; }

// Validity of shapes

void expect(bool holds, const char* expected) {
  if (!holds) throw std::invalid_argument(fmt::format("expected {}", expected));
}

void check(const Table& table) {
  expect(table.q.size() >= 2, "a table of at least 2 rows");
  expect(table.value.size() == table.q.size(), "one value per position of the table");
  for (Index i = 0; i < table.q.size(); ++i) {
    if (!std::isfinite(table.q[i]) || !std::isfinite(table.value[i]))
      throw std::invalid_argument(fmt::format("row {}: expected finite numbers, seen {} {}", i + 1,
                                              table.q[i], table.value[i]));
    if (i > 0 && !(table.q[i] > table.q[i - 1]))
      throw std::invalid_argument(fmt::format("row {}: expected a position above {}, seen {}",
                                              i + 1, table.q[i - 1], table.q[i]));
  }
  expect(std::isfinite(table.q[table.q.size() - 1] - table.q[0]), "a table of finite length");
  if (table.between == TableInterpolation::Spline) {
    expect(table.second.size() == table.q.size() && table.second.allFinite(),
           "the second derivatives of the spline, as set by make_table");
  }
}

void check_series(const VectorXd& c, double centre, double half_range) {
  expect(c.allFinite(), "finite coefficients");
  expect(std::isfinite(centre), "a finite centre");
  expect(half_range > 0.0 && std::isfinite(half_range), "a half range above 0");
}

void check(const Constant& shape) { expect(std::isfinite(shape.value), "a finite value"); }
void check(const Polynomial& shape) { check_series(shape.c, shape.centre, shape.half_range); }
void check(const Legendre& shape) { check_series(shape.c, shape.centre, shape.half_range); }
void check(const Fourier& shape) {
  expect(shape.a.size() == shape.b.size(), "equally many sine and cosine coefficients");
  expect(shape.a.allFinite() && shape.b.allFinite(), "finite coefficients");
  expect(shape.period > 0.0 && std::isfinite(shape.period), "a period above 0");
}
void check(const Backlash& shape) { expect(std::isfinite(shape.half), "a finite half reversal"); }
void check(const DirectionalTables& shape) {
  check(shape.up);
  check(shape.down);
}
void check(const Repeatability& shape) {
  expect(shape.sigma >= 0.0 && std::isfinite(shape.sigma), "a sigma of at least 0");
}
void check(const Asynchronous& shape) {
  expect(shape.rms >= 0.0 && std::isfinite(shape.rms), "an rms of at least 0");
  expect(shape.lowest_order > 0.0 && std::isfinite(shape.lowest_order), "a lowest order above 0");
  expect(std::isfinite(shape.highest_order) && shape.highest_order <= 1e4,
         "a highest order of at most 10000");
  expect(shape.highest_order >= shape.lowest_order * (1.0 + 1e-6),
         "a highest order above the lowest order");
}

// Bounds of the second derivative

double max_second_derivative(const Fourier& shape) {
  const double rate = 2.0 * std::numbers::pi / shape.period;
  double sum = 0.0;
  for (Index k = 0; k < shape.a.size(); ++k)
    sum += double((k + 1) * (k + 1)) * rate * rate * std::hypot(shape.a[k], shape.b[k]);
  return sum;
}
double max_second_derivative(const Asynchronous& shape) {
  double sum = 0.0;
  for (int k = 0; k < wave_count; ++k) sum += std::pow(wave(shape, k).order, 2);
  return amplitude(shape) * sum;
}
template <typename Other>
double max_second_derivative(const Other&) {
  return 0.0;
}

// Random numbers

/// Returns a uniform number in [-1, 1) from the upper 53 bits.
double symmetric_uniform(std::uint64_t bits) { return double(bits >> 11) * 0x1p-52 - 1.0; }

/// Returns a uniform number in [0, 1).
double uniform(std::uint64_t seed, std::uint64_t counter) {
  return double(split_mix::stream(seed, counter) >> 11) * 0x1p-53;
}

/// Returns the natural logarithm by arithmetic alone, since libraries differ in the last bit. 0 <
/// x; error below 1e-15.
double portable_log(double x) {
  int exponent = 0;
  double m = std::frexp(x, &exponent);
  // With m in [1/sqrt 2, sqrt 2), |s| is at most 0.172 and twelve terms of the series reach 1e-18.
  if (m < std::numbers::sqrt2 / 2.0) {
    m *= 2.0;
    --exponent;
  }
  const double s = (m - 1.0) / (m + 1.0);
  double sum = 0.0;
  for (int k = 23; k >= 1; k -= 2) sum = sum * (s * s) + 1.0 / k;
  return 2.0 * s * sum + exponent * std::numbers::ln2;
}

}  // namespace

double normal_deviate(std::uint64_t seed, std::uint64_t counter) {
  std::uint64_t bits = split_mix::stream(seed, counter);
  for (;;) {  // polar method (Marsaglia): a point in the unit disc; 1.27 attempts on average
    const double u = symmetric_uniform(split_mix::mixed(bits += split_mix::golden));
    const double v = symmetric_uniform(split_mix::mixed(bits += split_mix::golden));
    const double s = u * u + v * v;
    if (s > 0.0 && s < 1.0) return u * std::sqrt(-2.0 * portable_log(s) / s);
  }
}

double value(const Curve& curve, const CurveState& state) {
  const CurveInput input = curve_input(curve, state);
  return factor(curve) *
         std::visit([&](const auto& s) { return shape_value(s, input); }, curve.shape);
}

double slope(const Curve& curve, const CurveState& state) {
  const CurveInput input = curve_input(curve, state);
  return factor(curve) * input.per_command *
         std::visit([&](const auto& s) { return shape_slope(s, input); }, curve.shape);
}

void validate(const Curve& curve) {
  expect(std::isfinite(curve.scale), "a finite scale");
  std::visit([](const auto& s) { check(s); }, curve.shape);
}

Table make_table(VectorXd q, VectorXd value, TableInterpolation between,
                 TableExtrapolation outside) {
  Table table{std::move(q), std::move(value), TableInterpolation::Linear, outside, {}};
  check(table);
  table.between = between;
  if (between == TableInterpolation::Spline) table.second = natural_spline(table.q, table.value);
  check(table);
  return table;
}

DetrendedTable detrend(const Table& table, Detrend how) {
  const Index last = table.q.size() - 1;
  DetrendedTable result{table, 0.0, 0.0};
  if (how == Detrend::Ends) {
    result.slope = (table.value[last] - table.value[0]) / (table.q[last] - table.q[0]);
    result.offset = table.value[0] - result.slope * table.q[0];
  } else {
    const double q_mean = table.q.mean();
    const VectorXd dq = table.q.array() - q_mean;
    result.slope = dq.dot(table.value) / dq.squaredNorm();
    result.offset = table.value.mean() - result.slope * q_mean;
  }
  // A line has no second derivative, so those of a spline are unchanged.
  result.table.value = table.value.array() - (result.offset + result.slope * table.q.array());
  return result;
}

double second_derivative_bound(const Curve& curve) {
  return std::abs(curve.scale) *
         std::visit([](const auto& s) { return max_second_derivative(s); }, curve.shape);
}

bool is_random(const Curve& curve) {
  return std::holds_alternative<Repeatability>(curve.shape) ||
         std::holds_alternative<Asynchronous>(curve.shape);
}

namespace {

/// Returns the coefficients in the order of the basis functions.
std::vector<double> series_coefficients(const Curve& curve) {
  if (const auto* legendre = std::get_if<Legendre>(&curve.shape))
    return {legendre->c.begin(), legendre->c.end()};
  const auto& fourier = std::get<Fourier>(curve.shape);
  std::vector<double> coefficients;
  for (Eigen::Index k = 0; k < fourier.a.size(); ++k) {
    coefficients.push_back(fourier.a[k]);
    coefficients.push_back(fourier.b[k]);
  }
  return coefficients;
}

}  // namespace

bool SeriesBasis::has_same_functions(const SeriesBasis& other) const {
  return kind == other.kind && argument == other.argument && centre == other.centre &&
         range == other.range;
}

std::optional<SeriesBasis> series_basis(const Curve& curve) {
  SeriesBasis basis;
  basis.argument = curve.argument;
  Eigen::Index functions = 0;
  if (const auto* legendre = std::get_if<Legendre>(&curve.shape)) {
    basis.centre = legendre->centre;
    basis.range = legendre->half_range;
    functions = legendre->c.size();
  } else if (const auto* fourier = std::get_if<Fourier>(&curve.shape)) {
    basis.kind = SeriesBasis::Kind::Harmonics;
    basis.range = fourier->period;
    functions = 2 * fourier->a.size();
  } else {
    return std::nullopt;
  }
  if (functions > SeriesBasis::max_functions) return std::nullopt;
  basis.functions = int(functions);
  return basis;
}

int add(const Curve& curve, SeriesGroup& group) {
  const std::vector<double> coefficients = series_coefficients(curve);
  // Coefficients are stored function by function, in rows of `SeriesGroup::max_series`, so that
  // each basis value multiplies a contiguous row (SIMD).
  group.basis.functions = std::max(group.basis.functions, int(coefficients.size()));
  group.coefficients.resize(std::size_t(group.basis.functions * SeriesGroup::max_series), 0.0);
  for (std::size_t k = 0; k < coefficients.size(); ++k)
    group.coefficients[k * SeriesGroup::max_series + std::size_t(group.count)] = coefficients[k];
  return group.count++;
}

SeriesGroup::Sums sums(const SeriesGroup& group, const CurveState& state) {
  const SeriesBasis& basis = group.basis;
  const double q = basis.argument == Argument::Command ? state.command : state.carriage;
  const double* c = group.coefficients.data();
  const double* const end = c + group.coefficients.size();
  constexpr std::size_t max_series = SeriesGroup::max_series;
  SeriesGroup::Sums sum{};
  if (basis.kind == SeriesBasis::Kind::Legendre) {
    LegendreRecurrence recurrence{(q - basis.centre) / basis.range};
    while (c != end) {
      for (std::size_t i = 0; i < max_series; ++i) sum[i] += c[i] * recurrence.P;
      if ((c += max_series) != end) recurrence.next();
    }
  } else {
    HarmonicRecurrence recurrence(2.0 * std::numbers::pi * (q / basis.range));
    while (c != end) {
      for (std::size_t i = 0; i < max_series; ++i)
        sum[i] += c[i] * recurrence.c + c[max_series + i] * recurrence.s;
      if ((c += 2 * max_series) != end) recurrence.next();
    }
  }
  return sum;
}

double factor(const Curve& curve) { return curve.negate ? -curve.scale : curve.scale; }

}  // namespace abbe::errors
