#include "kinematics/decompositions.h"

#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

namespace abbe {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Eigen's decomposition keeps its factors protected; this class moves them out.
struct Parts : Eigen::HouseholderQR<MatrixXd> {
  explicit Parts(const MatrixXd& A) : HouseholderQR(A) {}
  HouseholderQr taken() && { return {std::move(m_qr), std::move(m_hCoeffs)}; }
};

// Eigen stores the reflections by columns below the diagonal; the sequence applies them unformed.
Eigen::HouseholderSequence<MatrixXd, VectorXd> Q(const HouseholderQr& A) {
  return {A.packed, A.factor};
}

}  // namespace

HouseholderQr factor_by_householder(const MatrixXd& A) { return Parts(A).taken(); }

MatrixXd triangle(const HouseholderQr& A) {
  return A.packed.topRows(A.packed.cols()).triangularView<Eigen::Upper>();
}

VectorXd apply_reflections(const HouseholderQr& A, const VectorXd& b) {
  VectorXd result = b;
  result.applyOnTheLeft(Q(A).adjoint());
  return result;
}

VectorXd solve(const HouseholderQr& A, const VectorXd& b) {
  const Index n = A.packed.cols();
  VectorXd along = apply_reflections(A, b);
  A.packed.topLeftCorner(n, n).triangularView<Eigen::Upper>().solveInPlace(along.topRows(n));
  return along.topRows(n);
}

MatrixXd solve_upper(const MatrixXd& R, const MatrixXd& B) {
  return R.triangularView<Eigen::Upper>().solve(B);
}

MatrixXd solve_upper_transposed(const MatrixXd& R, const MatrixXd& B) {
  return R.transpose().triangularView<Eigen::Lower>().solve(B);
}

MatrixXd solve_lower(const MatrixXd& L, const MatrixXd& B) {
  return L.triangularView<Eigen::Lower>().solve(B);
}

Eigenvectors eigenvectors(const MatrixXd& A) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(A);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

VectorXd eigenvalues(const MatrixXd& A) {
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(A, Eigen::EigenvaluesOnly).eigenvalues();
}

Cholesky cholesky(const MatrixXd& A) {
  const Eigen::LLT<MatrixXd> root(A);
  return {root.matrixL(), root.info() == Eigen::Success};
}

VectorXd solve_positive(const MatrixXd& A, const VectorXd& b) { return A.llt().solve(b); }

VectorXd solve_semidefinite(const MatrixXd& A, const VectorXd& b) { return A.ldlt().solve(b); }

MatrixXd solve_semidefinite(const MatrixXd& A, const MatrixXd& b) { return A.ldlt().solve(b); }

SingularValues singular_values(const Eigen::MatrixXd& A, unsigned vectors) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(A, vectors);
  SingularValues result{svd.singularValues(), {}, {}};
  if (svd.computeU()) result.U = svd.matrixU();
  if (svd.computeV()) result.V = svd.matrixV();
  return result;
}

PrincipalAxes principal_axes(const MatrixXd& rows) {
  const SingularValues svd = singular_values(rows, Eigen::ComputeFullV);
  PrincipalAxes result{Eigen::Vector3d::Zero(), svd.V};
  result.size.head(svd.values.size()) = svd.values;
  return result;
}

namespace {

template <typename Unknowns>
LeastSquares<Unknowns> solve_by_pivots(const MatrixXd& A, const Unknowns& b,
                                       const std::optional<double>& threshold) {
  Eigen::ColPivHouseholderQR<MatrixXd> qr(A);
  if (threshold) qr.setThreshold(*threshold);
  return {qr.solve(b), qr.rank()};
}

}  // namespace

LeastSquares<VectorXd> least_squares(const MatrixXd& A, const VectorXd& b,
                                     std::optional<double> threshold) {
  return solve_by_pivots(A, b, threshold);
}

LeastSquares<MatrixXd> least_squares(const MatrixXd& A, const MatrixXd& b,
                                     std::optional<double> threshold) {
  return solve_by_pivots(A, b, threshold);
}

// Uses pivoted QR: Eigen's divide-and-conquer SVD has returned a singular value of 4e-7 where the
// exact one is 5e-16, which would hide a null direction.
MatrixXd null_space(const MatrixXd& A, double threshold) {
  const Index n = A.cols();
  Eigen::ColPivHouseholderQR<MatrixXd> qr(A);
  qr.setThreshold(threshold);
  const Index rank = qr.rank();
  const Index d = n - rank;
  if (d == 0) return MatrixXd(n, 0);
  MatrixXd along(n, d);
  // With A P = [R1 R2], the columns [-R1^-1 R2; I] span the null space; they are then
  // orthonormalised.
  along.bottomRows(d).setIdentity();
  along.topRows(rank) = -qr.matrixR()
                             .topLeftCorner(rank, rank)
                             .triangularView<Eigen::Upper>()
                             .solve(qr.matrixR().topRightCorner(rank, d));
  const Eigen::HouseholderQR<MatrixXd> unit(qr.colsPermutation() * along);
  return unit.householderQ() * MatrixXd::Identity(n, d);
}

MatrixXd full_pivot_inverse(const MatrixXd& A) { return A.fullPivLu().inverse(); }

VectorXd shortest_least_squares(const MatrixXd& A, const VectorXd& b,
                                std::optional<double> threshold) {
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> parts;
  if (threshold) parts.setThreshold(*threshold);
  return parts.compute(A).solve(b);
}

MatrixXd pseudo_inverse(const MatrixXd& A) {
  return A.completeOrthogonalDecomposition().pseudoInverse();
}

}  // namespace abbe
