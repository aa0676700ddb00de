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
// Extended precision costs little at these sizes and preserves the digits that ill-conditioned
// polynomials lose.
using Real = long double;
using RealMatrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
using RealVector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

void validate(const MatrixXd& A, const VectorXd& y) {
  require(A.rows() == y.size(), "design and readings differ in rows");
  require(A.allFinite() && y.allFinite(), "a regression needs finite numbers");
}

/// Returns the square roots of the weights.
RealVector row_scale(const VectorXd& weight, Index n) {
  if (weight.size() == 0) return RealVector::Ones(n);
  require(weight.size() == n, "weights and readings differ in rows");
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
  require(A.rows() >= 1 && A.cols() >= 1, "a shrunk fit needs a row and a column");
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
  require(q >= 1, "a regression needs a column or a constant");
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
  require(std::isfinite(penalty) && penalty > 0, "a ridge penalty is positive");
  const StandardisedData s = standardise(A, y);
  const double n = static_cast<double>(A.rows());
  MatrixXd normal = s.Z.transpose() * s.Z / n;
  normal.diagonal().array() += penalty;
  return in_original_units(s,
                           solve_semidefinite(normal, VectorXd(s.Z.transpose() * s.centred / n)));
}

ShrunkFit fit_lasso(const MatrixXd& A, const VectorXd& y, double penalty) {
  require(std::isfinite(penalty) && penalty >= 0, "a LASSO penalty is not negative");
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
  result.kkt = max_gradient > 0 ? max_violation / max_gradient : 0.0;
  return result;
}

double max_penalty(const MatrixXd& A, const VectorXd& y) {
  return largest_gradient(standardise(A, y));
}

}  // namespace abbe::errors::identification
