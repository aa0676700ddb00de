#include "errors/metrology/positioning.h"

#include <array>
#include <cmath>
#include <iostream>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "kinematics/units.h"

namespace abbe::errors::metrology {
namespace {

using namespace abbe::literals;

/// Where a machine with squareness errors of travel and scale errors really goes.
struct Skewed {
  Squareness squareness;
  Eigen::Vector3d scale = Eigen::Vector3d::Zero();

  Eigen::Vector3d at(Eigen::Vector3d p) const {
    p += scale.cwiseProduct(p);
    const Eigen::Vector3d y(-std::sin(squareness.EC0Y), std::cos(squareness.EC0Y), 0.0);
    const Eigen::Vector3d z = Eigen::Vector3d(squareness.EB0Z, -squareness.EA0Z, 1.0).normalized();
    return p.x() * Eigen::Vector3d::UnitX() + p.y() * y + p.z() * z;
  }
  /// Lengthening of the diagonal with these signs in a box of `sides`.
  double lengthening(const std::array<double, 3>& sides, const std::array<int, 3>& signs) const {
    Eigen::Vector3d d;
    for (int i = 0; i < 3; ++i) d[i] = sides[std::size_t(i)] * signs[std::size_t(i)];
    return at(d).norm() - d.norm();
  }
};

constexpr std::array<std::array<int, 3>, 4> body{{{1, 1, 1}, {-1, 1, 1}, {1, -1, 1}, {1, 1, -1}}};

TEST(BodyDiagonals, TellSquarenessWhateverTheScales) {
  const unsigned seed = 20250602;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const std::array<double, 3> sides{500.0, 400.0, 300.0};
  double worst = 0.0;
  for (int k = 0; k < 1000; ++k) {
    const Skewed m{{unit(random) * 50e-6, unit(random) * 50e-6, unit(random) * 50e-6},
                   {unit(random) * 50e-6, unit(random) * 50e-6, unit(random) * 50e-6}};
    std::array<double, 4> lengthening{};
    double d = 0.0;
    for (std::size_t i = 0; i < 4; ++i) {
      lengthening[i] = m.lengthening(sides, body[i]);
      d = std::max(d, std::abs(lengthening[i]));
    }
    const Squareness s = squareness_from_body_diagonals(sides, lengthening);
    const double off =
        std::max({std::abs(s.EC0Y - m.squareness.EC0Y), std::abs(s.EB0Z - m.squareness.EB0Z),
                  std::abs(s.EA0Z - m.squareness.EA0Z)});
    worst = std::max(worst, off);
    ASSERT_LE(off, 4.0 * d * d / (300.0 * 300.0) + 4e-9);  // rad: second order in 50 urad
  }
  std::cout << "squareness off by at most " << worst << " rad\n";
}

TEST(BodyDiagonals, AgreeWithTheClosedFormsForABoxOf500x400x300) {
  // s_xy = 20, s_xz = -30, s_yz = 15 urad as displacements of the first axis with the second
  const Skewed m{{-20e-6, -30e-6, -15e-6}};
  const std::array<double, 3> sides{500.0, 400.0, 300.0};
  std::array<double, 4> lengthening{};
  for (std::size_t i = 0; i < 4; ++i) lengthening[i] = m.lengthening(sides, body[i]);
  const Squareness s = squareness_from_body_diagonals(sides, lengthening);
  EXPECT_NEAR(s.EC0Y, -20e-6, 2e-9);
  EXPECT_NEAR(s.EB0Z, -30e-6, 2e-9);
  EXPECT_NEAR(s.EA0Z, -15e-6, 2e-9);
}

TEST(FaceDiagonals, TellTheSquarenessOfTheirFace) {
  const std::array<double, 3> sides{500.0, 400.0, 300.0};
  const Skewed m{{40e-6, -25e-6, 15e-6}, {1e-5, -2e-5, 3e-5}};
  const auto face = [&](int first, int second) {
    std::array<int, 3> pp{}, np{};
    pp[std::size_t(first)] = pp[std::size_t(second)] = np[std::size_t(second)] = 1;
    np[std::size_t(first)] = -1;
    return squareness_from_face_diagonals(sides[std::size_t(first)], sides[std::size_t(second)],
                                          m.lengthening(sides, pp), m.lengthening(sides, np));
  };
  EXPECT_NEAR(face(0, 1), 40e-6, 4e-9);
  EXPECT_NEAR(face(0, 2), 25e-6, 4e-9);  // X x Z = -Y
  EXPECT_NEAR(face(1, 2), 15e-6, 4e-9);
}

DiagonalRuns diagonal_runs(std::array<int, 3> signs, double slope, double reversal) {
  DiagonalRuns d{signs, {}};
  d.runs.target = Eigen::VectorXd::LinSpaced(11, 0.0, 700.0);
  d.runs.up = (slope * d.runs.target) * Eigen::RowVector3d::Ones();
  d.runs.down = d.runs.up.array() - reversal;
  return d;
}

TEST(Diagonals, TheWorstOfTheSetIsTheSetsFigure) {
  const Diagonals d = diagonals(
      {diagonal_runs({1, 1, 1}, 10e-6, 1.0_um), diagonal_runs({-1, 1, 1}, -30e-6, 2.0_um)});
  ASSERT_EQ(d.each.size(), 2u);
  EXPECT_NEAR(d.E_d, 21.0_um + 2.0_um, 1e-12);
  EXPECT_NEAR(*d.B_d, 2.0_um, 1e-15);
  EXPECT_NEAR(*d.each[0].E, 7.0_um + 1.0_um, 1e-12);
  DiagonalRuns up = diagonal_runs({1, -1, 1}, 50e-6, 0.0);
  up.runs.down.resize(0, 0);
  const Diagonals mixed = diagonals({diagonal_runs({1, 1, 1}, 10e-6, 1.0_um), up});
  EXPECT_NEAR(mixed.E_d, 35.0_um, 1e-12);
  EXPECT_FALSE(mixed.B_d);
}

TEST(Diagonals, RefusesWhatIsNoSetOfDiagonals) {
  EXPECT_THROW(diagonals({}), std::invalid_argument);
  EXPECT_THROW(diagonals({diagonal_runs({1, 0, 0}, 0, 0)}), std::invalid_argument);
  EXPECT_THROW(diagonals({diagonal_runs({2, 1, 1}, 0, 0)}), std::invalid_argument);
  EXPECT_THROW(diagonals({diagonal_runs({1, 1, -1}, 0, 0), diagonal_runs({-1, -1, 1}, 0, 0)}),
               std::invalid_argument);
  EXPECT_NO_THROW(diagonals({diagonal_runs({1, 1, 0}, 0, 0), diagonal_runs({-1, 1, 0}, 0, 0)}));
  EXPECT_THROW(squareness_from_body_diagonals({1, 0, 1}, {0, 0, 0, 0}), std::invalid_argument);
  EXPECT_THROW(squareness_from_face_diagonals(1, 1, std::nan(""), 0), std::invalid_argument);
}

}  // namespace
}  // namespace abbe::errors::metrology
