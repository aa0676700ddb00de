#include <ctime>
#include "sim/compensation/time_series.h"
#include "tests/compensation/courses.h"
#include "tests/test.h"

namespace abbe::sim::compensation {
namespace {

using testing_courses::before;
using testing_courses::course;

/// Steps, rests, jumps and ramps of all sizes; times repeat.
TimeSeries any_course(std::mt19937& random, int knots, int columns) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  TimeSeries result{VectorXd(knots), MatrixXd(knots, columns)};
  double time_s = unit(random);
  VectorXd value = VectorXd::Zero(columns);
  for (int i = 0; i < knots; ++i) {
    const double choice = unit(random);
    if (choice > -0.5) time_s += std::pow(10.0, 2.0 * unit(random) - 1.0);
    for (int j = 0; j < columns; ++j)
      if (choice < 0.6) value[j] += unit(random) * std::pow(10.0, unit(random) - 1.0);
    result.time_s[i] = time_s;
    result.value.row(i) = value.transpose();
  }
  return result;
}

/// Largest difference at any instant, by both sides of every knot: between knots of the finer
/// course both are linear.
VectorXd largest_difference(const TimeSeries& fine, const TimeSeries& coarse) {
  VectorXd most = VectorXd::Zero(fine.value.cols());
  for (Index i = 0; i < fine.time_s.size(); ++i) {
    const double t = fine.time_s[i];
    most = most.cwiseMax((value_at(fine, t) - value_at(coarse, t)).cwiseAbs());
    for (Index j = 0; j < most.size(); ++j)
      most[j] = std::max(most[j], std::abs(before(fine, t, j) - before(coarse, t, j)));
  }
  return most;
}

TEST(TimeSeries, IsLinearBetweenKnotsAndHeldOutside) {
  const TimeSeries c = course({{1.0, 2.0}, {3.0, 6.0}});
  EXPECT_EQ(value_at(c, -infinity)[0], 2.0);
  EXPECT_EQ(value_at(c, 1.0)[0], 2.0);
  EXPECT_EQ(value_at(c, 1.5)[0], 3.0);
  EXPECT_EQ(value_at(c, 3.0)[0], 6.0);
  EXPECT_EQ(value_at(c, infinity)[0], 6.0);
}

TEST(TimeSeries, AtAJumpIsWhatComesAfterIt) {
  const TimeSeries c = course({{0.0, 1.0}, {0.0, 5.0}, {1.0, 5.0}, {1.0, 7.0}, {1.0, -3.0}});
  EXPECT_EQ(value_at(c, -1e-12)[0], 1.0);
  EXPECT_EQ(value_at(c, 0.0)[0], 5.0);
  EXPECT_EQ(value_at(c, 1.0 - 1e-12)[0], 5.0);
  EXPECT_EQ(value_at(c, 1.0)[0], -3.0);
}

TEST(TimeSeries, OfOneKnotIsConstant) {
  const TimeSeries c = course({{4.0, 9.0}});
  for (const double t : {-1e300, 4.0, 1e300}) EXPECT_EQ(value_at(c, t)[0], 9.0);
}

TEST(TimeSeries, ThatIsNotValidIsRefused) {
  EXPECT_THROW(validate(TimeSeries{}, "test"), std::invalid_argument);
  EXPECT_THROW(value_at(TimeSeries{}, 0.0), std::invalid_argument);
  EXPECT_THROW(value_at(course({{0.0, 1.0}}), nan), std::invalid_argument);
  EXPECT_THROW(validate(course({{1.0, 0.0}, {0.0, 0.0}}), "test"), std::invalid_argument);
  EXPECT_THROW(validate(course({{nan, 0.0}}), "test"), std::invalid_argument);
  EXPECT_THROW(validate(course({{0.0, nan}}), "test"), std::invalid_argument);
  EXPECT_THROW(validate(course({{0.0, infinity}}), "test"), std::invalid_argument);
  TimeSeries short_of_a_row = course({{0.0, 1.0}, {1.0, 1.0}});
  short_of_a_row.value.conservativeResize(1, 1);
  EXPECT_THROW(validate(short_of_a_row, "test"), std::invalid_argument);
  EXPECT_THROW(value_at(short_of_a_row, 1.0), std::invalid_argument);
  EXPECT_NO_THROW(validate(course({{0.0, 1.0}, {0.0, 2.0}}), "test"));
}

TEST(TimeSeriesReader, SaysTheSameBitsAsValueAt) {
  SeededRandom random(20250301);
  for (int trial = 0; trial < 50; ++trial) {
    const TimeSeries c = any_course(random, 1 + trial, 2);
    std::vector<double> times(c.time_s.begin(), c.time_s.end());
    std::uniform_real_distribution<double> any(times.front() - 1.0, times.back() + 1.0);
    for (int i = 0; i < 100; ++i) times.push_back(any(random));
    std::sort(times.begin(), times.end());
    TimeSeriesReader rows(c), numbers(c);
    for (const double t : times) {
      ASSERT_EQ(rows.at(t), value_at(c, t));
      ASSERT_EQ(numbers.at(t, 1), value_at(c, t)[1]);
    }
  }
}

TEST(DecimatedMesh, StaysWithinItsToleranceAtEveryInstant) {
  SeededRandom random(20250302);
  double worst = 0.0;
  long knots = 0, kept = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const int columns = 1 + trial % 3;
    const TimeSeries fine = any_course(random, 1 + trial % 60, columns);
    VectorXd tolerance(columns);
    for (int j = 0; j < columns; ++j)
      tolerance[j] = std::pow(10.0, std::uniform_real_distribution<double>(-4.0, 1.0)(random));
    const TimeSeries coarse = thin_out(fine, tolerance);
    const VectorXd share = largest_difference(fine, coarse).cwiseQuotient(tolerance);
    worst = std::max(worst, share.maxCoeff());
    ASSERT_LE(share.maxCoeff(), 1.0 + 1e-9) << "trial " << trial;
    ASSERT_EQ(coarse.time_s[0], fine.time_s[0]);
    ASSERT_EQ(coarse.value.row(0), fine.value.row(0));
    ASSERT_EQ(coarse.time_s.tail<1>(), fine.time_s.tail<1>());
    ASSERT_EQ(coarse.value.row(coarse.value.rows() - 1), fine.value.row(fine.value.rows() - 1));
    knots += fine.time_s.size();
    kept += coarse.time_s.size();
  }
  EXPECT_GT(worst, 0.9) << "the tolerance is hardly used";
  EXPECT_LT(kept, knots * 4 / 5) << "hardly anything is left out";
  std::cout << "  largest difference " << worst << " of the tolerance; " << kept << " of " << knots
            << " knots kept\n";
}

TEST(DecimatedMesh, KeepsBothSidesOfEveryJumpLargerThanTheTolerance) {
  const TimeSeries fine = course({{0.0, 0.0},
                                  {1.0, 0.0},
                                  {1.0, 1.0},
                                  {2.0, 1.0},
                                  {2.0, 1.05},
                                  {3.0, 1.05},
                                  {3.0, 9.0},
                                  {3.0, 2.0},
                                  {4.0, 2.0}});
  const TimeSeries coarse = thin_out(fine, VectorXd::Constant(1, 0.1));
  const TimeSeries expected =
      course({{0.0, 0.0}, {1.0, 0.0}, {1.0, 1.0}, {3.0, 1.05}, {3.0, 2.0}, {4.0, 2.0}});
  EXPECT_EQ(coarse.time_s, expected.time_s);
  EXPECT_EQ(coarse.value, expected.value);
}

TEST(DecimatedMesh, LeavesTwoKnotsOfALine) {
  TimeSeries fine{VectorXd::LinSpaced(1000, 0.0, 1.0), {}};
  fine.value = 3.0 * fine.time_s;
  EXPECT_EQ(thin_out(fine, VectorXd::Constant(1, 1e-12)).time_s.size(), 2);
}

TEST(DecimatedMesh, KeepsOfASineAboutAsManyKnotsAsItsChordsNeed) {
  const double tolerance = 1e-4;
  TimeSeries fine{VectorXd::LinSpaced(100000, 0.0, 20.0), {}};
  fine.value = fine.time_s.array().sin().matrix();
  const Index kept = thin_out(fine, VectorXd::Constant(1, tolerance)).time_s.size();
  // A chord with its ends on the curve is off by h^2 |curvature| / 8.
  double chords = 0.0;
  for (Index i = 1; i < fine.time_s.size(); ++i)
    chords += (fine.time_s[i] - fine.time_s[i - 1]) *
              std::sqrt(std::abs(std::sin(fine.time_s[i])) / (8.0 * tolerance));
  std::cout << "  " << kept << " knots, chords need " << chords << "\n";
  EXPECT_LT(double(kept), 1.1 * chords + 10.0);
}

TEST(DecimatedMesh, TakesTimeLinearInTheKnots) {
  TimeSeries fine{VectorXd::LinSpaced(1000000, 0.0, 3600.0), MatrixXd(1000000, 5)};
  for (int j = 0; j < 5; ++j)
    fine.value.col(j) = ((j + 1.0) * fine.time_s.array()).sin().matrix() * 1e-2;
  const std::clock_t start = std::clock();
  const TimeSeries coarse = thin_out(fine, VectorXd::Constant(5, 1e-6));
  const double seconds = double(std::clock() - start) / CLOCKS_PER_SEC;
  std::cout << "  a million knots of five axes: " << seconds << " s, " << coarse.time_s.size()
            << " left\n";
  EXPECT_LT(seconds, 5.0);
}

TEST(DecimatedMesh, RefusesAToleranceThatIsNotAboveZero) {
  const TimeSeries c = course({{0.0, 0.0}, {1.0, 1.0}});
  for (const double bad : {0.0, -1.0, nan})
    EXPECT_THROW(thin_out(c, VectorXd::Constant(1, bad)), std::invalid_argument);
  EXPECT_THROW(thin_out(c, VectorXd::Constant(2, 1.0)), std::invalid_argument);
  EXPECT_EQ(thin_out(c, VectorXd::Constant(1, infinity)).time_s.size(), 2);
}

TEST(TimeSeriesBuilder, RefuseMoreThanMemoryShouldHold) {
  const VectorXd row = VectorXd::Zero(25'000'001);
  TimeSeriesBuilder knots(row.size());
  knots.add(0.0, row);
  EXPECT_THROW(knots.add(1.0, row), std::invalid_argument);
}

}  // namespace
}  // namespace abbe::sim::compensation
