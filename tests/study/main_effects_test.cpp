#include "sim/study/response_statistics.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "sim/study/farm.h"
#include "sim/study/sampling.h"

namespace abbe::sim::study {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd normal_inputs(Index inputs, Index cases, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  return MatrixXd::NullaryExpr(inputs, cases, [&] { return normal(random); });
}

TEST(MainEffects, SeeWhatIsEvenInItsInputsWhereCorrelationsDoNot) {
  // y = 3 x0^2 + x1^2: variances 18 and 2, so 90 and 10 %
  const MatrixXd x = normal_inputs(4, 4000, 11);
  const VectorXd y = 3.0 * x.row(0).array().square() + x.row(1).array().square();
  const VectorXd effects = main_effects(x, y);
  EXPECT_NEAR(effects[0], 0.9, 0.03);
  EXPECT_NEAR(effects[1], 0.1, 0.03);
  EXPECT_LT(effects[2], main_effect_chance_limit(4000, 4));
  const double correlation = (x.row(0).array() * (y.array() - y.mean()).transpose()).mean() /
                             std::sqrt((y.array() - y.mean()).square().mean());
  EXPECT_LT(std::abs(correlation), 0.1) << "a correlation says that it makes 1 % at most";
}

TEST(MainEffects, AreTheFirstOrderIndicesOfAQuadraticForm) {
  // the mean square of a map: y = (2 x0 + x1)^2 + x2, with an interaction 4 x0 x1
  const auto f = [](const auto& x) { return std::pow(2.0 * x[0] + x[1], 2) + x[2]; };
  const MatrixXd x = normal_inputs(3, 200000, 3);
  VectorXd y(x.cols());
  for (Index i = 0; i < y.size(); ++i) y[i] = f(x.col(i));
  const VectorXd effects = main_effects(x, y);
  // by hand: 4 x0^2 (32), x1^2 (2), 4 x0 x1 (16), x2 (1) of 51
  EXPECT_NEAR(effects[0], 32.0 / 51.0, 0.01);
  EXPECT_NEAR(effects[1], 2.0 / 51.0, 0.01);
  EXPECT_NEAR(effects[2], 1.0 / 51.0, 0.01);
  EXPECT_NEAR(effects.sum(), 35.0 / 51.0, 0.02) << "the rest is their interaction";
}

TEST(MainEffects, OfNothingAreZeroOnTheAverageAndBeyondChanceInOneStudyOfTwenty) {
  int beyond = 0;
  double sum = 0.0;
  constexpr int studies = 1000, inputs = 20, cases = 200;
  for (int k = 0; k < studies; ++k) {
    const MatrixXd x = normal_inputs(inputs + 1, cases, unsigned(1000 + k));
    const VectorXd effects = main_effects(x.topRows(inputs), x.row(inputs).transpose());
    beyond += effects.maxCoeff() > main_effect_chance_limit(cases, inputs);
    sum += effects.mean() / studies;
  }
  // 50 are expected, with a standard deviation of 7
  EXPECT_GT(beyond, 25);
  EXPECT_LT(beyond, 80);
  EXPECT_LT(sum, 0.01);
}

TEST(MainEffects, OfFewCasesOrWithoutVariationAreZero) {
  const MatrixXd x = normal_inputs(2, 9, 1);
  EXPECT_EQ(main_effects(x, x.row(0).transpose()), Eigen::Vector2d(0, 0));
  EXPECT_EQ(main_effect_chance_limit(9, 2), 1.0);
  MatrixXd many = normal_inputs(2, 50, 1);
  EXPECT_EQ(main_effects(many, VectorXd::Constant(50, 3.0)), Eigen::Vector2d(0, 0));
  many.row(1).setConstant(2.0);
  const VectorXd effects = main_effects(many, many.row(0).transpose());
  EXPECT_NEAR(effects[0], 1.0, 1e-12);
  EXPECT_EQ(effects[1], 0.0);
  // of two values there is no parabola, and no unit is too small
  for (Index i = 0; i < 50; ++i) many(0, i) = i % 2 ? 1e-150 : -1e-150;
  EXPECT_NEAR(main_effects(many, many.row(0).transpose() * 1e150)[0], 1.0, 1e-12);
}

}  // namespace
}  // namespace abbe::sim::study
