#include <tbb/global_control.h>
#include "cutting/surface/surface.h"
#include "tests/cutting/milled_parts.h"
#include "tests/cutting/turned_parts.h"
#include "tests/test.h"

// The reference for what rivals foretell is the exact surface of the displaced motion, which has
// oracles of its own; closed forms for a ball and a nose on planes.
namespace abbe::cutting {
namespace {

constexpr double um = 1e-3;

/// mm, of a circle of radius R over its lowest point, `aside` from it.
double lift(double R, double aside) { return R - std::sqrt(R * R - aside * aside); }

double predicted(const CompetingPass& competing_pass, const Vector3d& d) {
  const double t = competing_pass.across.dot(d);
  return competing_pass.distance + competing_pass.gradient.dot(d) +
         0.5 * competing_pass.curvature * t * t;
}

CutterMotion displaced(CutterMotion motion, const Vector3d& d) {
  motion.tip.rowwise() += d.transpose();
  return motion;
}

NoseMotion displaced(NoseMotion motion, const Vector3d& d) {
  for (Eigen::Isometry3d& T : motion.T_without_spindle) T.translation() += d;
  return motion;
}

/// The displacement that a rival's tool has in the workpiece, of one that stands in the machine.
Vector3d at_rival(const CutterMotion&, const CompetingPass&, const Vector3d& d) { return d; }

Vector3d at_rival(const NoseMotion& motion, const CompetingPass& competing_pass,
                  const Vector3d& d) {
  const double from = motion.spindle[competing_pass.move];
  const double angle = from + competing_pass.t * (motion.spindle[competing_pass.move + 1] - from);
  return Eigen::AngleAxisd(angle, motion.spindle_direction) * d;
}

template <class Motion>
VectorXd predicted(const std::vector<CompetingPass>& competing_passes, const Motion& motion,
                   const Vector3d& d, Index vertices) {
  VectorXd s = VectorXd::Constant(vertices, std::numeric_limits<double>::infinity());
  for (const CompetingPass& competing_pass : competing_passes)
    s[competing_pass.vertex] = std::min(
        s[competing_pass.vertex], predicted(competing_pass, at_rival(motion, competing_pass, d)));
  return s;
}

Surface surface_of(const Design& design, const Cutter& cutter, const CutterMotion& motion) {
  return milled_surface(design, cutter, motion);
}
Surface surface_of(const Design& design, const Nose& nose, const NoseMotion& motion) {
  return turned_surface(design, nose, motion);
}
std::vector<CompetingPass> competing_passes_along(const Design& design, const Cutter& cutter,
                                                  const CutterMotion& motion) {
  return milled_competing_passes(design, cutter, motion);
}
std::vector<CompetingPass> competing_passes_along(const Design& design, const Nose& nose,
                                                  const NoseMotion& motion) {
  return turned_competing_passes(design, nose, motion);
}

struct Study {
  int seed = 0;
  double size = 50 * um;
  int draws = 20;
};

/// Largest difference (mm) between what the rivals foretell and the surface of the displaced
/// motion, over random displacements of one size.
template <class Tool, class Motion>
double largest_miss(const Design& design, const Tool& tool, const Motion& motion,
                    const Study& study) {
  const std::vector<CompetingPass> competing_passes = competing_passes_along(design, tool, motion);
  std::mt19937_64 random{std::uint64_t(study.seed)};
  std::normal_distribution<double> normal;
  double largest = 0.0;
  for (int i = 0; i < study.draws; ++i) {
    const Vector3d direction =
        Vector3d(normal(random), normal(random), normal(random)).normalized();
    const Vector3d d = study.size * direction;
    const Surface cut = surface_of(design, tool, displaced(motion, d));
    const VectorXd s = predicted(competing_passes, motion, d, design.vertices.rows());
    for (Index v = 0; v < s.size(); ++v) {
      EXPECT_EQ(cut.status[std::size_t(v)], VertexStatus::Cut) << "vertex " << v;
      largest = std::max(largest, std::abs(s[v] - cut.residual[v]));
    }
  }
  return largest;
}

/// The header's bound, for passes of a pitch.
struct Bound {
  double cross_section = 5.0;  // mm, radius
  double pitch = 0.4;          // mm
  double along =
      std::numeric_limits<double>::infinity();  // mm, radius of the passes along the feed
  double turn = 0.0;                            // rad, of the path between two moves
  bool axis_turns = false;

  double at(double d) const {
    const double R = cross_section;
    const double slope = (d + pitch / 2) / R;
    const double spread = d * (d * d + 1e-4);  // of the stencil too
    const double noise = 1e-7 + (axis_turns ? 2e-6 : 1e-7) * d + (axis_turns ? 4e-4 : 2e-5) * d * d;
    return slope * spread / (2 * R * R) + d * spread / (8 * R * R * R) + d * d / (2 * along) +
           turn * d / 2 + noise;
  }
};

/// Holds the bound for displacements of 1, 10 and 50 um, and prints the figures.
template <class Tool, class Motion>
void expect_predicted(const Design& design, const Tool& tool, const Motion& motion,
                      const Bound& bound) {
  for (const int size : {1, 10, 50}) {
    const Study study{.seed = 20 + size, .size = size * um};
    SCOPED_TRACE("seed " + std::to_string(study.seed));
    const double miss = largest_miss(design, tool, motion, study);
    const double max_passes = bound.at(study.size);
    std::cout << miss * 1e6 << " nm off of " << max_passes * 1e6 << " at " << size << " um\n";
    EXPECT_LT(miss, max_passes);
  }
}

bool same_bits(const std::vector<CompetingPass>& a, const std::vector<CompetingPass>& b) {
  const auto same = [](const CompetingPass& p, const CompetingPass& q) {
    return p.vertex == q.vertex && p.distance == q.distance && p.move == q.move && p.t == q.t &&
           p.contact == q.contact && p.gradient == q.gradient && p.across == q.across &&
           p.curvature == q.curvature;
  };
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), same);
}

/// Largest difference (mm) of the first rival from the surface, and whether every vertex that is
/// cut has rivals, in order, and no other has.
template <class Tool, class Motion>
double check_first(const Design& design, const Tool& tool, const Motion& motion) {
  const Surface surface = surface_of(design, tool, motion);
  const std::vector<CompetingPass> competing_passes = competing_passes_along(design, tool, motion);
  std::vector<int> count(surface.status.size(), 0);
  double largest = 0.0;
  for (std::size_t k = 0; k < competing_passes.size(); ++k) {
    const CompetingPass& competing_pass = competing_passes[k];
    const int earlier = count[std::size_t(competing_pass.vertex)]++;
    if (earlier == 0)
      largest = std::max(
          largest, std::abs(competing_pass.distance - surface.residual[competing_pass.vertex]));
    else
      EXPECT_GE(competing_pass.distance, competing_passes[k - 1].distance);
    EXPECT_LE(competing_pass.distance, surface.residual[competing_pass.vertex] + 0.05 + 1e-7);
    EXPECT_NEAR(competing_pass.gradient.dot(design.normals.row(competing_pass.vertex).transpose()),
                1, 1e-12);
    EXPECT_NEAR(competing_pass.across.norm(), 1, 1e-12);
    EXPECT_NEAR(competing_pass.across.dot(design.normals.row(competing_pass.vertex).transpose()), 0,
                1e-9);
    EXPECT_GE(competing_pass.vertex, k > 0 ? competing_passes[k - 1].vertex : 0);
  }
  for (std::size_t v = 0; v < count.size(); ++v)
    EXPECT_EQ(count[v] > 0, surface.status[v] == VertexStatus::Cut) << "vertex " << v;
  return largest;
}

// ---- milling ------------------------------------------------------------------------------------

struct RasterOptions {
  double half_width = 4.0;  // mm
  double step_over = 0.4;   // mm
  double spacing = 0.1;     // mm, of the stops
  double lead = 0.0;        // rad, of the axis from the normal, towards +x
};

struct Dome {
  double R = 100.0;
  Vector3d point(double x, double y) const { return {x, y, std::sqrt(R * R - x * x - y * y) - R}; }
  Vector3d normal(double x, double y) const { return (point(x, y) + Vector3d(0, 0, R)) / R; }
};

/// Hollow of radius 20.
struct Bowl {
  Vector3d point(double x, double y) const { return {x, y, 20 - std::sqrt(400 - x * x - y * y)}; }
  Vector3d normal(double x, double y) const { return (Vector3d(0, 0, 20) - point(x, y)) / 20; }
};

struct Plane {
  Vector3d point(double x, double y) const { return {x, y, 0}; }
  Vector3d normal(double, double) const { return Vector3d::UnitZ(); }
};

/// Zig-zag whose corner circle touches the part.
template <class Part>
CutterMotion raster(const Part& part, const Cutter& cutter, const RasterOptions& options) {
  std::vector<Stop> stops;
  const int passes = int(2 * options.half_width / options.step_over) + 1;
  const int stops_a_pass = int(std::round(2 * options.half_width / options.spacing)) + 1;
  for (int j = 0; j < passes; ++j)
    for (int i = 0; i < stops_a_pass; ++i) {
      const double along = 2.0 * i / (stops_a_pass - 1) - 1.0;
      const double x = options.half_width * (j % 2 == 0 ? along : -along);
      const double y = (j - 0.5 * (passes - 1)) * options.step_over;
      const Vector3d n = part.normal(x, y);
      const Vector3d forward = (Vector3d::UnitX() - n.x() * n).normalized();
      const Vector3d axis = std::cos(options.lead) * n + std::sin(options.lead) * forward;
      const Vector3d up = n - n.dot(axis) * axis;
      const Vector3d out = up.norm() > 1e-12 ? up.normalized() : Vector3d::Zero().eval();
      const double ring = cutter.radius - cutter.corner_radius;
      const Vector3d centre = part.point(x, y) + cutter.corner_radius * n + ring * out;
      stops.push_back({centre - cutter.corner_radius * axis, axis});
    }
  return motion_of(stops);
}

template <class Part>
Design sites_on(const Part& part, double half_width, int count, int seed) {
  std::mt19937_64 random{std::uint64_t(seed)};
  std::uniform_real_distribution<double> place(-half_width, half_width);
  std::vector<Site> sites;
  for (int i = 0; i < count; ++i) {
    const double x = place(random);
    const double y = place(random);
    sites.push_back({part.point(x, y), part.normal(x, y)});
  }
  return design_of(sites);
}

TEST(MilledRivals, OfABallRasterOnAPlaneAreCirclesAside) {
  constexpr double pitch = 0.3;
  std::vector<Stop> stops;
  for (int j = 0; j < 11; ++j) {  // one way, lifted on the way back
    for (const double x : {-4.0, -1.3, 0.4, 0.9, 4.0}) stops.push_back({{x, pitch * j, 0}});
    stops.push_back({{4, pitch * j, 30}});
    stops.push_back({{-4, pitch * (j + 1), 30}});
  }
  const CutterMotion motion = motion_of(stops);
  const std::vector<double> aside{0.0, 0.04, 0.11, 0.149999, -0.15 + 1e-9};
  std::vector<Site> sites;
  for (const double a : aside) sites.push_back({{0.2, 5 * pitch + a, 0}});
  const std::vector<CompetingPass> competing_passes = milled_competing_passes(
      design_of(sites), ball_mill, motion, {.reach = 0.03, .max_passes = 20});
  double worst[3] = {0, 0, 0};
  std::size_t k = 0;
  for (int v = 0; v < int(sites.size()); ++v) {
    std::vector<std::pair<double, double>> expected;  // distance, aside
    for (int j = 0; j < 11; ++j) {
      const double y = sites[std::size_t(v)].point.y() - pitch * j;
      expected.push_back({lift(5, y), y});
    }
    std::stable_sort(expected.begin(), expected.end(), [](const auto& a, const auto& b) {
      return a.first < b.first - 1e-12;  // of equal ones the earlier
    });
    for (const auto& [s, y] : expected) {
      if (s > expected.front().first + 0.03) break;
      ASSERT_LT(k, competing_passes.size());
      const CompetingPass& competing_pass = competing_passes[k++];
      const double depth = std::sqrt(25 - y * y);
      EXPECT_EQ(competing_pass.vertex, v);
      const Vector3d gradient(0, -y / depth, 1);
      worst[0] = std::max(worst[0], std::abs(competing_pass.distance - s));
      worst[1] = std::max(worst[1], (competing_pass.gradient - gradient).norm());
      worst[2] = std::max(worst[2], std::abs(competing_pass.curvature - 25 / std::pow(depth, 3)));
      EXPECT_LT((competing_pass.contact - Vector3d(0.2, sites[std::size_t(v)].point.y(), s)).norm(),
                1e-9);
      EXPECT_NEAR(std::abs(competing_pass.across.y()), 1, 1e-9);
    }
  }
  EXPECT_EQ(k, competing_passes.size());
  std::cout << "ball raster: " << competing_passes.size() << " rivals, distance " << worst[0]
            << " mm, gradient " << worst[1] << ", curvature " << worst[2] << " 1/mm\n";
  EXPECT_LT(worst[0], 1e-9);
  EXPECT_LT(worst[1], 1e-6);
  EXPECT_LT(worst[2], 2e-4);
}

TEST(MilledRivals, ForetellADisplacedBallOnAPlane) {
  const Plane part;
  expect_predicted(sites_on(part, 3.0, 2000, 1), ball_mill, raster(part, ball_mill, {}), {});
}

TEST(MilledRivals, ForetellADisplacedBallOnADome) {
  const Dome part;
  expect_predicted(sites_on(part, 3.0, 2000, 2), ball_mill, raster(part, ball_mill, {.lead = 0.2}),
                   {.along = 100, .turn = 1.05e-3, .axis_turns = true});
}

TEST(MilledRivals, ForetellADisplacedBallInABowl) {
  const Bowl part;
  expect_predicted(sites_on(part, 3.0, 2000, 5), ball_mill,
                   raster(part, ball_mill, {.spacing = 0.02}),
                   {.along = 20, .turn = 1.1e-3, .axis_turns = true});
}

TEST(MilledRivals, ForetellADisplacedBullNoseThatLeans) {
  const Dome part;
  const Cutter bull{5.0, 1.0, 20.0};
  expect_predicted(sites_on(part, 3.0, 2000, 3), bull, raster(part, bull, {.lead = 0.1745}),
                   {.along = 100, .turn = 1.05e-3, .axis_turns = true});
}

TEST(MilledRivals, ForetellADisplacedFlatEndThatLeans) {
  const Dome part;
  const Cutter flat{5.0, 0.0, 20.0};
  expect_predicted(sites_on(part, 3.0, 2000, 4), flat, raster(part, flat, {.lead = 0.0873}),
                   {.along = 100, .turn = 1.05e-3, .axis_turns = true});
}

TEST(MilledRivals, OfAnUprightFlatEndFollowTheNormalAlone) {
  const Plane part;
  const Cutter flat{5.0, 0.0, 20.0};
  const Design design = sites_on(part, 3.0, 300, 6);
  const CutterMotion motion = raster(part, flat, {.step_over = 2.0});
  for (const CompetingPass& competing_pass : milled_competing_passes(design, flat, motion)) {
    EXPECT_LT((competing_pass.gradient - Vector3d::UnitZ()).norm(), 1e-9);
    EXPECT_LT(std::abs(competing_pass.curvature), 1e-6);
  }
  expect_predicted(design, flat, motion, {});
}

TEST(MilledRivals, OfPassesJoinedByTheirTurnAreThePassesAndTheTurn) {
  // Out, 0.5 mm across and back, all moves in one run within reach of a vertex near the turn.
  std::vector<Stop> stops;
  for (int i = 0; i <= 40; ++i) stops.push_back({{-4 + 0.1 * i, 0, 0}});
  for (int i = 1; i <= 5; ++i) stops.push_back({{0, 0.1 * i, 0}});
  for (int i = 1; i <= 40; ++i) stops.push_back({{-0.1 * i, 0.5, 0}});
  const Design design = design_of({Site{{-0.3, 0.2, 0}}, Site{{-2, 0.2, 0}}});
  const std::vector<CompetingPass> competing_passes =
      milled_competing_passes(design, ball_mill, motion_of(stops));
  ASSERT_EQ(competing_passes.size(), 5u);
  const std::vector<Vector3d> aside{
      {0, 0.2, 0}, {-0.3, 0, 0}, {0, -0.3, 0}, {0, 0.2, 0}, {0, -0.3, 0}};
  std::vector<CompetingPass> sorted =
      competing_passes;  // the turn and the way back are equally far
  if (sorted[1].move > sorted[2].move) std::swap(sorted[1], sorted[2]);
  for (std::size_t i = 0; i < 5; ++i) {
    const double a = aside[i].norm();
    const double depth = std::sqrt(25 - a * a);
    EXPECT_NEAR(sorted[i].distance, lift(5, a), 1e-9);
    EXPECT_LT((sorted[i].gradient - Vector3d(0, 0, 1) + aside[i] / depth).norm(), 1e-6);
    EXPECT_NEAR(std::abs(sorted[i].across.dot(aside[i])), a, 1e-9);
  }
}

TEST(MilledRivals, OfAPoseThatStandsHaveTheCurvatureOfTheTool) {
  const Design design = design_of({Site{{0.3, 0.1, 0}}, Site{{-0.2, 0.6, 0}}});
  const std::vector<CompetingPass> competing_passes =
      milled_competing_passes(design, ball_mill, motion_of({Stop{{0, 0, 0}}}));
  ASSERT_EQ(competing_passes.size(), 2u);
  for (int v = 0; v < 2; ++v) {
    const CompetingPass& competing_pass = competing_passes[std::size_t(v)];
    const Vector3d aside = design.vertices.row(v);
    const double depth = std::sqrt(25 - aside.squaredNorm());
    EXPECT_LT((competing_pass.gradient - Vector3d(0, 0, 1) + aside / depth).norm(), 1e-6);
    EXPECT_NEAR(competing_pass.curvature, 25 / std::pow(depth, 3),
                1e-5);  // the larger one, outwards
    EXPECT_NEAR(std::abs(competing_pass.across.dot(aside.normalized())), 1, 1e-3);
  }
}

TEST(MilledRivals, BesideTheEdgeOfACutTakeTheFlatterSide) {
  const Cutter flat{5.0, 0.0, 20.0};
  const CutterMotion motion = motion_of({Stop{{-9, 0, 0}}, Stop{{9, 0, 0}}});
  for (const double from_edge : {1e-6, 0.005, 0.0099}) {
    const std::vector<CompetingPass> competing_passes =
        milled_competing_passes(design_of({Site{{0, 5 - from_edge, 0}}}), flat, motion);
    ASSERT_EQ(competing_passes.size(), 1u);
    EXPECT_LT((competing_passes[0].gradient - Vector3d::UnitZ()).norm(), 1e-9);
    EXPECT_EQ(competing_passes[0].curvature, 0.0);
  }
}

TEST(MilledRivals, BeginWithTheSurface) {
  const Dome part;
  for (const double corner : {5.0, 1.0, 0.0}) {
    const Cutter cutter{5.0, corner, 20.0};
    Design design = sites_on(part, 6.0, 3000, 7);  // some beyond the raster
    design.judged.assign(3000, 1);
    for (int i = 0; i < 300; ++i) design.judged[std::size_t(i)] = 0;
    design.vertices.bottomRows(50).col(2).array() -= 9.0;
    const double off = check_first(design, cutter, raster(part, cutter, {.lead = 0.1}));
    std::cout << "corner " << corner << ": first rival " << off << " mm from the surface\n";
    EXPECT_LT(off, 1e-7);
  }
}

TEST(MilledRivals, DoNotDependOnTheNumberOfThreads) {
  const Dome part;
  const Cutter bull{5.0, 1.0, 20.0};
  const Design design = sites_on(part, 3.0, 1000, 8);
  const CutterMotion motion = raster(part, bull, {.lead = 0.1745});
  const auto with_threads = [&](std::size_t threads) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    return milled_competing_passes(design, bull, motion);
  };
  const std::vector<CompetingPass> one = with_threads(1);
  EXPECT_GT(one.size(), 1000u);
  EXPECT_TRUE(same_bits(one, with_threads(2)));
  EXPECT_TRUE(same_bits(one, with_threads(7)));
}

TEST(MilledRivals, RefuseOptionsThatMeanNothing) {
  const Design design = design_of({Site{{0, 0, 0}}});
  const CutterMotion motion = motion_of({Stop{{0, 0, 0}}});
  const auto refused = [&](const CompetingPassOptions& options) {
    EXPECT_THROW(milled_competing_passes(design, ball_mill, motion, options),
                 std::invalid_argument);
  };
  for (const double bad : {-1e-9, nan}) refused({.reach = bad});
  for (const int bad : {0, -1}) refused({.max_passes = bad});
  for (const double bad : {0.0, -0.01, nan}) refused({.difference_step = bad});
  for (const double bad : {0.0, nan}) refused({.band = bad});
  EXPECT_TRUE(milled_competing_passes(design_of(std::vector<Site>{}), ball_mill, motion).empty());
  EXPECT_TRUE(milled_competing_passes(design, ball_mill, motion_of(std::vector<Stop>{})).empty());
  EXPECT_EQ(
      milled_competing_passes(design, ball_mill, motion, {.reach = 0.0, .max_passes = 1}).size(),
      1u);
}

// ---- turning ------------------------------------------------------------------------------------

struct Turning {
  double feed = 0.02;       // mm a revolution
  int samples = 1;          // a revolution
  double half_angle = 0.0;  // rad, of the cone that the surface is, from the plane of the face
};

constexpr double nose_radius = 0.249;

/// From r = 6 to r = 1, or along as much at r = 6, the edge touching the surface.
NosePath path_of(const Turning& turning) {
  NosePath path;
  const int revolutions = int(5.0 / turning.feed);
  const double s = std::sin(turning.half_angle);
  const double c = std::cos(turning.half_angle);
  for (int i = 0; i <= revolutions * turning.samples; ++i) {
    const double turned = double(i) / turning.samples;
    const double way = turning.feed * turned;
    path.add({nose_radius * c + way * s, 0, 6 + nose_radius * s - way * c}, two_pi * turned);
  }
  return path;
}

Design turned_sites(const Turning& turning, int count, int seed) {
  std::mt19937_64 random{std::uint64_t(seed)};
  std::uniform_real_distribution<double> way(0.5, 4.5);
  std::uniform_real_distribution<double> angle(-3.14, 3.14);
  const double s = std::sin(turning.half_angle);
  const double c = std::cos(turning.half_angle);
  std::vector<MeridianVertex> vertices;
  for (int i = 0; i < count; ++i) {
    const double w = way(random);
    vertices.push_back({w * s, 6 - w * c, angle(random), c, s});
  }
  return design_of(vertices);
}

TEST(TurnedRivals, OfAFaceAreTheRevolutionsAside) {
  const double feed = 0.02;
  const std::vector<MeridianVertex> vertices{
      {0, 3.0, 0.0, 1, 0}, {0, 3.0037, 1.3, 1, 0}, {0, 1.51, -2.0, 1, 0}, {0, 5.5, 3.1, 1, 0}};
  const Design design = design_of(vertices);
  const Matrix3d R_wl = lathe_in_workpiece().linear();
  for (const int samples : {1, 24}) {
    const NoseMotion motion = motion_of(path_of({.feed = feed, .samples = samples}));
    const std::vector<CompetingPass> competing_passes = turned_competing_passes(
        design, {nose_radius, {}}, motion, {.reach = 0.01, .max_passes = 50});
    double worst[3] = {0, 0, 0};
    std::size_t k = 0;
    for (int v = 0; v < 4; ++v) {
      const MeridianVertex& vertex = vertices[std::size_t(v)];
      std::vector<std::pair<double, double>> expected;  // distance, aside
      for (int turn = 0; turn < 251; ++turn) {
        const double aside = vertex.r - (6 - feed * (turn + vertex.angle / two_pi));
        if (std::abs(aside) < 0.2) expected.push_back({lift(nose_radius, aside), aside});
      }
      std::stable_sort(expected.begin(), expected.end(),
                       [](const auto& a, const auto& b) { return a.first < b.first - 1e-12; });
      const Vector3d e_r(0, -std::sin(vertex.angle), std::cos(vertex.angle));
      const Vector3d e_c(0, -std::cos(vertex.angle), -std::sin(vertex.angle));
      for (const auto& [s, aside] : expected) {
        if (s > expected.front().first + 0.01) break;
        ASSERT_LT(k, competing_passes.size());
        const CompetingPass& competing_pass = competing_passes[k++];
        EXPECT_EQ(competing_pass.vertex, v);
        const double depth = std::sqrt(nose_radius * nose_radius - aside * aside);
        const double slope = aside / depth;
        const Vector3d gradient_l =
            Vector3d::UnitX() - slope * e_r - slope * feed / (two_pi * vertex.r) * e_c;
        const double bend = nose_radius * nose_radius / std::pow(depth, 3);
        worst[0] = std::max(worst[0], std::abs(competing_pass.distance - s));
        worst[1] =
            std::max(worst[1], (R_wl.transpose() * competing_pass.gradient - gradient_l).norm());
        worst[2] = std::max(worst[2], std::abs(competing_pass.curvature / bend - 1));
        EXPECT_NEAR(std::abs(competing_pass.across.dot(R_wl * e_r)), 1, 1e-9);
      }
    }
    EXPECT_EQ(k, competing_passes.size());
    std::cout << samples << " samples a turn: " << k << " rivals, distance " << worst[0]
              << " mm, gradient " << worst[1] << ", curvature " << 100 * worst[2] << " %\n";
    EXPECT_LT(worst[0], 1e-9);
    EXPECT_LT(worst[1], 3e-4);
    EXPECT_LT(worst[2], 4e-3);
  }
}

TEST(TurnedRivals, ForetellADisplacedNose) {
  const Nose nose{nose_radius, {}};
  for (const double half_angle : {0.0, 0.3, 1.2, two_pi / 4})
    for (const int samples : {1, 24}) {
      const Turning turning{.samples = samples, .half_angle = half_angle};
      const double min_r = 6 - 4.5 * std::cos(half_angle);
      const double along = min_r / std::min(1.0, std::sin(half_angle) + 0.25);
      std::cout << "cone of " << half_angle << " rad, " << samples << " samples a turn\n";
      expect_predicted(turned_sites(turning, 500, 9), nose, motion_of(path_of(turning)),
                       {.cross_section = nose_radius, .pitch = turning.feed, .along = along});
    }
}

TEST(TurnedRivals, BeginWithTheSurface) {
  const Turning turning{.samples = 7, .half_angle = 0.2};
  // of 300 sites 100 are not judged and 50 lie beyond the cut
  Design design = turned_sites(turning, std::getenv("ABBE_LONG") != nullptr ? 1000 : 300, 10);
  for (int i = 0; i < 100; ++i) design.judged[std::size_t(i)] = 0;
  design.vertices.bottomRows(50).array() += 9.0;
  const double off =
      check_first(design, Nose{nose_radius, {{3, 1e-4, 0.2}}}, motion_of(path_of(turning)));
  std::cout << "first rival " << off << " mm from the surface\n";
  EXPECT_LT(off, 1e-7);
}

TEST(TurnedRivals, OnTheSpindleLineAreFinite) {
  std::vector<MeridianVertex> vertices;
  for (const double r : {0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.01, 0.05})
    vertices.push_back({0, r, 0.4, 1, 0});
  NosePath path;
  for (int i = 0; i <= 60; ++i) path.add({nose_radius, 0, 0.4 - 0.01 * i}, two_pi * i);
  const Design design = design_of(vertices);
  const double off = check_first(design, Nose{nose_radius, {}}, motion_of(path));
  EXPECT_LT(off, 1e-7);
  for (const CompetingPass& competing_pass :
       turned_competing_passes(design, {nose_radius, {}}, motion_of(path))) {
    EXPECT_TRUE(competing_pass.gradient.allFinite() && competing_pass.across.allFinite());
    EXPECT_TRUE(std::isfinite(competing_pass.curvature));
  }
}

TEST(TurnedRivals, DoNotDependOnTheNumberOfThreads) {
  const Turning turning{.samples = 7, .half_angle = 0.2};
  const Design design = turned_sites(turning, 500, 11);
  const NoseMotion motion = motion_of(path_of(turning));
  const auto with_threads = [&](std::size_t threads) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    return turned_competing_passes(design, {nose_radius, {}}, motion);
  };
  const std::vector<CompetingPass> one = with_threads(1);
  EXPECT_GT(one.size(), 500u);
  EXPECT_TRUE(same_bits(one, with_threads(2)));
  EXPECT_TRUE(same_bits(one, with_threads(7)));
}

}  // namespace
}  // namespace abbe::cutting
