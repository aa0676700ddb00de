#include "errors/metrology/drift.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

#include "kinematics/units.h"

namespace abbe::errors::metrology {
namespace {

using namespace abbe::literals;

/// Spindle that warms up: 1 - exp(-t / 1 h), on for four hours, off for two.
DriftLog warming(Eigen::Index n) {
  DriftLog log{Eigen::VectorXd::LinSpaced(n, 0.0, 6 * 3600.0), {"Z"}, Eigen::MatrixXd(n, 1)};
  const auto on = [](double t) { return 50.0_um * (1.0 - std::exp(-t / 3600.0)); };
  for (Eigen::Index i = 0; i < n; ++i) {
    const double t = log.time_s[i];
    log.values(i, 0) = t < 14400.0 ? on(t) : on(14400.0) * std::exp(-(t - 14400.0) / 3600.0);
  }
  return log;
}

TEST(Drift, OfAWarmingSpindleIsThatOfItsExponential) {
  const DriftLog log = warming(2161);  // every ten seconds
  const auto found = drift(log, running_intervals(log, 0.0, 14400.0));
  ASSERT_EQ(found.size(), 3u);
  EXPECT_NEAR(found[0].range[0], 50.0_um * (1.0 - std::exp(-1.0)), 1e-12);
  EXPECT_NEAR(found[1].range[0], 50.0_um * (1.0 - std::exp(-4.0)), 1e-12);
  EXPECT_NEAR(found[2].change[0], -50.0_um * (1.0 - std::exp(-4.0)) * (1.0 - std::exp(-2.0)),
              1e-12);
  EXPECT_NEAR(found[0].max_rate[0], 50.0_um / 3600.0, 50.0_um / 3600.0 * 0.002);
}

TEST(Drift, EndsBetweenSamplesAreStraightLines) {
  DriftLog log{Eigen::Vector3d(0, 10, 20), {"X", "Y"}, Eigen::MatrixXd(3, 2)};
  log.values << 0, 0, 10, -1, 0, 0;
  const auto found = drift(log, {{"a", 5, 12}, {"b", 12, 18}, {"all", 0, 20}});
  EXPECT_DOUBLE_EQ(found[0].range[0], 5.0);
  EXPECT_DOUBLE_EQ(found[0].range[1], 0.5);
  EXPECT_DOUBLE_EQ(found[0].change[0], 3.0);
  EXPECT_DOUBLE_EQ(found[1].range[0], 6.0);
  EXPECT_DOUBLE_EQ(found[2].range[0], 10.0);
  EXPECT_DOUBLE_EQ(found[2].change[0], 0.0);
}

/// The worst window by trying very many.
double brute_worst(const DriftLog& log, double window) {
  const double first = log.time_s[0], last = log.time_s[log.time_s.size() - 1];
  double worst = 0.0;
  for (int i = 0; i <= 4000; ++i) {
    const double from = std::min(first + i / 4000.0 * (last - window - first), last - window);
    worst = std::max(worst, drift(log, {{"", from, std::min(from + window, last)}})[0].range[0]);
  }
  return worst;
}

TEST(Drift, TheWorstWindowIsNoLessThanAnyAndHardlyMore) {
  const unsigned seed = 20250603;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  double most = 0.0;
  for (int k = 0; k < 40; ++k) {
    const Eigen::Index n = 2 + k;
    DriftLog log{Eigen::VectorXd(n), {"X"}, Eigen::MatrixXd(n, 1)};
    double t = -50.0;
    for (Eigen::Index i = 0; i < n; ++i) {
      log.time_s[i] = t += 0.1 + unit(random);
      log.values(i, 0) = unit(random);
    }
    const double window = (0.05 + 0.9 * unit(random)) * (t - log.time_s[0]);
    const double found = max_window_drift(log, window)[0], brute = brute_worst(log, window);
    EXPECT_GE(found, brute - 1e-12);
    EXPECT_LE(found, brute + 0.05);  // a window of the brute search is at most 0.01 s off
    most = std::max(most, found - brute);
  }
  std::cout << "worst window above the brute search by at most " << most << " of 1\n";
}

TEST(Drift, TiltsOfAMandrelComeFromItsTwoHeights) {
  const double a = 20e-6, b = -15e-6;
  DriftLog log{Eigen::Vector2d(0, 1), {"X1", "Y1", "X2", "Y2", "Z"}, Eigen::MatrixXd::Zero(2, 5)};
  // x += b z, y -= a z for a turn (a, b, 0) about the origin
  log.values.row(1) << 3.0_um + b * 50, -a * 50, 3.0_um + b * 200, -a * 200, 7.0_um;
  const DriftLog d = mandrel_drift(log, {50.0, 200.0});
  EXPECT_NEAR(d.values(1, 3), a, 1e-18);
  EXPECT_NEAR(d.values(1, 4), b, 1e-18);
  EXPECT_NEAR(d.values(1, 0), 3.0_um + b * 50, 1e-18);
  EXPECT_NEAR(d.values(1, 2), 7.0_um, 1e-18);
  EXPECT_THROW(mandrel_drift(log, {50.0, 50.0}), std::invalid_argument);
  EXPECT_THROW(mandrel_drift(warming(3), {50.0, 90.0}), std::invalid_argument);
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
  EXPECT_THROW(max_window_drift(good, 0.0), std::invalid_argument);
  EXPECT_THROW(max_window_drift(good, 1e9), std::invalid_argument);
}

}  // namespace
}  // namespace abbe::errors::metrology
