#include <algorithm>
#include <atomic>
#include <cmath>
#include <iostream>
#include <numeric>
#include <random>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "cutting/surface/surface.h"
#include "tests/cutting/milled_parts.h"

namespace abbe::cutting {
namespace {

using Eigen::Vector3d;
using Real = long double;
using Vector = Eigen::Matrix<Real, 3, 1>;

constexpr double milled_promise = 1e-7;  // mm

// ---- dense scan in long double, sharing nothing with the module ---------------------------------

Vector axis_at(const CutterMotion& motion, Eigen::Index move, Real t) {
  const Vector a = motion.axis.row(move).cast<Real>();
  const Vector b = motion.axis.row(move + 1).cast<Real>();
  const Real angle = 2 * std::asin((b - a).norm() / 2);
  if (angle < 1e-12L) return (a + t * (b - a)).normalized();
  return (std::sin((1 - t) * angle) * a + std::sin(t * angle) * b) / std::sin(angle);
}

/// Negative inside the cutter, positive outside, convex along lines.
Real outside(const Cutter& cutter, const Vector& tip, const Vector& axis, const Vector& point) {
  const Vector p = point - tip;
  const Real h = p.dot(axis);
  const Real rho = (p - h * axis).norm();
  const Real r = cutter.corner_radius;
  const Real a = rho - (Real(cutter.radius) - r);
  const Real b = r - h;
  const Real body = a > 0 && b > 0 ? std::hypot(a, b) - r : std::max(a, b) - r;
  return std::max(body, h - Real(cutter.flank_length));
}

/// First s in the band inside the cutter at one instant, by golden section and bisection; infinity
/// if there is none.
Real entry(const Cutter& cutter, const CutterMotion& motion, Eigen::Index move, Real t,
           const Site& site, Real band) {
  const Vector tip = motion.tip.row(move).cast<Real>() +
                     t * (motion.tip.row(move + 1) - motion.tip.row(move)).cast<Real>();
  const Vector axis = axis_at(motion, move, t);
  const auto g = [&](Real s) {
    return outside(cutter, tip, axis, site.point.cast<Real>() + s * site.normal.cast<Real>());
  };
  if (g(-band) <= 0) return -band;
  Real low = -band;
  Real high = band;
  const Real golden = 0.6180339887498948482L;
  Real x1 = high - golden * (high - low);
  Real x2 = low + golden * (high - low);
  Real g1 = g(x1);
  Real g2 = g(x2);
  for (int i = 0; i < 90 && g1 > 0 && g2 > 0; ++i) {
    if (g1 <= g2) {
      high = x2;
      x2 = x1;
      g2 = g1;
      x1 = high - golden * (high - low);
      g1 = g(x1);
    } else {
      low = x1;
      x1 = x2;
      g1 = g2;
      x2 = low + golden * (high - low);
      g2 = g(x2);
    }
  }
  Real inside = g1 <= 0 ? x1 : x2;
  if (g(inside) > 0) inside = band;
  if (g(inside) > 0) return std::numeric_limits<Real>::infinity();
  Real before = -band;
  for (int i = 0; i < 60; ++i) {
    const Real middle = (before + inside) / 2;
    (g(middle) <= 0 ? inside : before) = middle;
  }
  return inside;
}

/// Smallest entry over a grid of instants, each basin of the grid followed down by golden section.
Real scanned_entry(const Cutter& cutter, const CutterMotion& motion, const Site& site, Real band,
                   int steps) {
  Real best = std::numeric_limits<Real>::infinity();
  for (Eigen::Index move = 0; move + 1 < motion.tip.rows(); ++move) {
    std::vector<Real> value(std::size_t(steps) + 1);
    for (int k = 0; k <= steps; ++k)
      value[std::size_t(k)] = entry(cutter, motion, move, Real(k) / steps, site, band);
    const auto lowest = std::min_element(value.begin(), value.end());
    if (!std::isfinite(*lowest)) continue;
    best = std::min(best, *lowest);
    Real low = std::max<Real>(0, (lowest - value.begin() - 1) / Real(steps));
    Real high = std::min<Real>(1, (lowest - value.begin() + 1) / Real(steps));
    for (int i = 0; i < 20; ++i) {
      const Real x1 = low + (high - low) / 3;
      const Real x2 = high - (high - low) / 3;
      const Real v1 = entry(cutter, motion, move, x1, site, band);
      const Real v2 = entry(cutter, motion, move, x2, site, band);
      best = std::min({best, v1, v2});
      (v1 <= v2 ? high : low) = v1 <= v2 ? x2 : x1;
    }
  }
  return best;
}

// ---- random motions -----------------------------------------------------------------------------

struct Kind {
  const char* name;
  double step;  // mm between samples
  double turn;  // rad between samples
  double tilt;  // rad, of the first axis
};

struct RandomCase {
  Cutter cutter;
  CutterMotion motion;
  std::vector<Site> sites;
};

RandomCase random_case(std::mt19937& random, const Cutter& cutter, const Kind& kind, int moves,
                       int vertices) {
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto any = [&] { return Vector3d(unit(random), unit(random), unit(random)); };
  std::vector<Stop> stops;
  Vector3d tip(4 * unit(random), 4 * unit(random), 0.5 * unit(random));
  Vector3d axis = (Vector3d::UnitZ() + std::tan(kind.tilt) * any()).normalized();
  for (int i = 0; i <= moves; ++i) {
    stops.push_back({tip, axis});
    tip += kind.step * any();
    tip.z() *= 0.7;
    tip.x() = std::clamp(tip.x(), -8.0, 8.0);
    tip.y() = std::clamp(tip.y(), -8.0, 8.0);
    axis = (axis + kind.turn * any()).normalized();
  }
  RandomCase result{cutter, motion_of(stops), {}};
  for (int i = 0; i < vertices; ++i) {
    const Vector3d normal = (Vector3d::UnitZ() + 0.8 * any()).normalized();
    result.sites.push_back({Vector3d(9 * unit(random), 9 * unit(random), unit(random)), normal});
  }
  return result;
}

const Kind kinds[] = {
    {"small steps, small turns", 0.5, 0.01, 0.3}, {"long steps, no turn", 10.0, 0.0, 0.3},
    {"long steps, large turns", 8.0, 0.5, 0.5},   {"turns in place", 0.0, 0.3, 0.2},
    {"tiny steps, tiny turns", 1e-3, 1e-4, 0.0},  {"lying tool", 2.0, 0.05, 1.4}};
const Cutter cutters[] = {{5, 5, 20}, {5, 1, 20}, {5, 0, 20}, {3, 2.9, 4}, {1, 0.01, 8}, {5, 5, 5}};

TEST(MilledRandom, AgreesWithADenseScanOfRandomMotions) {
  const unsigned seed = 20250611;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  const double band = 2.0;
  for (const Kind& kind : kinds)
    for (const Cutter& cutter : cutters) {
      const RandomCase c = random_case(random, cutter, kind, 6, 24);
      const SurfaceOptions options{.band = band, .progress = {}};
      const Surface surface = milled_surface(design_of(c.sites), cutter, c.motion, options);
      double late = 0.0;
      double early = 0.0;
      int cut = 0;
      for (std::size_t i = 0; i < c.sites.size(); ++i) {
        const Real scanned = scanned_entry(cutter, c.motion, c.sites[i], band, 48);
        const Eigen::Index v = Eigen::Index(i);
        if (surface.status[i] != VertexStatus::Cut) {
          EXPECT_TRUE(scanned <= -band + milled_promise || scanned > band - milled_promise)
              << kind.name << ", vertex " << i << ": " << double(scanned);
          continue;
        }
        ++cut;
        // Nothing that the scan saw was removed before the reported surface ...
        late = std::max(late, double(surface.residual[v] - scanned));
        // ... and at the reported instant the cutter stands there.
        const double time = surface.cut_time_s[v];
        const Eigen::Index last = c.motion.tip.rows() - 2;
        const Eigen::Index move = std::min<Eigen::Index>(Eigen::Index(time), last);
        const Real t = Real(time) - Real(move);
        const Real witness = entry(cutter, c.motion, move, t, c.sites[i], band);
        early = std::max(early, std::abs(double(witness - surface.residual[v])));
      }
      std::cout << "  " << kind.name << ", r " << cutter.corner_radius << " of " << cutter.radius
                << ": " << cut << " cut, late by " << late * 1e6 << " nm, early by " << early * 1e6
                << " nm\n";
      EXPECT_LE(late, milled_promise);
      EXPECT_LE(early, milled_promise);
    }
}

TEST(MilledRandom, BitsDoNotDependOnThreadsOrTheOrderOfVertices) {
  const unsigned seed = 7;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  for (const Kind& kind : kinds)
    for (const Cutter& cutter : cutters) {
      const RandomCase c = random_case(random, cutter, kind, 400, 2000);
      const auto found_by = [&](std::size_t threads, const std::vector<Site>& sites) {
        const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
        return milled_surface(design_of(sites), cutter, c.motion);
      };
      const Surface one = found_by(1, c.sites);
      EXPECT_TRUE(same_bits(one, found_by(2, c.sites))) << kind.name;

      std::vector<std::size_t> order(c.sites.size());
      std::iota(order.begin(), order.end(), std::size_t(0));
      std::shuffle(order.begin(), order.end(), random);
      std::vector<Site> shuffled;
      for (const std::size_t i : order) shuffled.push_back(c.sites[i]);
      const Surface other = found_by(2, shuffled);
      int different = 0;
      for (std::size_t k = 0; k < order.size(); ++k) {
        const Eigen::Index i = Eigen::Index(order[k]);
        const double a = one.residual[i];
        const double b = other.residual[Eigen::Index(k)];
        const bool same = (a == b || (std::isnan(a) && std::isnan(b))) &&
                          one.cut_line[order[k]] == other.cut_line[k];
        different += !same;
      }
      EXPECT_EQ(different, 0) << kind.name << ", r " << cutter.corner_radius;
    }
}

TEST(MilledRandom, ProgressRisesToOne) {
  std::mt19937 random(3);
  const RandomCase c = random_case(random, {5, 5, 20}, kinds[0], 50, 5000);
  std::atomic<int> calls = 0;
  std::atomic<bool> finished = false;
  const auto progress = [&](double fraction) {
    ++calls;
    EXPECT_GT(fraction, 0.0);
    EXPECT_LE(fraction, 1.0);
    if (fraction == 1.0) finished = true;
  };
  milled_surface(design_of(c.sites), c.cutter, c.motion, {.band = 2.0, .progress = progress});
  EXPECT_GT(calls, 1);
  EXPECT_TRUE(finished);
}

}  // namespace
}  // namespace abbe::cutting
