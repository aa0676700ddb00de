#include "sim/study/response_statistics.h"

#include <cmath>
#include <iomanip>
#include <iostream>

#include <gtest/gtest.h>

#include "kinematics/units.h"
#include "sim/study/sampling.h"

namespace abbe::sim::study {
namespace {

using Kind = Distribution::Kind;

TEST(ResponseStatistics, OfFiveByHand) {
  Eigen::VectorXd values(7);
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
  const ResponseStatistics seen = answers(Eigen::VectorXd::Constant(9, 0.1));
  EXPECT_DOUBLE_EQ(seen.mean.value, 0.1);
  EXPECT_NEAR(seen.standard_deviation.value, 0.0, 1e-16);
  EXPECT_EQ(seen.p99.low, 0.1);
  EXPECT_EQ(seen.p99.high, 0.1);
  EXPECT_FALSE(process_capability(Eigen::VectorXd::Constant(9, 0.1), 1.0));
  EXPECT_FALSE(process_capability(Eigen::VectorXd::Constant(1, 0.1), 1.0));
  EXPECT_FALSE(process_capability(Eigen::VectorXd(), 1.0));
}

TEST(ResponseStatistics, TwoSayLittleAndFewerAreRefused) {
  const ResponseStatistics two = answers(Eigen::Vector2d(1.0, 3.0));
  EXPECT_NEAR(two.mean.high - two.mean.value, 12.706204736432095, 1e-9);
  EXPECT_GT(two.standard_deviation.high, 100.0);
  EXPECT_LT(two.standard_deviation.low, 0.01);
  EXPECT_TRUE(std::isfinite(two.standard_deviation.high));
  EXPECT_THROW(answers(Eigen::Vector3d(1.0, NAN, infinity)), std::invalid_argument);
  EXPECT_THROW(answers(Eigen::VectorXd()), std::invalid_argument);
  EXPECT_THROW(fraction_within_limit(Eigen::VectorXd(), 0.5), std::invalid_argument);
}

TEST(ResponseStatistics, QuantilesAreType7WithRanksOfTheBinomialBand) {
  const Eigen::VectorXd to_100 = Eigen::VectorXd::LinSpaced(100, 1.0, 100.0);
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
  Eigen::VectorXd ten = Eigen::VectorXd::LinSpaced(10, 1.0, 10.0);
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
  EXPECT_DOUBLE_EQ(*process_capability(Eigen::Vector3d(1, 2, 3), 5.0), 1.0);
  EXPECT_DOUBLE_EQ(*process_capability(Eigen::Vector3d(1, 2, 3), -1.0), -1.0);
  EXPECT_DOUBLE_EQ(*process_capability(Eigen::Vector4d(1, 2, 3, NAN), 5.0), 1.0);
}

TEST(ResponseStatistics, CorrelationsByHand) {
  Eigen::MatrixXd inputs(5, 5);
  inputs << 1, 2, 3, 4, 5,  //
      5, 4, 3, 2, 1,        //
      1, 2, 3, 4, 500,      // same ranks, other values
      2, 1, 4, 3, 5,        //
      0.1, 0.1, 0.1, 0.1, 0.1;
  Eigen::VectorXd values(5);
  values << 1, 2, 3, 4, 5;
  const Correlations seen = correlations(inputs, values);
  EXPECT_DOUBLE_EQ(seen.linear(0), 1.0);
  EXPECT_DOUBLE_EQ(seen.linear(1), -1.0);
  EXPECT_DOUBLE_EQ(seen.linear(2), 1000.0 / std::sqrt(198010.0 * 10.0));
  EXPECT_DOUBLE_EQ(seen.rank(2), 1.0);
  EXPECT_NEAR(seen.rank(3), 0.8, 1e-15);  // 1 - 6 * 4 / 120
  EXPECT_EQ(seen.linear(4), 0.0);
  EXPECT_EQ(seen.rank(4), 0.0);
  EXPECT_EQ(correlations(inputs, Eigen::VectorXd::Constant(5, 0.1)).linear.norm(), 0.0);
}

TEST(ResponseStatistics, EqualValuesShareTheirMeanRank) {
  Eigen::MatrixXd inputs(1, 4);
  inputs << 1, 2, 2, 3;
  // ranks 0, 1.5, 1.5, 3 against 0, 1, 2, 3: 4.5 over sqrt(4.5 * 5)
  EXPECT_NEAR(correlations(inputs, Eigen::Vector4d(1, 5, 6, 7)).rank(0), std::sqrt(0.9), 1e-15);
}

TEST(ResponseStatistics, CorrelationsLeaveOutCasesWithoutAnAnswer) {
  Eigen::MatrixXd inputs(1, 6);
  inputs << 1, 2, 99, 3, 4, NAN;
  Eigen::VectorXd values(6);
  values << 1, 2, NAN, 3, 4, -7;
  EXPECT_DOUBLE_EQ(correlations(inputs, values).linear(0), 1.0);
  EXPECT_DOUBLE_EQ(correlations(inputs, values).rank(0), 1.0);
  EXPECT_THROW(correlations(inputs, values.head(5)), std::invalid_argument);
  EXPECT_EQ(correlations(inputs, Eigen::VectorXd::Constant(6, NAN)).linear(0), 0.0);
}

/// Shares of samples of n whose bands hold the truth: mean, standard deviation, median, p95, and
/// share below the 90 % quantile.
Eigen::Array<double, 5, 1> coverage(const Distribution& d, int n, int samples) {
  const Moments truth = moments(d);
  const double p90 = quantile(d, 0.9);
  Eigen::Array<double, 5, 1> held = Eigen::Array<double, 5, 1>::Zero();
  for (int k = 0; k < samples; ++k) {
    const Eigen::MatrixXd u = points({Sampling::Random, n, 77}, std::uint64_t(k), 1);
    const Eigen::VectorXd values = quantiles(d, u.col(0));
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
