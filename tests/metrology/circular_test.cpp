#include "errors/metrology/circular.h"

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
using Eigen::Index;

/// Two slides with known faults, read by a bar whose length is known.
struct TwoSlides {
  double R = 150.0;
  double scale_u = 0.0, scale_v = 0.0;  // relative
  double squareness = 0.0;              // rad, second axis turned away from the first
  double reversal_u = 0.0, reversal_v = 0.0;
  double lag = 0.0;
  double centre_u = 0.0, centre_v = 0.0;

  /// Radius of the true point where (R, angle) was commanded.
  double radius(double angle, double sense) const {
    double u = R * std::cos(angle), v = R * std::sin(angle);
    const double going_u = -sense * std::sin(angle), going_v = sense * std::cos(angle);
    const auto sign = [](double x) { return std::abs(x) < 1e-12 ? 0.0 : (x > 0.0 ? 1.0 : -1.0); };
    u += -lag * R * going_u + 0.5 * reversal_u * sign(going_u);
    v += 0.5 * reversal_v * sign(going_v);
    u *= 1.0 + scale_u;
    v *= 1.0 + scale_v;
    const double x = centre_u + u - v * std::sin(squareness);
    const double y = centre_v + v * std::cos(squareness);
    return std::hypot(x, y);
  }

  CircularTrace trace(double from, double to, Index n, double sense) const {
    CircularTrace t{Eigen::VectorXd::LinSpaced(n, from, to), Eigen::VectorXd(n)};
    if (sense < 0.0) t.angle.reverseInPlace();
    for (Index i = 0; i < n; ++i) t.radius[i] = radius(t.angle[i], sense);
    return t;
  }
  CircularRuns runs(double from = 0.0, double to = 2.0 * pi, Index n = 720) const {
    return {R, trace(from, to, n, 1.0), trace(from, to, n, -1.0)};
  }
};

/// What a commanded angle for a true one leaves out.
double second_order(double largest, double R) { return largest * largest / R; }

TEST(CircularResult, SquarenessMakesAFormOfRadiusTimesAngle) {
  TwoSlides m;
  m.R = 100.0;
  m.squareness = 50e-6;
  const CircularResult c = circular(m.runs());
  const double left = second_order(5.0_um, 100.0);
  EXPECT_NEAR(c.both->G_lsq, 5.0_um, left);
  EXPECT_NEAR(c.both->G_minimum_zone, 5.0_um, left);
  EXPECT_NEAR(c.both->F_max, 2.5_um, left);
  EXPECT_NEAR(c.both->F_min, -2.5_um, left);
}

TEST(CircularResult, ScaleMismatchMakesAFormOfRadiusTimesMismatch) {
  TwoSlides m;
  m.R = 100.0;
  m.scale_u = 30e-6;
  m.scale_v = -20e-6;
  const CircularResult c = circular(m.runs(0.0, 2.0 * pi, 721));
  const double left = second_order(5.0_um, 100.0);  // 0 and 360 degrees are one place
  EXPECT_NEAR(c.both->G_lsq, 5.0_um, left);
  EXPECT_NEAR(c.D, 100.0 * 5e-6, left);
  EXPECT_NEAR(c.both->F_max, 3.0_um, 2.0 * left);
  EXPECT_NEAR(c.both->F_min, -2.0_um, 2.0 * left);
}

TEST(CircularResult, ACentreSetAsideCountsOnlyIfAskedFor) {
  TwoSlides m;
  m.R = 100.0;
  m.centre_u = 20.0_um;
  m.centre_v = -10.0_um;
  const double left = 2.0 * second_order(20.0_um, 100.0);
  const CircularResult without = circular(m.runs());
  EXPECT_NEAR(without.centre.x(), 20.0_um, left);
  EXPECT_NEAR(without.both->F_max, 0.0, left);
  const CircularResult with = circular(m.runs(), {CircleCentre::Set});
  EXPECT_EQ(with.centre.norm(), 0.0);
  EXPECT_NEAR(with.both->F_max, std::hypot(20.0_um, 10.0_um), left);
  EXPECT_NEAR(with.both->F_min, -std::hypot(20.0_um, 10.0_um), left);
  EXPECT_NEAR(with.both->G_lsq, 0.0, left);
}

TEST(CircularResult, BothSensesTogetherAreAsWideAsTheWiderOrWider) {
  TwoSlides m;
  m.R = 100.0;
  m.squareness = 20e-6;
  m.lag = 30e-6;  // helps the squareness in one sense, hides it in the other
  const CircularResult c = circular(m.runs());
  const double left = second_order(5.0_um, 100.0);
  EXPECT_NEAR(c.anticlockwise->G_lsq, 1.0_um, left);
  EXPECT_NEAR(c.clockwise->G_lsq, 5.0_um, left);
  EXPECT_NEAR(c.both->G_lsq, 5.0_um, left);
  EXPECT_NEAR(c.both->G_minimum_zone, 5.0_um, left);
}

TEST(CircularCauses, AreFoundWithinSecondOrder) {
  const unsigned seed = 20250611;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  double worst = 0.0;
  for (int k = 0; k < 100; ++k) {
    TwoSlides m;
    m.scale_u = 30e-6 * unit(random);
    m.scale_v = 30e-6 * unit(random);
    m.squareness = 50e-6 * unit(random);
    m.reversal_u = 5.0_um * unit(random);
    m.reversal_v = 5.0_um * unit(random);
    m.lag = 30e-6 * unit(random);
    m.centre_u = 10.0_um * unit(random);
    m.centre_v = 10.0_um * unit(random);
    const CircularCauses c = circular_causes(m.runs());
    ASSERT_TRUE(c.undetermined.empty());
    const double second = std::pow(30.0_um, 2) / m.R * 2.0;  // mm
    const auto off = [&](double mm) {
      worst = std::max(worst, std::abs(mm));
      return std::abs(mm);
    };
    EXPECT_LE(off(m.R * (c.scale->value - (m.scale_u - m.scale_v))), second);
    EXPECT_LE(off(m.R * (c.squareness->value - m.squareness)), second);
    EXPECT_LE(off(c.reversal_u->value - m.reversal_u), second);
    EXPECT_LE(off(c.reversal_v->value - m.reversal_v), second);
    EXPECT_LE(off(m.R * (c.lag->value - m.lag)), second);
    EXPECT_LE(off(c.centre_u->value - m.centre_u), second);
    EXPECT_LE(off(c.radius->value - 0.5 * m.R * (m.scale_u + m.scale_v)), second);
    EXPECT_LE(c.residual, second);
  }
  std::cout << "causes off by at most " << worst << " mm\n";
}

TEST(CircularCauses, UncertaintiesAreThoseOfTheNoise) {
  const unsigned seed = 20250612;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 0.5_um);
  TwoSlides m;
  m.squareness = 20e-6;
  m.reversal_u = 3.0_um;
  int inside = 0, all = 0;
  for (int k = 0; k < 500; ++k) {
    CircularRuns runs = m.runs(0.0, 2.0 * pi, 90);
    for (CircularTrace* t : {&runs.anticlockwise, &runs.clockwise})
      for (double& r : t->radius) r += noise(random);
    const CircularCauses c = circular_causes(runs);
    const auto count = [&](const EstimatedValue& e, double truth) {
      inside += std::abs(e.value - truth) <= 1.9740 * e.u;  // Student, 172 degrees of freedom
      ++all;
    };
    count(*c.squareness, m.squareness);
    count(*c.reversal_u, m.reversal_u);
    count(*c.scale, 0.0);
    count(*c.lag, 0.0);
  }
  const double share = inside / double(all);
  std::cout << "95 % intervals cover " << 100.0 * share << " % of " << all << "\n";
  EXPECT_NEAR(share, 0.95, 2.576 * std::sqrt(0.95 * 0.05 / all));  // the 99 % band
}

TEST(CircularCauses, WhatAnArcCannotTellIsLeftOpenAndNamed) {
  TwoSlides m;
  m.squareness = 20e-6;
  CircularRuns one = m.runs();
  one.clockwise = {};
  const CircularCauses single = circular_causes(one);
  EXPECT_FALSE(single.squareness || single.lag);
  EXPECT_EQ(single.undetermined, (std::vector<std::string>{"squareness", "lag"}));
  EXPECT_TRUE(single.scale && single.reversal_u);
  const CircularCauses slow = circular_causes(one, {.is_lag_excluded = true});
  EXPECT_TRUE(slow.undetermined.empty());
  EXPECT_NEAR(slow.squareness->value, 20e-6, 1e-10);
  // in one quadrant and one sense a reversal is a shift of the centre
  CircularRuns quadrant = m.runs(0.1, 1.4, 100);
  quadrant.clockwise = {};
  const CircularCauses q = circular_causes(quadrant, {.is_lag_excluded = true});
  EXPECT_FALSE(q.reversal_u || q.reversal_v || q.centre_u || q.centre_v);
  EXPECT_EQ(q.undetermined.size(), 4u);
  EXPECT_NEAR(q.squareness->value, 20e-6, 1e-9);
  // both senses tell them apart
  const CircularCauses both = circular_causes(m.runs(0.1, 1.4, 100));
  EXPECT_TRUE(both.undetermined.empty());
}

TEST(CircularResult, RefusesWhatIsNoCircle) {
  const CircularRuns good = TwoSlides{}.runs(0, 2 * pi, 20);
  const auto refuses = [&](const auto& spoil) {
    CircularRuns runs = good;
    spoil(runs);
    EXPECT_THROW(circular(runs), std::invalid_argument);
    EXPECT_THROW(circular_causes(runs), std::invalid_argument);
  };
  refuses([](CircularRuns& r) { r.nominal_radius = 0.0; });
  refuses([](CircularRuns& r) { r.anticlockwise.radius[3] = -1.0; });
  refuses([](CircularRuns& r) { r.clockwise.angle.reverseInPlace(); });
  refuses([](CircularRuns& r) { r.clockwise.radius.conservativeResize(5); });
  refuses([](CircularRuns& r) { r.anticlockwise.angle[2] = std::nan(""); });
  refuses([](CircularRuns& r) { r.anticlockwise = r.clockwise = {}; });
  CircularRuns few = TwoSlides{}.runs(0, 6, 4);
  few.clockwise = {};
  EXPECT_THROW(circular_causes(few), std::invalid_argument);
  EXPECT_NO_THROW(circular(few));
}

}  // namespace
}  // namespace abbe::errors::metrology
