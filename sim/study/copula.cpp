#include "sim/study/copula.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

#include "kinematics/symmetric.h"
#include "kinematics/triangle.h"

namespace abbe::sim::study {
namespace {

constexpr double of_rounding = 1e-8;  // eigenvalues: of a matrix printed with some nine digits
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

/// Inputs that correlate, directly or through others; alone ones are left out.
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

/// Lower triangular, times its transpose the correlation: eigenvectors first, as they take any
/// rank, then turned into a triangle, as its first input should not depend on other coordinates.
Eigen::MatrixXd factor_of(const Eigen::MatrixXd& correlation) {
  const Eigenvectors eigen = eigenvectors(correlation);
  const double least = eigen.values(0);
  if (least < -of_rounding)
    refuse("no numbers can be correlated so: the least eigenvalue of the correlation matrix is " +
           short_text(least) + ", expected none below 0 (all correlations times " +
           short_text(std::floor(1e3 / (1.0 - least)) / 1e3) + " would do)");
  const double rank_limit = double(correlation.rows()) * std::numeric_limits<double>::epsilon() *
                            eigen.values(correlation.rows() - 1);
  const Eigen::VectorXd lengths =
      (eigen.values.array() > rank_limit).select(eigen.values.array().sqrt(), 0.0);
  Eigen::MatrixXd factor =
      triangle(reflected((eigen.vectors * lengths.asDiagonal()).transpose())).transpose();
  for (Eigen::Index i = 0; i < factor.cols(); ++i)
    if (factor(i, i) < 0.0) factor.col(i) *= -1.0;
  return factor.rowwise().normalized();  // what truncation took, so that every score has variance 1
}

/// One row of inputs at a time and no matrix product, as the bits of a product may depend on how
/// many cases there are.
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

std::vector<bool> in_groups(const Copula& copula) {
  std::vector<bool> result(std::size_t(copula.inputs()), false);
  for (const Copula::Group& group : copula.groups())
    for (const int input : group.of) result[std::size_t(input)] = true;
  return result;
}

/// (inputs x cases) from what becomes of an input's coordinates, and of its correlated scores.
template <typename OfCoordinates, typename OfScores>
Eigen::MatrixXd drawn(const Copula& copula, const Eigen::MatrixXd& u, OfCoordinates of_coordinates,
                      OfScores of_scores) {
  if (u.rows() != copula.inputs())
    refuse("points have " + std::to_string(u.rows()) + " coordinates and the copula " +
           std::to_string(copula.inputs()) + " inputs");
  Eigen::MatrixXd result(u.rows(), u.cols());
  const std::vector<bool> grouped = in_groups(copula);
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

Correlated correlated(const Eigen::MatrixXd& covariance) {
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
      [](int, const Numbers& correlated) { return correlated; });
}

Eigen::MatrixXd values(const Copula& copula, std::span<const Distribution> marginals,
                       const Eigen::MatrixXd& u) {
  if (marginals.size() != std::size_t(copula.inputs()))
    refuse("a distribution is needed for every input of the copula");
  const auto of = [&](int input) { return marginals[std::size_t(input)]; };
  using Numbers = Eigen::VectorXd;
  return drawn(
      copula, u, [&](int input, const Numbers& p) { return quantiles(of(input), p); },
      [&](int input, const Numbers& scores) { return at_scores(of(input), scores); });
}

}  // namespace abbe::sim::study
