#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

namespace abbe::errors {

/// State of one axis on which a curve may depend.
struct CurveState {
  double command = 0.0;   ///< mm or rad, commanded position of the axis
  double carriage = 0.0;  ///< mm or rad, travel of the carriage itself: -command on a primed axis
  int direction = 0;      ///< of the command: +1 up, -1 down, 0 before the first motion
  int stroke = 0;         ///< number of reversals so far
  bool primed = false;    ///< the carriage moves opposite to the command
};

// Shapes. Every shape holds plain numbers, mm or rad, and q is its argument; "up" is the direction
// in which q grows. Polynomial, Legendre and Fourier extend beyond their range; only a table ends.

/// A value that does not depend on q.
struct Constant {
  double value = 0.0;
};
/// Polynomial sum_k c[k] t^k, t = (q - centre) / half_range.
struct Polynomial {
  Eigen::VectorXd c;  ///< (n + 1), in the unit of the value, so that coefficients are comparable
  double centre = 0.0;
  double half_range = 1.0;  ///< > 0
};
/// Series sum_k c[k] P_k(t) of Legendre polynomials, t = (q - centre) / half_range.
struct Legendre {
  Eigen::VectorXd c;  ///< (n + 1)
  double centre = 0.0;
  double half_range = 1.0;  ///< > 0
};
/// Series sum_k a[k] cos(2 pi (k+1) q / period) + b[k] sin(2 pi (k+1) q / period).
struct Fourier {
  Eigen::VectorXd a;    ///< (n)
  Eigen::VectorXd b;    ///< (n)
  double period = 1.0;  ///< mm or rad, > 0: a screw pitch, or 2 pi
};
enum class TableInterpolation {
  Linear,
  Spline
};  ///< between rows: linear, or a natural cubic spline
enum class TableExtrapolation { Refuse, Hold };  ///< beyond the ends: an error, or the last value
struct Table {
  Eigen::VectorXd q;      ///< (n) strictly increasing, n >= 2
  Eigen::VectorXd value;  ///< (n)
  TableInterpolation between = TableInterpolation::Linear;
  TableExtrapolation outside = TableExtrapolation::Refuse;
  Eigen::VectorXd second;  ///< (n) second derivatives of the spline, set by `make_table`
};
/// Reversal error: +half while moving up, -half while moving down, 0 before the first motion. A
/// lagging carriage has half < 0 on the tool side and half > 0 if primed, since "up" refers to the
/// command.
struct Backlash {
  double half = 0.0;
};
/// One table for each direction of approach; before the first motion their mean.
struct DirectionalTables {
  Table up;
  Table down;
};
/// Repeatability: one normal deviate for every stroke (between two reversals), from a seed. It is
/// never part of a belief. Curves with the same seed have the same deviates.
struct Repeatability {
  double sigma = 0.0;  ///< >= 0
  std::uint64_t seed = 0;
};
/// Asynchronous error motion of a spindle over its own angle (q in rad, unwrapped): 32 cosines of
/// equal amplitude and random phase. A seed determines their orders, one in each of 32 equal parts
/// of the range and none near a whole number. Equal at equal angles, never repeating, and never
/// part of a belief. Over n turns the mean square equals rms^2 within the fraction 200 / (n
/// (highest - lowest)).
struct Asynchronous {
  double rms = 0.0;  ///< >= 0
  std::uint64_t seed = 0;
  double lowest_order = 0.3;    ///< per turn, > 0
  double highest_order = 20.0;  ///< > lowest, <= 10000
};
using Shape = std::variant<Constant, Polynomial, Legendre, Fourier, Table, Backlash,
                           DirectionalTables, Repeatability, Asynchronous>;

enum class Argument { Command, Carriage };

/// A named contribution to an error element.
struct Curve {
  Shape shape;
  std::string name = {};  ///< for reports: "screw pitch", "laser run 3"; may be empty
  Argument argument = Argument::Command;
  bool negate = false;  ///< true if the source counted in the opposite direction
  double scale = 1.0;   ///< for what-if studies
};

/// Returns the value at a state, mm or rad.
/// @throws std::out_of_range, naming the position and the range, outside a table with
///         `TableExtrapolation::Refuse`
double value(const Curve& curve, const CurveState& state);

/// Returns the derivative with respect to the commanded position, per mm or rad (of a table at a
/// row: to the right of it; of backlash and repeatability: 0).
double slope(const Curve& curve, const CurveState& state);

/// Checks a curve.
/// @throws std::invalid_argument if a shape violates the conditions stated at its members or holds
///         a number that is not finite
void validate(const Curve& curve);

/// Returns a table, with its spline prepared.
/// @throws std::invalid_argument unless q is strictly increasing and finite with at least 2 rows of
///         finite values
Table make_table(Eigen::VectorXd q, Eigen::VectorXd value,
                 TableInterpolation between = TableInterpolation::Linear,
                 TableExtrapolation outside = TableExtrapolation::Refuse);

/// The straight line that is removed from a table.
enum class Detrend {
  Ends,          ///< line through the first and last row
  LeastSquares,  ///< least-squares line
};
/// A table without its line, and the line; its slope belongs to the squareness.
struct DetrendedTable {
  Table table;
  double slope = 0.0;   ///< per mm or rad of q
  double offset = 0.0;  ///< of the line at q = 0: a constant shift, without meaning
};
DetrendedTable detrend(const Table& table, Detrend how);

/// Returns a bound of the second derivative of harmonics (Fourier and asynchronous) with respect to
/// the argument, per mm^2 or rad^2; 0 for every other shape. If the curve is sampled in steps d,
/// the error of linear interpolation is at most the bound times d^2 / 8.
double second_derivative_bound(const Curve& curve);

/// Returns true if the curve is random. A curve that depends on the direction of approach, such as
/// backlash, is not random: it can be identified.
bool is_random(const Curve& curve);

/// Returns standard normal deviate number `counter` of the stream `seed`: a hash of both, with the
/// same bits on every machine with IEEE arithmetic (only + - * / and square root are used).
double normal_deviate(std::uint64_t seed, std::uint64_t counter);

/// The functions that Legendre or Fourier series of the same argument and range have in common,
/// whatever their coefficients.
struct SeriesBasis {
  enum class Kind {
    Legendre,   ///< P_0, P_1 ...
    Harmonics,  ///< cos, sin, cos of twice the angle ...
  };
  static constexpr int max_functions = 24;

  Kind kind = Kind::Legendre;
  Argument argument = Argument::Command;
  double centre = 0.0;  ///< mm or rad, of Legendre series
  double range = 1.0;   ///< mm or rad: half range, period
  int functions = 0;    ///< number used by the longest series

  /// Returns true if two series use the same functions, whatever their number.
  bool has_same_functions(const SeriesBasis& other) const;
};

/// Returns the basis of a Legendre or Fourier series; empty for another shape or a series of more
/// than max_functions.
std::optional<SeriesBasis> series_basis(const Curve& curve);

/// Series of one basis, evaluated together.
struct SeriesGroup {
  static constexpr int max_series = 8;
  using Sums = std::array<double, max_series>;

  SeriesBasis basis;
  int count = 0;
  std::vector<double> coefficients = {};  ///< (functions x most), function by function
};

/// Adds a curve of the same basis to a group that is not full.
/// @return index of the series in the group
int add(const Curve& curve, SeriesGroup& group);

/// Returns the sum of every series, bit for bit as `value` of its curve with a scale of 1, not
/// negated.
SeriesGroup::Sums sums(const SeriesGroup& group, const CurveState& state);

/// Returns the factor of the shape: the scale, negative if the curve is negated.
double factor(const Curve& curve);

}  // namespace abbe::errors
