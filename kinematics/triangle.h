#pragma once

#include <Eigen/Core>

/// A matrix turned into a triangle, A = Q R, kept in its parts for many right-hand sides.
namespace abbe {

/// By reflections, without pivots.
struct Reflected {
  Eigen::MatrixXd packed;  ///< (m x n) R on and above the diagonal, the reflections below
  Eigen::VectorXd factor;  ///< (least of m and n) of each reflection
};
Reflected reflected(const Eigen::MatrixXd& A);

/// R (n x n), zeros below; m >= n.
Eigen::MatrixXd triangle(const Reflected& A);

/// Q' b. (m)
Eigen::VectorXd reflect(const Reflected& A, const Eigen::VectorXd& b);

/// x of least |A x - b| where the columns are independent; m >= n. (n)
Eigen::VectorXd solve(const Reflected& A, const Eigen::VectorXd& b);

/// R^-1 B and R'^-1 B of an upper triangle, L^-1 B of a lower; the other half is not read.
Eigen::MatrixXd solve_upper(const Eigen::MatrixXd& R, const Eigen::MatrixXd& B);
Eigen::MatrixXd solve_upper_transposed(const Eigen::MatrixXd& R, const Eigen::MatrixXd& B);
Eigen::MatrixXd solve_lower(const Eigen::MatrixXd& L, const Eigen::MatrixXd& B);

}  // namespace abbe
