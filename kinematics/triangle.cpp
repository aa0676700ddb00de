#include "kinematics/triangle.h"

#include <utility>

#include <Eigen/QR>

namespace abbe {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// The decomposition that gives its parts away.
struct Parts : Eigen::HouseholderQR<MatrixXd> {
  explicit Parts(const MatrixXd& A) : HouseholderQR(A) {}
  Reflected taken() && { return {std::move(m_qr), std::move(m_hCoeffs)}; }
};

Eigen::HouseholderSequence<MatrixXd, VectorXd> Q(const Reflected& A) {
  return {A.packed, A.factor};
}

}  // namespace

Reflected reflected(const MatrixXd& A) { return Parts(A).taken(); }

MatrixXd triangle(const Reflected& A) {
  return A.packed.topRows(A.packed.cols()).triangularView<Eigen::Upper>();
}

VectorXd reflect(const Reflected& A, const VectorXd& b) {
  VectorXd result = b;
  result.applyOnTheLeft(Q(A).adjoint());
  return result;
}

VectorXd solve(const Reflected& A, const VectorXd& b) {
  const Index n = A.packed.cols();
  VectorXd along = reflect(A, b);
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

}  // namespace abbe
