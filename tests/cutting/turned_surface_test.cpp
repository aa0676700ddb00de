#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include "cutting/surface/surface.h"
#include "tests/cutting/largest_difference.h"
#include "tests/cutting/random.h"
#include "tests/cutting/turned_parts.h"
#include "tests/oracles/brute_surface.h"
#include "tests/oracles/closed_forms.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

constexpr double R = 0.249;              // mm, the diamond of the platform
constexpr double f = 0.02;               // mm a revolution
constexpr double turned_promise = 1e-7;  // mm, 0.1 nm

/// A facing spiral: radius from `start` to 0 by f a revolution, then one revolution at 0. `x_of`
/// tells the nose centre for a radius of its centre.
struct Facing {
  double start = 10.8;
  double height = 0.0;
  int samples_per_revolution = 1;
  std::function<double(double)> x_of;

  double revolutions() const { return start / f; }
  Vector3d centre(double turns) const {
    const double r = std::max(0.0, start - f * turns);
    return {x_of(r), height, r};
  }
  NosePath path() const {
    NosePath path;
    const double step = 1.0 / samples_per_revolution;
    const int whole = int(std::floor(revolutions() / step + 1e-9));
    for (int i = 0; i <= whole; ++i) path.add(centre(i * step), two_pi * i * step);
    if (whole * step < revolutions()) path.add(centre(revolutions()), two_pi * revolutions());
    path.add(centre(revolutions()), two_pi * (revolutions() + 1.0));
    return path;
  }

  /// What the circle leaves on a ray in the meridian: every pass of either side of the axis is a
  /// circle in the ray's own plane, its centre between the samples on a line.
  double left_on(const MeridianVertex& v) const {
    double least = std::numeric_limits<double>::infinity();
    for (const double side : {1.0, -1.0}) {
      const double first = std::fmod(v.angle / two_pi + (side < 0 ? 0.5 : 0.0) + 8.0, 1.0);
      for (double turns = first; turns <= revolutions() + 1.0; turns += 1.0) {
        const Vector3d c = between_samples(turns);
        const double s =
            oracles::ray_to_circle({c.x() - v.x, c.z() - side * v.r}, {v.nx, side * v.nr}, R);
        if (s < least) least = s;
      }
    }
    return least;
  }

 private:
  Vector3d between_samples(double turns) const {
    if (turns >= revolutions()) return centre(revolutions());
    const double step = 1.0 / samples_per_revolution;
    const double i = std::floor(turns / step);
    const double to = std::min((i + 1.0) * step, revolutions());
    const double u = (turns - i * step) / (to - i * step);
    return (1.0 - u) * centre(i * step) + u * centre(to);
  }
};

std::vector<double> left_on_all(const Facing& facing, const std::vector<MeridianVertex>& vertices) {
  std::vector<double> left;
  for (const MeridianVertex& v : vertices) left.push_back(facing.left_on(v));
  return left;
}

/// Radii that no feed is commensurable with.
std::vector<double> radii(int n, double from, double to, std::mt19937& random) {
  std::uniform_real_distribution<double> r(from, to);
  std::vector<double> result;
  for (int i = 0; i < n; ++i) result.push_back(r(random));
  return result;
}

std::vector<MeridianVertex> on_plane(int n, double from, double to, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> angle(-7.0, 7.0);
  std::vector<MeridianVertex> vertices;
  for (const double r : radii(n, from, to, random)) vertices.push_back({0, r, angle(random), 1, 0});
  return vertices;
}

SurfaceOptions within(double band) {
  SurfaceOptions options;
  options.band = band;
  return options;
}

void print(const char* what, double figure_mm) {
  std::cout << what << ": " << figure_mm * 1e6 << " nm\n";
}

TEST(TurnedSurface, FacedPlaneHasTheCuspOfItsFeed) {
  const unsigned seed = 4711;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const Facing facing{.x_of = [](double) { return R; }};
  const auto vertices = on_plane(20000, f, 10.8 - f, seed);
  const Surface surface = turned_surface(design_of(vertices), {R, {}}, motion_of(facing.path()));
  const double highest = surface.residual.maxCoeff();
  std::cout << "largest residual " << highest * 1e3 << " um, closed form "
            << oracles::cusp(R, f) * 1e3 << " um\n";
  EXPECT_NEAR(oracles::cusp(R, f), 0.200884e-3, 1e-9);
  EXPECT_NEAR(highest, oracles::cusp(R, f), turned_promise);
  EXPECT_GE(surface.residual.minCoeff(), -1e-12);
}

TEST(TurnedSurface, FacedPlaneIsTheClosedFormAtEveryVertex) {
  const unsigned seed = 4712;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const auto vertices = on_plane(1000, 0.0, 10.8 - f, seed);
  for (const int samples : {1, 7, 64}) {
    const Facing facing{.samples_per_revolution = samples, .x_of = [](double) { return R; }};
    const Surface surface = turned_surface(design_of(vertices), {R, {}}, motion_of(facing.path()));
    const double worst = largest_difference(surface, left_on_all(facing, vertices));
    print("plane, largest difference", worst);
    EXPECT_LE(worst, 1e-9) << samples << " samples a revolution";
  }
}

TEST(TurnedSurface, IntervalsOfManyRevolutionsGiveTheSameAsOneForEach) {
  const auto vertices = on_plane(500, 0.0, 10.7, 5);
  const Facing facing{.start = 10.8, .x_of = [](double) { return R; }};
  NosePath coarse;
  coarse.add(facing.centre(0), 0);
  coarse.add(facing.centre(123.37), two_pi * 123.37);
  coarse.add(facing.centre(facing.revolutions()), two_pi * facing.revolutions());
  coarse.add(facing.centre(facing.revolutions()), two_pi * (facing.revolutions() + 1));
  const Surface surface = turned_surface(design_of(vertices), {R, {}}, motion_of(coarse));
  const double worst = largest_difference(surface, left_on_all(facing, vertices));
  print("many revolutions an interval, largest difference", worst);
  EXPECT_LE(worst, 1e-9);
}

TEST(TurnedSurface, OneRevolutionAtTheCentreFinishesTheAxis) {
  const Facing facing{.start = 0.2, .x_of = [](double) { return R; }};
  std::vector<MeridianVertex> vertices;
  for (const double r : {0.0, 1e-15, 1e-12, 1e-9, 1e-7, 1e-5, 9.9e-4, 1.1e-3, 0.004, 0.0099}) {
    for (const double angle : {0.0, 1.3, 2.9, -2.0}) vertices.push_back({0, r, angle, 1, 0});
  }
  const Surface surface = turned_surface(design_of(vertices), {R, {}}, motion_of(facing.path()));
  const double worst = largest_difference(surface, left_on_all(facing, vertices));
  print("around the axis, largest difference", worst);
  EXPECT_LE(worst, 1e-9);
  EXPECT_NEAR(surface.residual[0], 0.0, 1e-12);
  EXPECT_EQ(surface.status[0], VertexStatus::Cut);
}

TEST(TurnedSurface, NoseHeightLeavesAPipOnTheAxis) {
  const double h = 0.01;
  const Facing facing{.start = 0.5, .height = h, .x_of = [](double) { return R; }};
  const std::vector<MeridianVertex> vertices{
      {0, 0, 0, 1, 0}, {0, 0.0099, 2, 1, 0}, {0, 0.0101, 2, 1, 0}};
  const Surface surface = turned_surface(design_of(vertices), {R, {}}, motion_of(facing.path()));
  EXPECT_EQ(surface.status[0], VertexStatus::Uncut);
  EXPECT_EQ(surface.status[1], VertexStatus::Uncut);
  EXPECT_TRUE(std::isnan(surface.residual[1]));
  EXPECT_EQ(surface.cut_line[1], 0);
  EXPECT_EQ(surface.status[2], VertexStatus::Cut);
}

TEST(TurnedSurface, ConeHasTheCuspOfTheFeedAlongItsGenerator) {
  const unsigned seed = 31;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const double slope = 0.04;  // 0.4 mm over a base radius of 10 mm
  const double c = 1 / std::hypot(1, slope);
  // The nose centre lies R along the normal (c, c slope) above x = -slope r.
  const Facing facing{.x_of = [&](double r) { return R / c - slope * r; }};
  std::mt19937 random(seed);
  std::vector<MeridianVertex> vertices;
  for (const double r : radii(2000, 0.1, 10.7, random)) {
    vertices.push_back({-slope * r, r, 17 * r, c, slope * c});
  }
  const Surface surface = turned_surface(design_of(vertices), {R, {}}, motion_of(facing.path()));
  const double worst = largest_difference(surface, left_on_all(facing, vertices));
  print("cone, largest difference", worst);
  EXPECT_LE(worst, 1e-9);
  EXPECT_NEAR(surface.residual.maxCoeff(), oracles::cusp(R, f / c), turned_promise);
}

constexpr double rho = 125.2;

TEST(TurnedSurface, SphereHasTheCuspOfPassesOnAnArc) {
  const unsigned seed = 32;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const double reach = rho + R;
  const Facing facing{.samples_per_revolution = 8,
                      .x_of = [&](double r) { return std::sqrt(reach * reach - r * r) - rho; }};
  std::mt19937 random(seed);
  std::vector<MeridianVertex> vertices;
  for (const double r : radii(2000, 0.0, 10.7, random)) {
    const double x = std::sqrt(rho * rho - r * r) - rho;
    vertices.push_back({x, r, 23 * r, (x + rho) / rho, r / rho});
  }
  const Surface surface = turned_surface(design_of(vertices), {R, {}}, motion_of(facing.path()));
  const double worst = largest_difference(surface, left_on_all(facing, vertices));
  print("sphere, largest difference", worst);
  EXPECT_LE(worst, 1e-9);
  // Passes lie f apart in the radius of the nose centre, hence a little wider on the arc at the
  // rim.
  const double angle = std::asin(10.7 / reach) - std::asin((10.7 - f) / reach);
  EXPECT_LE(surface.residual.maxCoeff(), oracles::dome_cusp(R, rho, angle * rho) + turned_promise);
  EXPECT_GE(surface.residual.maxCoeff(),
            oracles::dome_cusp(R, rho, f * rho / reach) - turned_promise);
}

TEST(TurnedSurface, RadialOffsetOfTheNoseLiftsASphereByItsSlope) {
  const double reach = rho + R;
  const double fine = 1e-4;  // mm a revolution: cusps of 5e-9 mm
  for (const double e : {0.1, -0.02, 1e-4}) {
    std::vector<MeridianVertex> vertices;
    NosePath path;
    for (double r : {1.0, 5.0, 10.0}) {
      vertices.push_back({std::sqrt(rho * rho - r * r) - rho, r, r, 1, 0});
    }
    for (double r = 10.3; r > 0.5; r -= fine) {
      path.add({std::sqrt(reach * reach - r * r) - rho, 0, r + e},
               two_pi * double(path.spindle.size()));
    }
    const Surface surface = turned_surface(design_of(vertices), {R, {}}, motion_of(path));
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      const double r = vertices[i].r;
      const double first = e * r / std::sqrt(rho * rho - r * r);
      const double exact = std::sqrt(rho * rho - (r - e) * (r - e)) - std::sqrt(rho * rho - r * r);
      const double s = surface.residual[Index(i)];
      EXPECT_NEAR(s, first, 0.6 * e * e / rho + turned_promise) << "e " << e << " r " << r;
      EXPECT_NEAR(s, exact, 1e-8) << "e " << e << " r " << r;
      std::cout << "offset " << e << " mm at r " << r << ": " << s * 1e3 << " um, e r / sqrt "
                << first * 1e3 << " um\n";
    }
  }
}

TEST(TurnedSurface, CentreHeightEnlargesACylinderToTheHypotenuse) {
  const double r = 5.0;
  for (const double h : {0.0, 1e-12, 0.01, -0.01, 0.3, -2.0}) {
    NosePath path;
    path.add({0.7, h, r + R}, 0.4);
    path.add({0.7, h, r + R}, 0.4 + two_pi * 1.5);
    std::vector<MeridianVertex> vertices;
    for (const double angle : {0.0, 0.39, 0.41, 1.5707963267948966, 3.0, -3.0, 6.0}) {
      vertices.push_back({0.7, r, angle, 0, 1});
    }
    const Surface surface = turned_surface(design_of(vertices), {R, {}}, motion_of(path));
    const double worst =
        largest_difference(surface, std::vector<double>(vertices.size(), std::hypot(r, h) - r));
    print("centre height, largest difference", worst);
    EXPECT_LE(worst, 1e-9) << "h " << h;  // 1e-10 rad of the instant on a ray across the rake plane
  }
}

TEST(TurnedSurface, SquarenessTurnsAFaceIntoACone) {
  const double beta = 9.42e-5;
  const Facing facing{.x_of = [&](double r) { return R + beta * r; }};
  const auto vertices = on_plane(2000, f, 10.7, 33);
  const Surface surface = turned_surface(design_of(vertices), {R, {}}, motion_of(facing.path()));
  const double worst = largest_difference(surface, left_on_all(facing, vertices));
  print("squareness, largest difference", worst);
  EXPECT_LE(worst, 1e-9);
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const double over = surface.residual[Index(i)] - beta * vertices[i].r;
    ASSERT_GE(over, -0.5 * beta * beta * R - 1e-12);
    ASSERT_LE(over, oracles::cusp(R, f) + beta * f);
  }
}

TEST(TurnedSurface, WavesOfTheNoseStandOnTheFace) {
  const Nose nose{R, {{2, 3e-5, 0.3}, {37, 1e-5, -1.0}, {90, 2e-4, 2.0}}};
  const auto edge = [&](double psi) {
    double e = R;
    for (const NoseWave& w : nose.waves) e += w.amplitude * std::cos(w.order * psi + w.phase);
    return e;
  };
  NosePath path;  // a groove at r = 3
  path.add({R, 0, 3.0}, 0.0);
  path.add({R, 0, 3.0}, two_pi * 1.25);
  std::vector<MeridianVertex> vertices;
  std::vector<double> expected;
  for (double psi = 2.5; psi < 3.8; psi += 0.013) {  // psi = pi faces the part, -x
    const double z = edge(psi) * std::sin(psi);
    // A steep wave may hide another point of the edge below the one at psi: the lowest counts.
    double lowest = R + edge(psi) * std::cos(psi);
    for (double a = 2.0; a < 4.2; a += 1e-4) {
      const double za = edge(a) * std::sin(a) - z, zb = edge(a + 1e-4) * std::sin(a + 1e-4) - z;
      if (za * zb > 0) continue;
      double low = a, high = a + 1e-4;
      for (int i = 0; i < 60; ++i) {
        const double m = 0.5 * (low + high);
        ((edge(m) * std::sin(m) - z) * za > 0 ? low : high) = m;
      }
      lowest = std::min(lowest, R + edge(low) * std::cos(low));
    }
    vertices.push_back({0, 3.0 + z, 5 * psi, 1, 0});
    expected.push_back(lowest);
  }
  const Surface surface = turned_surface(design_of(vertices), nose, motion_of(path));
  const double worst = largest_difference(surface, expected);
  print("waves, largest difference", worst);
  EXPECT_LE(worst, 1e-10);
}

TEST(TurnedSurface, VertexKnowsTheInstantAndLineThatCutIt) {
  const Facing facing{.start = 5.0, .x_of = [](double) { return R; }};
  // On the pass itself at azimuth 1 after 100 revolutions.
  const double turns = 100 + 1.0 / two_pi;
  const std::vector<MeridianVertex> vertices{{0, 5.0 - f * turns, 1.0, 1, 0}};
  const Surface surface = turned_surface(design_of(vertices), {R, {}}, motion_of(facing.path()));
  EXPECT_NEAR(surface.residual[0], 0.0, 1e-12);
  EXPECT_NEAR(surface.cut_time_s[0], turns, 1e-9);
  EXPECT_EQ(surface.cut_line[0], 100 + 101);
}

TEST(TurnedSurface, TiesGoToTheEarlierInstant) {
  // On the axis every instant of a dwell leaves the same bits.
  NoseMotion motion;
  motion.T_without_spindle.assign(41, Eigen::Isometry3d(Eigen::Translation3d(R, 0, 0)));
  motion.spindle = VectorXd::LinSpaced(41, 0.0, 40.0 * two_pi);
  motion.time_s = VectorXd::LinSpaced(41, 3.0, 43.0);
  motion.line.assign(41, 7);
  Design design;
  design.vertices = Points::Zero(1, 3);
  design.normals = Vector3d::UnitX().transpose();
  const Surface surface = turned_surface(design, {R, {}}, motion);
  EXPECT_EQ(surface.residual[0], 0.0);
  EXPECT_EQ(surface.cut_time_s[0], 3.0);
  EXPECT_EQ(surface.cut_line[0], 7);
}

TEST(TurnedSurface, RayThatStartsInRemovedSpaceIsGouged) {
  const Facing facing{.start = 5.0, .x_of = [](double) { return R; }};
  Design design =
      design_of({{0.35, 3.0, 1.0, 1, 0}, {0.1, 3.0, 1.0, 1, 0}, {0, 3, 1, 1, 0}, {0, 7, 1, 1, 0}});
  design.judged[2] = 0;
  const Surface surface = turned_surface(design, {R, {}}, motion_of(facing.path()), within(0.2));
  EXPECT_EQ(surface.status[0], VertexStatus::Gouged);
  EXPECT_EQ(surface.status[1], VertexStatus::Cut);
  EXPECT_EQ(surface.status[2], VertexStatus::Outside);
  EXPECT_EQ(surface.status[3], VertexStatus::Uncut);
  EXPECT_TRUE(std::isnan(surface.residual[0]) && std::isnan(surface.cut_time_s[3]));
  ASSERT_EQ(surface.gouges.size(), 1u);
  const Surface wide = turned_surface(design, {R, {}}, motion_of(facing.path()), within(1.0));
  EXPECT_NEAR(surface.gouges[0].depth, -wide.residual[0], 1e-12);
  EXPECT_NEAR(surface.gouges[0].depth, 0.35, 1e-4);  // less the cusp
}

TEST(TurnedSurface, NumberOfThreadsDoesNotShow) {
  const Facing facing{.samples_per_revolution = 3, .x_of = [](double r) { return R - 1e-5 * r; }};
  const Design design = design_of(on_plane(20000, 0.0, 10.8, 77));
  const NoseMotion motion = motion_of(facing.path());
  const auto with_threads = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return turned_surface(design, {R, {}}, motion);
  };
  const Surface one = with_threads(1);
  const Surface two = with_threads(2);
  EXPECT_TRUE((one.residual.array() == two.residual.array()).all());
  EXPECT_TRUE((one.cut_time_s.array() == two.cut_time_s.array()).all());
  EXPECT_EQ(one.cut_line, two.cut_line);
}

TEST(TurnedSurface, BadNumbersAreRefused) {
  const Facing facing{.start = 0.1, .x_of = [](double) { return R; }};
  const Design design = design_of({{0, 0.05, 0, 1, 0}});
  const NoseMotion good = motion_of(facing.path());
  const Nose nose{R, {}};
  const auto refused = [&](const Design& d, const Nose& n, const NoseMotion& m, double band = 2) {
    EXPECT_THROW(turned_surface(d, n, m, within(band)), std::invalid_argument);
  };
  NoseMotion motion = good;
  motion.spindle[1] = nan;
  refused(design, nose, motion);
  motion = good;
  motion.time_s[1] = motion.time_s[0];
  refused(design, nose, motion);
  motion = good;
  motion.line.pop_back();
  refused(design, nose, motion);
  motion = good;
  motion.T_without_spindle[0].linear() *= 1.001;
  refused(design, nose, motion);
  motion = good;
  motion.spindle *= 1e12;
  refused(design, nose, motion);
  motion = good;
  motion.spindle_direction *= 2;
  refused(design, nose, motion);
  refused(design, {0.0, {}}, good);
  refused(design, {R, {{3, R, 0}}}, good);
  refused(design, nose, good, 0.0);
  refused(design, nose, good, nan);
  Design bad = design;
  bad.normals(0, 1) = nan;
  refused(bad, nose, good);
  bad = design;
  bad.judged.push_back(1);
  refused(bad, nose, good);
  const Surface nothing = turned_surface(design, nose, {});
  EXPECT_EQ(nothing.status[0], VertexStatus::Uncut);
}

TEST(TurnedSurface, FiveHundredRevolutionsOnTwoHundredThousandVerticesTakeSeconds) {
  const Facing facing{.x_of = [](double) { return R; }};
  const Design design = design_of(on_plane(200000, 0.0, 10.8, 78));
  const NoseMotion motion = motion_of(facing.path());
  const auto start = std::chrono::steady_clock::now();
  const Surface surface = turned_surface(design, {R, {}}, motion);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  std::cout << "200000 vertices, 541 revolutions: " << took.count() << " s\n";
  EXPECT_EQ(surface.residual.size(), 200000);
  EXPECT_LT(took.count(), 20.0);  // far above what it needs, so that only a lost hierarchy fails it
}

// The reference bounds itself from below as well as from above, so it can be no nearer than its own
// bound; where a ray only grazes the swept body or the band ends, either answer may be right.

oracles::BruteTurning for_oracle(const Nose& nose, const NoseMotion& motion) {
  oracles::BruteTurning turning{nose.radius, {}, motion.spindle_point, motion.spindle_direction};
  for (std::size_t i = 0; i < motion.T_without_spindle.size(); ++i) {
    const Eigen::Isometry3d& T = motion.T_without_spindle[i];
    turning.poses.push_back(
        {T.linear(), T.translation(), motion.spindle[Index(i)], motion.time_s[Index(i)]});
  }
  return turning;
}

struct Comparison {
  double largest = 0.0;  // mm
  double bound = 0.0;    // mm, the reference's own
  int cut = 0;
  int uncut = 0;
  int disagree = 0;
};

Comparison compare(const Design& design, const Nose& nose, const NoseMotion& motion, double band) {
  SurfaceOptions options;
  options.band = band;
  const Surface surface = turned_surface(design, nose, motion, options);
  const oracles::BruteTurning turning = for_oracle(nose, motion);
  std::vector<oracles::BruteHit> hits(std::size_t(design.vertices.rows()));
  tbb::parallel_for(std::size_t(0), hits.size(), [&](std::size_t i) {
    const auto k = Index(i);
    oracles::BruteOptions brute;
    brute.band = band;
    hits[i] =
        oracles::brute_turned({design.vertices.row(k), design.normals.row(k)}, turning, brute);
  });
  Comparison result;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    const oracles::BruteHit& hit = hits[i];
    const bool cut = surface.status[i] == VertexStatus::Cut;
    result.bound = std::max(result.bound, hit.bound);
    if (cut != (hit.cut && !hit.begins_removed)) {
      ++result.disagree;
      std::cout << "ray " << i << ": " << (cut ? "cut" : "uncut") << " at "
                << surface.residual[Index(i)] << ", reference " << hit.cut << " s " << hit.s
                << " bound " << hit.bound << "\n";
      continue;
    }
    ++(cut ? result.cut : result.uncut);
    if (!cut) continue;
    const double s = surface.residual[Index(i)];
    const double off = std::max(s - hit.s, hit.s - hit.bound - s);
    if (off > 1e-9) {
      std::cout << "ray " << i << ": " << s << ", reference " << hit.s << " bound " << hit.bound
                << " times " << surface.cut_time_s[Index(i)] << " " << hit.time_s << "\n";
    }
    result.largest = std::max(result.largest, std::abs(s - hit.s));
  }
  return result;
}

/// How wrong a random lathe is.
struct Wrong {
  double height = 0.0;          // mm
  double offset = 0.0;          // mm
  double tilt = 0.0;            // rad, of the rake plane
  double wander = 0.0;          // mm and rad from sample to sample
  double askew = 0.0;           // of the normals, out of the meridian
  double from = 0.6, to = 0.0;  // mm, radius of the nose centre
  double feed = 0.05;           // mm a revolution
  double turns_a_sample = 0.37;
};

NosePath random_path(const Wrong& wrong, OracleRandom& random) {
  NosePath path;
  const Matrix3d tilt = random.rotation(wrong.tilt);
  const double height = random.in(-1, 1) * wrong.height;
  const double offset = random.in(-1, 1) * wrong.offset;
  const double turns = (wrong.from - wrong.to) / wrong.feed + 1.0;
  const double angle0 = random.in(-20, 20);
  for (double turn = 0; turn < turns; turn += wrong.turns_a_sample * random.in(0.5, 1.5)) {
    const double r = std::max(wrong.to, wrong.from - wrong.feed * turn);
    const Vector3d centre(0.249 - 0.05 * r, height, r + offset);
    path.add(centre + wrong.wander * random.any(), angle0 + two_pi * turn,
             tilt * random.rotation(wrong.wander));
  }
  return path;
}

Design random_rays(int n, const Wrong& wrong, double r_low, double r_high, OracleRandom& random) {
  std::vector<MeridianVertex> vertices;
  for (int i = 0; i < n; ++i) {
    const double lean = random.in(-0.3, 0.6);
    const double r = random.in(r_low, r_high);
    vertices.push_back(
        {random.in(-0.01, 0.01) - 0.05 * r, r, random.in(-10, 10), std::cos(lean), std::sin(lean)});
  }
  Design design = design_of(vertices);
  for (int i = 0; i < n; ++i) {
    design.normals.row(i) += wrong.askew * random.any().transpose();
    design.normals.row(i).normalize();
  }
  return design;
}

void expect_agreement(const char* what, const Wrong& wrong, unsigned seed, int rays) {
  SCOPED_TRACE(testing::Message() << what << ", seed " << seed);
  OracleRandom random(seed);
  const Nose nose{0.249, {}};
  const NoseMotion motion = motion_of(random_path(wrong, random));
  const Design design = random_rays(rays, wrong, std::max(0.0, wrong.to - 0.1), wrong.from, random);
  const Comparison c = compare(design, nose, motion, 0.2);
  std::cout << what << ", seed " << seed << ": " << c.cut << " cut, " << c.uncut
            << " uncut, largest difference " << c.largest * 1e6 << " nm, reference's bound "
            << c.bound * 1e6 << " nm\n";
  EXPECT_EQ(c.disagree, 0);
  EXPECT_GT(c.cut, rays / 2);
  EXPECT_LE(c.largest, c.bound + 1e-9);
  EXPECT_LE(c.bound, 1e-7);
}

TEST(TurnedOracle, PerfectLatheAgrees) { expect_agreement("perfect", {}, 1, 150); }

TEST(TurnedOracle, HeightTiltAndOffsetAgree) {
  for (const unsigned seed : {2u, 3u, 4u}) {
    expect_agreement("constant deviations",
                     {.height = 0.02, .offset = 0.05, .tilt = 0.05, .from = 4.0, .to = 3.6}, seed,
                     100);
  }
}

TEST(TurnedOracle, WanderingNoseAgrees) {
  for (const unsigned seed : {5u, 6u, 7u}) {
    expect_agreement(
        "wandering",
        {.height = 0.01, .offset = 0.01, .tilt = 0.02, .wander = 1e-3, .from = 7.0, .to = 6.5},
        seed, 100);
  }
}

TEST(TurnedOracle, NormalsOutOfTheMeridianAgree) {
  for (const unsigned seed : {8u, 9u, 10u}) {
    expect_agreement(
        "askew normals",
        {.height = 0.01, .tilt = 0.02, .wander = 1e-4, .askew = 0.5, .from = 3.0, .to = 2.5}, seed,
        100);
  }
}

TEST(TurnedOracle, FineSamplesAgree) {
  expect_agreement("fine samples",
                   {.height = 0.01,
                    .tilt = 0.02,
                    .wander = 1e-5,
                    .askew = 0.1,
                    .from = 3.0,
                    .to = 2.7,
                    .turns_a_sample = 0.01},
                   11, 100);
}

TEST(TurnedOracle, RaysAboutTheAxisAgree) {
  for (const unsigned seed : {12u, 13u, 14u}) {
    expect_agreement("about the axis",
                     {.height = 0.002,
                      .offset = 0.003,
                      .tilt = 0.01,
                      .wander = 1e-5,
                      .askew = 0.02,
                      .from = 0.1},
                     seed, 100);
  }
}

TEST(TurnedOracle, LargeDeviationsAgree) {
  for (const unsigned seed : {15u, 16u, 17u}) {
    expect_agreement("large deviations",
                     {.height = 0.5,
                      .offset = 0.3,
                      .tilt = 0.4,
                      .wander = 0.02,
                      .askew = 0.3,
                      .from = 2.0,
                      .to = 1.5},
                     seed, 100);
  }
}

}  // namespace
}  // namespace abbe::cutting
