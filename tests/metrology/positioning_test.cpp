#include "errors/metrology/positioning.h"
#include "errors/metrology/drift.h"
#include "errors/metrology/position_file.h"
#include "kinematics/text.h"
#include "tests/test.h"

namespace abbe::errors::metrology {
namespace {

/// Deviations in units that a hand can add up: means 2 and 0 up, -1 and 1 down.
PositionRuns by_hand() {
  PositionRuns runs;
  runs.target = Vector2d(0.0, 100.0);
  runs.up.resize(2, 3);
  runs.up << 1, 2, 3, 0, 0, 0;
  runs.down.resize(2, 3);
  runs.down << -1, -1, -1, -1, 1, 3;
  return runs;
}

TEST(Positioning, AgreesWithASheetOfPaper) {
  const Positioning p = positioning(by_hand());
  ASSERT_TRUE(p.up && p.down && p.R && p.A);
  EXPECT_EQ(p.up->mean, Vector2d(2, 0));
  EXPECT_EQ(p.down->mean, Vector2d(-1, 1));
  EXPECT_EQ(p.up->s, Vector2d(1, 0));
  EXPECT_EQ(p.down->s, Vector2d(0, 2));
  EXPECT_EQ(p.reversal, Vector2d(3, -1));
  EXPECT_EQ(*p.B, 3.0);
  EXPECT_EQ(*p.B_mean, 1.0);
  EXPECT_EQ(p.mean, Vector2d(0.5, 0.5));
  EXPECT_EQ(*p.M, 0.0);
  EXPECT_EQ(p.up->E, 2.0);
  EXPECT_EQ(p.down->E, 2.0);
  EXPECT_EQ(*p.E, 3.0);
  EXPECT_EQ(*p.up->R, 4.0);
  EXPECT_EQ(*p.down->R, 8.0);
  EXPECT_EQ(p.repeatability, Vector2d(5, 8));  // 2*1 + 0 + 3; max(0 + 2*2 + 1, 0, 8)
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
  for (const MatrixXd* way : {&runs.up, &runs.down})
    for (Index i = 0; i < way->rows(); ++i) {
      long double sum = 0, squares = 0;
      const auto n = static_cast<long double>(way->cols());
      for (Index j = 0; j < way->cols(); ++j) {
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
  SeededRandom random(20250601);
  std::normal_distribution<double> noise(0.0, 5.0_um);
  double worst = 0.0;
  for (int k = 0; k < 300; ++k) {
    PositionRuns runs;
    const Index m = 2 + k % 20, n = 2 + k % 6;
    runs.target = VectorXd::LinSpaced(m, -200.0, 300.0);
    runs.up = MatrixXd::NullaryExpr(m, n, [&] { return noise(random); });
    runs.down = MatrixXd::NullaryExpr(m, n, [&] { return noise(random) + 2.0_um; });
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

fs::path validation(const std::string& name) {
  const char* folder = std::getenv("ABBE_VALIDATION");
  return folder ? fs::path(folder) / name : fs::path();
}

TEST(Positioning, GivesEveryDigitOfTheReferenceSets) {
  const auto raw = validation("iso230_2_raw.csv"), wanted = validation("iso230_2_expected.csv");
  if (!fs::exists(raw) || !fs::exists(wanted))
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

DiagonalRuns diagonal_runs(std::array<int, 3> signs, double slope, double reversal) {
  DiagonalRuns d{signs, {}};
  d.runs.target = VectorXd::LinSpaced(11, 0.0, 700.0);
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

/// Spindle that warms up: 1 - exp(-t / 1 h), on for four hours, off for two.
DriftLog warming(Index n) {
  DriftLog log{VectorXd::LinSpaced(n, 0.0, 6 * 3600.0), {"Z"}, MatrixXd(n, 1)};
  const auto on = [](double t) { return 50.0_um * (1.0 - std::exp(-t / 3600.0)); };
  for (Index i = 0; i < n; ++i) {
    const double t = log.time_s[i];
    log.values(i, 0) = t < 14400.0 ? on(t) : on(14400.0) * std::exp(-(t - 14400.0) / 3600.0);
  }
  return log;
}

TEST(Drift, OfAWarmingSpindleIsThatOfItsExponential) {
  const DriftLog log = warming(2161);  // every ten seconds
  const auto found = drift(
      log, {{"first hour", 0.0, 3600.0}, {"running", 0.0, 14400.0}, {"after", 14400.0, 21600.0}});
  ASSERT_EQ(found.size(), 3u);
  EXPECT_NEAR(found[0].range[0], 50.0_um * (1.0 - std::exp(-1.0)), 1e-12);
  EXPECT_NEAR(found[1].range[0], 50.0_um * (1.0 - std::exp(-4.0)), 1e-12);
  EXPECT_NEAR(found[2].change[0], -50.0_um * (1.0 - std::exp(-4.0)) * (1.0 - std::exp(-2.0)),
              1e-12);
}

TEST(Drift, EndsBetweenSamplesAreStraightLines) {
  DriftLog log{Vector3d(0, 10, 20), {"X", "Y"}, MatrixXd(3, 2)};
  log.values << 0, 0, 10, -1, 0, 0;
  const auto found = drift(log, {{"a", 5, 12}, {"b", 12, 18}, {"all", 0, 20}});
  EXPECT_DOUBLE_EQ(found[0].range[0], 5.0);
  EXPECT_DOUBLE_EQ(found[0].range[1], 0.5);
  EXPECT_DOUBLE_EQ(found[0].change[0], 3.0);
  EXPECT_DOUBLE_EQ(found[1].range[0], 6.0);
  EXPECT_DOUBLE_EQ(found[2].range[0], 10.0);
  EXPECT_DOUBLE_EQ(found[2].change[0], 0.0);
}

TEST(Drift, RefusesWhatIsNoLog) {
  const DriftLog good = warming(10);
  const auto refuses = [](const DriftLog& log, DriftInterval interval) {
    EXPECT_THROW(drift(log, {interval}), std::invalid_argument) << interval.from_s;
  };
  refuses(good, {"", 5, 5});
  refuses(good, {"", -1, 5});
  refuses(good, {"", 5, 1e9});
  refuses(good, {"", std::nan(""), 5});
  DriftLog bad = good;
  bad.time_s[3] = bad.time_s[2];
  refuses(bad, {"", 0, 5});
  bad = good;
  bad.values(0, 0) = std::nan("");
  refuses(bad, {"", 0, 5});
  bad = good;
  bad.names.clear();
  refuses(bad, {"", 0, 5});
}

}  // namespace
}  // namespace abbe::errors::metrology
