#pragma once

#include <optional>

#include <Eigen/Core>

/// A matrix turned into a triangle, A = Q R, kept in its parts for many right-hand sides.
namespace abbe {

/// By reflections, without pivots.
struct HouseholderQr {
  Eigen::MatrixXd packed;  ///< (m x n) R on and above the diagonal, the reflections below
  Eigen::VectorXd factor;  ///< (least of m and n) of each reflection
};
HouseholderQr factor_by_householder(const Eigen::MatrixXd& A);

/// R (n x n), zeros below; m >= n.
Eigen::MatrixXd triangle(const HouseholderQr& A);

/// Q' b. (m)
Eigen::VectorXd apply_reflections(const HouseholderQr& A, const Eigen::VectorXd& b);

/// x of least |A x - b| where the columns are independent; m >= n. (n)
Eigen::VectorXd solve(const HouseholderQr& A, const Eigen::VectorXd& b);

/// R^-1 B and R'^-1 B of an upper triangle, L^-1 B of a lower; the other half is not read.
Eigen::MatrixXd solve_upper(const Eigen::MatrixXd& R, const Eigen::MatrixXd& B);
Eigen::MatrixXd solve_upper_transposed(const Eigen::MatrixXd& R, const Eigen::MatrixXd& B);
Eigen::MatrixXd solve_lower(const Eigen::MatrixXd& L, const Eigen::MatrixXd& B);

// Symmetric matrices, such as normal equations, covariances and stiffnesses; of each only the
// lower half is read.

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

/// A = U diag(values) V', by rotations of Jacobi.
struct SingularValues {
  Eigen::VectorXd values;  ///< largest first
  Eigen::MatrixXd U, V;    ///< empty where not asked for
};

/// @param vectors  Eigen::ComputeThinU, ComputeFullU, ComputeThinV, ComputeFullV or two of them
SingularValues singular_values(const Eigen::MatrixXd& A, unsigned vectors);

/// Directions in which points, or normals, spread most and least.
struct PrincipalAxes {
  Eigen::Vector3d size;  ///< largest first; 0 past the number of rows
  Eigen::Matrix3d axes;  ///< a column for each
};
PrincipalAxes principal_axes(const Eigen::MatrixX3d& rows);

// Linear equations in many unknowns. The decompositions behind them are costly to compile, so they
// stand in one source for all modules.

template <typename Unknowns>
struct LeastSquares {
  Unknowns x;
  Eigen::Index rank = 0;  ///< of A, by the pivots above the threshold
};

/// x of least |A x - b|, by reflections with pivots; of columns that depend on others within
/// rounding some are left at 0.
/// @param A          (m x n), m >= n unless only a solution is wanted that meets every row
/// @param b          (m) or (m x k)
/// @param threshold  least pivot that counts, of the largest; else of the order of rounding
LeastSquares<Eigen::VectorXd> least_squares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b,
                                            std::optional<double> threshold = {});
LeastSquares<Eigen::MatrixXd> least_squares(const Eigen::MatrixXd& A, const Eigen::MatrixXd& b,
                                            std::optional<double> threshold = {});
LeastSquares<Eigen::Vector3d> least_squares(const Eigen::MatrixX3d& A, const Eigen::VectorXd& b,
                                            std::optional<double> threshold = {});
LeastSquares<Eigen::Vector2d> least_squares(const Eigen::MatrixX2d& A, const Eigen::VectorXd& b,
                                            std::optional<double> threshold = {});

/// The shortest x of least |A x - b|, whatever the rank of A; the threshold as above.
Eigen::VectorXd shortest_least_squares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b,
                                       std::optional<double> threshold = {});

/// (n x 3), what takes b to that shortest x.
Eigen::MatrixXd pseudo_inverse(const Eigen::Matrix3Xd& A);

/// Orthonormal columns N (n x n - rank) with A N = 0; the threshold as above.
Eigen::MatrixXd null_space(const Eigen::MatrixXd& A, double threshold);

/// A^-1, by pivots from the whole matrix.
Eigen::MatrixXd full_pivot_inverse(const Eigen::MatrixXd& A);

}  // namespace abbe
