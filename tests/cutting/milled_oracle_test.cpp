#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include "cutting/surface/surface.h"
#include "tests/cutting/milled_parts.h"
#include "tests/cutting/random.h"
#include "tests/oracles/brute_surface.h"
#include "tests/test.h"

// The reference is proved to lie within its own bound of the truth, so an answer outside [s -
// bound, s] is wrong. The proof is slow where many instants are all but equally deep (a flat face
// on its own plane, a tool that goes there and back); there the bound stays wide. A ray whose
// status hangs on less than 1e-6 mm (an end of the band), or on a proof not finished, may go either
// way: counted apart.
namespace abbe::cutting {
namespace {

using Real = long double;
using Vector = Eigen::Matrix<Real, 3, 1>;

constexpr double agreement = 1e-6;  // mm, 1 nm

struct Motion {
  CutterMotion moves;

  void add(const std::vector<oracles::BrutePose>& poses) {
    const auto n = Index(poses.size());
    moves.tip.resize(n, 3);
    moves.axis.resize(n, 3);
    moves.time_s.resize(n);
    for (Index i = 0; i < n; ++i) {
      const oracles::BrutePose& pose = poses[std::size_t(i)];
      moves.tip.row(i) = pose.tip.transpose();
      moves.axis.row(i) = pose.axis.transpose();
      moves.time_s[i] = pose.time_s;
      moves.line.push_back(10 + int(i));
    }
  }
};

struct Case {
  std::string name;
  Cutter cutter;
  std::vector<oracles::BrutePose> poses;
  std::vector<oracles::Ray> rays;
  double band = 2.0;
  std::size_t most = 50000;  // stretches the reference may look at
};

void expect_agreement(const Case& c) {
  Motion motion;
  motion.add(c.poses);
  Design design;
  design.vertices.resize(Index(c.rays.size()), 3);
  design.normals.resize(Index(c.rays.size()), 3);
  design.judged.assign(c.rays.size(), 1);
  for (std::size_t i = 0; i < c.rays.size(); ++i) {
    design.vertices.row(Index(i)) = c.rays[i].origin.transpose();
    design.normals.row(Index(i)) = c.rays[i].direction.transpose();
  }
  SurfaceOptions options;
  options.band = c.band;
  const Surface surface = milled_surface(design, c.cutter, motion.moves, options);

  std::vector<oracles::BruteHit> hits(c.rays.size());
  tbb::parallel_for(std::size_t(0), hits.size(), [&](std::size_t i) {
    oracles::BruteOptions brute;
    brute.band = c.band;
    brute.tolerance = 4e-7;
    brute.most = c.most;
    hits[i] = oracles::brute_milled(
        c.rays[i], {c.cutter.radius, c.cutter.corner_radius, c.cutter.flank_length}, c.poses,
        brute);
  });

  double largest = 0.0, bound = 0.0, outside = 0.0;
  int cut = 0, uncut = 0, undecided = 0;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    const oracles::BruteHit& hit = hits[i];
    const double s = surface.residual[Index(i)];
    const bool is_cut = surface.status[i] == VertexStatus::Cut;
    if (is_cut != (hit.cut && !hit.begins_removed)) {
      const bool at_an_end = (hit.cut && c.band - std::abs(hit.s) < 1e-6 + hit.bound) ||
                             (is_cut && c.band - std::abs(s) < 1e-6) ||
                             (!hit.cut && hit.bound > 0.0);
      ++undecided;
      EXPECT_TRUE(at_an_end) << "ray " << i << ": status " << int(surface.status[i]) << " at " << s
                             << ", reference " << hit.cut << " at " << hit.s << " bound "
                             << hit.bound;
      continue;
    }
    ++(is_cut ? cut : uncut);
    if (!is_cut) continue;
    bound = std::max(bound, hit.bound);
    largest = std::max(largest, std::abs(s - hit.s));
    const double off = std::max({0.0, s - hit.s, hit.s - hit.bound - s});
    outside = std::max(outside, off);
    // The place that the reference found is near the truth long before it can prove so: where its
    // bound is wide, two independent searches must still have found the same.
    EXPECT_LE(std::max(off, std::abs(s - hit.s)), agreement)
        << "ray " << i << ": " << s << " at " << surface.cut_time_s[Index(i)] << " s, reference "
        << hit.s << " at " << hit.time_s << " s, bound " << hit.bound << ", q "
        << c.rays[i].origin.transpose() << ", n " << c.rays[i].direction.transpose();
  }
  std::cout << c.name << ": " << cut << " cut, " << uncut << " uncut, " << undecided
            << " undecided; largest difference " << largest * 1e6 << " nm, outside the reference's "
            << "interval by " << outside * 1e6 << " nm, its bound " << bound * 1e6 << " nm\n";
  EXPECT_GT(cut, 0);
  EXPECT_LE(undecided, int(hits.size()) / 20);
}

const std::vector<std::pair<std::string, Cutter>> named_cutters{
    {"ball", ball_mill}, {"flat", {5.0, 0.0, 20.0}}, {"bull-nose", {5.0, 1.0, 20.0}}};

/// Passes over about z = 0 with an axis that wanders by `spread`.
std::vector<oracles::BrutePose> random_passes(int moves, double length, double spread,
                                              OracleRandom& r) {
  std::vector<oracles::BrutePose> poses;
  Vector3d tip(-6, r.in(-3, 3), r.in(-0.3, 0.3));
  for (int i = 0; i <= moves; ++i) {
    poses.push_back({tip, r.near(Vector3d::UnitZ(), spread), double(i)});
    tip += length * Vector3d(r.in(-0.5, 1), r.in(-1, 1), 0);
    tip.z() = r.in(-0.3, 0.3);
    tip = tip.cwiseMax(Vector3d(-8, -8, -1)).cwiseMin(Vector3d(8, 8, 1));
  }
  return poses;
}

std::vector<oracles::Ray> random_rays(int n, double spread, OracleRandom& r) {
  std::vector<oracles::Ray> rays;
  for (int i = 0; i < n; ++i) {
    rays.push_back(
        {{r.in(-7, 7), r.in(-7, 7), r.in(-0.5, 0.5)}, r.near(Vector3d::UnitZ(), spread)});
  }
  return rays;
}

TEST(MilledOracle, FixedAxisAgrees) {
  for (const auto& [name, cutter] : named_cutters) {
    const unsigned seed = 101;
    SCOPED_TRACE(testing::Message() << name << ", seed " << seed);
    OracleRandom r(seed);
    std::vector<oracles::BrutePose> poses = random_passes(30, 2.0, 0.0, r);
    expect_agreement({name + ", fixed axis", cutter, poses, random_rays(60, 0.5, r)});
  }
}

TEST(MilledOracle, RandomFiveAxisMotionAgrees) {
  for (const auto& [name, cutter] : named_cutters) {
    for (const unsigned seed : {201u, 202u}) {
      SCOPED_TRACE(testing::Message() << name << ", seed " << seed);
      OracleRandom r(seed);
      std::vector<oracles::BrutePose> poses = random_passes(30, 1.5, 0.4, r);
      expect_agreement({name + ", five axes", cutter, poses, random_rays(40, 0.7, r)});
    }
  }
}

TEST(MilledOracle, LargeRotationsAgree) {
  for (const auto& [name, cutter] : named_cutters) {
    const unsigned seed = 301;
    SCOPED_TRACE(testing::Message() << name << ", seed " << seed);
    OracleRandom r(seed);
    std::vector<oracles::BrutePose> poses = random_passes(5, 3.0, 3.0, r);
    expect_agreement({name + ", large rotations", cutter, poses, random_rays(60, 3.0, r)});
  }
}

TEST(MilledOracle, TurningOnTheSpotAgrees) {
  for (const auto& [name, cutter] : named_cutters) {
    OracleRandom r(311);
    const Vector3d tip(0.3, -0.2, 0.1);
    const std::vector<oracles::BrutePose> poses{{tip, Vector3d(0, 0.1, 1).normalized(), 0},
                                                {tip, Vector3d(1, 0, 1).normalized(), 1},
                                                {tip, Vector3d(0, -1, 0.2).normalized(), 2}};
    expect_agreement({name + ", turning on the spot", cutter, poses, random_rays(60, 0.7, r)});
  }
}

// The tool misses the ray at both ends of the move and cuts it in the middle.
TEST(MilledOracle, LongMovesThatMissAtBothEndsAgree) {
  for (const auto& [name, cutter] : named_cutters) {
    OracleRandom r(321);
    std::vector<oracles::BrutePose> poses;
    for (int i = 0; i < 6; ++i) {
      const double side = i % 2 == 0 ? -60.0 : 60.0;
      poses.push_back(
          {{side, r.in(-5, 5), r.in(-0.5, 0.5)}, r.near(Vector3d::UnitZ(), 0.2), 1.0 * i});
    }
    expect_agreement({name + ", long moves", cutter, poses, random_rays(40, 0.3, r)});
  }
}

TEST(MilledOracle, FlankOfATiltedCutterAgrees) {
  for (const auto& [name, cutter] : named_cutters) {
    OracleRandom r(331);
    std::vector<oracles::BrutePose> poses;  // along x, the flank faces -y where the wall stands
    for (int i = 0; i <= 8; ++i) {
      poses.push_back(
          {{2.0 * i - 8, 5.0 + r.in(-0.1, 0.1), -8}, r.near(Vector3d::UnitZ(), 0.1), 1.0 * i});
    }
    std::vector<oracles::Ray> rays;
    for (int i = 0; i < 60; ++i) {
      rays.push_back({{r.in(-7, 7), 0, r.in(-7, 7)}, r.near(Vector3d::UnitY(), 0.3)});
    }
    expect_agreement({name + ", flank", cutter, poses, rays});
  }
}

TEST(MilledOracle, AwkwardMovesAgree) {
  const Vector3d z = Vector3d::UnitZ();
  const auto leaning = [](double angle) { return Vector3d(std::sin(angle), 0, std::cos(angle)); };
  const std::vector<std::pair<std::string, std::vector<oracles::BrutePose>>> motions{
      {"zero-length move", {{{0, 0, 0}, z, 0}, {{0, 0, 0}, z, 1}}},
      {"jump at one instant", {{{-3, 0, 0}, z, 0}, {{3, 0, 0.1}, leaning(0.1), 0}}},
      {"move of 1e-12", {{{0, 0, 0}, z, 0}, {{1e-12, 0, 0}, z, 1}}},
      {"turn of 1e-12", {{{-1, 0, 0}, z, 0}, {{1, 0, 0}, leaning(1e-12), 1}}},
      {"plunge along the axis", {{{0, 0, 3}, z, 0}, {{0, 0, -0.5}, z, 1}}},
      {"axis across the normal",
       {{{-6, 0, 3}, leaning(pi / 2), 0}, {{4, 1, 3}, leaning(pi / 2), 1}}},
      {"axis from up to level", {{{-2, 0, 0}, z, 0}, {{2, 0, 2}, leaning(pi / 2), 1}}},
      {"turn past level", {{{0, 0, 1}, leaning(-1.5), 0}, {{0, 0, 1}, leaning(1.5), 1}}},
      {"nearly opposite axes", {{{0, 0, 0}, z, 0}, {{1, 0, 0}, leaning(3.1), 1}}},
      {"there and back", {{{-4, 0, 0}, z, 0}, {{4, 0, 0}, z, 1}, {{-4, 0, 0}, z, 2}}},
  };
  std::vector<oracles::Ray> rays;
  for (const double x : {0.0, 1e-12, -1e-12, 1.0, 4.0, -4.0, 5.0, 4.999999, -5.3}) {
    for (const double y : {0.0, 0.7, -3.0}) {
      rays.push_back({{x, y, 0}, z});
      rays.push_back({{x, y, 0.01}, Vector3d(0.6, 0, 0.8)});
    }
  }
  for (const double y : {-6.0, -5.0, -4.5}) {
    rays.push_back({{0.1, y, 0.7}, Vector3d::UnitY()});
    rays.push_back({{y, 0.1, 0.7}, Vector3d::UnitX()});
  }
  for (const auto& [name, cutter] : named_cutters) {
    for (const auto& [what, poses] : motions) {
      SCOPED_TRACE(name + ", " + what);
      expect_agreement({name + ", " + what, cutter, poses, rays, 2.0, 10000});
    }
  }
}

TEST(MilledOracle, ManySmallMovesAgree) {
  for (const auto& [name, cutter] : named_cutters) {
    const unsigned seed = 401;
    SCOPED_TRACE(testing::Message() << name << ", seed " << seed);
    OracleRandom r(seed);
    std::vector<oracles::BrutePose> poses;  // a raster with a lead of 10 degrees on a wavy face
    for (double y = -3; y <= 3; y += 0.5) {
      for (double x = -7; x <= 7; x += 0.5) {
        const double z = 0.2 * std::sin(x / 2) * std::cos(y / 2);
        poses.push_back(
            {{x, y, z}, r.near(Vector3d(0.17, 0, 1).normalized(), 0.02), double(poses.size())});
      }
    }
    expect_agreement({name + ", raster", cutter, poses, random_rays(40, 0.2, r), 1.0});
  }
}

constexpr double milled_promise = 1e-7;  // mm

// ---- dense scan in long double, sharing nothing with the module ---------------------------------

Vector axis_at(const CutterMotion& motion, Index move, Real t) {
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
Real entry(const Cutter& cutter, const CutterMotion& motion, Index move, Real t, const Site& site,
           Real band) {
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
  for (Index move = 0; move + 1 < motion.tip.rows(); ++move) {
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
  SeededRandom random(20250611);
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
        const Index v = Index(i);
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
        const Index last = c.motion.tip.rows() - 2;
        const Index move = std::min<Index>(Index(time), last);
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
  SeededRandom random(7);
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
        const Index i = Index(order[k]);
        const double a = one.residual[i];
        const double b = other.residual[Index(k)];
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
