#include "kinematics/decompositions.h"
#include "tests/test.h"

namespace abbe {
namespace {

MatrixXd drawn(int rows, int columns, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  MatrixXd A(rows, columns);
  for (double& a : A.reshaped()) a = unit(random);
  return A;
}

TEST(LeastSquares, EveryRoadLeadsToTheSameUnknowns) {
  const MatrixXd A = drawn(12, 3, 20241122);
  const VectorXd b = drawn(12, 1, 20241123);
  const MatrixXd normal = A.transpose() * A;
  const VectorXd moment = A.transpose() * b;
  const auto fit = least_squares(A, b);
  EXPECT_EQ(fit.rank, 3);
  EXPECT_LT((A.transpose() * (A * fit.x - b)).norm(), 1e-14);
  EXPECT_LT((least_squares(Eigen::MatrixX3d(A), b).x - fit.x).norm(), 1e-14);
  EXPECT_LT((least_squares(A, MatrixXd(b)).x - fit.x).norm(), 1e-14);
  EXPECT_LT((shortest_least_squares(A, b) - fit.x).norm(), 1e-14);
  EXPECT_LT((solve(factor_by_householder(A), b) - fit.x).norm(), 1e-14);
  EXPECT_LT((solve_positive(normal, moment) - fit.x).norm(), 1e-13);
  EXPECT_LT((solve_semidefinite(normal, moment) - fit.x).norm(), 1e-13);
  EXPECT_LT((full_pivot_inverse(normal) * moment - fit.x).norm(), 1e-13);
  const MatrixXd L = cholesky(normal).L;
  EXPECT_LT((solve_upper(L.transpose(), solve_lower(L, moment)) - fit.x).norm(), 1e-13);
  EXPECT_LT((solve_upper_transposed(L.transpose(), moment) - solve_lower(L, moment)).norm(), 1e-13);
}

TEST(LeastSquares, WhatColumnsShareIsTheNullSpaceAndTheShortestUsesNoneOfIt) {
  MatrixXd A = drawn(9, 4, 20241124);
  A.col(3) = A.col(0) - 2.0 * A.col(1);
  const VectorXd b = drawn(9, 1, 20241125);
  EXPECT_EQ(least_squares(A, b, 1e-9).rank, 3);
  const MatrixXd N = null_space(A, 1e-9);
  ASSERT_EQ(N.cols(), 1);
  const VectorXd by_hand = Eigen::Vector4d(1.0, -2.0, 0.0, -1.0).normalized();
  EXPECT_NEAR(std::abs(N.col(0).dot(by_hand)), 1.0, 1e-14);
  EXPECT_LT(std::abs(N.col(0).dot(shortest_least_squares(A, b, 1e-9))), 1e-14);
  EXPECT_FALSE(cholesky(MatrixXd(-A.transpose() * A)).positive_definite);
}

TEST(SingularValues, AreTheRootsOfTheEigenvaluesOfTheNormalMatrix) {
  const MatrixXd A = drawn(7, 3, 20241126);
  const SingularValues parts = singular_values(A, Eigen::ComputeThinU | Eigen::ComputeThinV);
  EXPECT_LT((parts.U * parts.values.asDiagonal() * parts.V.transpose() - A).norm(), 1e-14);
  const Eigenvectors normal = eigenvectors(A.transpose() * A);
  EXPECT_LT((normal.values.reverse() - parts.values.cwiseAbs2()).norm(), 1e-13);
  EXPECT_LT((eigenvalues(A.transpose() * A) - normal.values).norm(), 1e-13);
  const PrincipalAxes rows = principal_axes(A);
  EXPECT_LT((rows.size - parts.values).norm(), 1e-14);
  EXPECT_NEAR(std::abs(rows.axes.col(2).dot(normal.vectors.col(0))), 1.0, 1e-13);
}

TEST(SingularValues, OfTwoRowsTheThirdIsZero) {
  const PrincipalAxes two = principal_axes(Eigen::MatrixX3d(drawn(2, 3, 20241127)));
  EXPECT_GT(two.size[1], 0.0);
  EXPECT_EQ(two.size[2], 0.0);
}

}  // namespace
}  // namespace abbe
