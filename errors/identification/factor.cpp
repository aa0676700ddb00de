#include "errors/identification/factor.h"

#include <algorithm>
#include <cmath>

#include "kinematics/decompositions.h"

namespace abbe::errors::identification {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Columns that contribute less than this to a unit null vector are not candidates.
constexpr double min_participation = 1e-5;
// Columns that contribute nearly equally are chosen by their order, so that rounding does not
// decide.
constexpr double equal_participation = 0.1;
// Smaller factors are set to 0 in `hidden`, as the header states.
constexpr double min_hiding_factor = 1e-6;

std::vector<int> true_indices(const std::vector<char>& flags) {
  std::vector<int> result;
  for (std::size_t i = 0; i < flags.size(); ++i)
    if (flags[i]) result.push_back(int(i));
  return result;
}

/// Returns the row of the null space N to leave out next: one of the lowest preference among those
/// that contribute, and of these the last one of nearly the largest contribution.
Index next_row_to_leave_out(const MatrixXd& N, const std::vector<int>& preference) {
  const VectorXd participation = N.rowwise().norm();
  std::vector<int> sorted_levels = preference;
  std::sort(sorted_levels.begin(), sorted_levels.end());
  sorted_levels.erase(std::unique(sorted_levels.begin(), sorted_levels.end()), sorted_levels.end());
  for (const int level : sorted_levels) {
    double max_participation = 0.0;
    for (Index i = 0; i < N.rows(); ++i)
      if (preference[std::size_t(i)] == level)
        max_participation = std::max(max_participation, participation[i]);
    if (max_participation < min_participation) continue;
    for (Index i = N.rows() - 1; i >= 0; --i)
      if (preference[std::size_t(i)] == level &&
          participation[i] >= equal_participation * max_participation)
        return i;
  }
  Index largest = 0;  // a unit vector always has a row that is not small
  participation.maxCoeff(&largest);
  return largest;
}

/// Returns the rows of an orthonormal null space N (n x d) to be left out: they determine all other
/// rows of each null vector.
std::vector<Index> rows_to_leave_out(MatrixXd N, const std::vector<int>& preference) {
  std::vector<Index> rows;
  for (Index d = N.cols(); d > 0; --d) {
    const Index i = next_row_to_leave_out(N, preference);
    rows.push_back(i);
    const VectorXd direction = N.row(i).transpose().normalized();
    // Projecting out the chosen row makes the next one belong to another null vector.
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

/// Returns the norms of columns; 1 for a zero column, by which it can be divided.
VectorXd norms(const MatrixXd& A, const std::vector<int>& columns) {
  VectorXd norm(Index(columns.size()));
  for (Index j = 0; j < norm.size(); ++j) {
    const double n = A.col(columns[std::size_t(j)]).norm();
    norm[j] = n > 0.0 ? n : 1.0;
  }
  return norm;
}

/// Returns the largest singular value of B from v -> B'B v, by power iteration.
template <typename Operator>
double max_singular_value(Index n, const Operator& apply) {
  VectorXd v = VectorXd::LinSpaced(n, 1.0, 2.0)
                   .normalized();  // not orthogonal to a symmetric or alternating vector
  double largest = 0.0;
  // 200 iterations and 1e-4: the condition is reported to a few per cent only.
  for (int i = 0; i < 200; ++i) {
    v = apply(v);
    const double eigenvalue = v.norm();
    v /= eigenvalue;
    if (std::abs(eigenvalue - largest) <= 1e-4 * eigenvalue) return std::sqrt(eigenvalue);
    largest = eigenvalue;
  }
  return std::sqrt(largest);
}

/// Returns the condition number of a triangular matrix, to a few per cent.
double condition_number(const MatrixXd& R) {
  if (R.cols() == 0) return 1.0;
  const auto upper = R.triangularView<Eigen::Upper>();
  const double largest = max_singular_value(R.cols(), [&](const VectorXd& v) -> VectorXd {
    return upper.transpose() * VectorXd(upper * v);
  });
  const double inverse_of_smallest =
      max_singular_value(R.cols(), [&](const VectorXd& v) -> VectorXd {
        return upper.solve(VectorXd(upper.transpose().solve(v)));
      });
  return largest * inverse_of_smallest;
}

}  // namespace

Factor factor(const MatrixXd& A, const std::vector<char>& is_sought,
              const std::vector<int>& preference, double tolerance) {
  Factor result;
  result.rows = int(A.rows());
  const std::vector<int> columns = true_indices(is_sought);
  const auto n = Index(columns.size());
  result.hidden = MatrixXd::Zero(A.cols(), 0);
  if (n == 0) return result;
  const VectorXd norm = norms(A, columns);
  result.outer = factor_by_householder(scaled(A, columns, norm));
  const MatrixXd R = triangle(result.outer);
  const MatrixXd N = null_space(R, tolerance);

  std::vector<int> sought_preference;
  for (const int column : columns) sought_preference.push_back(preference[std::size_t(column)]);
  const std::vector<Index> left_out = rows_to_leave_out(N, sought_preference);
  std::vector<Index> determined;
  for (Index j = 0; j < n; ++j)
    if (!std::binary_search(left_out.begin(), left_out.end(), j)) determined.push_back(j);
  for (const Index j : left_out) result.left_out.push_back(columns[std::size_t(j)]);
  for (const Index j : determined) result.determined.push_back(columns[std::size_t(j)]);
  result.norm = norm(determined);
  result.inner = factor_by_householder(R(Eigen::all, determined));
  result.condition = condition_number(triangle(result.inner));
  result.hidden = MatrixXd::Zero(A.cols(), N.cols());
  if (left_out.empty()) return result;
  const MatrixXd N_left = N(left_out, Eigen::all);
  const MatrixXd null_vectors = N * full_pivot_inverse(N_left);  // each with a unit of one
                                                                 // column left out
  for (Index k = 0; k < N.cols(); ++k)
    for (const Index j : determined)
      if (std::abs(null_vectors(j, k)) > min_hiding_factor)
        result.hidden(columns[std::size_t(j)], k) =
            -null_vectors(j, k) * norm[left_out[std::size_t(k)]] / norm[j];
  return result;
}

VectorXd solve(const Factor& factor, const VectorXd& b) {
  if (factor.determined.empty()) return VectorXd();
  VectorXd padded = VectorXd::Zero(factor.outer.packed.rows());
  padded.head(b.size()) = b;
  const VectorXd reduced = apply_reflections(factor.outer, padded).head(factor.outer.packed.cols());
  return abbe::solve(factor.inner, reduced).cwiseQuotient(factor.norm);
}

MatrixXd covariance(const Factor& factor) {
  const auto n = Index(factor.determined.size());
  if (n == 0) return MatrixXd(0, 0);
  const MatrixXd root = solve_upper(triangle(factor.inner), MatrixXd::Identity(n, n));
  const VectorXd inverse = factor.norm.cwiseInverse();
  return inverse.asDiagonal() * (root * root.transpose()) * inverse.asDiagonal();
}

VectorXd leverage(const Factor& factor, const MatrixXd& A) {
  if (factor.determined.empty()) return VectorXd::Zero(A.rows());
  const MatrixXd rows = scaled(A, factor.determined, factor.norm).topRows(A.rows());
  const MatrixXd reduced = solve_upper_transposed(triangle(factor.inner), rows.transpose());
  return reduced.colwise().squaredNorm();
}

}  // namespace abbe::errors::identification
