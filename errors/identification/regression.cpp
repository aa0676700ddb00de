#include "errors/identification/regression.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <Eigen/QR>
#include <Eigen/SVD>

#include "kinematics/bad_input.h"
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

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
// Extended precision costs little at these sizes and preserves the digits that ill-conditioned
// polynomials lose.
using Real = long double;
using RealMatrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
using RealVector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

void validate(const MatrixXd& A, const VectorXd& y) {
  require(A.rows() == y.size(), "design matrix and readings differ in their number of rows");
  require(A.allFinite() && y.allFinite(), "a regression needs finite numbers");
}

/// Returns the square roots of the weights.
RealVector row_scale(const VectorXd& weight, Index n) {
  if (weight.size() == 0) return RealVector::Ones(n);
  require(weight.size() == n, "weights and readings differ in number");
  require(weight.allFinite() && (weight.array() >= 0).all(), "a weight is negative or not finite");
  return weight.cast<Real>().cwiseSqrt();
}

/// Design matrix [1 A] in extended precision. Each row is multiplied by the root of its weight,
/// each column scaled to a length near 1 by a power of two, which is exact.
struct ExtendedDesign {
  RealMatrix scaled;
  RealVector unit;  ///< divisor of each column
};

/// Returns the weighted and scaled design matrix.
ExtendedDesign make_design(const MatrixXd& A, bool constant, const RealVector& row) {
  const Index q = A.cols() + (constant ? 1 : 0);
  ExtendedDesign design{RealMatrix(A.rows(), q), RealVector::Ones(q)};
  if (constant) design.scaled.col(0).setOnes();
  design.scaled.rightCols(A.cols()) = A.cast<Real>();
  design.scaled = row.asDiagonal() * design.scaled;
  for (Index j = 0; j < q; ++j) {
    const Real length = design.scaled.col(j).norm();
    if (length > 0) design.unit(j) = std::exp2(std::round(std::log2(length)));
    design.scaled.col(j) /= design.unit(j);
  }
  return design;
}

using Qr = Eigen::ColPivHouseholderQR<RealMatrix>;

/// Returns the leading half of the mantissa (Veltkamp splitting).
Real leading_half(Real a) {
  const Real c = 4294967297.0L * a;  // 2^32 + 1
  return c - (c - a);
}

/// Compensated sum of products (Dekker, Knuth): `correction` collects the rounding of every step.
struct TwofoldSum {
  Real sum = 0, correction = 0;
  void add(Real a, Real b) {
    const Real product = a * b;
    // Split products: a fused multiply-add of long double is emulated in software, and slow.
    const Real a1 = leading_half(a), b1 = leading_half(b), a2 = a - a1, b2 = b - b1;
    const Real product_error = ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2;
    const Real new_sum = sum + product;
    const Real added = new_sum - sum;
    correction += product_error + ((sum - (new_sum - added)) + (product - added));
    sum = new_sum;
  }
};

/// Returns b corrected by one refinement step, with the gradient of the normal equations in
/// compensated summation: plain QR has an error of condition^2 times the residual, which matters
/// for a poor fit.
RealVector refine(const ExtendedDesign& design, const RealVector& y, const Qr& qr,
                  const RealVector& b) {
  const Index n = design.scaled.rows(), q = design.scaled.cols();
  std::vector<TwofoldSum> gradient(static_cast<std::size_t>(q));
  for (Index i = 0; i < n; ++i) {
    TwofoldSum residual;
    residual.add(y(i), 1);
    for (Index j = 0; j < q; ++j) residual.add(-design.scaled(i, j), b(j));
    for (Index j = 0; j < q; ++j) {
      gradient[static_cast<std::size_t>(j)].add(design.scaled(i, j), residual.sum);
      gradient[static_cast<std::size_t>(j)].add(design.scaled(i, j), residual.correction);
    }
  }
  RealVector g(q);
  for (Index j = 0; j < q; ++j)
    g(j) = gradient[static_cast<std::size_t>(j)].sum +
           gradient[static_cast<std::size_t>(j)].correction;
  const auto R = qr.matrixQR().topRows(q).triangularView<Eigen::Upper>();
  const RealVector forward_solution = R.transpose().solve(qr.colsPermutation().transpose() * g);
  return b + qr.colsPermutation() * R.solve(forward_solution);
}

/// Returns the columns beyond `rank` as combinations of those before.
std::vector<Dependence> confounded(const Qr& qr, const ExtendedDesign& design, Index rank,
                                   bool constant) {
  const Index q = design.scaled.cols();
  const auto& order = qr.colsPermutation().indices();
  const RealMatrix R = qr.matrixR().topRows(std::min(q, design.scaled.rows()));
  const RealMatrix combination = R.topLeftCorner(rank, rank)
                                     .template triangularView<Eigen::Upper>()
                                     .solve(R.topRightCorner(rank, q - rank));
  const int shift = constant ? 1 : 0;
  std::vector<Dependence> result;
  for (Index k = 0; k < q - rank; ++k) {
    const Index column = order(rank + k);
    Dependence dependence{static_cast<int>(column) - shift, {}, {}};
    for (Index i = 0; i < rank; ++i) {
      // 1e-9: smaller factors are rounding and would only obscure the dependence.
      if (std::abs(combination(i, k)) < 1e-9L) continue;
      dependence.with.push_back(static_cast<int>(order(i)) - shift);
      dependence.factor.push_back(
          static_cast<double>(combination(i, k) * design.unit(column) / design.unit(order(i))));
    }
    result.push_back(std::move(dependence));
  }
  return result;
}

/// Returns the number of columns of which more than the tolerance remains after projection on those
/// before them; n >= q.
Index numerical_rank(const Qr& qr, double tolerance) {
  const auto& R = qr.matrixQR();
  Index rank = 0;
  while (rank < R.cols() &&
         std::abs(R(rank, rank)) > Real(tolerance) * R.col(rank).head(rank + 1).norm())
    ++rank;
  return rank;
}

/// Returns the inverse of A'A of the scaled design.
RealMatrix inverse_normal_matrix(const Qr& qr, Index q) {
  const RealMatrix R_inverse =
      qr.matrixQR().topRows(q).template triangularView<Eigen::Upper>().solve(
          RealMatrix::Identity(q, q));
  const RealMatrix unpermuted = qr.colsPermutation() * R_inverse;
  return unpermuted * unpermuted.transpose();
}

/// Returns the condition number of the design with columns scaled to length 1.
double scaled_condition(const Qr& qr) {
  const Index q = qr.matrixQR().cols();
  RealMatrix R = qr.matrixQR().topRows(q).template triangularView<Eigen::Upper>();
  R.colwise().normalize();
  const Eigen::JacobiSVD<RealMatrix, Eigen::NoQRPreconditioner> svd(R);  // square
  return static_cast<double>(svd.singularValues()(0) / svd.singularValues()(q - 1));
}

/// Returns the weighted sum of squares about the weighted mean, or about 0 if not `about_mean`.
Real total_squares(const RealVector& y, const RealVector& row, bool about_mean) {
  if (!about_mean) return y.cwiseProduct(row).squaredNorm();
  const RealVector weight = row.cwiseAbs2();
  const Real mean = weight.dot(y) / weight.sum();
  return (y.array() - mean).matrix().cwiseProduct(row).squaredNorm();
}

/// Returns the variance inflation of every column: its diagonal entry of the inverse normal matrix
/// times its sum of squares about the mean (about 0 without a constant).
VectorXd inflation(const MatrixXd& A, const ExtendedDesign& design, const RealMatrix& inverse,
                   const RealVector& row) {
  const Index p = A.cols(), shift = inverse.cols() - p;
  VectorXd vif(p);
  for (Index j = 0; j < p; ++j) {
    vif(j) = static_cast<double>(
        inverse(j + shift, j + shift) *
        total_squares(A.col(j).cast<Real>() / design.unit(j + shift), row, shift == 1));
  }
  return vif;
}

/// Returns the RMS of every row's error as predicted by a fit to all others.
double press_rms(const RealVector& residual, const VectorXd& leverage, const RealVector& row) {
  Real sum = 0;
  Index count = 0;
  for (Index i = 0; i < residual.size(); ++i) {
    if (row(i) == 0) continue;
    // A row of leverage 1 cannot be predicted by the others.
    const Real redundancy = std::max<Real>(1.0L - static_cast<Real>(leverage(i)), 1e-12L);
    sum += (residual(i) / redundancy) * (residual(i) / redundancy);
    ++count;
  }
  return static_cast<double>(std::sqrt(sum / static_cast<Real>(count)));
}

/// Columns scaled to mean 0 and standard deviation 1 (0 for a constant one).
struct StandardisedData {
  MatrixXd Z;
  VectorXd mean, sd;
  VectorXd centred;  ///< y minus its mean
  double y_mean = 0.0;
};

StandardisedData standardise(const MatrixXd& A, const VectorXd& y) {
  validate(A, y);
  require(A.rows() >= 1 && A.cols() >= 1, "a penalised fit needs at least one row and one column");
  const double n = static_cast<double>(A.rows());
  StandardisedData s{A, A.colwise().mean(), VectorXd::Zero(A.cols()), y, y.mean()};
  s.Z.rowwise() -= s.mean.transpose();
  s.centred.array() -= s.y_mean;
  for (Index j = 0; j < A.cols(); ++j) {
    const double sd = std::sqrt(s.Z.col(j).squaredNorm() / n);
    // Below this the column contains only the rounding of its mean.
    if (sd > 1e-13 * std::abs(s.mean(j)) && sd > 0) s.sd(j) = sd;
    s.Z.col(j) *= s.sd(j) > 0 ? 1.0 / s.sd(j) : 0.0;
  }
  return s;
}

/// Returns the fit with its coefficients converted from scaled to original columns.
ShrunkFit in_original_units(const StandardisedData& s, const VectorXd& b) {
  ShrunkFit result;
  result.beta = (s.sd.array() > 0).select(b.array() / s.sd.array(), 0.0);
  result.constant = s.y_mean - s.mean.dot(result.beta);
  return result;
}

/// Returns the largest gradient of any column at zero coefficients.
double largest_gradient(const StandardisedData& s) {
  return (s.Z.transpose() * s.centred).cwiseAbs().maxCoeff() / static_cast<double>(s.Z.rows());
}

/// Returns the largest violation of the optimality conditions (Karush, Kuhn, Tucker) of the LASSO,
/// as defined in the header.
double kkt_violation(const MatrixXd& gram, const VectorXd& moment, const VectorXd& b,
                     double penalty) {
  const VectorXd gradient = moment - gram * b;
  double max_violation = 0;
  for (Index j = 0; j < b.size(); ++j) {
    if (gram(j, j) == 0) continue;
    const double violation = b(j) == 0 ? std::max(std::abs(gradient(j)) - penalty, 0.0)
                                       : std::abs(gradient(j) - std::copysign(penalty, b(j)));
    max_violation = std::max(max_violation, violation);
  }
  return max_violation;
}

}  // namespace

Regression fit_regression(const MatrixXd& A, const VectorXd& y, const RegressionOptions& options) {
  validate(A, y);
  const Index n = A.rows(), q = A.cols() + (options.constant ? 1 : 0);
  require(q >= 1, "a regression needs at least one column or a constant");
  const RealVector row = row_scale(options.weight, n);
  const Index rows = (row.array() > 0).count();
  Regression fit;
  if (rows < q) {
    fit.status = RegressionStatus::TooFewRows;
    return fit;
  }
  const ExtendedDesign design = make_design(A, options.constant, row);
  const Qr qr(design.scaled);
  const Index rank = numerical_rank(qr, options.rank_tolerance);
  if (rank < q) {
    fit.status = RegressionStatus::RankDeficient;
    fit.confounded = confounded(qr, design, rank, options.constant);
    return fit;
  }
  const RealVector weighted = y.cast<Real>().cwiseProduct(row);
  const RealVector b = refine(design, weighted, qr, qr.solve(weighted));
  const RealVector weighted_residual = weighted - design.scaled * b;
  const RealVector coefficient = b.cwiseQuotient(design.unit);
  const Index p = A.cols();
  const RealVector fitted = (A.cast<Real>() * coefficient.tail(p)).array() +
                            (options.constant ? coefficient(0) : Real(0));
  const RealVector residual = y.cast<Real>() - fitted;
  const RealMatrix inverse = inverse_normal_matrix(qr, q);
  const Real squares = weighted_residual.squaredNorm();

  fit.degrees_of_freedom = static_cast<int>(rows - q);
  const Real variance = rows > q ? squares / static_cast<Real>(rows - q) : Real(0);
  const RealVector inverse_unit = design.unit.cwiseInverse();
  fit.covariance = (inverse_unit.asDiagonal() * inverse * inverse_unit.asDiagonal() * variance)
                       .eval()
                       .cast<double>();
  fit.standard_error = fit.covariance.diagonal().cwiseSqrt();
  fit.constant = options.constant ? static_cast<double>(coefficient(0)) : 0.0;
  fit.beta = coefficient.tail(p).cast<double>();
  fit.residual = residual.cast<double>();
  fit.leverage =
      (design.scaled * inverse).cwiseProduct(design.scaled).rowwise().sum().cast<double>();
  fit.residual_sd = static_cast<double>(std::sqrt(variance));
  const Real total_sum = total_squares(y.cast<Real>(), row, options.constant);
  fit.r_squared = total_sum > 0 ? static_cast<double>(1 - squares / total_sum) : 0.0;
  fit.condition = scaled_condition(qr);
  fit.vif = inflation(A, design, inverse, row);
  fit.press_rms = press_rms(residual, fit.leverage, row);
  return fit;
}

std::string describe(const std::vector<Dependence>& confounded,
                     const std::vector<std::string>& names) {
  const auto name = [&](int column) {
    return column < 0 ? std::string("constant") : names.at(static_cast<std::size_t>(column));
  };
  std::string text;
  for (const Dependence& dependence : confounded) {
    text += (text.empty() ? "" : "; ") + name(dependence.column) + " =";
    if (dependence.with.empty()) text += " 0";
    for (std::size_t i = 0; i < dependence.with.size(); ++i)
      text += fmt::format("{} {:.6g} {}", i ? " +" : "", dependence.factor[i],
                          name(dependence.with[i]));
  }
  return text;
}

ShrunkFit fit_ridge(const MatrixXd& A, const VectorXd& y, double penalty) {
  require(std::isfinite(penalty) && penalty > 0, "the ridge penalty must be positive");
  const StandardisedData s = standardise(A, y);
  const double n = static_cast<double>(A.rows());
  MatrixXd normal = s.Z.transpose() * s.Z / n;
  normal.diagonal().array() += penalty;
  return in_original_units(s,
                           solve_semidefinite(normal, VectorXd(s.Z.transpose() * s.centred / n)));
}

ShrunkFit fit_lasso(const MatrixXd& A, const VectorXd& y, double penalty) {
  require(std::isfinite(penalty) && penalty >= 0, "the LASSO penalty must not be negative");
  const StandardisedData s = standardise(A, y);
  const double n = static_cast<double>(A.rows());
  const MatrixXd gram = s.Z.transpose() * s.Z / n;
  const VectorXd moment = s.Z.transpose() * s.centred / n;
  const double max_gradient = largest_gradient(s);
  VectorXd b = VectorXd::Zero(A.cols());
  double max_violation = kkt_violation(gram, moment, b, penalty);
  // The limits of the header: 1e-9 of the largest gradient, at most 20 000 sweeps.
  for (int sweep = 0; sweep < 20000 && max_violation > 1e-9 * max_gradient; ++sweep) {
    for (Index j = 0; j < b.size(); ++j) {
      if (gram(j, j) == 0) continue;
      // Soft thresholding: the minimum over one coefficient with the others fixed.
      const double unpenalised = moment(j) - gram.col(j).dot(b) + gram(j, j) * b(j);
      b(j) =
          std::copysign(std::max(std::abs(unpenalised) - penalty, 0.0), unpenalised) / gram(j, j);
    }
    max_violation = kkt_violation(gram, moment, b, penalty);
  }
  ShrunkFit result = in_original_units(s, b);
  result.converged = max_violation <= 1e-9 * max_gradient;
  return result;
}

double max_penalty(const MatrixXd& A, const VectorXd& y) {
  return largest_gradient(standardise(A, y));
}

}  // namespace abbe::errors::identification
