#include "errors/identification/sensor_choice.h"

#include <iostream>
#include <random>

#include <gtest/gtest.h>

#include "tests/errors/numbers.h"

namespace {

using namespace abbe::errors::identification;
using abbe::errors::numbers;
using Eigen::MatrixXd;
using Eigen::VectorXd;

GreyOptions grey_options(GreyKind kind, Image image = Image::Initial) {
  GreyOptions options;
  options.kind = kind;
  options.image = image;
  return options;
}

/// The output of an economy and of its three sectors, six years: a published worked example.
MatrixXd economy() {
  MatrixXd data(6, 4);
  data << 1988, 386, 839, 763, 2061, 408, 846, 808, 2335, 422, 960, 953, 2750, 482, 1258, 1010,
      3356, 511, 1577, 1268, 3806, 561, 1893, 1352;
  return data;
}

}  // namespace

TEST(Grey, DengOfTheWorkedExampleIsWhatWasPublished) {
  const MatrixXd data = economy();
  const GreyDegrees degrees =
      grey_degrees(data.col(0), data.rightCols(3), grey_options(GreyKind::Deng, Image::Mean));
  ASSERT_EQ(degrees.status, GreyStatus::Ok);
  const VectorXd published = numbers({0.5084, 0.6243, 0.7573});
  EXPECT_LT((degrees.degree - published).cwiseAbs().maxCoeff(), 0.5e-4) << degrees.degree;
}

TEST(Grey, DengAgreesWithWholeFractions) {
  const MatrixXd data = economy();
  // in whole fractions, rounded once
  const VectorXd mean = numbers({0.5084324125959361, 0.6242958335060429, 0.7572996249999108});
  const VectorXd initial = numbers({0.6684738902446069, 0.7313950723612371, 0.8296948136967913});
  for (const auto& [expected, image] : {std::pair(mean, Image::Mean), {initial, Image::Initial}}) {
    const GreyDegrees degrees =
        grey_degrees(data.col(0), data.rightCols(3), grey_options(GreyKind::Deng, image));
    const double off = (degrees.degree - expected).cwiseAbs().maxCoeff();
    std::cout << "worst degree off by " << off << '\n';
    EXPECT_LT(off, 1e-15);
  }
}

TEST(Grey, LiusDegreesTakeAreasAndNotFirstDifferences) {
  const VectorXd x1 = numbers({30.5, 34.7, 35.9, 38.2, 41});
  const VectorXd x2 = numbers({22.1, 25.4, 27.1, 28.3, 31.5});
  const auto degree = [&](GreyKind kind) {
    return grey_degrees(x1, x2, grey_options(kind)).degree(0);
  };
  // By hand: areas from the start 4.2 + 5.4 + 7.7 + 10.5 / 2 = 22.55 and 3.3 + 5 + 6.2 + 9.4 / 2 =
  // 19.2, so (1 + 41.75) / (1 + 41.75 + 3.35).
  EXPECT_NEAR(degree(GreyKind::Absolute), 42.75 / 46.1, 1e-14);
  EXPECT_NEAR(degree(GreyKind::Absolute), 0.927332, 0.5e-6);
  EXPECT_NEAR(degree(GreyKind::Relative), 0.952719, 0.5e-6);
  EXPECT_NEAR(degree(GreyKind::Comprehensive), 0.940026, 0.5e-6);
  GreyOptions options = grey_options(GreyKind::Comprehensive);
  options.theta = 0.25;
  EXPECT_NEAR(grey_degrees(x1, x2, options).degree(0),
              0.25 * degree(GreyKind::Absolute) + 0.75 * degree(GreyKind::Relative), 1e-15);
}

TEST(Grey, ASeriesWithoutAnImageIsNamed) {
  MatrixXd series(3, 2);
  series << 1, 0, 2, 1, 3, -1;
  const VectorXd reference = numbers({1, 2, 4});
  const GreyDegrees start = grey_degrees(reference, series, grey_options(GreyKind::Deng));
  EXPECT_EQ(start.status, GreyStatus::StartsAtZero);
  EXPECT_EQ(start.series, 1);
  EXPECT_EQ(start.degree.size(), 0);
  EXPECT_EQ(grey_degrees(reference, series, grey_options(GreyKind::Relative)).series, 1);
  EXPECT_EQ(grey_degrees(reference, series, grey_options(GreyKind::Absolute)).status,
            GreyStatus::Ok);
  const GreyDegrees mean =
      grey_degrees(reference, series, grey_options(GreyKind::Deng, Image::Mean));
  EXPECT_EQ(mean.status, GreyStatus::MeanIsZero);
  EXPECT_EQ(mean.series, 1);
  const GreyDegrees error =
      grey_degrees(numbers({0, 1, 2}), series.leftCols(1), grey_options(GreyKind::Deng));
  EXPECT_EQ(error.status, GreyStatus::StartsAtZero);
  EXPECT_EQ(error.series, -1) << "the reference";
  const GreyDegrees still =
      grey_degrees(numbers({5, 5, 5}), series, grey_options(GreyKind::Deng, Image::Interval));
  EXPECT_EQ(still.status, GreyStatus::ConstantSeries);
  EXPECT_EQ(still.series, -1);
  EXPECT_EQ(mutual_degrees(series, grey_options(GreyKind::Deng)).series, 1);
}

TEST(Grey, SeriesLikeTheReferenceHaveDegreeOne) {
  const VectorXd x = numbers({1, 2, 5});
  MatrixXd twins(3, 2);
  twins << x, 3 * x;
  for (const Image image : {Image::Initial, Image::Mean, Image::Interval}) {
    const GreyDegrees degrees = grey_degrees(x, twins, grey_options(GreyKind::Deng, image));
    EXPECT_NEAR(degrees.degree.minCoeff(), 1, 1e-12);
  }
  const GreyDegrees same =
      grey_degrees(x, twins.leftCols(1), grey_options(GreyKind::Deng, Image::None));
  EXPECT_EQ(same.degree(0), 1);
}

TEST(Grey, DengIsTheDefinitionTermByTerm) {
  const unsigned seed = 20240708;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(10, 40);
  for (int repeat = 0; repeat < 100; ++repeat) {
    const MatrixXd x = MatrixXd::NullaryExpr(12, 5, [&] { return any(random); });
    GreyOptions options;
    options.rho = 0.3;
    double least = 1e9, most = 0;
    const auto delta = [&](int i, int k) {
      return std::abs(x(k, 0) / x(0, 0) - x(k, i) / x(0, i));
    };
    for (int i = 1; i < 5; ++i)
      for (int k = 0; k < 12; ++k) {
        least = std::min(least, delta(i, k));
        most = std::max(most, delta(i, k));
      }
    const GreyDegrees degrees = grey_degrees(x.col(0), x.rightCols(4), options);
    for (int i = 1; i < 5; ++i) {
      double sum = 0;
      for (int k = 0; k < 12; ++k) sum += (least + 0.3 * most) / (delta(i, k) + 0.3 * most);
      EXPECT_NEAR(degrees.degree(i - 1), sum / 12, 1e-14);
    }
  }
}

TEST(Grey, TheMutualMatrixIsSymmetricWithOnesOnItsDiagonal) {
  const MatrixXd data = economy();
  for (const GreyKind kind :
       {GreyKind::Deng, GreyKind::Absolute, GreyKind::Relative, GreyKind::Comprehensive}) {
    const MutualDegrees mutual = mutual_degrees(data, grey_options(kind));
    ASSERT_EQ(mutual.status, GreyStatus::Ok);
    EXPECT_EQ(mutual.degree, mutual.degree.transpose());
    EXPECT_EQ(mutual.degree.diagonal(), VectorXd::Ones(4));
    EXPECT_GT(mutual.degree.minCoeff(), 0);
    EXPECT_LE(mutual.degree.maxCoeff(), 1);
  }
  const MutualDegrees liu_degree = mutual_degrees(data, grey_options(GreyKind::Absolute));
  EXPECT_EQ(liu_degree.degree.col(0).tail(3),
            grey_degrees(data.col(0), data.rightCols(3), grey_options(GreyKind::Absolute)).degree);
}

TEST(Grey, RefusesWhatHasNoMeaning) {
  const VectorXd x = numbers({1, 2, 3});
  EXPECT_THROW((void)grey_degrees(x, MatrixXd::Ones(2, 1)), std::invalid_argument);
  EXPECT_THROW((void)grey_degrees(x.head(1), MatrixXd::Ones(1, 1)), std::invalid_argument);
  EXPECT_THROW((void)grey_degrees(x, MatrixXd(3, 0)), std::invalid_argument);
  EXPECT_THROW((void)grey_degrees(numbers({1, NAN, 3}), x), std::invalid_argument);
  GreyOptions options;
  options.rho = 0;
  EXPECT_THROW((void)grey_degrees(x, x, options), std::invalid_argument);
}
