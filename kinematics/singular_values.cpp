#include "kinematics/singular_values.h"

#include <Eigen/SVD>

namespace abbe {

SingularValues singular_values(const Eigen::MatrixXd& A, unsigned vectors) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(A, vectors);
  SingularValues result{svd.singularValues(), {}, {}};
  if (svd.computeU()) result.U = svd.matrixU();
  if (svd.computeV()) result.V = svd.matrixV();
  return result;
}

Principal principal(const Eigen::MatrixX3d& rows) {
  const Eigen::JacobiSVD<Eigen::MatrixX3d> svd(rows, Eigen::ComputeFullV);
  Principal result{Eigen::Vector3d::Zero(), svd.matrixV()};
  result.size.head(svd.singularValues().size()) = svd.singularValues();
  return result;
}

}  // namespace abbe
