#include "sim/compensation/channels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>
#include <numbers>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

#include "kinematics/units.h"
#include "tests/compensation/courses.h"
#include "tests/kinematics/nan.h"

namespace abbe::sim::compensation {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using testing_courses::before;
using testing_courses::course;
using Order = PositionLoop::Order;

double w_of(const PositionLoop& loop) { return 2.0 * std::numbers::pi * loop.bandwidth; }

PositionLoop second(double damping) { return {Order::Second, 20.0, damping}; }

/// Step response of the second order from the textbook's own three formulas.
double step_response(double w, double d, double t) {
  if (d == 1.0) return 1.0 - std::exp(-w * t) * (1.0 + w * t);
  if (d < 1.0) {
    const double r = std::sqrt(1.0 - d * d);
    return 1.0 - std::exp(-d * w * t) / r * std::sin(w * r * t + std::acos(d));
  }
  const double r = std::sqrt(d * d - 1.0), p = w * (d - r), q = w * (d + r);
  return 1.0 - (q * std::exp(-p * t) - p * std::exp(-q * t)) / (q - p);
}

/// The same loop by Runge and Kutta's fourth-order rule in small steps, at the knots of an answer.
double largest_difference_from_rk4(const TimeSeries& wanted, const PositionLoop& loop,
                                   const TimeSeries& answer) {
  const double w = w_of(loop), d = loop.damping;
  const bool is_second = loop.order == Order::Second;
  double x = wanted.value(0, 0), v = 0.0, worst = std::abs(answer.value(0, 0) - x);
  for (Index i = 1; i < answer.time_s.size(); ++i) {
    const double t0 = answer.time_s[i - 1], t1 = answer.time_s[i];
    if (t1 == t0) continue;
    // Every knot of `wanted` is one of `answer`, so the input is one line here.
    const double u0 = value_at(wanted, t0)[0], u1 = before(wanted, t1, 0);
    const auto slope = [&](double s, double y, double z) -> std::array<double, 2> {
      const double u = u0 + (u1 - u0) * s;
      if (!is_second) return {w * (u - y), 0.0};
      return {z, w * w * (u - y) - 2.0 * d * w * z};
    };
    const int steps = int(std::ceil(w * std::max(1.0, 2.0 * d) * (t1 - t0) / 0.004));
    const double h = (t1 - t0) / steps;
    for (int k = 0; k < steps; ++k) {
      const double s = double(k) / steps, half = 0.5 / steps;
      const auto a = slope(s, x, v);
      const auto b = slope(s + half, x + 0.5 * h * a[0], v + 0.5 * h * a[1]);
      const auto c = slope(s + half, x + 0.5 * h * b[0], v + 0.5 * h * b[1]);
      const auto e = slope(s + 2.0 * half, x + h * c[0], v + h * c[1]);
      x += h / 6.0 * (a[0] + 2.0 * b[0] + 2.0 * c[0] + e[0]);
      v += h / 6.0 * (a[1] + 2.0 * b[1] + 2.0 * c[1] + e[1]);
    }
    worst = std::max(worst, std::abs(answer.value(i, 0) - x));
  }
  return worst;
}

TEST(PositionLoop, AnswersAStepByTheClosedForms) {
  const TimeSeries step = course({{1.0, 0.0}, {1.0, 1.0}, {1.3, 1.0}});
  double worst = 0.0;
  for (const double d : {0.001, 0.05, 0.3, 0.7, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 1.5, 20.0, 100.0}) {
    const PositionLoop loop = second(d);
    const TimeSeries answer = loop_response(step, loop);
    ASSERT_GT(answer.time_s.size(), 50);
    for (Index i = 0; i < answer.time_s.size(); ++i) {
      const double closed = std::abs(d - 1.0) < 1e-6 ? 1.0 : d;
      const double expected = step_response(w_of(loop), closed, answer.time_s[i] - 1.0);
      worst = std::max(worst, std::abs(answer.value(i, 0) - expected));
      ASSERT_NEAR(answer.value(i, 0), expected, closed == d ? 1e-11 : 1e-8) << "damping " << d;
    }
  }
  const PositionLoop first{Order::First, 20.0, 0.7};
  const TimeSeries answer = loop_response(step, first);
  for (Index i = 0; i < answer.time_s.size(); ++i)
    ASSERT_NEAR(answer.value(i, 0), 1.0 - std::exp(-w_of(first) * (answer.time_s[i] - 1.0)), 1e-13);
  std::cout << "  largest difference from the closed forms " << worst << " of the step\n";
}

TEST(PositionLoop, FollowsARampAsLateAsItsLagSays) {
  const double slope = 0.3;
  const TimeSeries ramp = course({{0.0, 0.0}, {50.0, 50.0 * slope}, {100.0, 100.0 * slope}});
  for (const double d : {0.2, 0.7, 1.0, 3.0}) {
    const PositionLoop loop = second(d);
    const double late = 50.0 * slope - value_at(loop_response(ramp, loop), 50.0)[0];
    EXPECT_NEAR(late, slope * 2.0 * d / w_of(loop), 1e-11) << "damping " << d;
  }
  const PositionLoop first{Order::First, 20.0, 0.7};
  EXPECT_NEAR(50.0 * slope - value_at(loop_response(ramp, first), 50.0)[0], slope / w_of(first),
              1e-11);
}

TEST(PositionLoop, AgreesWithRungeAndKuttaOnAnyCourse) {
  const unsigned seed = 20250303;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  double worst = 0.0;
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<testing_courses::Knot> knots;
    double t = 0.0, x = 0.0;
    for (int i = 0; i < 8; ++i) {
      // lengths from far below to far above the time constant, jumps, rests
      if (unit(random) > -0.3) t += std::pow(10.0, 3.0 * unit(random) - 3.0);
      if (unit(random) > -0.3) x += unit(random);
      knots.push_back({t, x});
    }
    PositionLoop loop{trial % 5 == 0 ? Order::First : Order::Second, 5.0 + 10.0 * (trial % 7),
                      std::pow(10.0, unit(random))};
    if (trial % 11 == 0) loop.damping = 1.0;
    const TimeSeries wanted = course(knots);
    const double difference =
        largest_difference_from_rk4(wanted, loop, loop_response(wanted, loop));
    worst = std::max(worst, difference);
    ASSERT_LT(difference, 1e-8) << "trial " << trial << ", damping " << loop.damping;
  }
  std::cout << "  largest difference from Runge and Kutta " << worst << "\n";
}

TEST(PositionLoop, HasAKnotAtEveryInstantOfItsCourseAndEndsSettled) {
  const TimeSeries wanted =
      course({{0.0, 0.0}, {1e-9, 1e-3}, {0.5, 1e-3}, {0.5, 2e-3}, {2.0, -1e-3}});
  for (const double d : {0.1, 1.0, 30.0}) {
    const TimeSeries answer = loop_response(wanted, second(d));
    for (const double t : wanted.time_s)
      EXPECT_NE(std::find(answer.time_s.begin(), answer.time_s.end(), t), answer.time_s.end());
    EXPECT_NEAR(answer.value(answer.value.rows() - 1, 0), -1e-3, 1e-8) << "damping " << d;
  }
}

TEST(PositionLoop, IsOffBetweenItsKnotsByNoMoreThanItSays) {
  const double step = 1e-2;
  const TimeSeries wanted = course({{0.0, 0.0}, {0.0, step}});
  for (const int per_constant : {4, 8, 32}) {
    double worst = 0.0;
    for (const double d : {0.1, 0.4, 0.7, 1.0}) {
      const PositionLoop loop = second(d);
      const TimeSeries answer = loop_response(wanted, loop, {per_constant, 1e-8});
      for (double t = 0.0; t < 0.3; t += 1e-5)
        worst = std::max(worst,
                         std::abs(value_at(answer, t)[0] - step * step_response(w_of(loop), d, t)));
    }
    std::cout << "  " << per_constant << " knots a constant: off by " << 100.0 * worst / step
              << " % of the step\n";
    EXPECT_LT(worst, step / (3.0 * per_constant * per_constant) + 2e-8);
  }
}

TEST(PositionLoop, CreepsOverdampedWithoutAHostOfKnots) {
  const TimeSeries answer = loop_response(course({{0.0, 0.0}, {0.0, 1.0}}), second(100.0));
  EXPECT_LT(answer.time_s.size(), 500);
  EXPECT_NEAR(answer.value(answer.value.rows() - 1, 0), 1.0, 1e-8);
}

TEST(PositionLoop, WithoutOrderFollowsAtOnce) {
  const TimeSeries wanted = course({{0.0, 0.0}, {0.0, 1.0}, {1.0, 3.0}});
  const TimeSeries answer = loop_response(wanted, {});
  EXPECT_EQ(answer.time_s, wanted.time_s);
  EXPECT_EQ(answer.value, wanted.value);
}

TEST(PositionLoop, StaysPutOnAConstantCourse) {
  for (const TimeSeries& wanted : {course({{5.0, 0.25}}), course({{5.0, 0.25}, {5.0, 0.25}})}) {
    const TimeSeries answer = loop_response(wanted, second(0.7));
    EXPECT_EQ(answer.time_s.size(), 1);
    EXPECT_EQ(value_at(answer, 9.0)[0], 0.25);
  }
}

TEST(PositionLoop, RefusesWhatItCannotBe) {
  const TimeSeries step = course({{0.0, 0.0}, {0.0, 1.0}});
  for (const double bad : {0.0, -1.0, nan, infinity})
    EXPECT_THROW(loop_response(step, {Order::First, bad, 0.7}), std::invalid_argument);
  for (const double bad : {0.0, -1.0, 0.999e-3, 100.1, nan, infinity})
    EXPECT_THROW(loop_response(step, second(bad)), std::invalid_argument);
  EXPECT_THROW(loop_response(step, second(0.7), {0, 1e-8}), std::invalid_argument);
  EXPECT_THROW(loop_response(step, second(0.7), {8, 0.0}), std::invalid_argument);
  EXPECT_THROW(loop_response(course({{0.0, nan}}), second(0.7)), std::invalid_argument);
}

TEST(PositionLoop, TakesTimesAtTheEdgeOfWhatNumbersTellApart) {
  const TimeSeries answer =
      loop_response(course({{1e9, 0.0}, {1e9, 1.0}}), {Order::First, 1e9, 0.7});
  EXPECT_NEAR(answer.value(answer.value.rows() - 1, 0), 1.0, 1e-8);
  EXPECT_LT(answer.time_s.size(), 1000);
  const TimeSeries steep =
      loop_response(course({{0.0, 0.0}, {5e-324, 1.0}, {1.0, 1.0}}), second(0.7));
  EXPECT_TRUE(steep.value.allFinite());
  EXPECT_NEAR(value_at(steep, 1.0)[0], 1.0, 1e-8);
}

}  // namespace
}  // namespace abbe::sim::compensation
