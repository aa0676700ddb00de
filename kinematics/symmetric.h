#pragma once

#include <Eigen/Core>

/// Symmetric matrices, such as normal equations, covariances and stiffnesses; of each only the
/// lower half is read.
namespace abbe {

struct Eigenvectors {
  Eigen::VectorXd values;   ///< least first
  Eigen::MatrixXd vectors;  ///< a unit column for each
};
Eigenvectors eigenvectors(const Eigen::MatrixXd& A);

/// Least first.
Eigen::VectorXd eigenvalues(const Eigen::MatrixXd& A);

/// A = L L'.
struct Cholesky {
  Eigen::MatrixXd L;              ///< lower triangle, zeros above
  bool positive_definite = true;  ///< else L is worth nothing
};
Cholesky cholesky(const Eigen::MatrixXd& A);

/// A^-1 b of a positive definite matrix.
Eigen::VectorXd solve_positive(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);

/// A^-1 b of a matrix that may be semidefinite, by its roots without square roots and with pivots.
Eigen::VectorXd solve_semidefinite(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);
Eigen::MatrixXd solve_semidefinite(const Eigen::MatrixXd& A, const Eigen::MatrixXd& b);

}  // namespace abbe
