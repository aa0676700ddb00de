#include "kinematics/pose.h"

#include <cmath>
#include <iostream>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "kinematics/units.h"

namespace abbe::kinematics {
namespace {

using Eigen::Vector3d;
using Matrix3l = Eigen::Matrix<long double, 3, 3>;

// Rodrigues' formula in long double, the reference for `rotation`. It is itself good to 1e-18 times
// the angle.
Matrix3l long_rotation(const Vector3d& v) {
  const Eigen::Matrix<long double, 3, 1> w = v.cast<long double>();
  const long double angle = w.norm();
  if (angle == 0.0L) return Matrix3l::Identity();
  Matrix3l K;
  K << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
  const long double half = std::sin(angle / 2) / (angle / 2);
  return Matrix3l::Identity() + std::sin(angle) / angle * K + half * half / 2 * (K * K);
}

std::vector<Vector3d> awkward_axes() {
  std::vector<Vector3d> axes;
  for (const double a : {-1.0, 0.0, 1.0})
    for (const double b : {-1.0, 0.0, 1.0})
      for (const double c : {-1.0, 0.0, 1.0})
        if (a != 0 || b != 0 || c != 0) axes.push_back(Vector3d(a, b, c).normalized());
  axes.push_back(Vector3d(1, 1e-9, 0).normalized());
  axes.push_back(Vector3d(1e-9, 1e-13, -1).normalized());
  return axes;
}

std::vector<double> awkward_angles() {
  return {0.0,  1e-300,     1e-160,    1e-20,     1e-12,     1e-9,
          1e-6, 1e-3,       0.1,       1.0,       0.5 * pi,  0.5 * pi + 1e-12,
          2.0,  2 * pi / 3, pi - 1e-3, pi - 1e-6, pi - 1e-8, pi - 1e-12};
}

TEST(Rotation, EqualsRodriguesFormulaInLongDouble) {
  double worst = 0;
  for (const Vector3d& axis : awkward_axes())
    for (double angle : awkward_angles())
      worst = std::max(
          worst, double((rotation(axis * angle).cast<long double>() - long_rotation(axis * angle))
                            .cwiseAbs()
                            .maxCoeff()));
  std::cout << "largest error of an element up to half a turn: " << worst << "\n";
  EXPECT_LE(worst, 5e-16);

  double worst_far = 0;  // per radian of angle
  for (const Vector3d& axis : awkward_axes())
    for (double angle : {pi, 4.0, 2 * pi, 10.0, 100.0, 1e4, 1e6})
      worst_far =
          std::max(worst_far,
                   double((rotation(axis * angle).cast<long double>() - long_rotation(axis * angle))
                              .cwiseAbs()
                              .maxCoeff()) /
                       (1.0 + angle));
  std::cout << "beyond, per radian of angle: " << worst_far << "\n";
  EXPECT_LE(worst_far, 2e-16);
}

TEST(Rotation, IsTheIdentityToTheBitForNoTurn) {
  EXPECT_EQ(rotation(Vector3d::Zero()), Eigen::Matrix3d::Identity());
}

TEST(RotationVector, UndoesRotationUpToAHalfTurn) {
  double worst = 0;
  for (const Vector3d& axis : awkward_axes())
    for (double angle : awkward_angles()) {
      const Vector3d v = axis * angle;
      const double error = (rotation_vector(rotation(v)) - v).norm();
      ASSERT_LE(error, 2e-15) << v.transpose() << " angle " << angle;
      worst = std::max(worst, error);
    }
  const unsigned seed = 20250301;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int i = 0; i < 100000; ++i) {
    Vector3d v(unit(random), unit(random), unit(random));
    v *= std::pow(10.0, -6.0 * std::abs(unit(random))) * pi / std::max(1.0, v.norm()) * 0.999999999;
    const double error = (rotation_vector(rotation(v)) - v).norm();
    ASSERT_LE(error, 2e-15) << v.transpose();
    worst = std::max(worst, error);
  }
  std::cout << "largest error of the round trip: " << worst << " rad\n";
}

TEST(RotationVector, FindsTheAxisOfAHalfTurnUpToItsSign) {
  for (const Vector3d& axis : awkward_axes()) {
    const Vector3d v = rotation_vector(2.0 * axis * axis.transpose() - Eigen::Matrix3d::Identity());
    EXPECT_NEAR(v.norm(), pi, 1e-15);
    EXPECT_LE(std::min((v - pi * axis).norm(), (v + pi * axis).norm()), 2e-15) << axis.transpose();
  }
}

TEST(Motion, LeavesItsPointWhereTheTranslationPutsIt) {
  Deviation D;
  D << 1.0, -2.0, 3.0, 0.1, -0.2, 0.3;
  const Vector3d point(100, -50, 25);
  EXPECT_LT((motion(D, point) * point - (point + Vector3d(1, -2, 3))).norm(), 1e-13);
}

TEST(Motion, OfNothingIsTheIdentityToTheBit) {
  EXPECT_EQ(motion(Deviation::Zero(), Vector3d(0.1, 700.3, -1e3)).matrix(),
            Pose::Identity().matrix());
}

TEST(Motion, FirstOrderIsWithinItsPromise) {
  const unsigned seed = 20240607;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto any = [&](double size) {
    return Vector3d(size * unit(random), size * unit(random), size * unit(random));
  };
  double worst = 0;  // share of the bound that is used, where the bound is well above rounding
  for (int i = 0; i < 10000; ++i) {
    Deviation D;
    D.head<3>() = any(0.05);
    D.tail<3>() = any(1e-3);
    const Vector3d point = any(500);
    const Vector3d place = any(1000);
    const Vector3d lever = place - point;
    const Vector3d shift = D.head<3>();
    const Vector3d angles = D.tail<3>();
    const Vector3d exact = motion(D, point) * place;
    const Vector3d first = place + shift + angles.cross(lever);
    const double bound = 0.5 * angles.squaredNorm() * lever.norm();
    ASSERT_LE((exact - first).norm(), bound + 1e-12);
    if (bound > 1e-6) worst = std::max(worst, (exact - first).norm() / bound);
  }
  std::cout << "largest share of |E|^2 L / 2 that is used: " << worst << "\n";
  EXPECT_GT(worst, 0.9);  // the bound is not idle
}

TEST(Motion, FirstOrderAtOneMetreAndOneHundredMicroradiansNeglectsFiveNanometres) {
  Deviation D = Deviation::Zero();
  D[5] = 100e-6;
  const Vector3d place(1000, 0, 0);
  const Vector3d first = place + D.tail<3>().cross(place);
  EXPECT_NEAR((motion(D, Vector3d::Zero()) * place - first).norm(), 5e-6, 1e-10);
}

}  // namespace
}  // namespace abbe::kinematics
