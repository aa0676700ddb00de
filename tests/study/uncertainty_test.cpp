#include "sim/study/uncertainty.h"
#include <tbb/global_control.h>
#include <boost/math/distributions/chi_squared.hpp>
#include "sim/study/case_plan.h"
#include "sim/study/response_statistics.h"
#include "sim/study/sampling.h"
#include "tests/study/flat_machine.h"
#include "tests/test.h"

namespace abbe::sim::study {
namespace {

using Kind = Distribution::Kind;

MatrixXd waves(Index p, Index n) {
  return MatrixXd::NullaryExpr(p, n, [](Index i, Index v) {
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
  const MatrixXd S = input_covariance(correlated_normals().study);
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
  const MatrixXd G = machine.influence.slope.transpose();
  const VectorXd expected =
      (G * input_covariance(machine.study) * G.transpose()).diagonal().cwiseSqrt();
  ASSERT_EQ(map.standard_deviation.size(), 200);
  ASSERT_TRUE(map.standard_deviation.allFinite() && expected.allFinite());
  EXPECT_LT((map.standard_deviation - expected).cwiseAbs().maxCoeff(), 1e-17);
}

/// Chi-squared bands of 95 % of the variance at every vertex, of independent machines.
TEST(Uncertainty, MonteCarloVarianceOfOneRivalIsTheClosedFormWithinItsBand) {
  const FlatMachine machine = correlated_normals();
  const VectorXd closed = uncertainty_map(machine.study, machine.influence).standard_deviation;
  const int cases = 4000, repetitions = 50;
  const boost::math::chi_squared chi(cases - 1);
  const double low = quantile(chi, 0.025) / (cases - 1), high = quantile(chi, 0.975) / (cases - 1);
  ASSERT_EQ(closed.size(), 200);
  double within = 0.0, worst = 0.0;
  for (std::uint64_t seed = 1; seed <= repetitions; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    const MatrixXd all =
        maps(machine.influence,
             draw_inputs(machine.study, points({Sampling::Random, 4, seed}, 0, cases)));
    for (Index v = 0; v < closed.size(); ++v) {
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
  const VectorXd middle = maps(machine.influence, machine.influence.centre);
  ASSERT_EQ(map.drawn.size(), 200);
  for (const VectorXd* one : {&map.standard_deviation, &map.drawn, &map.low, &map.high, &middle})
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
  const FlatMachine machine = flat(std::move(study), MatrixXd::Constant(1, 3, 1e-3));
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
  machine.influence.error_free = VectorXd::Zero(1);
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
  for (Index v = 0; v < 200; ++v)
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
  for (Index v = 0; v < 300; ++v) {
    if (v % 17 == 3) continue;
    ASSERT_EQ(one.low[v], vector4.low[v]);
    ASSERT_EQ(one.high[v], vector4.high[v]);
    ASSERT_EQ(one.drawn[v], vector4.drawn[v]);
  }
}

TEST(Uncertainty, AMapWithoutAnyCutVertexIsToldAsNull) {
  FlatMachine machine = flat(study_of(normals(1)), MatrixXd::Zero(1, 2));
  machine.influence.first = {0, 0, 0};
  machine.influence.slope.resize(1, 0);
  machine.influence.shift.resize(1, 0);
  machine.influence.distance.resize(0);
  machine.influence.half_curvature.resize(0);
  const UncertaintyMap map = uncertainty_map(machine.study, machine.influence);
  EXPECT_TRUE(std::isnan(map.drawn[0]));
  EXPECT_TRUE(to_json(machine.influence, map)["standard_deviation_rms_um"].is_null());
}

TEST(ResponseStatistics, OfFiveByHand) {
  VectorXd values(7);
  values << 4, NAN, 1, 2, infinity, 10, 3;
  const ResponseStatistics seen = answers(values);
  EXPECT_EQ(seen.cases, 5);
  EXPECT_EQ(seen.min, 1.0);
  EXPECT_EQ(seen.max, 10.0);
  EXPECT_DOUBLE_EQ(seen.mean.value, 4.0);
  EXPECT_DOUBLE_EQ(seen.standard_deviation.value, std::sqrt(12.5));  // 9 + 4 + 1 + 0 + 36 over 4
  // Student's 2.776 of 4 degrees of freedom
  EXPECT_NEAR(seen.mean.high - 4.0, 2.7764451051977987 * std::sqrt(12.5 / 5), 1e-12);
  EXPECT_NEAR(4.0 - seen.mean.low, 2.7764451051977987 * std::sqrt(12.5 / 5), 1e-12);
  EXPECT_EQ(seen.median.value, 3.0);
  EXPECT_DOUBLE_EQ(seen.p95.value, 4 + 0.8 * 6);  // rank 3.8 from 0
  EXPECT_DOUBLE_EQ(seen.p99.value, 4 + 0.96 * 6);
  EXPECT_EQ(seen.median.low, 1.0);  // 2^-5 > 2.5 %: no rank, the ends
  EXPECT_EQ(seen.median.high, 10.0);
}

TEST(ResponseStatistics, OfEqualValuesHaveNoSpread) {
  const ResponseStatistics seen = answers(VectorXd::Constant(9, 0.1));
  EXPECT_DOUBLE_EQ(seen.mean.value, 0.1);
  EXPECT_NEAR(seen.standard_deviation.value, 0.0, 1e-16);
  EXPECT_EQ(seen.p99.low, 0.1);
  EXPECT_EQ(seen.p99.high, 0.1);
  EXPECT_FALSE(process_capability(VectorXd::Constant(9, 0.1), 1.0));
  EXPECT_FALSE(process_capability(VectorXd::Constant(1, 0.1), 1.0));
  EXPECT_FALSE(process_capability(VectorXd(), 1.0));
}

TEST(ResponseStatistics, TwoSayLittleAndFewerAreRefused) {
  const ResponseStatistics two = answers(Vector2d(1.0, 3.0));
  EXPECT_NEAR(two.mean.high - two.mean.value, 12.706204736432095, 1e-9);
  EXPECT_GT(two.standard_deviation.high, 100.0);
  EXPECT_LT(two.standard_deviation.low, 0.01);
  EXPECT_TRUE(std::isfinite(two.standard_deviation.high));
  EXPECT_THROW(answers(Vector3d(1.0, NAN, infinity)), std::invalid_argument);
  EXPECT_THROW(answers(VectorXd()), std::invalid_argument);
  EXPECT_THROW(fraction_within_limit(VectorXd(), 0.5), std::invalid_argument);
}

TEST(ResponseStatistics, QuantilesAreType7WithRanksOfTheBinomialBand) {
  const VectorXd to_100 = VectorXd::LinSpaced(100, 1.0, 100.0);
  const ResponseStatistics seen = answers(to_100);
  EXPECT_DOUBLE_EQ(seen.median.value, 50.5);
  EXPECT_DOUBLE_EQ(seen.p95.value, 95.05);
  EXPECT_DOUBLE_EQ(seen.min, 1.0);
  EXPECT_DOUBLE_EQ(seen.max, 100.0);
  // The textbook's ranks for the median of 100: the 40th and the 61st.
  EXPECT_EQ(seen.median.low, 40.0);
  EXPECT_EQ(seen.median.high, 61.0);
  EXPECT_EQ(seen.p99.high, 100.0);  // open
}

TEST(ResponseStatistics, BandsOfSharesAreWilsons) {
  VectorXd ten = VectorXd::LinSpaced(10, 1.0, 10.0);
  const IntervalEstimate eight = fraction_within_limit(ten, 8.0);
  EXPECT_DOUBLE_EQ(eight.value, 0.8);
  EXPECT_NEAR(eight.low, 0.4901625, 1e-6);
  EXPECT_NEAR(eight.high, 0.9433178, 1e-6);
  const IntervalEstimate none = fraction_within_limit(ten, 0.5);
  EXPECT_EQ(none.value, 0.0);
  EXPECT_EQ(none.low, 0.0);
  EXPECT_NEAR(none.high, 0.2775328, 1e-6);
  const IntervalEstimate all = fraction_within_limit(ten, 10.0);
  EXPECT_EQ(all.high, 1.0);
  EXPECT_NEAR(all.low, 1 - 0.2775328, 1e-6);
  ten(3) = NAN;
  EXPECT_DOUBLE_EQ(fraction_within_limit(ten, 8.0).value, 7.0 / 9.0);
}

TEST(ResponseStatistics, CapabilityByHand) {
  EXPECT_DOUBLE_EQ(*process_capability(Vector3d(1, 2, 3), 5.0), 1.0);
  EXPECT_DOUBLE_EQ(*process_capability(Vector3d(1, 2, 3), -1.0), -1.0);
  EXPECT_DOUBLE_EQ(*process_capability(Eigen::Vector4d(1, 2, 3, NAN), 5.0), 1.0);
}

TEST(ResponseStatistics, CorrelationsByHand) {
  MatrixXd inputs(5, 5);
  inputs << 1, 2, 3, 4, 5,  //
      5, 4, 3, 2, 1,        //
      1, 2, 3, 4, 500,      // same ranks, other values
      2, 1, 4, 3, 5,        //
      0.1, 0.1, 0.1, 0.1, 0.1;
  VectorXd values(5);
  values << 1, 2, 3, 4, 5;
  const Correlations seen = correlations(inputs, values);
  EXPECT_DOUBLE_EQ(seen.linear(0), 1.0);
  EXPECT_DOUBLE_EQ(seen.linear(1), -1.0);
  EXPECT_DOUBLE_EQ(seen.linear(2), 1000.0 / std::sqrt(198010.0 * 10.0));
  EXPECT_DOUBLE_EQ(seen.rank(2), 1.0);
  EXPECT_NEAR(seen.rank(3), 0.8, 1e-15);  // 1 - 6 * 4 / 120
  EXPECT_EQ(seen.linear(4), 0.0);
  EXPECT_EQ(seen.rank(4), 0.0);
  EXPECT_EQ(correlations(inputs, VectorXd::Constant(5, 0.1)).linear.norm(), 0.0);
}

TEST(ResponseStatistics, EqualValuesShareTheirMeanRank) {
  MatrixXd inputs(1, 4);
  inputs << 1, 2, 2, 3;
  // ranks 0, 1.5, 1.5, 3 against 0, 1, 2, 3: 4.5 over sqrt(4.5 * 5)
  EXPECT_NEAR(correlations(inputs, Eigen::Vector4d(1, 5, 6, 7)).rank(0), std::sqrt(0.9), 1e-15);
}

TEST(ResponseStatistics, CorrelationsLeaveOutCasesWithoutAnAnswer) {
  MatrixXd inputs(1, 6);
  inputs << 1, 2, 99, 3, 4, NAN;
  VectorXd values(6);
  values << 1, 2, NAN, 3, 4, -7;
  EXPECT_DOUBLE_EQ(correlations(inputs, values).linear(0), 1.0);
  EXPECT_DOUBLE_EQ(correlations(inputs, values).rank(0), 1.0);
  EXPECT_THROW(correlations(inputs, values.head(5)), std::invalid_argument);
  EXPECT_EQ(correlations(inputs, VectorXd::Constant(6, NAN)).linear(0), 0.0);
}

/// Shares of samples of n whose bands hold the truth: mean, standard deviation, median, p95, and
/// share below the 90 % quantile.
Eigen::Array<double, 5, 1> coverage(const Distribution& d, int n, int samples) {
  const Moments truth = moments(d);
  const double p90 = quantile(d, 0.9);
  Eigen::Array<double, 5, 1> held = Eigen::Array<double, 5, 1>::Zero();
  for (int k = 0; k < samples; ++k) {
    const MatrixXd u = points({Sampling::Random, n, 77}, std::uint64_t(k), 1);
    const VectorXd values = quantiles(d, u.col(0));
    const ResponseStatistics seen = answers(values);
    const auto look = [&](int band, const IntervalEstimate& of, double expected) {
      EXPECT_LE(of.low, of.value);
      EXPECT_GE(of.high, of.value);
      held(band) += of.low <= expected && expected <= of.high;
    };
    look(0, seen.mean, truth.mean);
    look(1, seen.standard_deviation, truth.standard_deviation);
    look(2, seen.median, quantile(d, 0.5));
    look(3, seen.p95, quantile(d, 0.95));
    look(4, fraction_within_limit(values, p90), 0.9);
  }
  return held / samples;
}

TEST(ResponseStatistics, BandsHoldTheTruthAsOftenAsTheySay) {
  const int samples = 1000;  // one standard deviation of a count is 0.7 %
  for (const Distribution& d :
       {Distribution{Kind::Normal, 5, 1}, Distribution{Kind::Uniform, 5, 1},
        Distribution{Kind::Normal, 0, 1, 0}, Distribution{Kind::LogNormal, 1, 0.5}})
    for (const int n : {20, 100, 500, 2000}) {
      const auto held = coverage(d, n, samples);
      std::cout << "kind " << int(d.kind) << (d.low == 0.0 ? " halved" : "") << std::setw(5) << n
                << " cases: mean " << held(0) << ", standard deviation " << held(1) << ", median "
                << held(2) << ", p95 " << held(3) << ", share below " << held(4) << "\n";
      const bool skew = d.kind == Kind::LogNormal;
      EXPECT_NEAR(held(0), 0.95, 0.03);
      EXPECT_NEAR(held(1), skew ? 0.92 : 0.95, skew ? 0.06 : 0.03);
      EXPECT_GT(held(2), 0.93);  // at least 95 %, and ranks are discrete
      EXPECT_LT(held(2), 0.985);
      EXPECT_GT(held(3), n < 72 ? 0.58 : 0.93);  // 1 - 0.95^20 = 64 % where the end is open
      EXPECT_LT(held(3), 0.995);
      EXPECT_NEAR(held(4), 0.95, 0.03);
    }
}

}  // namespace
}  // namespace abbe::sim::study
