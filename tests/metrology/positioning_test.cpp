#include "errors/metrology/positioning.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <limits>
#include <map>
#include <random>
#include <sstream>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

#include "errors/metrology/position_file.h"
#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {
namespace {

using namespace abbe::literals;

/// Deviations in units that a hand can add up: means 2 and 0 up, -1 and 1 down.
PositionRuns by_hand() {
  PositionRuns runs;
  runs.target = Eigen::Vector2d(0.0, 100.0);
  runs.up.resize(2, 3);
  runs.up << 1, 2, 3, 0, 0, 0;
  runs.down.resize(2, 3);
  runs.down << -1, -1, -1, -1, 1, 3;
  return runs;
}

TEST(Positioning, AgreesWithASheetOfPaper) {
  const Positioning p = positioning(by_hand());
  ASSERT_TRUE(p.up && p.down && p.R && p.A);
  EXPECT_EQ(p.up->mean, Eigen::Vector2d(2, 0));
  EXPECT_EQ(p.down->mean, Eigen::Vector2d(-1, 1));
  EXPECT_EQ(p.up->s, Eigen::Vector2d(1, 0));
  EXPECT_EQ(p.down->s, Eigen::Vector2d(0, 2));
  EXPECT_EQ(p.reversal, Eigen::Vector2d(3, -1));
  EXPECT_EQ(*p.B, 3.0);
  EXPECT_EQ(*p.B_mean, 1.0);
  EXPECT_EQ(p.mean, Eigen::Vector2d(0.5, 0.5));
  EXPECT_EQ(*p.M, 0.0);
  EXPECT_EQ(p.up->E, 2.0);
  EXPECT_EQ(p.down->E, 2.0);
  EXPECT_EQ(*p.E, 3.0);
  EXPECT_EQ(*p.up->R, 4.0);
  EXPECT_EQ(*p.down->R, 8.0);
  EXPECT_EQ(p.repeatability, Eigen::Vector2d(5, 8));  // 2*1 + 0 + 3; max(0 + 2*2 + 1, 0, 8)
  EXPECT_EQ(*p.R, 8.0);
  EXPECT_EQ(*p.up->A, 4.0);    // up to 4, down to 0
  EXPECT_EQ(*p.down->A, 8.0);  // up to 5, down to -3
  EXPECT_EQ(*p.A, 8.0);
}

TEST(Positioning, LeavesOutWhatTheRunsCannotGive) {
  PositionRuns runs = by_hand();
  runs.down = runs.down.leftCols(1).eval();
  const Positioning single = positioning(runs);
  EXPECT_TRUE(single.up->R && single.B && single.E && single.M);
  EXPECT_FALSE(single.down->R || single.down->A || single.R || single.A);
  EXPECT_EQ(single.repeatability.size(), 0);
  runs.down.resize(0, 0);
  const Positioning up = positioning(runs);
  EXPECT_FALSE(up.down || up.B || up.B_mean || up.M || up.E || up.R || up.A);
  EXPECT_EQ(*up.up->A, 4.0);
}

TEST(Positioning, RefusesWhatIsNoMeasurement) {
  const auto spoilt = [](const auto& spoil) {
    PositionRuns runs = by_hand();
    spoil(runs);
    return runs;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const PositionRuns& runs :
       {PositionRuns{}, spoilt([](auto& r) { r.target[1] = r.target[0]; }),
        spoilt([&](auto& r) { r.target[1] = nan; }), spoilt([&](auto& r) { r.up(0, 0) = nan; }),
        spoilt([](auto& r) { r.down.conservativeResize(1, 3); }),
        spoilt([](auto& r) { r.up.resize(0, 0), r.down.resize(0, 0); }),
        spoilt([](auto& r) { r.target.conservativeResize(1); })})
    EXPECT_THROW(positioning(runs), std::invalid_argument);
}

/// From the definitions, a reading at a time, with sums of squares instead of deviations.
double brute_A(const PositionRuns& runs) {
  long double high = -1e30L, low = 1e30L;
  for (const Eigen::MatrixXd* way : {&runs.up, &runs.down})
    for (Eigen::Index i = 0; i < way->rows(); ++i) {
      long double sum = 0, squares = 0;
      const auto n = static_cast<long double>(way->cols());
      for (Eigen::Index j = 0; j < way->cols(); ++j) {
        sum += (*way)(i, j);
        squares += static_cast<long double>((*way)(i, j)) * (*way)(i, j);
      }
      const long double s = std::sqrt(std::max(0.0L, (squares - sum * sum / n) / (n - 1)));
      high = std::max(high, sum / n + 2 * s);
      low = std::min(low, sum / n - 2 * s);
    }
  return double(high - low);
}

TEST(Positioning, AgreesWithTheDefinitionsOnRandomReadings) {
  const unsigned seed = 20250601;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 5.0_um);
  double worst = 0.0;
  for (int k = 0; k < 300; ++k) {
    PositionRuns runs;
    const Eigen::Index m = 2 + k % 20, n = 2 + k % 6;
    runs.target = Eigen::VectorXd::LinSpaced(m, -200.0, 300.0);
    runs.up = Eigen::MatrixXd::NullaryExpr(m, n, [&] { return noise(random); });
    runs.down = Eigen::MatrixXd::NullaryExpr(m, n, [&] { return noise(random) + 2.0_um; });
    const Positioning p = positioning(runs);
    worst = std::max(worst, std::abs(*p.A - brute_A(runs)));
    // what always holds between the quantities
    EXPECT_LE(*p.E, *p.A);
    EXPECT_LE(std::abs(*p.B_mean), *p.B + 1e-15);
    EXPECT_LE(*p.M, *p.E + 1e-15);
    EXPECT_LE(std::max(*p.up->R, *p.down->R), *p.R + 1e-15);
  }
  std::cout << "A off by at most " << worst << " mm\n";
  EXPECT_LT(worst, 1e-15);  // mm: a few ulp of 20 um
}

std::filesystem::path validation(const std::string& name) {
  const char* folder = std::getenv("ABBE_VALIDATION");
  return folder ? std::filesystem::path(folder) / name : std::filesystem::path();
}

TEST(Positioning, GivesEveryDigitOfTheReferenceSets) {
  const auto raw = validation("iso230_2_raw.csv"), wanted = validation("iso230_2_expected.csv");
  if (!std::filesystem::exists(raw) || !std::filesystem::exists(wanted))
    GTEST_SKIP() << "ABBE_VALIDATION does not name a folder with iso230_2_raw.csv";
  std::map<std::string, std::map<std::string, double>> found;
  for (const PositionSet& set : read_positions(read_text(raw, 1 << 24), raw.string())) {
    const Positioning p = positioning(set.runs);
    found[set.name] = {{"B", *p.B},        {"B_mean", *p.B_mean}, {"M", *p.M},
                       {"E_up", p.up->E},  {"E_dn", p.down->E},   {"E", *p.E},
                       {"R_up", *p.up->R}, {"R_dn", *p.down->R},  {"R", *p.R},
                       {"A_up", *p.up->A}, {"A_dn", *p.down->A},  {"A", *p.A}};
  }
  std::ifstream file(wanted);
  std::string line, set, quantity, value;
  std::getline(file, line);
  int rows = 0;
  double worst = 0.0;
  while (std::getline(file, line)) {
    std::istringstream cells(line);
    std::getline(cells, set, ',');
    std::getline(cells, quantity, ',');
    std::getline(cells, value);
    ASSERT_TRUE(found[set].count(quantity)) << line;
    const double off = std::abs(found[set][quantity] - std::stod(value));
    worst = std::max(worst, off);
    EXPECT_LE(off, 0.5000001e-6) << line << " seen " << found[set][quantity];  // six decimals
    ++rows;
  }
  std::cout << rows << " quantities, at most " << worst << " mm off six printed decimals\n";
  EXPECT_EQ(rows, 36);
}

}  // namespace
}  // namespace abbe::errors::metrology
