#include "errors/identification/factor.h"

#include <algorithm>
#include <cmath>

#include "kinematics/decompositions.h"

namespace abbe::errors::identification {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double min_participation =
    1e-5;  // of a unit null vector; columns with a smaller part are not candidates
// Columns that take part nearly equally are chosen by their order, not by rounding.
constexpr double equal_participation = 0.1;
// The bound of the header for what is named as hiding a column.
constexpr double hides = 1e-6;

std::vector<int> selected_indices(const std::vector<char>& wanted) {
  std::vector<int> result;
  for (std::size_t i = 0; i < wanted.size(); ++i)
    if (wanted[i]) result.push_back(int(i));
  return result;
}

/// Returns the row of N to leave out next: of the lowest preference that takes part.
Index next_left_out(const MatrixXd& N, const std::vector<int>& preference) {
  const VectorXd part = N.rowwise().norm();
  std::vector<int> levels = preference;
  std::sort(levels.begin(), levels.end());
  levels.erase(std::unique(levels.begin(), levels.end()), levels.end());
  for (const int level : levels) {
    double most = 0.0;
    for (Index i = 0; i < N.rows(); ++i)
      if (preference[std::size_t(i)] == level) most = std::max(most, part[i]);
    if (most < min_participation) continue;
    for (Index i = N.rows() - 1; i >= 0; --i)
      if (preference[std::size_t(i)] == level && part[i] >= equal_participation * most) return i;
  }
  Index largest = 0;  // of unit vectors one row is never small
  part.maxCoeff(&largest);
  return largest;
}

/// Returns rows of an orthonormal null space (n x d) such that they determine the others of each
/// null vector.
std::vector<Index> chosen(MatrixXd N, const std::vector<int>& preference) {
  std::vector<Index> rows;
  for (Index d = N.cols(); d > 0; --d) {
    const Index i = next_left_out(N, preference);
    rows.push_back(i);
    const VectorXd direction = N.row(i).transpose().normalized();
    // The chosen row is projected out, so that the next one belongs to another null vector.
    N -= (N * direction) * direction.transpose();
  }
  std::sort(rows.begin(), rows.end());
  return rows;
}

/// Returns the sought columns with unit norm, padded by zero rows if there are fewer rows than
/// columns.
MatrixXd scaled(const MatrixXd& A, const std::vector<int>& columns, const VectorXd& norm) {
  const auto n = Index(columns.size());
  MatrixXd S = MatrixXd::Zero(std::max(A.rows(), n), n);
  for (Index j = 0; j < n; ++j) S.col(j).head(A.rows()) = A.col(columns[std::size_t(j)]) / norm[j];
  return S;
}

VectorXd norms(const MatrixXd& A, const std::vector<int>& columns) {
  VectorXd norm(Index(columns.size()));
  for (Index j = 0; j < norm.size(); ++j) {
    const double n = A.col(columns[std::size_t(j)]).norm();
    norm[j] = n > 0.0 ? n : 1.0;
  }
  return norm;
}

/// Returns the square root of the largest eigenvalue of a symmetric operator, by power iteration.
template <typename Operator>
double root_of_max(Index n, const Operator& apply) {
  VectorXd v = VectorXd::LinSpaced(n, 1.0, 2.0).normalized();  // aligned with no symmetry
  double largest = 0.0;
  // 200 iterations and 1e-4: the condition is reported to a few per cent only.
  for (int i = 0; i < 200; ++i) {
    v = apply(v);
    const double now = v.norm();
    v /= now;
    if (std::abs(now - largest) <= 1e-4 * now) return std::sqrt(now);
    largest = now;
  }
  return std::sqrt(largest);
}

/// Returns the condition number, to a few per cent.
double condition_of(const MatrixXd& R) {
  if (R.cols() == 0) return 1.0;
  const auto upper = R.triangularView<Eigen::Upper>();
  const double most = root_of_max(R.cols(), [&](const VectorXd& v) -> VectorXd {
    return upper.transpose() * VectorXd(upper * v);
  });
  const double least = root_of_max(R.cols(), [&](const VectorXd& v) -> VectorXd {
    return upper.solve(VectorXd(upper.transpose().solve(v)));
  });
  return most * least;
}

}  // namespace

Factor factor(const MatrixXd& A, const std::vector<char>& is_sought,
              const std::vector<int>& preference, double tolerance) {
  Factor result;
  result.rows = int(A.rows());
  const std::vector<int> columns = selected_indices(is_sought);
  const auto n = Index(columns.size());
  result.hidden = MatrixXd::Zero(A.cols(), 0);
  if (n == 0) return result;
  const VectorXd norm = norms(A, columns);
  result.outer = factor_by_householder(scaled(A, columns, norm));
  const MatrixXd R = triangle(result.outer);
  const MatrixXd N = null_space(R, tolerance);

  std::vector<int> level;
  for (const int column : columns) level.push_back(preference[std::size_t(column)]);
  const std::vector<Index> left = chosen(N, level);
  std::vector<Index> found;
  for (Index j = 0; j < n; ++j)
    if (!std::binary_search(left.begin(), left.end(), j)) found.push_back(j);
  for (const Index j : left) result.left.push_back(columns[std::size_t(j)]);
  for (const Index j : found) result.found.push_back(columns[std::size_t(j)]);
  result.norm = norm(found);
  result.inner = factor_by_householder(R(Eigen::all, found));
  result.condition = condition_of(triangle(result.inner));
  result.hidden = MatrixXd::Zero(A.cols(), N.cols());
  if (left.empty()) return result;
  const MatrixXd N_left = N(left, Eigen::all);
  const MatrixXd along = N * full_pivot_inverse(N_left);  // null vectors, each with a unit of one
                                                          // left column
  for (Index k = 0; k < N.cols(); ++k)
    for (const Index j : found)
      if (std::abs(along(j, k)) > hides)
        result.hidden(columns[std::size_t(j)], k) =
            -along(j, k) * norm[left[std::size_t(k)]] / norm[j];
  return result;
}

VectorXd solve(const Factor& factor, const VectorXd& b) {
  if (factor.found.empty()) return VectorXd();
  VectorXd all = VectorXd::Zero(factor.outer.packed.rows());
  all.head(b.size()) = b;
  const VectorXd head = apply_reflections(factor.outer, all).head(factor.outer.packed.cols());
  return abbe::solve(factor.inner, head).cwiseQuotient(factor.norm);
}

MatrixXd covariance(const Factor& factor) {
  const auto n = Index(factor.found.size());
  if (n == 0) return MatrixXd(0, 0);
  const MatrixXd root = solve_upper(triangle(factor.inner), MatrixXd::Identity(n, n));
  const VectorXd inverse = factor.norm.cwiseInverse();
  return inverse.asDiagonal() * (root * root.transpose()) * inverse.asDiagonal();
}

VectorXd leverage(const Factor& factor, const MatrixXd& A) {
  if (factor.found.empty()) return VectorXd::Zero(A.rows());
  const MatrixXd rows = scaled(A, factor.found, factor.norm).topRows(A.rows());
  const MatrixXd reduced = solve_upper_transposed(triangle(factor.inner), rows.transpose());
  return reduced.colwise().squaredNorm();
}

}  // namespace abbe::errors::identification
