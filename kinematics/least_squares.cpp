#include "kinematics/least_squares.h"

#include <Eigen/LU>
#include <Eigen/QR>

namespace abbe {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

template <typename Unknowns, typename Matrix, typename Right>
LeastSquares<Unknowns> by_pivots(const Matrix& A, const Right& b,
                                 const std::optional<double>& threshold) {
  Eigen::ColPivHouseholderQR<Matrix> qr(A);
  if (threshold) qr.setThreshold(*threshold);
  return {qr.solve(b), qr.rank()};
}

}  // namespace

LeastSquares<VectorXd> least_squares(const MatrixXd& A, const VectorXd& b,
                                     std::optional<double> threshold) {
  return by_pivots<VectorXd>(A, b, threshold);
}

LeastSquares<MatrixXd> least_squares(const MatrixXd& A, const MatrixXd& b,
                                     std::optional<double> threshold) {
  return by_pivots<MatrixXd>(A, b, threshold);
}

LeastSquares<Eigen::Vector3d> least_squares(const Eigen::MatrixX3d& A, const VectorXd& b,
                                            std::optional<double> threshold) {
  return by_pivots<Eigen::Vector3d>(A, b, threshold);
}

LeastSquares<Eigen::Vector2d> least_squares(const Eigen::MatrixX2d& A, const VectorXd& b,
                                            std::optional<double> threshold) {
  return by_pivots<Eigen::Vector2d>(A, b, threshold);
}

// By pivoted triangularisation: the packaged divide-and-conquer SVD has shown a singular value of
// 4e-7 where it is 5e-16.
MatrixXd null_space(const MatrixXd& A, double threshold) {
  const Index n = A.cols();
  Eigen::ColPivHouseholderQR<MatrixXd> qr(A);
  qr.setThreshold(threshold);
  const Index rank = qr.rank();
  const Index d = n - rank;
  if (d == 0) return MatrixXd(n, 0);
  MatrixXd along(n, d);
  along.bottomRows(d).setIdentity();
  along.topRows(rank) = -qr.matrixR()
                             .topLeftCorner(rank, rank)
                             .triangularView<Eigen::Upper>()
                             .solve(qr.matrixR().topRightCorner(rank, d));
  const Eigen::HouseholderQR<MatrixXd> unit(qr.colsPermutation() * along);
  return unit.householderQ() * MatrixXd::Identity(n, d);
}

MatrixXd inverted(const MatrixXd& A) { return A.fullPivLu().inverse(); }

}  // namespace abbe
