#include <Eigen/QR>

#include "kinematics/least_squares.h"

namespace abbe {

using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd shortest_least_squares(const MatrixXd& A, const VectorXd& b,
                                std::optional<double> threshold) {
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> parts;
  if (threshold) parts.setThreshold(*threshold);
  return parts.compute(A).solve(b);
}

MatrixXd pseudo_inverse(const Eigen::Matrix3Xd& A) {
  return A.completeOrthogonalDecomposition().pseudoInverse();
}

}  // namespace abbe
