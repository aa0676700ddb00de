#include "sim/compensation/machine_belief.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace abbe::sim::compensation {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// One second in air, then six depths of cut of a second each.
ControlLog log_of_steps(double noise_A, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, 1.0);
  ControlLog log{{"spindle_rpm", "current_A"}, VectorXd(701), Eigen::MatrixXd(701, 2)};
  for (Index i = 0; i <= 700; ++i) {
    log.time_s[i] = 0.01 * double(i);
    const double depth = std::min(6.0, std::floor(log.time_s[i] + 1e-9));
    log.values(i, 0) = 2500.0;
    log.values(i, 1) = 1.1 + 0.8 * depth + noise_A * noise(random);
  }
  return log;
}

double bent(double x) { return 4e-3 * x - 0.3e-3 * x * x; }

CurrentTraining training_of_steps() {
  CurrentTraining part{VectorXd(6), VectorXd(6)};
  for (Index i = 0; i < 6; ++i) {
    part.time_s[i] = 1.9 + double(i);
    part.deviation[i] = bent(0.8 * double(i + 1));
  }
  return part;
}

TEST(ForceBelief, CurrentOfATrainingPartTeachesHowFarItBends) {
  const ControlLog log = log_of_steps(0.0, 1);
  const CurrentLaw law = fit_current_law(log, training_of_steps());
  EXPECT_NEAR(law.air_A, 1.1, 1e-12);
  EXPECT_NEAR(law.c[0], 4e-3, 1e-12);
  EXPECT_NEAR(law.c[1], -0.3e-3, 1e-12);
  const TimeSeries course = current_deflection(law, log);
  EXPECT_EQ(value_at(course, 0.5)[0], 0.0) << "in air nothing bends";
  EXPECT_NEAR(value_at(course, 3.5)[0], bent(2.4), 1e-12);
}

TEST(ForceBelief, LawIsHeldBeyondWhatItWasTrainedWith) {
  CurrentLaw law = fit_current_law(log_of_steps(0.0, 1), training_of_steps());
  ControlLog log = log_of_steps(0.0, 1);
  log.values(700, 1) = 100.0;
  EXPECT_NEAR(current_deflection(law, log).value(700, 0), bent(4.8), 1e-12);
}

TEST(ForceBelief, NoiseOfTheCurrentIsTakenDownByAMean) {
  SCOPED_TRACE("seed 20261121");
  const ControlLog log = log_of_steps(0.02, 20261121);
  const CurrentLaw law = fit_current_law(log, training_of_steps(), 0.5);
  const TimeSeries course = current_deflection(law, log);
  double sum = 0.0;
  for (Index k = 2; k <= 6; ++k)
    sum += std::pow(value_at(course, double(k) + 0.95)[0] - bent(0.8 * double(k)), 2);
  RecordProperty("rms_um", std::to_string(1e3 * std::sqrt(sum / 5)));
  EXPECT_LT(std::sqrt(sum / 5), 0.05e-3);
}

TEST(ForceBelief, TrainingThatTeachesNothingIsRefused) {
  const ControlLog log = log_of_steps(0.0, 1);
  CurrentTraining part = training_of_steps();
  part.time_s.setConstant(3.9);  // one depth alone
  EXPECT_THROW(fit_current_law(log, part), std::invalid_argument);
  part = training_of_steps();
  part.time_s.setZero();  // never in air before
  EXPECT_THROW(fit_current_law(log, part), std::invalid_argument);
  EXPECT_THROW(fit_current_law(log, {VectorXd(1), VectorXd(1)}), std::invalid_argument);
  ControlLog blind = log;
  blind.names[1] = "torque";
  EXPECT_THROW(fit_current_law(blind, training_of_steps()), std::invalid_argument);
}

TEST(ForceBelief, DynamometerGivesTheForceAtTheTip) {
  ControlLog log{{"FX_dynamometer_N", "FY_dynamometer_N", "FZ_dynamometer_N"},
                 VectorXd(2),
                 Eigen::MatrixXd(2, 3)};
  log.time_s << 0.0, 1.0;
  log.values << 0, 0, 0, 10, -20, 40;
  const LoadSeries course = dynamometer_load(log);
  EXPECT_EQ(load_at(course, 0.5).tool_wrench_t[2], 20.0);
  EXPECT_TRUE(load_at(course, 1.5).tool_wrench_t.isZero(0.0)) << "nothing after the last reading";
  EXPECT_TRUE(load_at({}, 0.0).tool_wrench_t.isZero(0.0));
}

}  // namespace
}  // namespace abbe::sim::compensation
