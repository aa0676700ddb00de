#pragma once

#include <Eigen/Core>

namespace abbe {

/// A = U diag(values) V', by rotations of Jacobi.
struct SingularValues {
  Eigen::VectorXd values;  ///< largest first
  Eigen::MatrixXd U, V;    ///< empty where not asked for
};

/// @param vectors  Eigen::ComputeThinU, ComputeFullU, ComputeThinV, ComputeFullV or two of them
SingularValues singular_values(const Eigen::MatrixXd& A, unsigned vectors);

/// Directions in which points, or normals, spread most and least.
struct Principal {
  Eigen::Vector3d size;  ///< largest first; 0 past the number of rows
  Eigen::Matrix3d axes;  ///< a column for each
};
Principal principal(const Eigen::MatrixX3d& rows);

}  // namespace abbe
