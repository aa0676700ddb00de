#pragma once

#include <optional>

#include <Eigen/Core>

/// Matrix decompositions and linear equations. They are costly to compile, so they are instantiated
/// in one source for all modules, and for dynamic matrices only.
namespace abbe {

/// QR decomposition by Householder reflections without pivoting, kept factored for many right-hand
/// sides.
struct HouseholderQr {
  Eigen::MatrixXd packed;  ///< (m x n) R on and above the diagonal, the reflections below it
  Eigen::VectorXd factor;  ///< (min(m, n)) scale of each reflection
};
HouseholderQr factor_by_householder(const Eigen::MatrixXd& A);

/// Returns R (n x n), zeros below the diagonal; m >= n.
Eigen::MatrixXd triangle(const HouseholderQr& A);

/// Returns Q' b (m).
Eigen::VectorXd apply_reflections(const HouseholderQr& A, const Eigen::VectorXd& b);

/// Returns the x (n) that minimises |A x - b|, for independent columns; m >= n.
Eigen::VectorXd solve(const HouseholderQr& A, const Eigen::VectorXd& b);

/// Return R^-1 B and R'^-1 B of an upper triangular matrix, L^-1 B of a lower one. The other half
/// is not read.
Eigen::MatrixXd solve_upper(const Eigen::MatrixXd& R, const Eigen::MatrixXd& B);
Eigen::MatrixXd solve_upper_transposed(const Eigen::MatrixXd& R, const Eigen::MatrixXd& B);
Eigen::MatrixXd solve_lower(const Eigen::MatrixXd& L, const Eigen::MatrixXd& B);

// Symmetric matrices, such as normal equations, covariances and stiffnesses. Only the lower half is
// read.

struct Eigenvectors {
  Eigen::VectorXd values;   ///< ascending
  Eigen::MatrixXd vectors;  ///< unit columns, in the order of the values
};
Eigenvectors eigenvectors(const Eigen::MatrixXd& A);

/// Returns the eigenvalues in ascending order.
Eigen::VectorXd eigenvalues(const Eigen::MatrixXd& A);

/// The decomposition A = L L'.
struct Cholesky {
  Eigen::MatrixXd L;              ///< lower triangle, zeros above
  bool positive_definite = true;  ///< if false, L is meaningless
};
Cholesky cholesky(const Eigen::MatrixXd& A);

/// Returns A^-1 b of a positive definite matrix.
Eigen::VectorXd solve_positive(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);

/// Returns A^-1 b of a matrix that may be semidefinite, by a pivoted L D L' decomposition without
/// square roots.
Eigen::VectorXd solve_semidefinite(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);
Eigen::MatrixXd solve_semidefinite(const Eigen::MatrixXd& A, const Eigen::MatrixXd& b);

/// The decomposition A = U diag(values) V', by Jacobi rotations.
struct SingularValues {
  Eigen::VectorXd values;  ///< descending
  Eigen::MatrixXd U, V;    ///< empty if not requested
};

/// @param vectors  Eigen::ComputeThinU, ComputeFullU, ComputeThinV, ComputeFullV or two of them
SingularValues singular_values(const Eigen::MatrixXd& A, unsigned vectors);

/// Principal directions of points or normals (n x 3), by singular values.
struct PrincipalAxes {
  Eigen::Vector3d size;  ///< singular values, descending; 0 beyond the number of rows
  Eigen::Matrix3d axes;  ///< unit columns, in the order of the sizes
};
PrincipalAxes principal_axes(const Eigen::MatrixXd& rows);

// Least squares.

template <typename Unknowns>
struct LeastSquares {
  Unknowns x;
  Eigen::Index rank = 0;  ///< rank of A: number of pivots above the threshold
};

/// Returns the x that minimises |A x - b|, by column-pivoted QR. Of columns that are dependent
/// within rounding, some get the value 0.
/// @param A          (m x n); m < n only if any x that solves every row will do
/// @param b          (m) or (m x k)
/// @param threshold  smallest pivot that counts, relative to the largest; by default of the order
///                   of rounding
LeastSquares<Eigen::VectorXd> least_squares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b,
                                            std::optional<double> threshold = {});
LeastSquares<Eigen::MatrixXd> least_squares(const Eigen::MatrixXd& A, const Eigen::MatrixXd& b,
                                            std::optional<double> threshold = {});

/// Returns the shortest x that minimises |A x - b|, whatever the rank of A; threshold as above.
Eigen::VectorXd shortest_least_squares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b,
                                       std::optional<double> threshold = {});

/// Returns the pseudo-inverse (n x m), which maps b to that shortest x.
Eigen::MatrixXd pseudo_inverse(const Eigen::MatrixXd& A);

/// Returns orthonormal columns N (n x n - rank) with A N = 0; threshold as above.
Eigen::MatrixXd null_space(const Eigen::MatrixXd& A, double threshold);

/// Returns A^-1 by LU with full pivoting.
Eigen::MatrixXd full_pivot_inverse(const Eigen::MatrixXd& A);

}  // namespace abbe
