#include "sim/study/sampling.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <boost/math/quadrature/gauss.hpp>
#include <boost/math/special_functions/erf.hpp>
#include <boost/random/sobol.hpp>

#include "kinematics/decompositions.h"
#include "kinematics/hash.h"
#include "kinematics/units.h"

namespace abbe::sim::study {

namespace {

// Boost's table of direction numbers ends at 3667 dimensions.
constexpr int max_dimensions = 3600;
// Coordinates have 52 bits, so the coordinates of later points would be repetitions.
constexpr std::uint64_t max_points = std::uint64_t(1) << 52;

/// Random bits of a point, one number per dimension.
class RandomStream {
 public:
  RandomStream(std::uint64_t seed, std::uint64_t point) : state_(split_mix::stream(seed, point)) {}
  std::uint64_t next() { return split_mix::mixed(state_ += split_mix::golden); }

 private:
  std::uint64_t state_;
};

/// Returns the middle of one of 2^52 intervals. It is never 0 or 1, whose quantiles may be
/// infinite.
double open_unit_value(std::uint64_t bits) { return (double(bits >> 12) + 0.5) * 0x1p-52; }

void draw_random(const Sequence& sequence, std::uint64_t first, Eigen::MatrixXd& u) {
  for (Eigen::Index k = 0; k < u.cols(); ++k) {
    RandomStream stream(sequence.seed, first + std::uint64_t(k));
    for (Eigen::Index d = 0; d < u.rows(); ++d) u(d, k) = open_unit_value(stream.next());
  }
}

void draw_sobol(const Sequence& sequence, std::uint64_t first, Eigen::MatrixXd& u) {
  RandomStream stream(sequence.seed, max_points);  // no random point has this number
  std::vector<std::uint64_t> shift(std::size_t(u.rows()));
  for (std::uint64_t& bits : shift) bits = stream.next();
  // Boost's engine skips the origin, so its point 0 is number 1.
  boost::random::sobol engine(shift.size());
  if (first > 0) engine.seed(first - 1);  // takes time logarithmic in the number
  for (Eigen::Index k = 0; k < u.cols(); ++k) {
    const bool is_origin = first == 0 && k == 0;
    for (Eigen::Index d = 0; d < u.rows(); ++d)
      u(d, k) = open_unit_value((is_origin ? 0 : engine()) ^ shift[std::size_t(d)]);
  }
}

}  // namespace

Eigen::MatrixXd points(const Sequence& sequence, std::uint64_t first, Eigen::Index count) {
  if (sequence.dimensions < 1 || sequence.dimensions > max_dimensions)
    throw std::invalid_argument("points have 1 to " + std::to_string(max_dimensions) +
                                " dimensions, not " + std::to_string(sequence.dimensions));
  if (count < 0 || first > max_points || std::uint64_t(count) > max_points - first)
    throw std::invalid_argument("a sequence has at most 2^52 points");
  Eigen::MatrixXd u(sequence.dimensions, count);
  if (sequence.sampling == Sampling::Random) draw_random(sequence, first, u);
  if (sequence.sampling == Sampling::Sobol) draw_sobol(sequence, first, u);
  return u;
}

namespace {

using Shape = Distribution::Kind;

/// Everything is computed in double: long double takes five times as long, and its gain is far
/// below the stated bounds.
using DoublePolicy = boost::math::policies::policy<boost::math::policies::promote_double<false>>;

// Below 2.2e-308, the smallest normal number, doubles lose digits.
constexpr double min_probability = 1e-300;
constexpr double max_log_spread = 10.0;  // one standard deviation is then a factor of 22 000

/// Probabilities below and above a value, whose sum is 1. Both are stored because only the smaller
/// one has all its digits.
struct Probabilities {
  double below = 0.0;
  double above = 1.0;
};

/// Returns the probabilities of the standard normal distribution.
Probabilities normal_probabilities(double score) {
  // erfc is 0 above 30 and 2 below -30.
  const double x = std::clamp(score / std::numbers::sqrt2, -30.0, 30.0);
  return {0.5 * boost::math::erfc(-x, DoublePolicy()), 0.5 * boost::math::erfc(x, DoublePolicy())};
}

/// Returns the standard normal score with these probabilities.
double score_at(const Probabilities& p) {
  const double tail = std::min(p.below, p.above);
  const double score = tail > 0.0
                           ? std::numbers::sqrt2 * boost::math::erfc_inv(2.0 * tail, DoublePolicy())
                           : infinity;
  return p.below < p.above ? -score : score;
}

/// Returns the probabilities of the standard distribution of a kind.
/// @param z  score or, for a bounded kind, -1 .. 1
Probabilities probabilities_at(Shape kind, double z) {
  switch (kind) {
    case Shape::Uniform:
      return {0.5 * (1.0 + z), 0.5 * (1.0 - z)};
    case Shape::Triangular: {
      const double tail = 0.5 * (1.0 - std::abs(z)) * (1.0 - std::abs(z));
      return z < 0.0 ? Probabilities{tail, 1.0 - tail} : Probabilities{1.0 - tail, tail};
    }
    default:
      return normal_probabilities(z);
  }
}

/// Returns the value of the standard distribution of a kind with these probabilities.
double standard_value_at(Shape kind, const Probabilities& p) {
  const double tail = std::min(p.below, p.above);
  const double sign = p.below < p.above ? -1.0 : 1.0;
  switch (kind) {
    case Shape::Uniform:
      return sign * (1.0 - 2.0 * tail);
    case Shape::Triangular:
      return sign * (1.0 - std::sqrt(2.0 * tail));
    default:
      return score_at(p);
  }
}

/// Converts a value to that of the standard distribution.
double standardised(const Distribution& d, double value) {
  if (d.kind != Shape::LogNormal) return (value - d.centre) / d.spread;
  return value > 0.0 ? std::log(value / d.centre) / d.spread : -infinity;
}

/// Converts a value of the standard distribution to that of a distribution.
double value_at(const Distribution& d, double z) {
  return d.kind == Shape::LogNormal ? d.centre * std::exp(d.spread * z) : d.centre + d.spread * z;
}

bool is_bounded(Shape kind) { return kind == Shape::Uniform || kind == Shape::Triangular; }

/// The interval between the truncation limits.
struct Window {
  double low = 0.0;  ///< in the unit of the distribution
  double high = 0.0;
  double from = 0.0;  ///< low end for the standard distribution
  double to = 0.0;    ///< high end for the standard distribution
  Probabilities at_from;
  Probabilities at_to;
  double probability = 0.0;  ///< of the interval
};

/// Returns the interval to which a distribution is truncated.
Window truncation_window(const Distribution& d) {
  const double end = is_bounded(d.kind) ? 1.0 : infinity;
  Window w;
  w.from = std::max(standardised(d, d.low), -end);
  w.to = std::min(standardised(d, d.high), end);
  w.low = std::max(d.low, value_at(d, -end));
  w.high = std::min(d.high, value_at(d, end));
  w.at_from = probabilities_at(d.kind, w.from);
  w.at_to = probabilities_at(d.kind, w.to);
  // In the upper half the probabilities above are subtracted, since the difference of those below
  // would lose the digits of a narrow window.
  w.probability = w.from > 0.0 ? w.at_from.above - w.at_to.above : w.at_to.below - w.at_from.below;
  return w;
}

/// Returns the value of the truncated distribution.
/// @param within  probabilities below and above it, of the truncated distribution
double truncated_value(const Distribution& d, const Window& w, const Probabilities& within) {
  const Probabilities p{w.at_from.below + within.below * w.probability,
                        w.at_to.above + within.above * w.probability};
  return std::clamp(value_at(d, standard_value_at(d.kind, p)), w.low, w.high);
}

/// Returns the quantile p of a truncated distribution.
double truncated_quantile(const Distribution& d, const Window& w, double p) {
  if (p <= 0.0) return w.low;
  if (p >= 1.0) return w.high;
  return truncated_value(d, w, {p, 1.0 - p});
}

bool is_truncated(const Distribution& d) {
  return d.high < infinity || d.low > (d.kind == Shape::LogNormal ? 0.0 : -infinity);
}

/// Returns the logarithm of the density at z relative to that at z0, the point of maximum density
/// in the window.
double log_density(Shape kind, double z0, double z) {
  switch (kind) {
    case Shape::Uniform:
      return 0.0;
    case Shape::Triangular:
      return std::log((1.0 - std::abs(z)) / (1.0 - std::abs(z0)));
    default:
      return -0.5 * (z - z0) * (z + z0);
  }
}

/// Returns the distance from z0 beyond which the relative integrand is less than e^-60. For the
/// variance of a log-normal distribution the density is multiplied by e^(2 s t), which shifts its
/// maximum by `tilt`.
double integration_limit(double z0, double tilt) {
  const double m = z0 - tilt;
  return std::sqrt(m * m + 120.0) - m;
}

/// Returns the moments by Gauss-Legendre quadrature, because the closed forms lose all digits in
/// narrow windows and far out in a tail. All quantities are relative to the point z0 of maximum
/// density, so that there is no cancellation.
Moments truncated_moments(const Distribution& d, const Window& w) {
  const bool is_log_normal = d.kind == Shape::LogNormal;
  const double z0 = std::clamp(0.0, w.from, w.to);
  const double v0 = value_at(d, z0);
  const auto deviation = [&](double t) {
    return is_log_normal ? v0 * std::expm1(d.spread * t) : d.spread * t;
  };
  const double first = std::max(w.from - z0, -integration_limit(-z0, 0.0));
  const double last =
      std::min(w.to - z0, integration_limit(z0, is_log_normal ? 2.0 * d.spread : 0.0));
  const auto integral = [&](const auto& f) {
    // f multiplies each of its two factors by the root of the density, so that neither overflows.
    const auto weighted = [&](double t) {
      const double root_density = std::exp(0.5 * log_density(d.kind, z0, z0 + t));
      return f(t, root_density);
    };
    const auto side_integral = [&](double from, double to) {
      // There is one panel of 20 nodes per unit of z. Far out, where the density falls as e^(-z0
      // t), panels are shorter, so that it falls by less than e^8 in each.
      const int panels = 1 + int((to - from) * (1.0 + std::abs(z0) / 8.0));
      double sum = 0.0;
      for (int i = 0; i < panels; ++i)
        sum += boost::math::quadrature::gauss<double, 20>::integrate(
            weighted, from + (to - from) * i / panels, from + (to - from) * (i + 1) / panels);
      return sum;
    };
    // The integral is split at the mode, where the density of the triangle has its kink.
    return (first < 0.0 ? side_integral(first, 0.0) : 0.0) +
           (last > 0.0 ? side_integral(0.0, last) : 0.0);
  };
  const double total = integral([](double, double root) { return root * root; });
  const double mean =
      integral([&](double t, double root) { return deviation(t) * root * root; }) / total;
  const double variance = integral([&](double t, double root) {
                            const double weighted_deviation = (deviation(t) - mean) * root;
                            return weighted_deviation * weighted_deviation;
                          }) /
                          total;
  return {std::clamp(v0 + mean, w.low, w.high), std::sqrt(variance)};
}

}  // namespace

const char* distribution_error(const Distribution& d) {
  if (!std::isfinite(d.centre)) return "a finite centre";
  if (!(d.spread > 0.0) || !std::isfinite(d.spread)) return "a spread above 0";
  if (d.kind == Shape::LogNormal) {
    if (d.centre <= 0.0) return "a median above 0 for a log-normal distribution";
    if (d.spread > max_log_spread) return "a spread of at most 10 for the logarithm";
  }
  if (!std::isfinite(d.centre - d.spread) || !std::isfinite(d.centre + d.spread))
    return "a centre and a spread with a finite sum";
  if (!(d.low < d.high)) return "a low limit below the high limit";
  const Window w = truncation_window(d);
  if (!(w.from < w.to) || !(w.probability > min_probability))
    return "low and high limits that contain part of the distribution";
  return nullptr;
}

double normal_score(double p) { return score_at(Probabilities{p, 1.0 - p}); }

double quantile(const Distribution& d, double p) {
  return truncated_quantile(d, truncation_window(d), p);
}

double value_at_score(const Distribution& d, double score) {
  if (!is_bounded(d.kind) && !is_truncated(d)) return value_at(d, score);
  return truncated_value(d, truncation_window(d), normal_probabilities(score));
}

Eigen::VectorXd quantiles(const Distribution& d, const Eigen::VectorXd& p) {
  const Window w = truncation_window(d);
  return p.unaryExpr([&](double probability) { return truncated_quantile(d, w, probability); });
}

Eigen::VectorXd values_at_scores(const Distribution& d, const Eigen::VectorXd& scores) {
  if (!is_bounded(d.kind) && !is_truncated(d))
    return scores.unaryExpr([&](double score) { return value_at(d, score); });
  const Window w = truncation_window(d);
  return scores.unaryExpr(
      [&](double score) { return truncated_value(d, w, normal_probabilities(score)); });
}

double cumulative(const Distribution& d, double value) {
  const Window w = truncation_window(d);
  if (value <= w.low) return 0.0;
  if (value >= w.high) return 1.0;
  const double z = std::clamp(standardised(d, value), w.from, w.to);
  const Probabilities p = probabilities_at(d.kind, z);
  const double below = w.from > 0.0 ? w.at_from.above - p.above : p.below - w.at_from.below;
  return std::clamp(below / w.probability, 0.0, 1.0);
}

Moments moments(const Distribution& d) {
  if (is_truncated(d) || is_bounded(d.kind)) return truncated_moments(d, truncation_window(d));
  if (d.kind == Shape::Normal) return {d.centre, d.spread};
  const double variance = d.spread * d.spread;
  const double mean = d.centre * std::exp(0.5 * variance);
  return {mean, mean * std::sqrt(std::expm1(variance))};
}

namespace {

// Eigenvalues of a matrix that was printed with nine digits have rounding errors of this size.
constexpr double rounding_tolerance = 1e-8;
constexpr double symmetry_tolerance = 1e-9;

[[noreturn]] void throw_invalid(const std::string& message) {
  throw std::invalid_argument(message);
}

std::string short_text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

/// Returns the correlation matrix of pairs of inputs. Throws std::invalid_argument for an invalid
/// pair.
Eigen::MatrixXd correlation_matrix(int inputs, std::span<const Correlation> correlations) {
  if (inputs < 0) throw_invalid("a copula of a negative number of inputs");
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Identity(inputs, inputs);
  Eigen::Matrix<bool, -1, -1> is_listed(inputs, inputs);
  is_listed.setConstant(false);
  for (const auto& [a, b, rho] : correlations) {
    if (a < 0 || b < 0 || a >= inputs || b >= inputs || a == b)
      throw_invalid("a correlation must be between two different inputs from 0 to " +
                    std::to_string(inputs - 1) + ", not " + std::to_string(a) + " and " +
                    std::to_string(b));
    if (!(std::abs(rho) <= 1.0))
      throw_invalid("a correlation must be from -1 to 1, not " + short_text(rho));
    if (is_listed(a, b))
      throw_invalid("inputs " + std::to_string(a) + " and " + std::to_string(b) +
                    " have two correlations");
    is_listed(a, b) = is_listed(b, a) = true;
    matrix(a, b) = matrix(b, a) = rho;
  }
  return matrix;
}

/// Throws std::invalid_argument if the matrix is not symmetric with ones on its diagonal.
void require_correlation(const Eigen::MatrixXd& matrix) {
  if (matrix.rows() != matrix.cols()) throw_invalid("a correlation matrix must be square");
  if (!matrix.allFinite()) throw_invalid("a correlation is not finite");
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    if (std::abs(matrix(i, i) - 1.0) > symmetry_tolerance)
      throw_invalid("a correlation matrix must have ones on its diagonal, not " +
                    short_text(matrix(i, i)));
    for (Eigen::Index j = 0; j < i; ++j)
      if (std::abs(matrix(i, j) - matrix(j, i)) > symmetry_tolerance)
        throw_invalid("a correlation matrix must be symmetric");
  }
}

/// Returns the groups of inputs that are correlated, directly or through others; independent inputs
/// are left out.
std::vector<std::vector<int>> correlated_groups(const Eigen::MatrixXd& matrix) {
  const auto n = int(matrix.rows());
  std::vector<std::vector<int>> result;
  std::vector<bool> visited(std::size_t(n), false);
  for (int start = 0; start < n; ++start) {
    if (visited[std::size_t(start)]) continue;
    visited[std::size_t(start)] = true;
    std::vector<int> group = {start};
    for (std::size_t member = 0; member < group.size(); ++member)
      for (int j = 0; j < n; ++j) {
        if (visited[std::size_t(j)] || matrix(group[member], j) == 0.0) continue;
        visited[std::size_t(j)] = true;
        group.push_back(j);
      }
    std::ranges::sort(group);
    if (group.size() > 1) result.push_back(std::move(group));
  }
  return result;
}

/// Returns the lower triangular factor of a correlation matrix. It is computed from eigenvectors,
/// because a Cholesky decomposition needs full rank. Their factor is rotated into a triangle, so
/// that the first input of a group depends on its own coordinate only.
Eigen::MatrixXd triangular_factor(const Eigen::MatrixXd& correlation) {
  const Eigenvectors eigen = eigenvectors(correlation);
  const double smallest = eigen.values(0);
  // Multiplied by 1 / (1 - smallest), the correlations have a smallest eigenvalue of 0.
  if (smallest < -rounding_tolerance)
    throw_invalid(
        "these correlations are impossible: the smallest eigenvalue of the correlation matrix is " +
        short_text(smallest) + ", expected at least 0 (multiplying all correlations by " +
        short_text(std::floor(1e3 / (1.0 - smallest)) / 1e3) + " would suffice)");
  // Eigenvalues below n eps times the largest one are rounding of 0.
  const double rank_limit = double(correlation.rows()) * std::numeric_limits<double>::epsilon() *
                            eigen.values(correlation.rows() - 1);
  const Eigen::VectorXd lengths =
      (eigen.values.array() > rank_limit).select(eigen.values.array().sqrt(), 0.0);
  Eigen::MatrixXd factor =
      triangle(factor_by_householder((eigen.vectors * lengths.asDiagonal()).transpose()))
          .transpose();
  for (Eigen::Index i = 0; i < factor.cols(); ++i)
    if (factor(i, i) < 0.0) factor.col(i) *= -1.0;
  return factor.rowwise().normalized();  // restores variance 1 of every score after the truncation
}

/// Returns the scores of a group. They are summed input by input, because the bits of a matrix
/// product may depend on the number of cases. (cases x members)
Eigen::MatrixXd group_scores(const Copula::Group& group, const Eigen::MatrixXd& u) {
  const auto m = Eigen::Index(group.of.size());
  Eigen::MatrixXd independent(u.cols(), m);
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(u.cols(), m);
  for (Eigen::Index i = 0; i < m; ++i) {
    for (Eigen::Index k = 0; k < u.cols(); ++k)
      independent(k, i) = normal_score(u(group.of[std::size_t(i)], k));
    for (Eigen::Index j = 0; j <= i; ++j) result.col(i) += group.factor(i, j) * independent.col(j);
  }
  return result;
}

/// Returns true for each input that is in a group.
std::vector<bool> group_membership(const Copula& copula) {
  std::vector<bool> result(std::size_t(copula.inputs()), false);
  for (const Copula::Group& group : copula.groups())
    for (const int input : group.of) result[std::size_t(input)] = true;
  return result;
}

/// Draws all inputs (inputs x cases), independent ones by a function of their coordinates,
/// correlated ones by a function of their scores.
template <typename CoordinateFunction, typename ScoreFunction>
Eigen::MatrixXd draw_inputs(const Copula& copula, const Eigen::MatrixXd& u,
                            CoordinateFunction from_coordinates, ScoreFunction from_scores) {
  if (u.rows() != copula.inputs())
    throw_invalid("points have " + std::to_string(u.rows()) + " coordinates and the copula " +
                  std::to_string(copula.inputs()) + " inputs");
  Eigen::MatrixXd result(u.rows(), u.cols());
  const std::vector<bool> is_correlated = group_membership(copula);
  for (int i = 0; i < copula.inputs(); ++i)
    if (!is_correlated[std::size_t(i)]) result.row(i) = from_coordinates(i, u.row(i).transpose());
  for (const Copula::Group& group : copula.groups()) {
    const Eigen::MatrixXd scores = group_scores(group, u);
    for (Eigen::Index i = 0; i < scores.cols(); ++i) {
      const int input = group.of[std::size_t(i)];
      result.row(input) = from_scores(input, scores.col(i));
    }
  }
  return result;
}

}  // namespace

Copula::Copula(const Eigen::MatrixXd& correlation) : inputs_(int(correlation.rows())) {
  require_correlation(correlation);
  for (std::vector<int>& group : correlated_groups(correlation)) {
    Eigen::MatrixXd factor = triangular_factor(correlation(group, group));
    groups_.push_back({std::move(group), std::move(factor)});
  }
}

Copula::Copula(int inputs, std::span<const Correlation> correlations)
    : Copula(correlation_matrix(inputs, correlations)) {}

Eigen::MatrixXd scores(const Copula& copula, const Eigen::MatrixXd& u) {
  using Numbers = Eigen::VectorXd;
  return draw_inputs(
      copula, u,
      [](int, const Numbers& p) -> Numbers {
        return p.unaryExpr([](double probability) { return normal_score(probability); });
      },
      [](int, const Numbers& scores) { return scores; });
}

Eigen::MatrixXd values(const Copula& copula, std::span<const Distribution> marginals,
                       const Eigen::MatrixXd& u) {
  if (marginals.size() != std::size_t(copula.inputs()))
    throw_invalid("every input of the copula needs a distribution");
  const auto marginal = [&](int input) { return marginals[std::size_t(input)]; };
  using Numbers = Eigen::VectorXd;
  return draw_inputs(
      copula, u, [&](int input, const Numbers& p) { return quantiles(marginal(input), p); },
      [&](int input, const Numbers& scores) { return values_at_scores(marginal(input), scores); });
}

}  // namespace abbe::sim::study
