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
// Coordinates have 52 bits, so that later points would repeat coordinates.
constexpr std::uint64_t max_points = std::uint64_t(1) << 52;

/// Random bits of one point, dimension by dimension.
class Stream {
 public:
  Stream(std::uint64_t seed, std::uint64_t point) : state_(split_mix::stream(seed, point)) {}
  std::uint64_t next() { return split_mix::mixed(state_ += split_mix::golden); }

 private:
  std::uint64_t state_;
};

/// Returns the middle of one of 2^52 intervals: never 0 or 1, whose quantiles are infinite.
double open_unit_value(std::uint64_t bits) { return (double(bits >> 12) + 0.5) * 0x1p-52; }

void draw_random(const Sequence& sequence, std::uint64_t first, Eigen::MatrixXd& u) {
  for (Eigen::Index k = 0; k < u.cols(); ++k) {
    Stream stream(sequence.seed, first + std::uint64_t(k));
    for (Eigen::Index d = 0; d < u.rows(); ++d) u(d, k) = open_unit_value(stream.next());
  }
}

void draw_sobol(const Sequence& sequence, std::uint64_t first, Eigen::MatrixXd& u) {
  Stream stream(sequence.seed, max_points);  // a point number that no random point has
  std::vector<std::uint64_t> shift(std::size_t(u.rows()));
  for (std::uint64_t& word : shift) word = stream.next();
  boost::random::sobol engine(shift.size());  // Boost's engine skips the origin, so its point 0 is
                                              // number 1
  if (first > 0) engine.seed(first - 1);      // jumps by the bits of the number's Gray code
  for (Eigen::Index k = 0; k < u.cols(); ++k) {
    const bool origin = first == 0 && k == 0;
    for (Eigen::Index d = 0; d < u.rows(); ++d)
      u(d, k) = open_unit_value((origin ? 0 : engine()) ^ shift[std::size_t(d)]);
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

/// Everything is computed in double: the gain of long double is far below the stated bounds, and it
/// takes five times as long.
using Plain = boost::math::policies::policy<boost::math::policies::promote_double<false>>;

constexpr double min_share = 1e-300;     // below it doubles lose digits: the smallest normal one is
                                         // 2.2e-308
constexpr double max_log_spread = 10.0;  // one standard deviation is then a factor of 22 000

/// Probabilities below and above a value. Their sum is 1; both are kept because only the smaller
/// has all its digits.
struct Shares {
  double below = 0.0;
  double above = 1.0;
};

Shares normal_shares(double score) {
  const double x = std::clamp(score / std::numbers::sqrt2, -30.0, 30.0);  // erfc is 0 and 2 beyond
  return {0.5 * boost::math::erfc(-x, Plain()), 0.5 * boost::math::erfc(x, Plain())};
}

double score_of_shares(const Shares& shares) {
  const double tail = std::min(shares.below, shares.above);
  const double score =
      tail > 0.0 ? std::numbers::sqrt2 * boost::math::erfc_inv(2.0 * tail, Plain()) : infinity;
  return shares.below < shares.above ? -score : score;
}

/// Returns the probabilities of the standard distribution of a kind: at a normal score, or at a
/// value of -1 .. 1 for kinds with ends.
Shares shares_at(Shape kind, double z) {
  switch (kind) {
    case Shape::Uniform:
      return {0.5 * (1.0 + z), 0.5 * (1.0 - z)};
    case Shape::Triangular: {
      const double tail = 0.5 * (1.0 - std::abs(z)) * (1.0 - std::abs(z));
      return z < 0.0 ? Shares{tail, 1.0 - tail} : Shares{1.0 - tail, tail};
    }
    default:
      return normal_shares(z);
  }
}

double place_of(Shape kind, const Shares& shares) {
  const double tail = std::min(shares.below, shares.above);
  const double side = shares.below < shares.above ? -1.0 : 1.0;
  switch (kind) {
    case Shape::Uniform:
      return side * (1.0 - 2.0 * tail);
    case Shape::Triangular:
      return side * (1.0 - std::sqrt(2.0 * tail));
    default:
      return score_of_shares(shares);
  }
}

double place_of_value(const Distribution& d, double value) {
  if (d.kind != Shape::LogNormal) return (value - d.centre) / d.spread;
  return value > 0.0 ? std::log(value / d.centre) / d.spread : -infinity;
}

double value_at(const Distribution& d, double z) {
  return d.kind == Shape::LogNormal ? d.centre * std::exp(d.spread * z) : d.centre + d.spread * z;
}

bool ends(Shape kind) { return kind == Shape::Uniform || kind == Shape::Triangular; }

/// The interval that the truncation leaves.
struct Window {
  double low = 0.0;  ///< in the distribution's own unit
  double high = 0.0;
  double from = 0.0;  ///< the same in standard form
  double to = 0.0;
  Shares at_from;
  Shares at_to;
  double share = 0.0;  ///< probability between them
};

Window window_of(const Distribution& d) {
  const double end = ends(d.kind) ? 1.0 : infinity;
  Window w;
  w.from = std::max(place_of_value(d, d.low), -end);
  w.to = std::min(place_of_value(d, d.high), end);
  w.low = std::max(d.low, value_at(d, -end));
  w.high = std::min(d.high, value_at(d, end));
  w.at_from = shares_at(d.kind, w.from);
  w.at_to = shares_at(d.kind, w.to);
  // The smaller tails are subtracted: in the upper half the differences of `below` would lose the
  // digits of a narrow window.
  w.share = w.from > 0.0 ? w.at_from.above - w.at_to.above : w.at_to.below - w.at_from.below;
  return w;
}

double value_in(const Distribution& d, const Window& w, const Shares& within) {
  const Shares shares{w.at_from.below + within.below * w.share,
                      w.at_to.above + within.above * w.share};
  return std::clamp(value_at(d, place_of(d.kind, shares)), w.low, w.high);
}

double sorted_quantile(const Distribution& d, const Window& w, double p) {
  if (p <= 0.0) return w.low;
  if (p >= 1.0) return w.high;
  return value_in(d, w, {p, 1.0 - p});
}

bool is_cut(const Distribution& d) {
  return d.high < infinity || d.low > (d.kind == Shape::LogNormal ? 0.0 : -infinity);
}

/// Returns the logarithm of the density at z over that at z0, the point of maximum density in the
/// window.
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

/// Returns the distance from z0 beyond which the integrand weighs less than e^-60. A log-normal
/// variance multiplies the density by e^(2 s t), which shifts its maximum by `tilt`.
double farthest(double z0, double tilt) {
  const double m = z0 - tilt;
  return std::sqrt(m * m + 120.0) - m;
}

/// Returns the moments by Gauss-Legendre quadrature, because the closed forms lose all digits in
/// narrow windows and far out in a tail. All quantities are relative to the point z0 of maximum
/// density, so nothing cancels.
Moments moments_in(const Distribution& d, const Window& w) {
  const bool logarithm = d.kind == Shape::LogNormal;
  const double z0 = std::clamp(0.0, w.from, w.to);
  const double v0 = value_at(d, z0);
  const auto deviation = [&](double t) {
    return logarithm ? v0 * std::expm1(d.spread * t) : d.spread * t;
  };
  const double first = std::max(w.from - z0, -farthest(-z0, 0.0));
  const double last = std::min(w.to - z0, farthest(z0, logarithm ? 2.0 * d.spread : 0.0));
  const auto integral = [&](const auto& f) {
    // Each factor gets half of the density's logarithm, so that neither overflows.
    const auto weighed = [&](double t) {
      const double half = std::exp(0.5 * log_density(d.kind, z0, z0 + t));
      return f(t, half);
    };
    const auto side = [&](double from, double to) {
      // One panel of 20 nodes per unit of z; far out, where the density falls as e^(-z0 t), shorter
      // ones, so that it falls by less than e^8 in a panel.
      const int panels = 1 + int((to - from) * (1.0 + std::abs(z0) / 8.0));
      double sum = 0.0;
      for (int i = 0; i < panels; ++i)
        sum += boost::math::quadrature::gauss<double, 20>::integrate(
            weighed, from + (to - from) * i / panels, from + (to - from) * (i + 1) / panels);
      return sum;
    };
    // The integral is split at the mode, where the density of the triangle has its kink.
    return (first < 0.0 ? side(first, 0.0) : 0.0) + (last > 0.0 ? side(0.0, last) : 0.0);
  };
  const double all = integral([](double, double half) { return half * half; });
  const double mean =
      integral([&](double t, double half) { return deviation(t) * half * half; }) / all;
  const double variance = integral([&](double t, double half) {
                            const double part = (deviation(t) - mean) * half;
                            return part * part;
                          }) /
                          all;
  return {std::clamp(v0 + mean, w.low, w.high), std::sqrt(variance)};
}

}  // namespace

const char* distribution_error(const Distribution& d) {
  if (!std::isfinite(d.centre)) return "a finite centre";
  if (!(d.spread > 0.0) || !std::isfinite(d.spread)) return "a spread above 0";
  if (d.kind == Shape::LogNormal) {
    if (d.centre <= 0.0) return "a median above 0, as the distribution is log-normal";
    if (d.spread > max_log_spread) return "a spread of the logarithm of at most 10";
  }
  if (!std::isfinite(d.centre - d.spread) || !std::isfinite(d.centre + d.spread))
    return "a centre and a spread of which the sum is finite";
  if (!(d.low < d.high)) return "a low limit below the high one";
  const Window w = window_of(d);
  if (!(w.from < w.to) || !(w.share > min_share))
    return "some share of the distribution between its low and its high limit";
  return nullptr;
}

double normal_score(double p) { return score_of_shares(Shares{p, 1.0 - p}); }

double quantile(const Distribution& d, double p) { return sorted_quantile(d, window_of(d), p); }

double value_at_score(const Distribution& d, double score) {
  if (!ends(d.kind) && !is_cut(d)) return value_at(d, score);
  return value_in(d, window_of(d), normal_shares(score));
}

Eigen::VectorXd quantiles(const Distribution& d, const Eigen::VectorXd& p) {
  const Window w = window_of(d);
  return p.unaryExpr([&](double share) { return sorted_quantile(d, w, share); });
}

Eigen::VectorXd values_at_scores(const Distribution& d, const Eigen::VectorXd& scores) {
  if (!ends(d.kind) && !is_cut(d))
    return scores.unaryExpr([&](double score) { return value_at(d, score); });
  const Window w = window_of(d);
  return scores.unaryExpr([&](double score) { return value_in(d, w, normal_shares(score)); });
}

double cumulative(const Distribution& d, double value) {
  const Window w = window_of(d);
  if (value <= w.low) return 0.0;
  if (value >= w.high) return 1.0;
  const double z = std::clamp(place_of_value(d, value), w.from, w.to);
  const Shares shares = shares_at(d.kind, z);
  const double below =
      w.from > 0.0 ? w.at_from.above - shares.above : shares.below - w.at_from.below;
  return std::clamp(below / w.share, 0.0, 1.0);
}

Moments moments(const Distribution& d) {
  if (is_cut(d) || ends(d.kind)) return moments_in(d, window_of(d));
  if (d.kind == Shape::Normal) return {d.centre, d.spread};
  const double variance = d.spread * d.spread;
  const double mean = d.centre * std::exp(0.5 * variance);
  return {mean, mean * std::sqrt(std::expm1(variance))};
}

namespace {

constexpr double rounding_tolerance =
    1e-8;  // of eigenvalues: a matrix printed with nine digits has rounding errors of this size
constexpr double asymmetry = 1e-9;

[[noreturn]] void refuse(const std::string& why) { throw std::invalid_argument(why); }

std::string short_text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

Eigen::MatrixXd matrix_of(int inputs, std::span<const Correlation> correlations) {
  if (inputs < 0) refuse("a copula of a negative number of inputs");
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Identity(inputs, inputs);
  Eigen::Matrix<bool, -1, -1> named(inputs, inputs);
  named.setConstant(false);
  for (const auto& [a, b, rho] : correlations) {
    if (a < 0 || b < 0 || a >= inputs || b >= inputs || a == b)
      refuse("a correlation is between two different inputs of 0 to " + std::to_string(inputs - 1) +
             ", not " + std::to_string(a) + " and " + std::to_string(b));
    if (!(std::abs(rho) <= 1.0)) refuse("a correlation is within -1 to 1, not " + short_text(rho));
    if (named(a, b))
      refuse("inputs " + std::to_string(a) + " and " + std::to_string(b) +
             " have two correlations");
    named(a, b) = named(b, a) = true;
    matrix(a, b) = matrix(b, a) = rho;
  }
  return matrix;
}

void require_correlation(const Eigen::MatrixXd& matrix) {
  if (matrix.rows() != matrix.cols()) refuse("a correlation matrix is square");
  if (!matrix.allFinite()) refuse("a correlation is not finite");
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    if (std::abs(matrix(i, i) - 1.0) > asymmetry)
      refuse("a correlation matrix has ones on its diagonal, not " + short_text(matrix(i, i)));
    for (Eigen::Index j = 0; j < i; ++j)
      if (std::abs(matrix(i, j) - matrix(j, i)) > asymmetry)
        refuse("a correlation matrix is symmetric");
  }
}

/// Returns groups of inputs that correlate, directly or through others; independent inputs are left
/// out.
std::vector<std::vector<int>> connected(const Eigen::MatrixXd& matrix) {
  const auto n = int(matrix.rows());
  std::vector<std::vector<int>> result;
  std::vector<bool> seen(std::size_t(n), false);
  for (int start = 0; start < n; ++start) {
    if (seen[std::size_t(start)]) continue;
    seen[std::size_t(start)] = true;
    std::vector<int> group = {start};
    for (std::size_t next = 0; next < group.size(); ++next)
      for (int j = 0; j < n; ++j) {
        if (seen[std::size_t(j)] || matrix(group[next], j) == 0.0) continue;
        seen[std::size_t(j)] = true;
        group.push_back(j);
      }
    std::ranges::sort(group);
    if (group.size() > 1) result.push_back(std::move(group));
  }
  return result;
}

/// Returns the lower triangular factor of a correlation matrix. A Cholesky factor needs full rank,
/// eigenvectors do not; the eigenvector factor is then rotated into a triangle, so that the first
/// input of a group depends on its own coordinate only.
Eigen::MatrixXd factor_of(const Eigen::MatrixXd& correlation) {
  const Eigenvectors eigen = eigenvectors(correlation);
  const double least = eigen.values(0);
  // Correlations scaled by 1 / (1 - least) shift the smallest eigenvalue to 0.
  if (least < -rounding_tolerance)
    refuse("no numbers can be correlated so: the least eigenvalue of the correlation matrix is " +
           short_text(least) + ", expected none below 0 (all correlations times " +
           short_text(std::floor(1e3 / (1.0 - least)) / 1e3) + " would do)");
  // Eigenvalues below n eps times the largest are rounding of 0.
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

/// Returns the scores of a group, summed input by input and without a matrix product, because the
/// bits of a product may depend on the number of cases. (cases x members)
Eigen::MatrixXd group_scores(const Copula::Group& group, const Eigen::MatrixXd& u) {
  const auto m = Eigen::Index(group.of.size());
  Eigen::MatrixXd independent(u.cols(), m);
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(u.cols(), m);
  for (Eigen::Index i = 0; i < m; ++i) {
    for (Eigen::Index k = 0; k < u.cols(); ++k)
      independent(k, i) = normal_score(u(group.of[std::size_t(i)], k));
    for (Eigen::Index j = 0; j <= i; ++j) result.col(i) += group.factor(i, j) * independent.col(j);
  }
  return result;  // (cases x members)
}

std::vector<bool> group_membership(const Copula& copula) {
  std::vector<bool> result(std::size_t(copula.inputs()), false);
  for (const Copula::Group& group : copula.groups())
    for (const int input : group.of) result[std::size_t(input)] = true;
  return result;
}

/// Returns values of all inputs (inputs x cases): independent inputs by a function of their
/// coordinates, correlated ones by a function of their scores.
template <typename OfCoordinates, typename OfScores>
Eigen::MatrixXd drawn(const Copula& copula, const Eigen::MatrixXd& u, OfCoordinates of_coordinates,
                      OfScores of_scores) {
  if (u.rows() != copula.inputs())
    refuse("points have " + std::to_string(u.rows()) + " coordinates and the copula " +
           std::to_string(copula.inputs()) + " inputs");
  Eigen::MatrixXd result(u.rows(), u.cols());
  const std::vector<bool> grouped = group_membership(copula);
  for (int i = 0; i < copula.inputs(); ++i)
    if (!grouped[std::size_t(i)]) result.row(i) = of_coordinates(i, u.row(i).transpose());
  for (const Copula::Group& group : copula.groups()) {
    const Eigen::MatrixXd scores = group_scores(group, u);
    for (Eigen::Index i = 0; i < scores.cols(); ++i) {
      const int input = group.of[std::size_t(i)];
      result.row(input) = of_scores(input, scores.col(i));
    }
  }
  return result;
}

}  // namespace

Copula::Copula(const Eigen::MatrixXd& correlation) : inputs_(int(correlation.rows())) {
  require_correlation(correlation);
  for (std::vector<int>& of : connected(correlation)) {
    Eigen::MatrixXd factor = factor_of(correlation(of, of));
    groups_.push_back({std::move(of), std::move(factor)});
  }
}

Copula::Copula(int inputs, std::span<const Correlation> correlations)
    : Copula(matrix_of(inputs, correlations)) {}

CovarianceFactors factor_covariance(const Eigen::MatrixXd& covariance) {
  if (covariance.rows() != covariance.cols()) refuse("a covariance is square");
  if (!covariance.allFinite()) refuse("a covariance is not finite");
  const Eigen::Index m = covariance.rows();
  if (m > 0 && covariance.diagonal().minCoeff() < 0.0)
    refuse("a variance is negative: " + short_text(covariance.diagonal().minCoeff()));
  const Eigen::VectorXd deviation = covariance.diagonal().cwiseSqrt();
  Eigen::MatrixXd correlation = Eigen::MatrixXd::Identity(m, m);
  for (Eigen::Index i = 0; i < m; ++i)
    for (Eigen::Index j = 0; j < m; ++j) {
      if (i == j) continue;
      const double scale = deviation(i) * deviation(j);
      if (scale > 0.0)
        correlation(i, j) = covariance(i, j) / deviation(i) / deviation(j);
      else if (covariance(i, j) != 0.0)
        refuse("what has no variance has a covariance");
    }
  return {deviation, Copula(correlation)};
}

Eigen::MatrixXd scores(const Copula& copula, const Eigen::MatrixXd& u) {
  using Numbers = Eigen::VectorXd;
  return drawn(
      copula, u,
      [](int, const Numbers& p) -> Numbers {
        return p.unaryExpr([](double share) { return normal_score(share); });
      },
      [](int, const Numbers& factor_covariance) { return factor_covariance; });
}

Eigen::MatrixXd values(const Copula& copula, std::span<const Distribution> marginals,
                       const Eigen::MatrixXd& u) {
  if (marginals.size() != std::size_t(copula.inputs()))
    refuse("a distribution is needed for every input of the copula");
  const auto of = [&](int input) { return marginals[std::size_t(input)]; };
  using Numbers = Eigen::VectorXd;
  return drawn(
      copula, u, [&](int input, const Numbers& p) { return quantiles(of(input), p); },
      [&](int input, const Numbers& scores) { return values_at_scores(of(input), scores); });
}

}  // namespace abbe::sim::study
