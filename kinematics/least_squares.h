#pragma once

#include <optional>

#include <Eigen/Core>

/// Linear equations in many unknowns. The decompositions behind them are costly to compile, so they
/// stand in one source for all modules.
namespace abbe {

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
Eigen::MatrixXd inverted(const Eigen::MatrixXd& A);

}  // namespace abbe
