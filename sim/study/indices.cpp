#include "sim/study/indices.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include <Eigen/Geometry>

#include "sim/study/sequence.h"

namespace abbe::sim::study {
namespace {

constexpr Eigen::Index least_base_points = 8;
constexpr int draws = 1000;
// Base points taken together: few enough that Eigen never splits the sums of a product, which would
// make bits depend on the size of the processor's caches.
constexpr Eigen::Index row_block = 128;

/// Moments of which every index and its standard error are made: means over base points of
/// numerator n, of q = (a^2 + b^2)/2, of s = (a + b)/2 and of their products, columns in this
/// order. There are two numerators an input: those of the first order, then those of the totals.
struct Terms {
  Eigen::Index numerators = 0;
  Eigen::Index columns() const { return 4 * numerators + 5; }
  Eigen::Index n(Eigen::Index j) const { return j; }
  Eigen::Index nn(Eigen::Index j) const { return numerators + j; }
  Eigen::Index nq(Eigen::Index j) const { return 2 * numerators + j; }
  Eigen::Index ns(Eigen::Index j) const { return 3 * numerators + j; }
  Eigen::Index q() const { return 4 * numerators; }
  Eigen::Index s() const { return q() + 1; }
  Eigen::Index qq() const { return q() + 2; }
  Eigen::Index ss() const { return q() + 3; }
  Eigen::Index qs() const { return q() + 4; }
};

/// @param answers  (k x inputs + 2) less their mean
Eigen::MatrixXd terms_of(const Eigen::MatrixXd& answers) {
  const Eigen::Index inputs = answers.cols() - 2;
  const Terms at{2 * inputs};
  const Eigen::ArrayXd a = answers.col(0);
  const Eigen::ArrayXd b = answers.col(1);
  const Eigen::ArrayXd q = 0.5 * (a.square() + b.square());
  const Eigen::ArrayXd s = 0.5 * (a + b);
  Eigen::MatrixXd terms(answers.rows(), at.columns());
  const auto put = [&](Eigen::Index j, const Eigen::ArrayXd& n) {
    terms.col(at.n(j)) = n;
    terms.col(at.nn(j)) = n.square();
    terms.col(at.nq(j)) = n * q;
    terms.col(at.ns(j)) = n * s;
  };
  for (Eigen::Index i = 0; i < inputs; ++i) {
    const Eigen::ArrayXd change = answers.col(2 + i).array() - a;
    put(i, b * change);
    put(inputs + i, 0.5 * change.square());
  }
  terms.col(at.q()) = q;
  terms.col(at.s()) = s;
  terms.col(at.qq()) = q.square();
  terms.col(at.ss()) = s.square();
  terms.col(at.qs()) = q * s;
  return terms;
}

/// Estimates from means of the terms, and their standard errors by the delta method.
struct Estimates {
  Eigen::ArrayXd value;  ///< (numerators)
  Eigen::ArrayXd error;
};

/// @param weight  number of base points in the means
Estimates estimates(const Eigen::VectorXd& mean, const Terms& at, double weight) {
  const double q = mean(at.q());
  const double s = mean(at.s());
  const double variance = q - s * s;
  // The variance's own part in the error is that of v = q - 2 s(mean) s, around its mean.
  const double vv = (mean(at.qq()) - q * q) - 4.0 * s * (mean(at.qs()) - q * s) +
                    4.0 * s * s * (mean(at.ss()) - s * s);
  Estimates result{Eigen::ArrayXd(at.numerators), Eigen::ArrayXd(at.numerators)};
  for (Eigen::Index j = 0; j < at.numerators; ++j) {
    const double n = mean(at.n(j));
    const double value = n / variance;
    const double nv = (mean(at.nq(j)) - n * q) - 2.0 * s * (mean(at.ns(j)) - n * s);
    const double square = (mean(at.nn(j)) - n * n) - 2.0 * value * nv + value * value * vv;
    result.value(j) = value;
    result.error(j) = std::sqrt(std::max(0.0, square) / (weight - 1.0)) / variance;
  }
  return result;
}

/// Shares of Poisson numbers of mean 1 that are at most 0, 1, ...; none of 2^53 is above the last.
constexpr std::array<double, 18> poisson_shares = [] {
  std::array<double, 18> shares = {0.36787944117144233};
  double share = shares[0];
  for (std::size_t k = 1; k < shares.size(); ++k) shares[k] = shares[k - 1] + (share /= double(k));
  return shares;
}();

/// All shares are counted, as branches that none can foretell take longer.
double poisson_1(double u) {
  double count = 0.0;
  for (const double share : poisson_shares) count += u > share ? 1.0 : 0.0;
  return count;
}

/// Sums of the terms, and of their weights in the last row: every base point once in the first
/// column, then the draws. (columns + 1 x draws + 1)
Eigen::MatrixXd weighted_sums(const Eigen::MatrixXd& answers, std::uint64_t seed) {
  const Terms at{2 * (answers.cols() - 2)};
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(at.columns() + 1, draws + 1);
  for (Eigen::Index first = 0; first < answers.rows(); first += row_block) {
    const Eigen::Index count = std::min(row_block, answers.rows() - first);
    Eigen::MatrixXd weights = Eigen::MatrixXd::Ones(draws + 1, count);
    weights.bottomRows(draws) =
        points({Sampling::Random, draws, seed}, std::uint64_t(first), count).unaryExpr(&poisson_1);
    Eigen::MatrixXd terms(count, at.columns() + 1);
    terms << terms_of(answers.middleRows(first, count)), Eigen::VectorXd::Ones(count);
    sums.noalias() += terms.transpose() * weights.transpose();
  }
  return sums;
}

/// How many standard errors each draw's estimate is from the estimate. (numerators x useful draws)
std::vector<std::vector<double>> studentised(const Eigen::MatrixXd& sums, const Terms& at,
                                             const Estimates& estimate) {
  std::vector<std::vector<double>> result(static_cast<std::size_t>(at.numerators));
  for (Eigen::Index k = 1; k < sums.cols(); ++k) {
    const double weight = sums(at.columns(), k);
    if (weight < 2.0) continue;
    const Estimates drawn = estimates(sums.col(k).head(at.columns()) / weight, at, weight);
    for (Eigen::Index j = 0; j < at.numerators; ++j) {
      const double t = (drawn.value(j) - estimate.value(j)) / drawn.error(j);
      if (std::isfinite(t)) result[std::size_t(j)].push_back(t);  // none: all points were alike
    }
  }
  return result;
}

/// @param t  studentised draws of it
Banded banded(double value, double error, std::vector<double>& t) {
  if (!(error > 0.0) || t.empty()) return {value, value, value};
  const auto rank = [&](double p) {
    const auto at = t.begin() + std::ptrdiff_t(std::lround(p * double(t.size() - 1)));
    std::nth_element(t.begin(), at, t.end());
    return *at;
  };
  const double low = value - rank(0.975) * error;
  const double high = value - rank(0.025) * error;
  // No index is outside 0 .. 1, so cutting the band there loses no truth.
  return {value, std::min(value, std::max(low, 0.0)), std::max(value, std::min(high, 1.0))};
}

/// Rows without a gap.
Eigen::MatrixXd complete(const Eigen::MatrixXd& answers) {
  std::vector<Eigen::Index> rows;
  for (Eigen::Index k = 0; k < answers.rows(); ++k)
    if (answers.row(k).allFinite()) rows.push_back(k);
  if (answers.cols() < 3) throw std::invalid_argument("Sobol indices need columns A, B and inputs");
  if (Eigen::Index(rows.size()) < least_base_points)
    throw std::invalid_argument("Sobol indices need 8 base points with all their answers");
  return answers(rows, Eigen::all);
}

/// Less their mean and of size 1, so that fourth powers of tiny or huge answers are doubles. Sums
/// go one by one, as Eigen's depend on where in memory they begin.
Eigen::MatrixXd standardised(const Eigen::MatrixXd& answers) {
  const auto ab = answers.leftCols(2).array();
  const double middle = 0.5 * ab.minCoeff() + 0.5 * ab.maxCoeff();
  const double reach = 0.5 * ab.maxCoeff() - 0.5 * ab.minCoeff();
  Eigen::MatrixXd result = (answers.array() - middle) / reach;
  const double sum = std::accumulate(result.data(), result.data() + 2 * result.rows(), 0.0);
  result.array() -= sum / double(2 * result.rows());
  return result;
}

/// @param answers  without gaps
std::vector<SobolIndex> indices_of(const Eigen::MatrixXd& answers, std::uint64_t seed) {
  const Eigen::Index inputs = answers.cols() - 2;
  std::vector<SobolIndex> result(static_cast<std::size_t>(inputs));
  if (answers.leftCols(2).maxCoeff() == answers.leftCols(2).minCoeff()) return result;
  const Terms at{2 * inputs};
  const auto count = double(answers.rows());
  const Eigen::MatrixXd sums = weighted_sums(standardised(answers), seed);
  const Estimates estimate = estimates(sums.col(0).head(at.columns()) / count, at, count);
  std::vector<std::vector<double>> t = studentised(sums, at, estimate);
  const auto band = [&](Eigen::Index j) {
    return banded(estimate.value(j), estimate.error(j), t[std::size_t(j)]);
  };
  for (Eigen::Index i = 0; i < inputs; ++i) result[std::size_t(i)] = {band(i), band(inputs + i)};
  return result;
}

}  // namespace

std::vector<SobolIndex> sobol_indices(const Eigen::MatrixXd& answers, std::uint64_t seed) {
  return indices_of(complete(answers), seed);
}

IndexConvergence convergence(const Eigen::MatrixXd& answers, std::uint64_t seed) {
  const Eigen::MatrixXd gapless = complete(answers);
  IndexConvergence result;
  for (Eigen::Index count = gapless.rows(); count >= least_base_points; count /= 2)
    result.base_points.insert(result.base_points.begin(), count);
  for (const Eigen::Index count : result.base_points)
    result.indices.push_back(indices_of(gapless.topRows(count), seed));
  return result;
}

Eigen::VectorXd sobol_column(const Eigen::VectorXd& u, int column) {
  const Eigen::Index inputs = u.size() / 2;
  if (u.size() % 2 != 0 || column < 0 || column >= inputs + 2)
    throw std::invalid_argument("a point of Sobol's design is A, B or A with an input of B");
  if (column == 1) return u.tail(inputs);
  Eigen::VectorXd point = u.head(inputs);
  if (column >= 2) point(column - 2) = u(inputs + column - 2);
  return point;
}

}  // namespace abbe::sim::study
