#include "errors/metrology/positioning.h"

#include <array>
#include <stdexcept>

#include <gtest/gtest.h>

#include "kinematics/units.h"

namespace abbe::errors::metrology {
namespace {

using namespace abbe::literals;

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
}

}  // namespace
}  // namespace abbe::errors::metrology
