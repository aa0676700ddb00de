#include <tbb/parallel_for.h>
#include "cutting/stock/engagement.h"
#include "cutting/stock/force.h"
#include "cutting/surface/nose_cut.h"
#include "cutting/surface/removal.h"
#include "cutting/surface/surface.h"
#include "tests/cutting/random.h"
#include "tests/cutting/turned_parts.h"
#include "tests/oracles/brute_surface.h"
#include "tests/test.h"

// Turning inserts against closed forms: feed marks, stock, chip, force; and what is refused.
namespace abbe::cutting::insert_tests {
namespace {

using oracles::BruteTurning;

constexpr double shaft_radius = 12.5;  // mm, radius of the shaft

Insert pointed(double major_deg, double minor_deg, double wiper = 0.0) {
  return {.radius = 0.4,
          .major = major_deg * units::deg,
          .minor = minor_deg * units::deg,
          .major_length = 6.0,
          .minor_length = 6.0,
          .wiper = wiper};
}

/// mm above its lowest place, u mm along +x from its centre, between its ends.
double rise(const Insert& insert, double u) {
  const double r = insert.radius, k = insert.major, m = insert.minor, b = insert.wiper;
  if (u < -r * std::sin(k)) return r - (r + u * std::sin(k)) / std::cos(k);
  if (b > 0.0 && u >= 0.0) return u <= b ? 0.0 : (u - b) * std::tan(m);
  if (u <= r * std::sin(m)) return r - std::sqrt(r * r - u * u);
  return r + (u * std::sin(m) - r) / std::cos(m);
}

/// Turns a shaft along -x by `feed` a revolution, its centre at x = 0 when the spindle is at 0.
NosePath along_shaft(const Insert& insert, double feed) {
  NosePath path;
  for (int turn = -20; turn <= 20; ++turn)
    path.add(Vector3d(-feed * turn, 0, shaft_radius + insert.radius), two_pi * turn);
  return path;
}

/// Highest feed mark: where two revolutions meet, found by bisection of the closed form.
struct FeedMark {
  double u, height;
};
FeedMark highest_mark(const Insert& insert, double feed) {
  double low = insert.wiper > 0.0 ? insert.wiper : 0.0, high = feed;  // of u, past the centre
  for (int i = 0; i < 200; ++i) {
    const double u = 0.5 * (low + high);
    (rise(insert, u) < rise(insert, u - feed) ? low : high) = u;
  }
  return {low, rise(insert, low)};
}

std::vector<MeridianVertex> on_shaft(double from, double to, double angle, int n) {
  std::vector<MeridianVertex> vertices;
  for (int i = 0; i < n; ++i)
    vertices.push_back({from + (to - from) * (i + 0.5) / n, shaft_radius, angle, 0, 1});
  return vertices;
}

TEST(InsertMarks, AreAsHighAsTheyShould) {
  struct Case {
    const char* what;
    Insert insert;
    double feed;
  };
  for (const Case& one :
       {Case{"small feed", pointed(75, 15), 0.05}, Case{"both edges", pointed(60, 30), 0.9},
        Case{"minor edge and nose", pointed(80, 5), 0.25}}) {
    const double angle = 0.7, centre = -one.feed * angle / two_pi;
    const FeedMark mark = highest_mark(one.insert, one.feed);
    std::vector<MeridianVertex> vertices = on_shaft(centre, centre + one.feed, angle, 501);
    vertices.push_back({centre + mark.u, shaft_radius, angle, 0, 1});
    const Surface surface =
        turned_surface(design_of(vertices), profile_nose(insert_profile(one.insert)),
                       motion_of(along_shaft(one.insert, one.feed)));
    double worst = 0.0;
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      const double u = vertices[i].x - centre;
      const double left = std::min(rise(one.insert, u), rise(one.insert, u - one.feed));
      worst = std::max(worst, std::abs(surface.residual[Index(i)] - left));
    }
    const double r = one.insert.radius, f = one.feed;
    std::cout << "  " << one.what << ": " << surface.residual.maxCoeff() * 1e3
              << " um high, by the closed form " << mark.height * 1e3 << ", f^2 / 8r "
              << f * f / (8 * r) * 1e3 << ", every place to " << worst * 1e6 << " nm\n";
    EXPECT_LE(worst, 1e-9);
    EXPECT_NEAR(surface.residual.maxCoeff(), mark.height, 1e-9);
  }
  // f^2 / 8r to its next order, and the sharp insert's f / (cot + cot) less what the nose takes
  const FeedMark small = highest_mark(pointed(75, 15), 0.05);
  EXPECT_NEAR(small.height, 0.05 * 0.05 / (8 * 0.4), 2 * std::pow(0.05, 4) / (128 * 0.064));
  const double t60 = std::tan(60 * units::deg), t30 = std::tan(30 * units::deg);
  const double sharp = 0.9 / (1 / t60 + 1 / t30);
  const double less =
      0.4 *
      ((1 / std::cos(60 * units::deg) - 1) / t60 + (1 / std::cos(30 * units::deg) - 1) / t30) /
      (1 / t60 + 1 / t30);
  EXPECT_NEAR(highest_mark(pointed(60, 30), 0.9).height, sharp - less, 1e-12);
}

TEST(InsertMarks, OfAWiperVanishAlongTheFeed) {
  const Insert insert = pointed(75, 15, 0.3);
  for (const double feed : {0.05, 0.2, 0.2999}) {
    const auto vertices = on_shaft(-feed, feed, 1.3, 777);
    const Surface surface =
        turned_surface(design_of(vertices), profile_nose(insert_profile(insert)),
                       motion_of(along_shaft(insert, feed)));
    std::cout << "  feed " << feed << " mm on a flat of 0.3: " << surface.residual.minCoeff() * 1e6
              << " to " << surface.residual.maxCoeff() * 1e6 << " nm\n";
    EXPECT_LE(surface.residual.cwiseAbs().maxCoeff(), 1e-10);
  }
  const FeedMark mark = highest_mark(insert, 0.5);
  EXPECT_GT(mark.height, 0.001);
  const double angle = 0.7, centre = -0.5 * angle / two_pi;
  const Surface surface = turned_surface(
      design_of(std::vector<MeridianVertex>{{centre + mark.u, shaft_radius, angle, 0, 1}}),
      profile_nose(insert_profile(insert)), motion_of(along_shaft(insert, 0.5)));
  EXPECT_NEAR(surface.residual[0], mark.height, 1e-9);
}

TEST(InsertMarks, HaveTheSlopeOfTheEdge) {
  const Insert insert = pointed(60, 30);
  const double feed = 0.9, d = 1e-4, angle = 0.3;
  const auto vertices = on_shaft(-0.4, 0.4, angle, 41);
  auto beside = vertices;
  for (MeridianVertex& vertex : beside) vertex.x += d;
  const Nose nose = profile_nose(insert_profile(insert));
  const NoseMotion motion = motion_of(along_shaft(insert, feed));
  const Design design = design_of(vertices);
  const Surface here = turned_surface(design, nose, motion);
  const Surface there = turned_surface(design_of(beside), nose, motion);
  const PassGradients contacts = turned_gradients(design, here, nose, motion);
  const Vector3d along = d * lathe_in_workpiece().linear().col(0);
  double worst = 0.0;
  for (Index i = 0; i < here.residual.size(); ++i) {
    const double told = here.residual[i] - contacts.gradient.row(i).dot(along);
    worst = std::max(worst, std::abs(there.residual[i] - told));
  }
  std::cout << "  slope of the surface, over " << d << " mm off by " << worst * 1e6 << " nm\n";
  EXPECT_LE(worst, 0.6 * d * d / 0.4 * 8);  // curvature of the nose, steep beside the edges
}

TEST(InsertMarks, AreWhatItsRivalsBeginWith) {
  const Insert insert = pointed(75, 15);
  const Design design = design_of(on_shaft(-0.2, 0.2, 1.0, 9));
  const Nose nose = profile_nose(insert_profile(insert));
  const NoseMotion motion = motion_of(along_shaft(insert, 0.3));
  const Surface surface = turned_surface(design, nose, motion);
  const std::vector<CompetingPass> competing_passes = turned_competing_passes(design, nose, motion);
  std::vector<double> nearest(9, 1e9);
  for (const CompetingPass& competing_pass : competing_passes)
    nearest[std::size_t(competing_pass.vertex)] =
        std::min(nearest[std::size_t(competing_pass.vertex)], competing_pass.distance);
  for (int v = 0; v < 9; ++v) EXPECT_NEAR(nearest[std::size_t(v)], surface.residual[v], 1e-12);
}

// ---- stock, chip, force

Eigen::Isometry3d slow_pose_at(double x, double r) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() = Vector3d(x, 0, r);
  return T;
}

TurnedStock bar(double radius, double spacing) {
  Eigen::Matrix<double, Eigen::Dynamic, 2> profile(2, 2);
  profile << -20.0, radius, 20.0, radius;
  return make_turned_stock(profile, spacing, Vector3d::Zero(), Vector3d::UnitX());
}

TEST(InsertStock, IsCutBackToTheEdge) {
  for (const Insert& insert : {pointed(75, 15), pointed(60, 30), pointed(45, 20, 0.5)}) {
    TurnedStock stock = bar(14.0, 0.01);
    const double r = 12.0 + insert.radius, from = 3.0, to = 2.6;
    remove(stock, profile_nose(insert_profile(insert)), slow_pose_at(from, r), slow_pose_at(to, r));
    double worst = 0.0;
    for (Index i = 0; i < stock.radius.size(); ++i) {
      const double x = stock.first + stock.spacing * double(i);
      if (x < to - 0.8 || x > from + 2.0) continue;
      // the lowest of those that pass: nearest to the flat
      const double u = std::clamp(std::clamp(0.0, x - from, x - to), x - from, x - to);
      const double best =
          std::min(rise(insert, u), rise(insert, std::clamp(insert.wiper, x - from, x - to)));
      worst = std::max(worst, std::abs(stock.radius[i] - std::min(14.0, 12.0 + best)));
    }
    std::cout << "  stock within " << worst * 1e6 << " nm of the edge\n";
    EXPECT_LE(worst, 1e-8);
  }
}

/// mm, how far an insert that turns by 0.02 rad on its way comes below the stock that it leaves.
double below_tilted(double spacing) {
  const Nose nose = profile_nose(insert_profile(pointed(60, 30)));
  TurnedStock stock = bar(14.0, spacing);
  const Vector3d from(1.0, 0, 12.4), to(0.7, 0, 12.35);
  const auto pose = [&](double t) {
    return Eigen::Isometry3d(Eigen::Translation3d((1 - t) * from + t * to) *
                             Eigen::AngleAxisd(0.02 * t, Vector3d::UnitY()));
  };
  remove(stock, nose, pose(0), pose(1));
  double below = 0.0;
  for (double t = 0; t <= 1.0; t += 0.01) {
    for (double psi = 0; psi < two_pi; psi += 0.001) {
      const Vector2d at = edge_point(*nose.profile, psi).at;
      const Vector3d p = pose(t) * Vector3d(at.x(), 0, at.y());
      if (p.z() > 13.9) continue;
      const double u = (p.x() - stock.first) / stock.spacing;
      const auto i = Index(u);
      const double share = u - double(i);
      below = std::max(below, (1 - share) * stock.radius[i] + share * stock.radius[i + 1] -
                                  std::hypot(p.z(), p.y()));
    }
  }
  return below;
}

TEST(InsertStock, FollowsATiltedInsert) {
  const double coarse = below_tilted(0.02), fine = below_tilted(0.01);
  std::cout << "  edge below the profile by " << coarse * 1e3
            << " um at most, with half the spacing " << fine * 1e3 << "\n";
  EXPECT_LT(coarse, 4e-4);  // straight between nodes: a quarter with half
  EXPECT_LT(fine, 0.35 * coarse);
}

TEST(InsertStock, ChipIsThatOfTheFeedAndTheAngle) {
  const Insert insert = pointed(60, 10);
  const Nose nose = profile_nose(insert_profile(insert));
  const double depth = 1.5, feed = 0.2, r = 12.5 + insert.radius;
  TurnedStock stock = bar(12.5 + depth, 0.005);
  for (int turn = 0; turn < 40; ++turn)
    remove(stock, nose, slow_pose_at(10.0 - feed * turn, r),
           slow_pose_at(10.0 - feed * (turn + 1), r));
  const std::vector<EngagedEdge> edges = engagement(stock, nose, slow_pose_at(10.0 - feed * 41, r));
  double area = 0.0, worst = 0.0;
  int straight = 0;
  for (const EngagedEdge& edge : edges) {
    area += edge.length * edge.chip;
    const EdgePoint at = edge_point(*nose.profile, edge.psi);
    const double above = at.at.y() + insert.radius;
    const bool on_major = at.outward.x() < 0 && above > 0.5 && above < depth - 0.2;
    if (!on_major) continue;
    ++straight;
    EXPECT_NEAR(std::atan2(-at.outward.x(), -at.outward.y()), insert.major, 1e-12);
    worst = std::max(worst, std::abs(edge.chip - feed * std::sin(insert.major)));
  }
  std::cout << "  chip of the major edge " << worst * 1e6 << " nm off f sin(kappa); area " << area
            << " mm^2 of " << depth * feed << "\n";
  EXPECT_GT(straight, 20);
  EXPECT_LT(worst, 1e-5);
  EXPECT_NEAR(area, depth * feed, 0.04 * depth * feed);  // around the nose chip / 2r more

  const CuttingCoefficients K{"", "", 2000, 800, 0, 0, 0, 0};
  const CuttingLoad load = turning_force(edges, nose, K, 13.0);
  Vector3d normal = Vector3d::Zero();
  for (const EngagedEdge& edge : edges) {
    const Vector2d outward = edge_point(*nose.profile, edge.psi).outward;
    normal -= 800 * edge.chip * edge.length * Vector3d(outward.x(), 0, outward.y());
  }
  EXPECT_NEAR(load.tool_wrench_t[1], -2000 * area, 1e-9);
  EXPECT_NEAR(load.tool_wrench_t[0], normal.x(), 1e-9);
  EXPECT_NEAR(load.tool_wrench_t[2], normal.z(), 1e-9);
  // nearly all of it on the straight edge
  EXPECT_NEAR(load.tool_wrench_t[0] / load.tool_wrench_t[2], std::tan(insert.major), 0.3);
}

// ---- the edge itself

TEST(InsertEdge, EntersWhereItsDistanceSays) {
  const std::uint64_t seed = 806000;
  double worst = 0.0;
  for (int i = 0; i < 300 * longer(30); ++i) {
    Random random(seed + std::uint64_t(i));
    const EdgeProfile profile = insert_profile({.radius = random.decades(-1, 0),
                                                .major = random.in(30, 100) * units::deg,
                                                .minor = random.in(1, 50) * units::deg,
                                                .major_length = 8,
                                                .minor_length = random.in(7, 9)});
    const NoseEdge edge(profile_nose(profile));
    const Vector2d point(random.in(-9, 9), random.in(-3, 12));
    const double way = random.in(0, two_pi);
    const Vector2d step(std::cos(way), std::sin(way));
    const auto entry = edge.entry(point, step, -30.0);
    const std::optional<Chord> inside = chord(profile, point, step);
    ASSERT_EQ(entry.has_value(), inside.has_value());
    if (!entry) {
      const double s = edge.nearest_s(point, step, -30.0);
      for (const double off : {-0.01, 0.01})
        EXPECT_LE(edge.distance_bound(point + s * step),
                  edge.distance_bound(point + (s + off) * step) + 1e-12);
      EXPECT_GT(edge.distance_bound(point + s * step), 0.0);
      continue;
    }
    for (const double s : {inside->begin, inside->end})
      worst = std::max(worst, std::abs(distance(profile.segments, point + s * step).value));
    EXPECT_TRUE(edge.contains(point + 0.5 * (inside->begin + inside->end) * step));
    EXPECT_LE(std::abs(edge.reach(step) - step.dot(extreme_point(profile, step))), 0.0);
  }
  std::cout << "  seeds " << seed << " and on: ends of chords " << worst << " mm off the edge\n";
  EXPECT_LE(worst, 1e-12);
}

std::string refused(const std::function<void()>& act) {
  return thrown_text<std::invalid_argument>([&] { act(); }, "nothing");
}

void expect_refused(const std::string& part, const std::function<void()>& act) {
  const std::string said = refused(act);
  EXPECT_HAS(said, part);
}

TEST(InsertEdge, ThatCannotBeIsRefused) {
  const auto with = [](const std::function<void(Insert&)>& change) {
    return [change] {
      Insert insert = pointed(75, 15);
      change(insert);
      insert_profile(insert);
    };
  };
  expect_refused("nose radius", with([](Insert& i) { i.radius = 0; }));
  expect_refused("nose radius", with([](Insert& i) { i.radius = std::nan(""); }));
  expect_refused("sum of major and minor angle",
                 with([](Insert& i) { i.minor = 105 * units::deg; }));
  expect_refused("major angle", with([](Insert& i) { i.major = -0.1; }));
  expect_refused("length of the major", with([](Insert& i) { i.major_length = 0; }));
  expect_refused("a wiper of at least 0.0527 mm", with([](Insert& i) { i.wiper = 0.01; }));
  expect_refused("contain the nose circle", with([](Insert& i) { i.minor_length = 0.2; }));

  const auto through = [](const std::vector<OutlinePoint>& points) {
    return [points] { edge_profile_from_points(points); };
  };
  expect_refused("nothing", through({{{1, -1}}, {{1, 1}}, {{-1, 1}}, {{-1, -1}}}));
  expect_refused("clockwise", through({{{1, -1}}, {{-1, -1}}, {{-1, 1}}, {{1, 1}}}));
  expect_refused("an inward bend of 90 deg at (0, 1)",
                 through({{{2, -1}}, {{2, 2}}, {{1, 2}}, {{0, 1}}, {{-1, 2}}, {{-1, -1}}}));
  expect_refused("0.5 mm outside", through({{{1, 0.5}}, {{1, 2}}, {{-1, 2}}, {{-1, 0.5}}}));
  expect_refused("arc of radius", through({{{1, -1}}, {{1, 1}, 0.5}, {{-1, 1}}, {{-1, -1}}}));
  expect_refused("twice", through({{{1, -1}}, {{1, -1}}, {{-1, 1}}, {{-1, -1}}}));
  expect_refused("turns", [] {
    std::vector<OutlinePoint> star;
    for (int i = 0; i < 5; ++i)
      star.push_back({Vector2d(std::cos(0.8 * i * pi), std::sin(0.8 * i * pi))});
    edge_profile_from_points(star);
  });
  expect_refused("waves", [] {
    Nose nose = profile_nose(insert_profile(pointed(75, 15)));
    nose.waves.push_back({3, 1e-5, 0});
    NoseEdge edge(nose);
  });
}

// The surface of turning inserts against brute force. To the reference an edge is a union of convex
// parts: the polygon of its corners, and of every arc a disc, cut by its chord.

/// A part of an edge: a disc cut by straight sides.
struct DiscPart {
  Vector2d middle;
  double radius;
  std::vector<BruteTurning::Side> sides;
};

BruteTurning::Side side_through(const Vector2d& a, const Vector2d& b) {
  const Vector2d normal = Vector2d((b - a).y(), -(b - a).x()).normalized();
  return {normal, normal.dot(a)};
}

DiscPart polygon(const std::vector<Vector2d>& corners) {
  DiscPart part{{0, 0}, 1e3, {}};
  for (std::size_t i = 0; i < corners.size(); ++i)
    part.sides.push_back(side_through(corners[i], corners[(i + 1) % corners.size()]));
  return part;
}

struct TestEdge {
  Nose nose;
  std::vector<DiscPart> parts;
};

TestEdge insert_edge(const Insert& insert) {
  const double k = insert.major, m = insert.minor, r = insert.radius;
  const Vector2d ahead(-std::cos(k), std::sin(k)), behind(std::cos(m), std::sin(m));
  const Vector2d a = r * Vector2d(-std::sin(k), -std::cos(k));
  const Vector2d b = r * Vector2d(std::sin(m), -std::cos(m));
  std::vector<Vector2d> corners{a};
  if (insert.wiper > 0.0) {
    corners.emplace_back(0, -r);
    corners.emplace_back(insert.wiper, -r);
  } else {
    corners.push_back(b);
  }
  const Vector2d far_behind = corners.back() + insert.minor_length * behind;
  const Vector2d far_ahead = a + insert.major_length * ahead;
  corners.push_back(far_behind);
  // far_behind + s ahead = far_ahead + t behind
  Eigen::Matrix2d ways;
  ways << ahead, -behind;
  const Vector2d st = ways.inverse() * (far_ahead - far_behind);
  corners.push_back(far_behind + st.x() * ahead);
  corners.push_back(far_ahead);
  return {profile_nose(insert_profile(insert)), {polygon(corners), {{0, 0}, r, {}}}};
}

TestEdge free_edge(const std::vector<OutlinePoint>& points) {
  TestEdge edge{profile_nose(edge_profile_from_points(points)), {}};
  std::vector<Vector2d> corners;
  Vector2d last = points.back().at;
  for (const OutlinePoint& point : points) {
    corners.push_back(point.at);
    if (point.radius > 0.0) {
      const Vector2d chord = point.at - last;
      const double half = 0.5 * chord.norm();
      const Vector2d inward = Vector2d(-chord.y(), chord.x()).normalized();
      const Vector2d middle =
          0.5 * (last + point.at) + std::sqrt(point.radius * point.radius - half * half) * inward;
      edge.parts.push_back({middle, point.radius, {side_through(point.at, last)}});
    }
    last = point.at;
  }
  edge.parts.push_back(polygon(corners));
  return edge;
}

oracles::BruteHit brute(const Ray& ray, const TestEdge& edge, const NoseMotion& motion,
                        double shrunk = 0.0) {
  oracles::BruteHit first;
  for (const DiscPart& part : edge.parts) {
    BruteTurning turning{part.radius - shrunk, {}, motion.spindle_point, motion.spindle_direction};
    turning.sides = part.sides;
    for (BruteTurning::Side& side : turning.sides) side.reach -= shrunk;
    turning.middle = part.middle;
    if (part.radius == 1e3) turning.radius = edge.nose.profile->outer_radius + 1.0;
    for (std::size_t i = 0; i < motion.T_without_spindle.size(); ++i) {
      const Eigen::Isometry3d& T = motion.T_without_spindle[i];
      turning.poses.push_back(
          {T.linear(), T.translation(), motion.spindle[Index(i)], motion.time_s[Index(i)]});
    }
    const oracles::BruteHit hit = oracles::brute_turned(
        {ray.point, ray.normal}, turning, {.band = ray.band, .tolerance = 2e-7, .most = 400000});
    if (hit.cut && (!first.cut || hit.s < first.s)) first = hit;
  }
  return first;
}

Insert any_insert(Random& random) {
  Insert insert;
  insert.radius = random.decades(-1.2, 0.3);
  insert.major = random.in(20, 110) * units::deg;
  insert.minor = random.in(0, std::min(60.0, 165.0 - insert.major / units::deg)) * units::deg;
  if (random.once_in(3)) insert.minor = 5 * units::deg;
  if (random.once_in(5)) insert.major = 90 * units::deg;
  insert.major_length = insert.radius * random.in(3, 12);
  insert.minor_length = insert.radius * random.in(3, 12);
  return insert;
}

TestEdge any_insert_edge(Random& random, double wiper) {
  for (;;) {
    Insert insert = any_insert(random);
    if (wiper > 0.0) insert.wiper = insert.radius * (std::tan(0.5 * insert.minor) + wiper);
    try {
      return insert_edge(insert);
    } catch (const std::invalid_argument&) {
    }  // too short; another, then
  }
}

/// Points on an ellipse, some of them reached by arcs.
std::vector<OutlinePoint> any_points(Random& random) {
  const int n = 3 + random.below(6);
  const double a = random.in(0.2, 2), b = random.in(0.2, 2), turn = random.in(0, 6);
  const Vector2d off(random.in(-0.1, 0.1) * a, random.in(-0.1, 0.1) * b);
  std::vector<OutlinePoint> points;
  for (int i = 0; i < n; ++i) {
    const double angle = turn + two_pi * (i + random.in(-0.2, 0.2)) / n;
    points.push_back({off + Vector2d(a * std::cos(angle), b * std::sin(angle))});
  }
  return points;
}

TestEdge any_free_edge(Random& random) {
  for (;;) {
    std::vector<OutlinePoint> points = any_points(random);
    const std::vector<OutlinePoint> straight = points;
    for (std::size_t i = 0; i < points.size(); ++i)
      if (random.once_in(2))
        points[i].radius =
            (points[i].at - points[(i + points.size() - 1) % points.size()].at).norm() *
            random.in(0.6, 4);
    for (const auto& one : {points, straight}) {
      try {
        return free_edge(one);
      } catch (const std::invalid_argument&) {
      }  // another, then
    }
  }
}

struct TestCut {
  NosePath path;
  Ray ray;
};

/// Some revolutions and a ray near the edge of one of them, leaning as its normal does or any way.
TestCut any_cut(const TestEdge& edge, double wrong, double turns, Random& random) {
  TestCut cut;
  const double reach = edge.nose.profile->outer_radius;
  const double feed = edge.nose.radius * random.decades(-1.3, 0);
  const double way = random.in(0, two_pi);  // of the feed in (x, r)
  const double from = random.in(0, 4) < 1 ? random.in(0.0, 3 * reach) : random.in(3, 20) * reach;
  const Matrix3d tilt = random.rotation(0.1 * wrong);
  const double height = random.some(0.05 * wrong), wander = random.some(1e-3 * wrong);
  const double a_sample = random.in(0, 2) < 1 ? 1.0 : random.decades(-1, 0.5);
  const double angle0 = random.in(-20, 20);
  for (double turn = 0; turn < turns; turn += a_sample)
    cut.path.add(Vector3d(feed * turn * std::cos(way), height, from + feed * turn * std::sin(way)) +
                     wander * random.any(),
                 angle0 + two_pi * turn, tilt * random.rotation(wander));
  cut.path.add(cut.path.T_lt.back().translation(), cut.path.spindle.back() + 3.0, tilt);
  const std::size_t near = std::size_t(random.below(int(cut.path.T_lt.size())));
  const EdgePoint at = edge_point(*edge.nose.profile, random.in(0, two_pi));
  const Vector3d centre = cut.path.T_lt[near].translation();
  const double off = random.once_in(3) ? 0.0 : random.in(-0.3, 0.3) * edge.nose.radius;
  const double lean = random.once_in(2) ? 0.0 : random.in(-0.8, 0.8);
  const Vector2d inward = Eigen::Rotation2Dd(lean) * Vector2d(-at.outward);
  MeridianVertex vertex{centre.x() + at.at.x() + off * inward.x(),
                        centre.z() + at.at.y() + off * inward.y(),
                        cut.path.spindle[near] + random.in(-3, 3), inward.x(), inward.y()};
  if (random.once_in(12)) vertex.r = 0.0;
  if (vertex.r < 0.0) vertex.r = -vertex.r, vertex.nr = -vertex.nr;
  const Design design = design_of({vertex});
  const Vector3d askew = random.some(0.3 * wrong) * random.any();
  cut.ray = {design.vertices.row(0), (design.normals.row(0).transpose() + askew).normalized(),
             random.decades(-1, 0)};
  return cut;
}

/// Whether a place is that of the reference to 1 nm, for an edge moved by as little as 0.01 nm.
bool agrees(std::optional<NoseCut> found, const TestCut& cut, const TestEdge& edge,
            const NoseMotion& motion, const oracles::BruteHit& hit) {
  constexpr double nm = 1e-6, moved = 1e-8;
  const double s = found ? found->s : infinity;
  const auto within = [&](const oracles::BruteHit& low, const oracles::BruteHit& high) {
    return s >= (low.cut ? low.s - low.bound - nm : cut.ray.band - nm) &&
           (high.cut && high.s < cut.ray.band - nm ? s <= high.s + nm : true);
  };
  if (within(hit, hit)) return true;
  return within(brute(cut.ray, edge, motion, -moved), brute(cut.ray, edge, motion, moved));
}

template <class AnyEdge>
void expect_as_brute(const char* what, std::uint64_t seed, int pairs, const AnyEdge& any_edge) {
  std::atomic<int> cuts = 0, differ = 0;
  std::vector<double> off(std::size_t(pairs), 0.0);
  tbb::parallel_for(0, pairs, [&](int i) {
    Random random(seed + std::uint64_t(i));
    const TestEdge edge = any_edge(random);
    const TestCut cut = any_cut(edge, i % 3 == 0 ? 0.0 : i % 3 == 1 ? 0.1 : 1.0, 4.0, random);
    const NoseMotion motion = motion_of(cut.path);
    const std::optional<NoseCut> found = NoseCutSearch(edge.nose, motion).first(cut.ray);
    const oracles::BruteHit hit = brute(cut.ray, edge, motion);
    cuts += hit.cut;
    if (!agrees(found, cut, edge, motion, hit)) {
      if (++differ < 10)
        ADD_FAILURE() << what << ", seed " << seed + std::uint64_t(i) << ": "
                      << (found ? found->s : infinity) << ", reference " << hit.cut << " at "
                      << hit.s << " bound " << hit.bound << " of band " << cut.ray.band;
    } else if (found && hit.cut) {
      off[std::size_t(i)] = std::abs(found->s - hit.s);
    }
  });
  std::sort(off.begin(), off.end());
  std::cout << "  " << what << ", seeds " << seed << " and on: " << pairs << " pairs, " << cuts
            << " cut, " << differ << " differ; largest " << off.back() * 1e6 << " nm, of 99% "
            << off[std::size_t(0.99 * pairs)] * 1e6 << " nm\n";
  EXPECT_EQ(differ, 0);
  EXPECT_GT(cuts, pairs / 3);
}

int pairs() { return 100 * longer(100); }

TEST(InsertSurface, OfANoseWithEdgesIsThatOfBruteForce) {
  expect_as_brute("insert", 801000, pairs(),
                  [](Random& random) { return any_insert_edge(random, 0.0); });
}

TEST(InsertSurface, OfAWiperIsThatOfBruteForce) {
  expect_as_brute("wiper", 802000, pairs(),
                  [](Random& random) { return any_insert_edge(random, random.decades(-2, 0.3)); });
}

TEST(InsertSurface, OfAFreeEdgeIsThatOfBruteForce) {
  expect_as_brute("free edge", 803000, pairs(), any_free_edge);
}

TEST(InsertSurface, OfACircleOfArcsIsThatOfTheNose) {
  const std::uint64_t seed = 804000;
  double worst = 0.0;
  int cuts = 0;
  for (int i = 0; i < 400 * longer(10); ++i) {
    Random random(seed + std::uint64_t(i));
    const double r = random.decades(-1.3, 0.7), turn = random.in(0, two_pi);
    std::vector<OutlinePoint> points;
    for (int k = 0; k < 4; ++k) {
      const double angle = turn + 0.25 * two_pi * (k + random.in(0, 0.5));
      points.push_back({r * Vector2d(std::cos(angle), std::sin(angle)), r});
    }
    const TestEdge edge{profile_nose(edge_profile_from_points(points)), {}};
    EXPECT_NEAR(edge.nose.radius, r, 1e-12);
    const TestCut cut = any_cut(edge, i % 2 == 0 ? 0.0 : 0.5, 4.0, random);
    const NoseMotion motion = motion_of(cut.path);
    const auto found = NoseCutSearch(edge.nose, motion).first(cut.ray);
    const auto round = NoseCutSearch({r, {}}, motion).first(cut.ray);
    ASSERT_EQ(found.has_value(), round.has_value()) << "seed " << seed + std::uint64_t(i);
    if (!found) continue;
    ++cuts;
    worst = std::max(worst, std::abs(found->s - round->s));
    EXPECT_NEAR(found->s, round->s, 1e-9) << "seed " << seed + std::uint64_t(i);
  }
  std::cout << "  seeds " << seed << " and on: " << cuts << " cut, " << worst * 1e6
            << " nm from the round nose at most\n";
}

TEST(InsertSurface, TheTreeLosesNothing) {
  constexpr double no_turn_is_farther = 1e9;  // rad
  constexpr double settled = 1e-8;  // mm: 1e-10 rad of the instant on an askew ray at 50 mm
  const std::uint64_t seed = 805000;
  const int cases = 600 * longer(15);
  std::atomic<int> cut = 0, late = 0;
  tbb::parallel_for(0, cases, [&](int i) {
    Random random(seed + std::uint64_t(i));
    const TestEdge edge =
        i % 2 == 0 ? any_free_edge(random) : any_insert_edge(random, random.in(-1, 1));
    const TestCut one = any_cut(edge, i % 3 == 0 ? 0.0 : 1.0, random.in(1, 60), random);
    const NoseCutSearch swept(edge.nose, motion_of(one.path));
    const auto found = swept.first(one.ray);
    const auto tried =
        swept.first_in_window(one.ray, found.value_or(NoseCut{}), no_turn_is_farther);
    cut += found.has_value();
    const double s = found ? found->s : one.ray.band;
    if (!tried || tried->s >= s - settled) return;
    if (++late < 10)
      ADD_FAILURE() << "seed " << seed + std::uint64_t(i) << ": first cut at " << s
                    << ", of every revolution " << tried->s;
  });
  std::cout << "  seeds " << seed << " and on: " << cases << " rays, " << cut << " cut, " << late
            << " late\n";
  EXPECT_EQ(late, 0);
  EXPECT_GT(cut, cases / 2);
}

}  // namespace
}  // namespace abbe::cutting::insert_tests
