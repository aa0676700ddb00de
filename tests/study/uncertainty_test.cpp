#include "sim/study/uncertainty.h"

#include <cmath>
#include <iostream>

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <boost/math/distributions/chi_squared.hpp>

#include "sim/study/case_plan.h"
#include "tests/study/flat_machine.h"

namespace abbe::sim::study {
namespace {

Eigen::MatrixXd waves(Eigen::Index p, Eigen::Index n) {
  return Eigen::MatrixXd::NullaryExpr(p, n, [](Eigen::Index i, Eigen::Index v) {
    return 1e-3 * std::cos(0.7 * double(i) + 0.02 * double((i + 1) * v));
  });
}

FlatMachine correlated_normals() {
  Study study = study_of({{Distribution::Kind::Normal, 1.0, 2.0},
                          {Distribution::Kind::Normal, -3.0, 0.5},
                          {Distribution::Kind::Normal, 0.0, 1.0},
                          {Distribution::Kind::Normal, 0.0, 1.5}},
                         {}, {{0, 2, 0.8}, {2, 3, -0.5}});
  study.uncertainty = Uncertainty{0.9, 8192};
  return flat(std::move(study), waves(4, 200));
}

TEST(Uncertainty, CovarianceHasTheSpreadsAndTheCorrelationsOfTheStudy) {
  const Eigen::MatrixXd S = input_covariance(correlated_normals().study);
  Eigen::Matrix4d expected = Eigen::Matrix4d::Zero();
  expected.diagonal() << 4.0, 0.25, 1.0, 2.25;
  expected(0, 2) = expected(2, 0) = 0.8 * 2.0 * 1.0;
  expected(2, 3) = expected(3, 2) = -0.5 * 1.0 * 1.5;
  ASSERT_TRUE(S.allFinite());
  EXPECT_LT((S - expected).cwiseAbs().maxCoeff(), 1e-14) << S;
}

TEST(Uncertainty, ClosedFormIsGSG) {
  const FlatMachine machine = correlated_normals();
  const UncertaintyMap map = uncertainty_map(machine.study, machine.influence);
  const Eigen::MatrixXd G = machine.influence.slope.transpose();
  const Eigen::VectorXd expected =
      (G * input_covariance(machine.study) * G.transpose()).diagonal().cwiseSqrt();
  ASSERT_EQ(map.standard_deviation.size(), 200);
  ASSERT_TRUE(map.standard_deviation.allFinite() && expected.allFinite());
  EXPECT_LT((map.standard_deviation - expected).cwiseAbs().maxCoeff(), 1e-17);
}

/// Chi-squared bands of 95 % of the variance at every vertex, of independent machines.
TEST(Uncertainty, MonteCarloVarianceOfOneRivalIsTheClosedFormWithinItsBand) {
  const FlatMachine machine = correlated_normals();
  const Eigen::VectorXd closed =
      uncertainty_map(machine.study, machine.influence).standard_deviation;
  const int cases = 4000, repetitions = 50;
  const boost::math::chi_squared chi(cases - 1);
  const double low = quantile(chi, 0.025) / (cases - 1), high = quantile(chi, 0.975) / (cases - 1);
  ASSERT_EQ(closed.size(), 200);
  double within = 0.0, worst = 0.0;
  for (std::uint64_t seed = 1; seed <= repetitions; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    const Eigen::MatrixXd all =
        maps(machine.influence,
             draw_inputs(machine.study, points({Sampling::Random, 4, seed}, 0, cases)));
    for (Eigen::Index v = 0; v < closed.size(); ++v) {
      const double variance = (all.row(v).array() - all.row(v).mean()).square().sum() / (cases - 1);
      const double ratio = variance / (closed[v] * closed[v]);
      ASSERT_TRUE(std::isfinite(ratio)) << "vertex " << v;
      within += ratio > low && ratio < high ? 1.0 : 0.0;
      worst = std::max(worst, std::abs(ratio - 1.0));
      ASSERT_LT(std::abs(ratio - 1.0), 5.0 * std::sqrt(2.0 / cases)) << "vertex " << v;
    }
  }
  within /= double(closed.size()) * repetitions;
  std::cout << "variance of " << cases << " machines over G S G^T: band " << low << " .. " << high
            << ", within it " << 100.0 * within << " %, farthest " << 100.0 * worst << " %\n";
  EXPECT_NEAR(within, 0.95, 0.04);  // vertices of one repetition go together: some 200 are free
}

TEST(Uncertainty, DrawnMapsOfOneRivalAreNormalWithTheClosedForm) {
  const FlatMachine machine = correlated_normals();
  const UncertaintyMap map = uncertainty_map(machine.study, machine.influence);
  const Eigen::VectorXd middle = maps(machine.influence, machine.influence.centre);
  ASSERT_EQ(map.drawn.size(), 200);
  for (const Eigen::VectorXd* one :
       {&map.standard_deviation, &map.drawn, &map.low, &map.high, &middle})
    ASSERT_TRUE(one->allFinite());
  const Eigen::ArrayXd half = 1.6448536269514722 * map.standard_deviation.array();  // 90 %
  const double sd = (map.drawn.array() / map.standard_deviation.array() - 1.0).abs().maxCoeff();
  const double ends = std::max(((map.high - middle).array() / half - 1.0).abs().maxCoeff(),
                               ((middle - map.low).array() / half - 1.0).abs().maxCoeff());
  std::cout << "8192 Sobol machines: standard deviation within " << 100.0 * sd
            << " %, ends of the 90 % band within " << 100.0 * ends << " %\n";
  EXPECT_LT(sd, 0.01);
  EXPECT_LT(ends, 0.03);
}

TEST(Uncertainty, ATruncatedUniformInputHasItsOwnDeviationAndBand) {
  Study study = study_of({{Distribution::Kind::Uniform, 0.0, 3.0, -1.0, 2.0}});
  study.uncertainty = Uncertainty{0.95, 4096};
  const FlatMachine machine = flat(std::move(study), Eigen::MatrixXd::Constant(1, 3, 1e-3));
  const UncertaintyMap map = uncertainty_map(machine.study, machine.influence);
  EXPECT_NEAR(map.standard_deviation[1], 3e-3 / std::sqrt(12.0), 1e-15);
  EXPECT_NEAR(map.drawn[1], map.standard_deviation[1], 1e-6);
  EXPECT_NEAR(map.low[1], -1e-3 + 0.025 * 3e-3, 2e-6);
  EXPECT_NEAR(map.high[1], 2e-3 - 0.025 * 3e-3, 2e-6);
}

/// The lower of two equal passes that move opposite ways: -|x|, half normal.
TEST(Uncertainty, RivalsNarrowTheBandAndTheClosedFormDoesNotKnowThem) {
  Study study = study_of(normals(1));
  study.uncertainty = Uncertainty{0.95, 8192};
  FlatMachine machine = flat(std::move(study), 1e-3 * Eigen::RowVector2d(1.0, -1.0));
  machine.influence.first = {0, 2};
  machine.influence.status.resize(1);
  machine.influence.error_free = Eigen::VectorXd::Zero(1);
  const UncertaintyMap map = uncertainty_map(machine.study, machine.influence);
  EXPECT_NEAR(map.standard_deviation[0], 1e-3, 1e-15);
  EXPECT_NEAR(map.drawn[0], 1e-3 * std::sqrt(1.0 - 2.0 / std::acos(-1.0)), 5e-6);
  EXPECT_NEAR(map.high[0], -1e-3 * 0.03133798, 2e-6);  // half-normal quantile of 2.5 %
  EXPECT_NEAR(map.low[0], -1e-3 * 2.241403, 3e-5);
}

TEST(Uncertainty, WhatIsUncutHasNone) {
  Study study = study_of(normals(3));
  study.uncertainty = Uncertainty{0.95, 256};
  const FlatMachine machine = random_machine(std::move(study), 200, 3);
  const UncertaintyMap map = uncertainty_map(machine.study, machine.influence);
  for (Eigen::Index v = 0; v < 200; ++v)
    for (const double value : {map.standard_deviation[v], map.low[v], map.high[v], map.drawn[v]})
      EXPECT_EQ(std::isnan(value), v % 17 == 3) << v;
  const auto json = to_json(machine.influence, map);
  EXPECT_GT(json["standard_deviation_rms_um"].get<double>(), 0.0);
  EXPECT_GT(json["band_mean_width_um"].get<double>(), 0.0);
}

TEST(Uncertainty, BitsDoNotDependOnThreads) {
  Study study = study_of(normals(3));
  study.uncertainty = Uncertainty{0.95, 20000};  // so many that a lot holds 104 vertices
  const FlatMachine machine = random_machine(std::move(study), 300, 4);
  const auto with = [&](std::size_t threads) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    return uncertainty_map(machine.study, machine.influence);
  };
  const UncertaintyMap one = with(1), vector4 = with(4);
  for (Eigen::Index v = 0; v < 300; ++v) {
    if (v % 17 == 3) continue;
    ASSERT_EQ(one.low[v], vector4.low[v]);
    ASSERT_EQ(one.high[v], vector4.high[v]);
    ASSERT_EQ(one.drawn[v], vector4.drawn[v]);
  }
}

TEST(Uncertainty, AMapWithoutAnyCutVertexIsToldAsNull) {
  FlatMachine machine = flat(study_of(normals(1)), Eigen::MatrixXd::Zero(1, 2));
  machine.influence.first = {0, 0, 0};
  machine.influence.slope.resize(1, 0);
  machine.influence.shift.resize(1, 0);
  machine.influence.distance.resize(0);
  machine.influence.half_curvature.resize(0);
  const UncertaintyMap map = uncertainty_map(machine.study, machine.influence);
  EXPECT_TRUE(std::isnan(map.drawn[0]));
  EXPECT_TRUE(to_json(machine.influence, map)["standard_deviation_rms_um"].is_null());
}

}  // namespace
}  // namespace abbe::sim::study
