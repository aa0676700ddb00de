#include "kinematics/symmetric.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace abbe {

using Eigen::MatrixXd;
using Eigen::VectorXd;

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

}  // namespace abbe
