#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

namespace abbe::errors {

/// What a curve may depend on, for one axis.
struct CurveState {
  double command = 0.0;   ///< mm or rad, commanded position of the axis
  double carriage = 0.0;  ///< mm or rad, travel of the carriage itself: -command on a primed axis
  int direction = 0;      ///< +1 up, -1 down, of the command; 0 not moved yet
  int stroke = 0;         ///< reversals so far
  bool primed = false;    ///< the carriage moves against the command
};

// Every shape holds plain numbers, mm or rad. The argument is q. "Up" is the way in which q grows.
// Polynomial, Legendre and Fourier hold beyond their range too; only a table knows where it ends.

struct Constant {
  double value = 0.0;
};
/// sum_k c[k] t^k, t = (q - centre) / half_range
struct Polynomial {
  Eigen::VectorXd c;  ///< (n + 1), unit of the value, so coefficients compare
  double centre = 0.0;
  double half_range = 1.0;  ///< > 0
};
/// sum_k c[k] P_k(t), t = (q - centre) / half_range; P_k the Legendre polynomials
struct Legendre {
  Eigen::VectorXd c;  ///< (n + 1)
  double centre = 0.0;
  double half_range = 1.0;  ///< > 0
};
/// sum_k a[k] cos(2 pi (k+1) q / period) + b[k] sin(2 pi (k+1) q / period)
struct Fourier {
  Eigen::VectorXd a;    ///< (n)
  Eigen::VectorXd b;    ///< (n)
  double period = 1.0;  ///< mm or rad, > 0: a screw pitch, or 2 pi
};
enum class Between { Linear, Spline };  ///< how a table is read between its rows (natural cubic)
enum class Outside { Refuse, Hold };    ///< what a table says beyond its range
struct Table {
  Eigen::VectorXd q;      ///< (n) strictly increasing, n >= 2
  Eigen::VectorXd value;  ///< (n)
  Between between = Between::Linear;
  Outside outside = Outside::Refuse;
  Eigen::VectorXd second;  ///< (n) second derivatives of the spline, made by `make_table`
};
/// Reversal: +half while moving up, -half while moving down, 0 before the first motion. A carriage
/// that lags has half < 0 on the tool side and, as "up" is the command's, half > 0 if primed.
struct Backlash {
  double half = 0.0;
};
/// One table for each way of approach; before the first motion their mean.
struct DirectionalTables {
  Table up;
  Table down;
};
/// Normal deviate, one for every stroke (between two reversals), from a seed: not known to anyone.
/// Curves of equal seed move together.
struct Repeatability {
  double sigma = 0.0;  ///< >= 0
  std::uint64_t seed = 0;
};
/// Asynchronous error motion of a spindle over its own angle (q in rad, unwrapped): 32 cosines of
/// equal amplitude, their orders drawn from a seed in equal parts of the range and off every whole
/// number, their phases at will. The same at the same angle, never repeating; not known to anyone.
/// Over n turns its mean square is rms^2 to 200 / (n (highest - lowest)) of it.
struct Asynchronous {
  double rms = 0.0;  ///< >= 0
  std::uint64_t seed = 0;
  double lowest_order = 0.3;    ///< per turn, > 0
  double highest_order = 20.0;  ///< > lowest, <= 10000
};
using Shape = std::variant<Constant, Polynomial, Legendre, Fourier, Table, Backlash,
                           DirectionalTables, Repeatability, Asynchronous>;

enum class Argument { Command, Carriage };

/// One named part of an element.
struct Curve {
  Shape shape;
  std::string name = {};  ///< for reports: "screw pitch", "laser run 3"; may be empty
  Argument argument = Argument::Command;
  bool negate = false;  ///< the source counted the other way
  double scale = 1.0;   ///< for what-if studies
};

/// Value at the state; mm or rad.
/// @throws std::out_of_range, naming the position and the range, if a table that refuses is left
double value(const Curve& curve, const CurveState& state);

/// Derivative with respect to the commanded position, per mm or rad (of a table: of the piece to
/// the right of a knot; of backlash and repeatability: 0).
double slope(const Curve& curve, const CurveState& state);

/// @throws std::invalid_argument if a shape breaks what is said beside its fields or holds a number
///         that is not finite
void validate(const Curve& curve);

/// @throws std::invalid_argument unless q is strictly increasing and finite with at least 2 rows of
///         finite values
Table make_table(Eigen::VectorXd q, Eigen::VectorXd value, Between between = Between::Linear,
                 Outside outside = Outside::Refuse);

/// Straight line taken out of a table.
enum class Detrend {
  Ends,          ///< the line through its first and last row
  LeastSquares,  ///< the fitted line
};
/// The table without its line, and that line's slope, which belongs to the squareness.
struct DetrendedTable {
  Table table;
  double slope = 0.0;   ///< per mm or rad of q
  double offset = 0.0;  ///< of the line at q = 0: a shift of the whole, which means nothing
};
DetrendedTable detrend(const Table& table, Detrend how);

/// Bound of the second derivative of harmonics, Fourier and asynchronous, with respect to the
/// argument, per mm^2 or rad^2: sampled in steps d, lines between the samples miss the curve by at
/// most that d^2 / 8. 0 for every other shape.
double max_bend(const Curve& curve);

/// True if the curve depends on chance. One that depends only on the way of approach does not: a
/// backlash can be known.
bool is_random(const Curve& curve);

/// Standard normal deviate number `counter` of the stream `seed`: a hash of both, the same bits on
/// every machine of IEEE arithmetic (only + - * / and square root are used).
double normal_deviate(std::uint64_t seed, std::uint64_t counter);

/// P_0, P_1 ... one after the other, the Legendre polynomials at a place.
struct LegendreRecurrence {
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
struct HarmonicRecurrence {
  explicit HarmonicRecurrence(double angle);

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
  static constexpr int max_functions = 24;

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
