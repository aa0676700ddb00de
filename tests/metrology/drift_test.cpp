#include "errors/metrology/drift.h"

#include <cmath>
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
  const auto found = drift(
      log, {{"first hour", 0.0, 3600.0}, {"running", 0.0, 14400.0}, {"after", 14400.0, 21600.0}});
  ASSERT_EQ(found.size(), 3u);
  EXPECT_NEAR(found[0].range[0], 50.0_um * (1.0 - std::exp(-1.0)), 1e-12);
  EXPECT_NEAR(found[1].range[0], 50.0_um * (1.0 - std::exp(-4.0)), 1e-12);
  EXPECT_NEAR(found[2].change[0], -50.0_um * (1.0 - std::exp(-4.0)) * (1.0 - std::exp(-2.0)),
              1e-12);
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
