#include <atomic>
#include <cmath>
#include <iostream>
#include <numbers>

#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include "cutting/stock/engagement.h"
#include "tests/cutting/any_form.h"
#include "tests/cutting/stock_parts.h"

// The sweep through a stock against the same with every line tried, bit for bit, and engagement
// against counting: cutters of every kind, leans from 1e-9 rad on.
namespace abbe::cutting {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using std::numbers::pi;

Cutter any_cutter(Random& random, double least, double most) {
  const double R = random.decades(std::log10(least), std::log10(most));
  if (random.once_in(5)) return any_form(random, R);
  const double r = random.once_in(3) ? R
                   : random.once_in(2)
                       ? 0.0
                       : R * (random.once_in(3) ? random.decades(-9, -1) : random.in(0, 1));
  return {R, r, r + R * random.decades(-2, 1)};
}

bool same_runs(const Stock& a, const Stock& b) {
  for (std::size_t f = 0; f < a.fields.size(); ++f)
    for (std::size_t l = 0; l < a.fields[f].lines.size(); ++l) {
      const auto x = a.fields[f].lines[l].runs(), y = b.fields[f].lines[l].runs();
      if (!std::equal(x.begin(), x.end(), y.begin(), y.end(),
                      [](const DexelRun& p, const DexelRun& q) {
                        return p.low == q.low && p.high == q.high && p.low_line == q.low_line &&
                               p.high_line == q.high_line;
                      }))
        return false;
    }
  return true;
}

/// An axis: upright, leaning by 1e-9 to 1 rad, or any.
Vector3d any_axis(Random& random) {
  if (random.once_in(6)) return Vector3d::UnitZ();
  if (random.once_in(6)) return random.any().normalized();
  return random.turned(Vector3d::UnitZ(), random.decades(-9, 0));
}

TEST(StockCulling, LosesNothing) {
  const std::uint64_t seed = 601000;
  const int cases = 1500 * longer(10);
  std::atomic<int> different = 0, cut = 0, crashed = 0;
  std::atomic<long> near = 0, all = 0;
  tbb::parallel_for(0, cases, [&](int i) {
    Random random(seed + std::uint64_t(i));
    const Cutter cutter = any_cutter(random, 0.3, 40);
    const bool upright = random.once_in(2);
    const double spacing = random.in(0.7, 1.5);
    const Vector3d half(random.in(2, 9), random.in(2, 9), random.in(2, 7));
    const double away = random.once_in(3) ? 1000.0 : 1.0;
    const Vector3d middle = away * random.any();
    Stock culled = make_stock(BoxBlank{-half, half},
                              pose(middle, upright ? Vector3d::UnitZ() : random.any().normalized()),
                              {spacing, !random.once_in(3)});
    Stock tried = culled;
    for (int move = 0; move < 3; ++move) {
      const Vector3d axis = any_axis(random);
      const double turn = random.once_in(2) ? 0.0 : random.decades(-12, -0.7);
      const Vector3d target = turn > 0 ? random.turned(axis, turn) : axis;
      const Vector3d touch = middle + half.cwiseProduct(random.any());
      const double aside = cutter.radius * (random.once_in(3) ? 1.0 : random.in(0, 1));
      const Vector3d tip = touch + aside * axis.cross(random.any()).normalized();
      const Vector3d step = random.once_in(8) ? Vector3d::Zero().eval()
                                              : Vector3d(random.decades(-9, 1.3) * random.any());
      const StockMove way{pose(tip, axis), pose(tip + step, target), move + 1, random.once_in(5)};
      const RemovalResult a = remove(culled, cutter, way);
      const RemovalResult b = remove(tried, cutter, way, DexelSelection::All);
      cut += b.volume > 0;
      crashed += b.crashed;
      near += long(a.lines);
      all += long(b.lines);
      if (a.volume == b.volume && a.crashed == b.crashed && same_runs(culled, tried)) continue;
      if (++different < 10)
        ADD_FAILURE() << "seed " << seed + std::uint64_t(i) << ", move " << move << ", R "
                      << cutter.radius << " r " << cutter.corner_radius << ": " << a.volume
                      << " mm^3, of every line " << b.volume;
    }
  });
  std::cout << "  seeds " << seed << " and on: " << 3 * cases << " moves, " << cut << " cut, "
            << crashed << " crashed, " << near << " lines of " << all << ", " << different
            << " different\n";
  EXPECT_EQ(different, 0);
  EXPECT_GT(cut, cases);
  EXPECT_LT(near, all);
}

/// An axis that turns by 1e-12 to 1e-9 rad takes what one that stands takes.
TEST(StockCulling, ATurnOfNothingTakesWhatStandingTakes) {
  const std::uint64_t seed = 602000;
  double worst = 0.0;
  for (int i = 0; i < 200; ++i) {
    Random random(seed + std::uint64_t(i));
    const Cutter cutter{random.in(2, 6), 0.0, 60.0};
    const Vector3d axis = (Vector3d::UnitZ() + 0.5 * random.any()).normalized();
    const Vector3d step = 5 * random.any();
    Stock standing = make_stock(BoxBlank{Vector3d(-6, -6, 0), Vector3d(6, 6, 50)},
                                Isometry3d::Identity(), {1.1, true});
    Stock turning = standing;
    const Vector3d tip(random.in(-3, 3), random.in(-3, 3), 1.0);
    const Vector3d target = random.turned(axis, random.decades(-11.9, -9));
    remove(standing, cutter, {pose(tip, axis), pose(tip + step, axis), 1, false});
    remove(turning, cutter, {pose(tip, axis), pose(tip + step, target), 1, false});
    for (std::size_t f = 0; f < 3; ++f)
      for (std::size_t l = 0; l < standing.fields[f].lines.size(); ++l) {
        const auto a = standing.fields[f].lines[l].runs(), b = turning.fields[f].lines[l].runs();
        if (a.size() != b.size()) continue;  // a line that grazes
        for (std::size_t k = 0; k < a.size(); ++k) {
          // across the surface; a line that runs all but along it tells more than there is
          const double off =
              std::max(std::abs(a[k].low - b[k].low), std::abs(a[k].high - b[k].high));
          worst = std::max(worst, std::min(off, 1.0));
        }
      }
  }
  std::cout << "  seeds " << seed << " and on: ends of runs differ by " << worst << " mm\n";
  EXPECT_LT(worst, 1e-5);
}

// ---- engagement ---------------------------------------------------------------------------------

/// The outline by the length along it: (radius, height) and the angle of its normal.
struct Edge {
  double radius, height, kappa;
};
/// Along an outline, each arc by its angle.
Edge edge_at(const ToolOutline& outline, double at) {
  for (const OutlineSegment& piece : outline.segments) {
    const double begin = std::atan2(piece.normal_from.x(), -piece.normal_from.y());
    const double turn = std::atan2(piece.normal_to.x(), -piece.normal_to.y()) - begin;
    const double length = piece.is_arc ? piece.radius * turn : (piece.to - piece.from).norm();
    if (at > length) {
      at -= length;
      continue;
    }
    const double kappa = piece.is_arc ? begin + at / piece.radius : begin;
    const Eigen::Vector2d normal(std::sin(kappa), -std::cos(kappa));
    const Eigen::Vector2d place =
        piece.is_arc ? Eigen::Vector2d(piece.from + piece.radius * (normal - piece.normal_from))
                     : Eigen::Vector2d(piece.from + at / length * (piece.to - piece.from));
    return {place.x(), place.y(), kappa};
  }
  return {};
}

Edge edge_at(const Cutter& cutter, double at) {
  if (cutter.outline) return edge_at(*cutter.outline, at);
  const double r = cutter.corner_radius, flat = cutter.radius - r;
  if (at <= flat) return {at, 0.0, 0.0};
  const double kappa = r > 0 ? (at - flat) / r : pi;
  if (kappa >= 0.5 * pi) return {cutter.radius, r + at - flat - 0.5 * pi * r, 0.5 * pi};
  return {flat + r * std::sin(kappa), r * (1 - std::cos(kappa)), kappa};
}

/// rad mm of edge in material that faces the feed, by trying places.
double counted(const Stock& stock, const Cutter& cutter, const Isometry3d& T_wt,
               const Vector3d& feed_w) {
  constexpr int angles = 240, places = 5;
  const Vector3d feed = (T_wt.linear().transpose() * feed_w).normalized();
  double sum = 0.0, from = 0.0;
  for (const EdgeSlice& slice : slices(cutter)) {
    for (int a = 0; a < angles; ++a) {
      const double around = 2 * pi * (a + 0.5) / angles;
      const Vector3d e(std::cos(around), std::sin(around), 0);
      const Vector3d outward =
          std::sin(slice.kappa) * e - std::cos(slice.kappa) * Vector3d::UnitZ();
      if (outward.dot(feed) <= min_feed_component) continue;
      for (int k = 0; k < places; ++k) {
        const Edge edge = edge_at(cutter, from + slice.length * (k + 0.5) / places);
        const Vector3d place = edge.radius * e + edge.height * Vector3d::UnitZ();
        if (depth(stock, T_wt * place) > 0) sum += slice.length / places * 2 * pi / angles;
      }
    }
    from += slice.length;
  }
  return sum;
}

TEST(EngagementCulling, AgreesWithCounting) {
  const std::uint64_t seed = 603000;
  const int cases = 150 * longer(5);
  std::atomic<int> engaged = 0;
  std::vector<double> off(std::size_t(cases), 0.0);
  tbb::parallel_for(0, cases, [&](int i) {
    Random random(seed + std::uint64_t(i));
    const Cutter cutter = any_cutter(random, 2, 8);
    Stock stock = make_stock(BoxBlank{Vector3d(-10, -10, -12), Vector3d(10, 10, 0)},
                             Isometry3d::Identity(), {0.5, true});
    const Vector3d axis = any_axis(random);
    const Vector3d tip(random.in(-9, 9), random.in(-9, 9), random.in(-4, 0));
    const Vector3d feed = (Vector3d(random.in(-1, 1), random.in(-1, 1), 0) +
                           (random.once_in(2) ? random.decades(-9, 0) : 0.0) * random.any())
                              .normalized();
    remove(stock, cutter, {pose(tip - 15 * feed, axis), pose(tip - 0.7 * feed, axis), 1, false});
    double sum = 0.0, whole = 0.0;
    const Engagement found = engagement(stock, cutter, pose(tip, axis), feed);
    for (const EngagedArc& arc : found.arcs)
      sum += found.slices[std::size_t(arc.slice)].length * (arc.to - arc.from);
    for (const EdgeSlice& slice : slices(cutter)) whole += 2 * pi * slice.length;
    const double expected = counted(stock, cutter, pose(tip, axis), feed);
    engaged += expected > 0.01 * whole;
    off[std::size_t(i)] = std::abs(sum - expected) / whole;
  });
  const auto worst = std::max_element(off.begin(), off.end());
  std::cout << "  seeds " << seed << " and on: " << cases << " poses, " << engaged
            << " engaged, off by up to " << *worst * 100 << " % of the edge at seed "
            << seed + std::uint64_t(worst - off.begin()) << "\n";
  EXPECT_LT(*worst, 0.01);
  EXPECT_GT(engaged, cases / 3);
}

}  // namespace
}  // namespace abbe::cutting
