#include "errors/metrology/circular.h"
#include "errors/metrology/form.h"
#include "errors/metrology/plans.h"
#include "tests/metrology/machines.h"
#include "tests/test.h"

namespace abbe::errors::metrology {
namespace {

using Eigen::MatrixX2d;

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
    CircularTrace t{VectorXd::LinSpaced(n, from, to), VectorXd(n)};
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
  SeededRandom random(20250611);
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
  SeededRandom random(20250612);
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

// A path that closes counts once: every evaluation of a circle against closed forms and against
// brute force, for 3 to 200 places, with the first place read again at the end and without.

/// Angles of n places around a circle, the first of them read again at the end if wanted.
VectorXd around(Index n, bool again, double start = 0.0) {
  VectorXd angle(n + (again ? 1 : 0));
  for (Index i = 0; i < angle.size(); ++i) angle[i] = start + 2.0 * pi * double(i) / double(n);
  return angle;
}

template <typename Radius>
CircularTrace trace(VectorXd angle, double sense, const Radius& radius) {
  if (sense < 0.0) angle.reverseInPlace();
  CircularTrace t{angle, VectorXd(angle.size())};
  for (Index i = 0; i < angle.size(); ++i) t.radius[i] = radius(angle[i]);
  return t;
}

template <typename Radius>
CircularRuns circular_runs(double R, const VectorXd& angle, const Radius& radius) {
  return {R, trace(angle, 1.0, radius), trace(angle, -1.0, radius)};
}

constexpr double R = 100.0;
constexpr double mismatch = 50e-6;

/// Scales that differ by 50 um/m: r = R + 5 um cos^2, first order.
double ellipse(double angle) { return R * (1.0 + mismatch * std::pow(std::cos(angle), 2)); }

// ---- the shares themselves

TEST(Shares, OfEvenPlacesAreAlikeWhateverIsReadAgain) {
  for (const double start : {0.0, 1e-12, -1e-12, 0.5 * pi, -pi, 1.234, 1e3})
    for (Index n = 3; n <= 200; ++n) {
      const VectorXd once = arc_weights(around(n, false, start));
      ASSERT_LT((once.array() - 2.0 * pi / double(n)).abs().maxCoeff(), 1e-9) << n;
      const VectorXd again = arc_weights(around(n, true, start));
      ASSERT_NEAR(again.sum(), 2.0 * pi, 1e-9) << n;
      ASSERT_NEAR(again[0] + again[n], once[0], 1e-9) << n;
      ASSERT_LT((again.segment(1, n - 1) - once.tail(n - 1)).cwiseAbs().maxCoeff(), 1e-9) << n;
      ASSERT_TRUE(is_full_turn(around(n, true, start))) << n;
      ASSERT_TRUE(is_full_turn(around(n, false, start))) << n;
    }
}

TEST(Shares, OfSeveralTurnsAndOfOverlapsAddUpToOneTurn) {
  VectorXd turns(3 * 24 + 1);
  for (Index i = 0; i < turns.size(); ++i) turns[i] = 2.0 * pi * double(i) / 24.0;
  EXPECT_NEAR(arc_weights(turns).sum(), 2.0 * pi, 1e-9);
  EXPECT_NEAR(arc_weights(turns)[5], 2.0 * pi / 72.0, 1e-9) << "each place was read three times";
  const VectorXd over = VectorXd::LinSpaced(59, 0.0, 400.0_deg);  // other places the second time
  EXPECT_NEAR(arc_weights(over).sum(), 2.0 * pi, 1e-9);
  const double within = arc_weights(over).head(5).sum() + arc_weights(over).tail(5).sum();
  EXPECT_NEAR(within, 40.0_deg, 8.0_deg) << "of ten readings over the same 40 degrees";
}

TEST(Shares, OfAnArcAreAlikeAndItDoesNotGoRound) {
  for (const double degrees : {10.0, 90.0, 180.0, 220.0, 330.0}) {
    const VectorXd arc = VectorXd::LinSpaced(31, 0.3, 0.3 + degrees * units::deg);
    const VectorXd share = arc_weights(arc);
    EXPECT_LT(share.maxCoeff() / share.minCoeff() - 1.0, 1e-9) << degrees;
    EXPECT_FALSE(is_full_turn(arc)) << degrees;
  }
  const VectorXd half = VectorXd::LinSpaced(3, 0.0, pi);
  EXPECT_FALSE(is_full_turn(half));
  EXPECT_LT((arc_weights(half).array() - 0.5 * pi).abs().maxCoeff(), 1e-12);
  EXPECT_FALSE(is_full_turn(VectorXd::Zero(4)));
  EXPECT_TRUE(arc_weights(VectorXd::Zero(4)).allFinite());
}

TEST(Shares, OfPlacesCountEachOnce) {
  Eigen::MatrixX3d places(7, 3);
  places << 1, 2, 3, 4, 5, 6, 1, 2, 3 + 1e-10, -0.0, 0, 0, 0.0, 0, 0, 1, 2, 3, 7, 8, 9;
  const VectorXd share = position_weights(places, 1e-9);
  const VectorXd by_hand = (VectorXd(7) << 1.0 / 3, 1, 1.0 / 3, 0.5, 0.5, 1.0 / 3, 1).finished();
  EXPECT_LT((share - by_hand).cwiseAbs().maxCoeff(), 1e-12) << share.transpose();
}

// ---- circles

// The centre and mean radius of small radial deviations over n even places are the harmonics of
// order 1 and 0 of their discrete Fourier series.
TEST(ClosedCircle, IsThatOfItsFourierSeriesForEveryNumberOfPlaces) {
  SeededRandom random(20261125);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  double worst = 0.0;
  for (Index n = 3; n <= 200; ++n)
    for (const bool again : {false, true}) {
      VectorXd deviation(n + 1);
      for (Index i = 0; i < n; ++i) deviation[i] = 1.0_nm * unit(random);  // second order: 1e-14
      deviation[n] = deviation[0];
      const VectorXd angle = around(n, again);
      MatrixX2d p(angle.size(), 2);
      Vector2d centre = Vector2d::Zero();
      double radius = 0.0;
      for (Index i = 0; i < angle.size(); ++i) {
        const Vector2d ray(std::cos(angle[i]), std::sin(angle[i]));
        p.row(i) = (R + deviation[i]) * ray.transpose();
        if (i == n) continue;
        centre += 2.0 / double(n) * deviation[i] * ray;
        radius += deviation[i] / double(n);
      }
      const LeastSquaresCircle c = least_squares_circle(p, arc_weights(angle));
      worst = std::max({worst, (c.centre - centre).norm(), std::abs(c.radius - R - radius)});
    }
  std::cout << "centre and radius off by at most " << worst << " mm\n";
  EXPECT_LT(worst, 2e-12);
}

/// Sum of squares from the best circle of the places, each once, to check that no other is better.
double misfit(const MatrixX2d& places, const Vector2d& centre) {
  const VectorXd d = (places.rowwise() - centre.transpose()).rowwise().norm();
  return (d.array() - d.mean()).square().sum();
}

TEST(ClosedCircle, NoOtherCentreIsBetterForPlacesThatCountOnce) {
  SeededRandom random(20261126);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (const Index n : {3, 4, 5, 7, 12, 36, 72, 200}) {
    MatrixX2d p(n + 1, 2);
    const VectorXd angle = around(n, true);
    for (Index i = 0; i < n; ++i) {
      const double r = 50.0 + 0.01 * unit(random);
      p.row(i) << r * std::cos(angle[i]), r * std::sin(angle[i]);
    }
    p.row(n) = p.row(0);
    const Vector2d centre = least_squares_circle(p, arc_weights(angle)).centre;
    const double best = misfit(p.topRows(n), centre);
    for (int k = 0; k < 200; ++k) {
      const double step = std::pow(10.0, -2.0 - 4.0 * std::abs(unit(random)));
      const Vector2d there = centre + step * Vector2d(unit(random), unit(random));
      ASSERT_GE(misfit(p.topRows(n), there), best * (1.0 - 1e-12) - 1e-24) << n;
    }
  }
}

TEST(ClosedCircle, FiguresAreTheClosedFormsOfAnEllipseForEveryNumberOfPlaces) {
  double worst_centre = 0.0, worst_G = 0.0;
  for (Index n = 3; n <= 200; ++n)
    for (const bool again : {false, true}) {
      const VectorXd angle = around(n, again);
      const CircularResult c = circular(circular_runs(R, angle, ellipse));
      // 5 um cos^2 = 2.5 um + 2.5 um cos 2a: no first order but for n = 3, where cos 2a is cos a
      const double most = R * mismatch;
      double low = 1.0, high = 0.0;
      for (Index i = 0; i < n; ++i) {
        low = std::min(low, std::pow(std::cos(angle[i]), 2));
        high = std::max(high, std::pow(std::cos(angle[i]), 2));
      }
      const double left = 2.0 * most * most / R + 1e-12;
      if (n == 3) {
        EXPECT_NEAR(c.both->G_lsq, 0.0, 1e-12) << "three points are always a circle";
        continue;
      }
      worst_centre = std::max(worst_centre, c.circle.centre.norm());
      worst_G = std::max(worst_G, std::abs(c.both->G_lsq - most * (high - low)));
      EXPECT_NEAR(c.circle.radius, R + 0.5 * most, left) << n;
      EXPECT_NEAR(c.D, 0.5 * most, left) << n;
      EXPECT_NEAR(c.both->F_max, most * high, left) << n;
      EXPECT_NEAR(c.both->F_min, most * low, left) << n;
      EXPECT_NEAR(c.anticlockwise->G_lsq, most * (high - low), left) << n;
      EXPECT_LE(c.both->G_minimum_zone, c.both->G_lsq + 1e-12) << n;
      EXPECT_NEAR(*c.H, 0.0, 1e-12) << n;
      EXPECT_EQ(c.centre_kind, CircleCentre::LeastSquares);
    }
  std::cout << "ellipse of 5 um: centre off by " << worst_centre << " mm, G by " << worst_G
            << " mm\n";
  const double second_order = 2.0 * std::pow(R * mismatch, 2) / R;
  EXPECT_LT(worst_centre, second_order);
  EXPECT_LT(worst_G, second_order);
}

TEST(ClosedCircle, SeventyTwoTargetsThatEndWhereTheyBeganGiveFiveMicrometres) {
  // as a bar of abbe 0.1.0 read them: 0 and 360 degrees are two of the 72
  const CircularResult c =
      circular(circular_runs(R, VectorXd::LinSpaced(72, 0.0, 2.0 * pi), ellipse));
  std::cout << "G " << c.both->G_lsq * 1e3 << " um\n";
  // 71 places, of which the nearest to 90 degrees is a quarter of a step away; 5.0538 um where 0
  // degrees counts twice
  EXPECT_NEAR(c.both->G_lsq, 5.0_um * std::pow(std::cos(2.0 * pi / 284.0), 2), 0.5_nm);
  EXPECT_LT(c.circle.centre.norm(), 0.5_nm);
}

// F from ISO 230-4 by its words: from the centring of the instrument, or of the least-squares
// circle for a full circle; H the largest radial difference of the two paths.
TEST(ClosedCircle, FAndHAreThoseOfTwoPathsApartAndAskew) {
  const double e = 3.0_um, lag = 1.0_um, gap = 0.5_um;
  for (const Index n : {4, 5, 6, 7, 12, 36, 37, 72, 100, 200})
    for (const bool again : {false, true}) {
      const VectorXd angle = around(n, again);
      CircularRuns two;
      two.nominal_radius = R;
      // the centre set aside, an ellipse at 45 degrees that both have, and a gap between them
      two.anticlockwise = trace(angle, 1.0, [&](double a) {
        return R + e * std::cos(a) + lag * std::sin(2.0 * a) + 0.5 * gap;
      });
      two.clockwise = trace(angle, -1.0, [&](double a) {
        return R + e * std::cos(a) - lag * std::sin(2.0 * a) - 0.5 * gap;
      });
      double form_low = 1.0, form_high = -1.0, H = 0.0;
      for (Index i = 0; i < n; ++i) {
        const double s = std::sin(2.0 * angle[i]);
        form_high = std::max({form_high, lag * s + 0.5 * gap, -lag * s - 0.5 * gap});
        form_low = std::min({form_low, lag * s + 0.5 * gap, -lag * s - 0.5 * gap});
        H = std::max(H, std::abs(2.0 * lag * s + gap));
      }
      const double left = 4.0 * e * e / R + 1e-12;
      const CircularResult c = circular(two);
      EXPECT_NEAR(*c.H, H, left) << n;
      EXPECT_NEAR(c.both->F_max, form_high, left) << n;
      EXPECT_NEAR(c.both->F_min, form_low, left) << n;
      EXPECT_NEAR(c.both->G_lsq, form_high - form_low, left) << n;
      EXPECT_NEAR(c.D, 0.0, left) << n;
      EXPECT_NEAR(c.circle.centre.x(), e, left) << n;
      const CircularResult set = circular(two, {CircleCentre::Set});
      EXPECT_EQ(set.both->F_max,
                std::max(two.anticlockwise.radius.maxCoeff(), two.clockwise.radius.maxCoeff()) - R);
    }
}

TEST(ClosedCircle, HOfSensesReadAtOtherAnglesGoesOnStraightBetweenThem) {
  CircularRuns two;
  two.nominal_radius = R;
  const auto radius = [](double a) { return R + 2.0_um * std::sin(a); };
  two.anticlockwise = trace(around(360, false), 1.0, radius);
  two.clockwise = trace(around(240, true, 0.3 * units::deg), -1.0,
                        [&](double a) { return radius(a) + 1.0_um; });
  const CircularResult c = circular(two);
  const double between = 2.0_um * std::pow(1.5 * units::deg, 2) / 8.0;
  EXPECT_NEAR(*c.H, 1.0_um, between + 1e-9);
  // arcs that have nothing in common have no hysteresis; those that overlap have, where they do
  CircularRuns arcs;
  arcs.nominal_radius = R;
  arcs.anticlockwise = trace(VectorXd::LinSpaced(20, 0.0, 1.0), 1.0, radius);
  arcs.clockwise = trace(VectorXd::LinSpaced(20, 2.0 - 2.0 * pi, 3.0 - 2.0 * pi), -1.0, radius);
  EXPECT_FALSE(circular(arcs).H);
  arcs.clockwise = trace(VectorXd::LinSpaced(20, 0.5 - 2.0 * pi, 1.5 - 2.0 * pi), -1.0,
                         [&](double a) { return radius(a) - 0.7_um; });
  EXPECT_NEAR(*circular(arcs).H, 0.7_um, 2e-6);
  EXPECT_EQ(circular(arcs).centre_kind, CircleCentre::Set) << "an arc has no centre of its own";
  EXPECT_EQ(circular(arcs).centre.norm(), 0.0);
}

TEST(ClosedCircle, CausesAreTheSameWithTheFirstPlaceReadAgain) {
  // a form that no cause explains, which a place counted twice would pull into the causes
  const auto radius = [](double a) {
    return ellipse(a) + 2.0_um * std::cos(3.0 * a) + 1.0_um * std::cos(4.0 * a) +
           3.0_um * std::cos(a);
  };
  for (Index n = 9; n <= 200; ++n) {
    const CircularCauses once = circular_causes(circular_runs(R, around(n, false), radius));
    const CircularCauses again = circular_causes(circular_runs(R, around(n, true), radius));
    ASSERT_EQ(once.undetermined, again.undetermined) << n;
    const auto same = [&](const std::optional<EstimatedValue>& a,
                          const std::optional<EstimatedValue>& b) {
      ASSERT_EQ(a.has_value(), b.has_value()) << n;
      if (a) {
        ASSERT_NEAR(a->value, b->value, 1e-12 * R) << n;
      }
    };
    same(once.scale, again.scale);
    same(once.squareness, again.squareness);
    same(once.radius, again.radius);
    same(once.centre_u, again.centre_u);
    same(once.reversal_u, again.reversal_u);
    EXPECT_NEAR(again.residual / once.residual, 1.0, 2.0 / double(n)) << n;
  }
}

TEST(ClosedCircle, PlacesCountAndNotReadings) {
  EXPECT_EQ(position_count(circular_runs(R, around(4, true), ellipse)), 8);
  EXPECT_THROW(circular_causes(circular_runs(R, around(4, true), ellipse)), std::invalid_argument)
      << "ten readings at eight places do not tell eight causes";
  EXPECT_NO_THROW(circular(circular_runs(R, around(3, true), ellipse)));
}

// ---- plans

/// Different places of the tool in the workpiece in the first circle of a plan.
int places_of(const Instrument& bar, const kinematics::Chain& chain) {
  std::vector<Vector3d> places;
  for (const Measurement& measurement : metrology::plan(bar, chain).measurements) {
    if (measurement.set_up != 0 || measurement.run != 0) continue;
    const Vector3d place = chain.tool_in_workpiece(measurement.state.q).translation();
    const bool seen = std::any_of(places.begin(), places.end(),
                                  [&](const auto& other) { return (other - place).norm() < 1e-6; });
    if (!seen) places.push_back(place);
  }
  return int(places.size());
}

TEST(ClosedPlan, AWholeCircleIsReadAtAsManyPlacesAsItHasTargets) {
  for (const int n : {3, 4, 5, 36, 72}) {
    Instrument bar = typical_instrument(Kind::BallBar);
    bar.targets = n;
    EXPECT_EQ(places_of(bar, machines::gantry()), n);
  }
}

TEST(ClosedPlan, TargetsOfSeveralTurnsFallOnTheSamePlacesAsOftenAsTheyHaveACommonFactor) {
  for (const int turns : {2, 3})
    for (const int n : {5, 36, 37, 72}) {
      Instrument bar = typical_instrument(Kind::BallBar);
      bar.to_rad = bar.from_rad + 2.0 * pi * turns;
      bar.targets = n;
      EXPECT_EQ(places_of(bar, machines::gantry()), n / std::gcd(n, turns)) << n << ", " << turns;
    }
}

}  // namespace
}  // namespace abbe::errors::metrology
