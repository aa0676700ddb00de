#include "errors/identification/thermal_epochs.h"

#include <cmath>
#include <iostream>
#include <random>

#include <gtest/gtest.h>

namespace {

using namespace abbe::errors::identification;
using Eigen::Vector2d;
using Eigen::VectorXd;

/// The X axis of yang2012, x in cm and delta in um: a cold quartic and the slope
/// -0.027523 - 0.0049600 dT7 + 0.033601 dT8.
constexpr double quartic[] = {0.29717, -6.2218e-3, 9.0575e-4, 8.9455e-5, 1.1192e-6};
constexpr double slope_constant = -0.027523, per_K7 = -0.0049600, per_K8 = 0.033601;

double yang(double x, double dT7, double dT8) {
  double g = 0;
  for (int k = 4; k >= 0; --k) g = g * x + quartic[k];
  return g + (slope_constant + per_K7 * dT7 + per_K8 * dT8) * x;
}

/// His 18 runs: the first cold, then screw and nut warm up and cool down at their own pace.
std::vector<CompositeRun> yang_runs() {
  std::vector<CompositeRun> runs;
  for (int i = 0; i < 18; ++i) {
    const double t = i / 17.0;
    CompositeRun run{VectorXd::LinSpaced(17, -40, 40), VectorXd(17),
                     Vector2d(6 * (1 - std::exp(-3 * t)), 9 * std::sin(2 * t)), i == 0};
    for (int k = 0; k < 17; ++k) run.delta(k) = yang(run.p(k), run.dT_K(0), run.dT_K(1));
    runs.push_back(run);
  }
  return runs;
}

}  // namespace

TEST(Composite, YangsAxisComesApartIntoItsCoefficients) {
  const CompositeFit fit = fit_composite(yang_runs());
  ASSERT_EQ(fit.status, CompositeStatus::Ok);
  // The constant of the slope stands at dT = 0 too, so it belongs to the cold curve.
  const double expected[] = {quartic[0], quartic[1] + slope_constant, quartic[2], quartic[3],
                             quartic[4]};
  double worst = 0;
  for (int k = 0; k <= 4; ++k)
    worst = std::max(worst, std::abs(fit.geometric(k) / expected[k] - 1));
  worst = std::max(
      {worst, std::abs(fit.thermal(0) / per_K7 - 1), std::abs(fit.thermal(1) / per_K8 - 1)});
  std::cout << "worst coefficient off by " << worst << " of itself; rms " << fit.rms << " um\n";
  EXPECT_LT(worst, 1e-11);
  EXPECT_EQ(fit.thermal_constant, 0);
  EXPECT_LT(fit.offset.cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT(fit.rms, 1e-13);
  EXPECT_NEAR(value(fit, 25, Vector2d(2, 3)), yang(25, 2, 3), 1e-12);
}

/// The least-squares slope of a run including its geometric part, as regressed in the paper.
double run_slope(const CompositeRun& run) { return fit_regression(run.p, run.delta).beta(0); }

TEST(Composite, AddingAPublishedConstantToTheColdCurveCountsTheColdSlopeTwice) {
  const std::vector<CompositeRun> runs = yang_runs();
  // As published: slopes of whole runs on the temperatures, with a constant.
  Eigen::MatrixXd dT(18, 2);
  VectorXd slopes(18);
  for (int i = 0; i < 18; ++i) {
    dT.row(i) = runs[std::size_t(i)].dT_K;
    slopes(i) = run_slope(runs[std::size_t(i)]);
  }
  const Regression published = fit_regression(dT, slopes);
  ASSERT_EQ(published.status, RegressionStatus::Ok);
  EXPECT_NEAR(published.beta(1), per_K8, 1e-12);
  EXPECT_NEAR(published.constant, run_slope(runs.front()), 1e-12) << "the cold run's own slope";
  const CompositeFit fit = fit_composite(runs);
  const double twice = value(fit, 40, Vector2d(0, 0)) + published.constant * 40;
  std::cout << "counted twice, the cold end of the axis is off by " << twice - yang(40, 0, 0)
            << " um\n";
  EXPECT_NEAR(twice - yang(40, 0, 0), 40 * run_slope(runs.front()), 1e-11);
  EXPECT_NEAR(value(fit, 40, Vector2d(0, 0)), yang(40, 0, 0), 1e-12);
}

TEST(Composite, AnOffsetOfAWholeRunIsReportedAndKeptOutOfTheSlope) {
  std::vector<CompositeRun> runs = yang_runs();
  for (CompositeRun& run : runs) {
    run.p.array() += 40;  // positions from one end, where an offset would tilt a bound line
    if (!run.cold) run.delta.array() += 0.7;
  }
  const CompositeFit free = fit_composite(runs);
  ASSERT_EQ(free.status, CompositeStatus::Ok);
  EXPECT_NEAR(free.thermal(1), per_K8, 1e-12);
  // The law's slope acts about p = 0, now an end of the axis: each run is lower by 40 slopes there.
  for (int i = 0; i < free.offset.size(); ++i)
    EXPECT_NEAR(free.offset(i), 0.7 - 40 * free.slope(i), 1e-11);
  CompositeOptions bound;
  bound.free_offset = false;
  EXPECT_GT(std::abs(fit_composite(runs, bound).thermal(1) / per_K8 - 1), 0.1);
}

TEST(Composite, NoiseMovesTheCoefficientsByTheirStandardErrors) {
  const unsigned seed = 20240709;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 0.1);
  double squares = 0;
  const int repeats = 400;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    std::vector<CompositeRun> runs = yang_runs();
    // Forty cold runs, so that the cold curve's own noise, common to all slopes, does not count.
    for (int i = 1; i < 40; ++i) runs.push_back(runs.front());
    for (CompositeRun& run : runs)
      for (double& delta : run.delta) delta += noise(random);
    const CompositeFit fit = fit_composite(runs);
    ASSERT_EQ(fit.status, CompositeStatus::Ok);
    squares += std::pow((fit.thermal(1) - per_K8) / fit.slope_fit.standard_error(1), 2);
  }
  const double ratio = std::sqrt(squares / repeats);
  std::cout << "rms of deviation over standard error " << ratio << '\n';
  EXPECT_NEAR(ratio, 1.0, 0.15);
}

TEST(Composite, OutcomesAreNamed) {
  std::vector<CompositeRun> runs = yang_runs();
  EXPECT_EQ(fit_composite({runs[0]}).status, CompositeStatus::NoLaterRun);
  EXPECT_EQ(fit_composite({runs[1], runs[2]}).status, CompositeStatus::NoColdRun);
  runs[3].cold = true;
  EXPECT_EQ(fit_composite(runs).status, CompositeStatus::ColdRunNotCold);
  EXPECT_EQ(fit_composite(runs).run, 3);
  runs = yang_runs();
  for (CompositeRun& run : runs) run.dT_K(1) = 2 * run.dT_K(0);
  const CompositeFit together = fit_composite(runs);
  EXPECT_EQ(together.status, CompositeStatus::SlopeNotDetermined);
  EXPECT_EQ(together.run, -1);
  EXPECT_EQ(together.slope_fit.status, RegressionStatus::RankDeficient);
  EXPECT_EQ(together.slope.size(), 17) << "the slopes themselves are known";
  CompositeOptions options;
  options.degree = 12;
  runs.front().p.conservativeResize(5);
  runs.front().delta.conservativeResize(5);
  EXPECT_EQ(fit_composite(runs, options).status, CompositeStatus::CurveNotDetermined);
  runs = yang_runs();
  runs[2].delta(0) = NAN;
  EXPECT_THROW((void)fit_composite(runs), std::invalid_argument);
  EXPECT_THROW((void)fit_composite({}), std::invalid_argument);
}
