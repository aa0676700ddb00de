#include "cutting/part/design_points.h"
#include "cutting/stock/body.h"
#include "cutting/surface/machined_surface.h"
#include "cutting/surface/surface.h"
#include "tests/cutting/milled_parts.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

/// A plate of 40 x 40 mm, top at z = 0, with a vertex every 2 mm above and below.
Design plate(double thickness) {
  constexpr int n = 21;
  Design design;
  design.vertices.resize(2 * n * n, 3);
  design.normals.resize(2 * n * n, 3);
  std::vector<Eigen::Vector3i> triangles;
  for (int side = 0; side < 2; ++side)
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        const int v = side * n * n + j * n + i;
        design.vertices.row(v) << 2.0 * i - 20, 2.0 * j - 20, side == 0 ? 0.0 : -thickness;
        design.normals.row(v) << 0, 0, side == 0 ? 1 : -1;
        if (i + 1 == n || j + 1 == n) continue;
        const int b = v + 1, c = v + n + 1, d = v + n;
        const auto add = [&](int p, int q, int r) {
          triangles.push_back(side == 0 ? Eigen::Vector3i(p, q, r) : Eigen::Vector3i(p, r, q));
        };
        add(v, b, c);
        add(v, c, d);
      }
  design.triangles.resize(Index(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t)
    design.triangles.row(Index(t)) = triangles[t].transpose();
  design.area = vertex_area(design.vertices, design.triangles);
  design.judged.assign(std::size_t(design.vertices.rows()), 1);
  return design;
}

int count(const Surface& surface, VertexStatus status) {
  return int(std::count(surface.status.begin(), surface.status.end(), status));
}

/// Passes along x every 2 mm at a height, the axis up or down.
std::vector<Stop> passes(double z, double axis) {
  std::vector<Stop> stops;
  for (int i = 0; i <= 20; ++i)
    for (const double x : {-30.0, 30.0})
      stops.push_back({Vector3d(x, 2.0 * i - 20, z), Vector3d(0, 0, axis)});
  return stops;
}

CutterMotion facing(double z) { return motion_of(passes(z, 1)); }

TEST(WallThickness, IsTheDistanceToTheOtherSide) {
  const Design design = plate(7.5);
  const WallThickness thickness(design);
  for (Index v = 0; v < design.vertices.rows(); ++v) {
    const auto behind = thickness.behind(design.vertices.row(v), design.normals.row(v), 20.0);
    ASSERT_TRUE(behind) << "vertex " << v;
    EXPECT_NEAR(*behind, 7.5, 1e-12);
    EXPECT_FALSE(thickness.behind(design.vertices.row(v), design.normals.row(v), 7.4));
  }
}

TEST(WallThickness, IsSeenFromARimThatRoundingPutBesideTheOtherSide) {
  // a place within the rim of an open mesh comes out at 30.000000000000004 where its corners have
  // 30
  const Design design = plate(1.5);
  const WallThickness thickness(design);
  const double rim = std::nextafter(20.0, 21.0);
  for (const double x : {-19.3, 0.0, 7.7, rim}) {
    const auto behind = thickness.behind({x, rim, 0.0}, {2.2e-16, 0.0, 1.0}, 20.0);
    ASSERT_TRUE(behind) << "x " << x;
    EXPECT_NEAR(*behind, 1.5, 1e-12);
    const auto along = thickness.behind({x, -rim, 0.0}, Vector3d::UnitZ(), 20.0);
    ASSERT_TRUE(along) << "x " << x;
    EXPECT_NEAR(*along, 1.5, 1e-12);
  }
  EXPECT_FALSE(thickness.behind({0.0, 20.001, 0.0}, Vector3d::UnitZ(), 20.0));
}

TEST(WallThickness, AgreesWithEveryTriangleTried) {
  SeededRandom random(20261122);
  std::normal_distribution<double> normal;
  Design design = plate(9.0);
  for (Index v = 0; v < design.vertices.rows(); ++v) {
    design.vertices(v, 2) += 0.3 * normal(random);
    design.normals.row(v) += 0.4 * Eigen::RowVector3d(normal(random), normal(random), 0);
    design.normals.row(v).normalize();
  }
  const WallThickness thickness(design);
  int found = 0;
  for (Index v = 0; v < design.vertices.rows(); ++v) {
    // the triangle's plane, and the place in it by areas
    double nearest = 30.0;
    const Vector3d p = design.vertices.row(v), d = -design.normals.row(v);
    for (const auto& t : design.triangles.rowwise()) {
      if ((t.array() == int(v)).any()) continue;
      const Vector3d a = design.vertices.row(t[0]), b = design.vertices.row(t[1]),
                     c = design.vertices.row(t[2]);
      const Vector3d n = (b - a).cross(c - a);
      if (n.dot(d) <= 0.0) continue;
      const double s = n.dot(a - p) / n.dot(d);
      if (s <= 0.0 || s >= nearest) continue;
      const Vector3d q = p + s * d;
      const bool inside = n.dot((b - a).cross(q - a)) >= 0 && n.dot((c - b).cross(q - b)) >= 0 &&
                          n.dot((a - c).cross(q - c)) >= 0;
      if (inside) nearest = s;
    }
    const auto behind = thickness.behind(design.vertices.row(v), design.normals.row(v), 30.0);
    EXPECT_EQ(behind.has_value(), nearest < 30.0) << "vertex " << v;
    if (!behind) continue;
    ++found;
    EXPECT_NEAR(*behind, nearest, 1e-9) << "vertex " << v;
  }
  EXPECT_GT(found, 400);
}

TEST(Gouge, DeeperThanTheBandIsFoundWithItsDepth) {
  const Design design = plate(50.0);
  for (const double depth : {2.5, 8.0, 19.0}) {
    const Surface surface = milled_surface(design, {5, 0, 60}, facing(-depth));
    EXPECT_EQ(count(surface, VertexStatus::Gouged), 441);
    ASSERT_EQ(surface.gouges.size(), 441u);
    for (const Gouge& gouge : surface.gouges) {
      EXPECT_NEAR(gouge.depth, depth, 1e-7);
      EXPECT_FALSE(gouge.continues_deeper);
      EXPECT_TRUE(std::isnan(surface.residual[gouge.vertex]));
      EXPECT_GT(surface.cut_line[std::size_t(gouge.vertex)], 0);
    }
  }
  for (const Gouge& gouge : milled_surface(design, {5, 0, 60}, facing(-30)).gouges) {
    EXPECT_EQ(gouge.depth, 20.0);
    EXPECT_TRUE(gouge.continues_deeper);
  }
}

TEST(Gouge, AToolThatRunsUnderTheSurfaceIsOne) {
  const Surface surface = milled_surface(plate(50.0), {5, 0, 4}, facing(-12));
  EXPECT_EQ(count(surface, VertexStatus::Gouged), 441);
  for (const Gouge& gouge : surface.gouges) EXPECT_NEAR(gouge.depth, 12.0, 1e-7);
}

TEST(Gouge, OfAThinPartTheOtherSideIsNone) {
  // both sides of a plate of 1.5 mm faced: a ray of 2 mm starts behind it
  const Design design = plate(1.5);
  std::vector<Stop> both = passes(0.0, 1);
  for (const Vector3d& axis : {Vector3d(0, 0, 1), Vector3d(1, 0, 0), Vector3d(0, 0, -1)})
    both.push_back({Vector3d(30, 60, axis.z() < 0 ? -1.5 : 0.0), axis});  // turned over beside it
  for (const Stop& stop : passes(-1.5, -1)) both.push_back(stop);
  const Surface surface = milled_surface(design, {5, 0, 20}, motion_of(both));
  EXPECT_EQ(count(surface, VertexStatus::Gouged), 0);
  EXPECT_EQ(count(surface, VertexStatus::Cut), 2 * 441);
  EXPECT_LE(surface.residual.cwiseAbs().maxCoeff(), 1e-7);
  const std::vector<CompetingPass> competing_passes =
      milled_competing_passes(design, {5, 0, 20}, motion_of(both));
  std::vector<int> of_vertex(std::size_t(surface.residual.size()), 0);
  for (const CompetingPass& competing_pass : competing_passes)
    if (of_vertex[std::size_t(competing_pass.vertex)]++ == 0) {
      EXPECT_NEAR(competing_pass.distance, surface.residual[competing_pass.vertex], 1e-7);
    }
  EXPECT_EQ(std::count(of_vertex.begin(), of_vertex.end(), 0), 0);
}

TEST(Shank, ThatGoesIntoThePartIsFoundWithItsDepthAndLine) {
  const Design design = plate(50.0);
  // 3 mm of flank, the shank from -5 upward
  const auto contact = shank_contact(design, {5, 0, 3}, facing(-8), {.length = 90, .band = 2});
  ASSERT_TRUE(contact);
  EXPECT_EQ(contact->vertices, 441);
  EXPECT_EQ(contact->deepest, 2.0);  // as far as was searched
  const auto shallow = shank_contact(design, {5, 0, 3}, facing(-4.2), {.length = 90, .band = 2});
  ASSERT_TRUE(shallow);
  EXPECT_NEAR(shallow->deepest, 1.2, 1e-7);
  EXPECT_GE(shallow->first_line, 1);
  EXPECT_FALSE(shank_contact(design, {5, 0, 3}, facing(-3.05), {.length = 90, .band = 2}));
  EXPECT_FALSE(shank_contact(design, {5, 0, 3}, facing(0), {.length = 90, .band = 2}));
  EXPECT_FALSE(shank_contact(design, {5, 0, 90}, facing(-8), {.length = 90, .band = 2}));
}

/// A box whose faces have vertices and normals of their own, ten squares along each edge.
Design meshed_box(const Vector3d& lower, const Vector3d& upper) {
  constexpr int n = 10;
  std::vector<Site> sites;
  std::vector<Eigen::Vector3i> triangles;
  for (int k = 0; k < 3; ++k)
    for (const bool up : {false, true}) {
      const int first = int(sites.size()), a = (k + 1) % 3, b = (k + 2) % 3;
      for (int j = 0; j <= n; ++j)
        for (int i = 0; i <= n; ++i) {
          Vector3d part = Vector3d::Zero();
          part[k] = up;
          part[a] = double(i) / n;
          part[b] = double(j) / n;
          sites.push_back(
              {lower + part.cwiseProduct(upper - lower), (up ? 1.0 : -1.0) * Vector3d::Unit(k)});
          if (i == n || j == n) continue;
          const int at = first + j * (n + 1) + i, right = at + 1, over = at + n + 1;
          for (const Eigen::Vector3i& t :
               {Eigen::Vector3i(at, right, over + 1), Eigen::Vector3i(at, over + 1, over)})
            triangles.push_back(up ? t : Eigen::Vector3i(t[0], t[2], t[1]));
        }
    }
  Design design = design_of(sites);
  design.triangles.resize(Index(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t)
    design.triangles.row(Index(t)) = triangles[t].transpose();
  return design;
}

/// A flat R 3 with 8 mm of flank in one pass along the wall x = 0 of `box`, so far before it.
CutterMotion along_the_wall(double before) {
  return motion_of({{Vector3d(-before, -30, 0), Vector3d::UnitZ()},
                    {Vector3d(-before, 30, 0), Vector3d::UnitZ()}});
}

TEST(Shank, ThatRunsAlongAWallIsNotInIt) {
  const Design design = meshed_box({0, -20, 0}, {12, 20, 20});
  const ShankOptions options{.length = 50, .band = 2};
  // across tangents rounding decides whether a line meets the cylinder
  for (const double before : {3.0 + 1e-12, 3.0, 3.0 - 1e-12, 2.95})
    EXPECT_FALSE(shank_contact(design, {3, 0, 8}, along_the_wall(before), options)) << before;
  const auto contact = shank_contact(design, {3, 0, 8}, along_the_wall(2.5), options);
  ASSERT_TRUE(contact);
  EXPECT_NEAR(contact->deepest, 0.5, 1e-7);
  EXPECT_EQ(contact->tolerated_depth, 0.1);
  EXPECT_FALSE(contact->continues_deeper);
}

TEST(Shank, HasARadiusOfItsOwn) {
  const Design design = meshed_box({0, -20, 0}, {12, 20, 20});
  const auto deepest = [&](double before, double radius) {
    const auto contact = shank_contact(design, {3, 0, 8}, along_the_wall(before),
                                       {.length = 50, .band = 2, .radius = radius});
    return contact ? contact->deepest : 0.0;
  };
  EXPECT_EQ(deepest(2.5, 2.2), 0.0) << "thinner than the cutter, it has room";
  EXPECT_NEAR(deepest(3.0, 4.0), 1.0, 1e-7);
  EXPECT_NEAR(deepest(4.5, 5.0), 0.5, 1e-7);
}

/// The holder from 5 mm above the tip: a disc, a cone to it, a step.
TEST(Holder, ThatGoesIntoThePartIsFoundWithItsDepth) {
  const Design design = plate(50.0);
  Eigen::MatrixX2d cylinder(2, 2), cone(3, 2), step(4, 2);
  cylinder << 12, 5, 12, 40;
  cone << 1, 5, 12, 16, 12, 40;
  step << 6, 5, 6, 20, 12, 20, 12, 40;
  for (const Eigen::MatrixX2d& profile : {cylinder, cone, step}) {
    const auto contact =
        non_cutting_contact(design, non_cutting_sections(profile), facing(-6.5), 2.0);
    ASSERT_TRUE(contact);
    EXPECT_NEAR(contact->deepest, 1.5, 1e-7);
    EXPECT_EQ(contact->vertices, 441);
    EXPECT_FALSE(contact->continues_deeper);
    EXPECT_FALSE(non_cutting_contact(design, non_cutting_sections(profile), facing(-5.05), 2.0));
  }
  EXPECT_EQ(non_cutting_sections(step).size(), 2u);
  // the cone above its disc, beside a wall: it leans by 45 deg
  const Design wall = meshed_box({0, -20, 0}, {12, 20, 20});
  const auto beside =
      non_cutting_contact(wall, non_cutting_sections(cone), along_the_wall(11.0), 2.0);
  ASSERT_TRUE(beside);
  EXPECT_NEAR(beside->deepest, 1.0, 1e-6);
  EXPECT_FALSE(non_cutting_contact(wall, non_cutting_sections(cone), along_the_wall(12.05), 2.0));
  // as a shank of that radius
  const auto as_shank = shank_contact(design, {12, 0, 5}, facing(-6.5), {.length = 40, .band = 2});
  const auto as_holder =
      non_cutting_contact(design, non_cutting_sections(cylinder), facing(-6.5), 2.0);
  EXPECT_NEAR(as_shank->deepest, as_holder->deepest, 1e-9);
  EXPECT_EQ(as_shank->first_line, as_holder->first_line);
}

constexpr double spacing = 0.25, half_width = 12.0;

/// A square of squares, at `origin`, along two edges.
void add_plane(Design& design, const Vector3d& origin, const Vector3d& u, const Vector3d& v,
               int along_u, int along_v) {
  const Index first = design.vertices.rows(), row = along_v + 1;
  const Vector3d normal = u.cross(v).normalized();
  design.vertices.conservativeResize(first + (along_u + 1) * row, 3);
  design.normals.conservativeResize(design.vertices.rows(), 3);
  for (int i = 0; i <= along_u; ++i)
    for (int j = 0; j <= along_v; ++j) {
      design.vertices.row(first + i * row + j) = origin + i * u + j * v;
      design.normals.row(first + i * row + j) = normal;
    }
  Index t = design.triangles.rows();
  design.triangles.conservativeResize(t + 2 * along_u * along_v, 3);
  for (int i = 0; i < along_u; ++i)
    for (int j = 0; j < along_v; ++j) {
      const int a = int(first + i * row + j), b = int(a + row);
      design.triangles.row(t++) << a, b, b + 1;
      design.triangles.row(t++) << a, b + 1, a + 1;
    }
}

Design finished(Design design) {
  design.area = vertex_area(design.vertices, design.triangles);
  return design;
}

Design floor_of(double step) {
  Design design;
  const int n = int(2.0 * half_width / step);
  add_plane(design, {-half_width, -half_width, 0.0}, step * Vector3d::UnitX(),
            step * Vector3d::UnitY(), n, n);
  return finished(design);
}

/// Passes of the ball along x at some y, all over the part and beyond.
CutterMotion passes_at(const std::vector<double>& ys) {
  std::vector<Stop> stops;
  for (std::size_t i = 0; i < ys.size(); ++i) {
    const double x = i % 2 == 0 ? 20.0 : -20.0;
    stops.push_back({{-x, ys[i], 0.0}});
    stops.push_back({{x, ys[i], 0.0}});
  }
  return motion_of(stops);
}

std::vector<std::uint8_t> none_of(const Design& design) {
  return std::vector<std::uint8_t>(std::size_t(design.vertices.rows()), 0);
}

/// The least of a convex function over [0, 1], by thirds.
template <typename Function>
double min_of(const Function& of) {
  double low = 0.0, high = 1.0;
  for (int i = 0; i < 60; ++i) {
    const double a = low + (high - low) / 3.0, b = high - (high - low) / 3.0;
    (of(a) <= of(b) ? high : low) = of(a) <= of(b) ? b : a;
  }
  return std::min({of(0.0), of(1.0), of(0.5 * (low + high))});
}

/// To the nearest place of a triangle, as a convex function of two weights.
double searched_distance(const std::array<Vector3d, 3>& t, const Vector3d& p) {
  return min_of([&](double u) {
    const Vector3d from = t[0] + u * (t[1] - t[0]), to = t[0] + u * (t[2] - t[0]);
    return min_of([&](double v) { return (from + v * (to - from) - p).norm(); });
  });
}

TEST(WallThickness, ComesWithinADistanceAsASearchOverEveryTriangleSays) {
  constexpr unsigned seed = 20261124;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Design design = floor_of(2.0);
  for (Index v = 0; v < design.vertices.rows(); ++v) design.vertices(v, 2) = normal(random);
  const WallThickness part(design);
  double nearest_call = 1e300;
  for (int i = 0; i < 20; ++i) {
    const Vector3d p(10.0 * normal(random), 10.0 * normal(random), 4.0 * normal(random));
    double least = 1e300;
    for (const auto& t : design.triangles.rowwise()) {
      const double longest = 12.0;  // mm, of an edge
      if ((design.vertices.row(t[0]).transpose() - p).norm() > least + longest) continue;
      least = std::min(least, searched_distance({Vector3d(design.vertices.row(t[0])),
                                                 Vector3d(design.vertices.row(t[1])),
                                                 Vector3d(design.vertices.row(t[2]))},
                                                p));
    }
    EXPECT_TRUE(part.comes_within(p, least + 1e-7)) << p.transpose();
    EXPECT_FALSE(part.comes_within(p, least - 1e-7)) << p.transpose();
    nearest_call = std::min(nearest_call, least);
  }
  std::cout << "nearest place " << nearest_call << " mm\n";
}

/// What is left of a single pass is the bottom of the ball, R - sqrt(R^2 - y^2).
TEST(Leftover, TheRunOutOfASinglePassIsAllButItsBottom) {
  for (const double step : {0.1, 0.25, 1.0}) {
    const Design design = floor_of(step);
    const Surface cut = milled_surface(design, ball_mill, passes_at({0.0}));
    const auto found = lead_out_leftover(design, cut, ball_mill.radius, none_of(design));
    int kept = 0;
    double max_kept = 0.0;
    for (Index i = 0; i < design.vertices.rows(); ++i) {
      if (cut.status[std::size_t(i)] != VertexStatus::Cut) continue;
      const double y = std::abs(design.vertices(i, 1));
      const double left = 5.0 - std::sqrt(25.0 - y * y);
      if (std::abs(left - 1e-3) > 1e-6) {
        EXPECT_EQ(found[std::size_t(i)] != 0, left > 1e-3) << "y " << y;
      }
      if (found[std::size_t(i)]) continue;
      ++kept;
      max_kept = std::max(max_kept, cut.residual[i]);
    }
    std::cout << "vertices every " << step << " mm: " << kept << " kept, up to " << 1e3 * max_kept
              << " um\n";
    EXPECT_GT(kept, 0);
    EXPECT_LE(max_kept, 1e-3);
  }
}

/// Cusps of 5.6 to 225 um stay where passes lie beside one another, up to the last of them.
TEST(Leftover, CuspsBetweenPassesAreNoRunOut) {
  for (const double step_over : {0.47, 1.0, 3.0}) {
    std::vector<double> ys;
    for (double y = -6.0; y < 6.0; y += step_over) ys.push_back(y);
    const Design design = floor_of(spacing);
    const Surface cut = milled_surface(design, ball_mill, passes_at(ys));
    const auto found = lead_out_leftover(design, cut, ball_mill.radius, none_of(design));
    const double cusp = 5.0 - std::sqrt(25.0 - 0.25 * step_over * step_over);
    double most = 0.0;
    int between = 0, lost = 0;
    for (Index i = 0; i < design.vertices.rows(); ++i) {
      const double y = design.vertices(i, 1);
      if (cut.status[std::size_t(i)] != VertexStatus::Cut) continue;
      if (!found[std::size_t(i)]) most = std::max(most, cut.residual[i]);
      if (y < ys.front() || y > ys.back()) continue;
      ++between;
      lost += found[std::size_t(i)];
    }
    std::cout << "step over " << step_over << " mm: of " << between << " between the passes "
              << lost << " taken; " << 1e3 * most << " um left, cusps " << 1e3 * cusp << "\n";
    EXPECT_EQ(lost, 0);
    EXPECT_LE(most, cusp + 1e-3);
  }
}

/// At the foot of a wall the ball stops at R from it: floor and wall are left there by closed form.
TEST(Leftover, TheFootOfAWallIsOutOfTheCorner) {
  Design design;
  const int n = int(half_width / spacing);
  add_plane(design, Vector3d::Zero(), spacing * Vector3d::UnitX(), spacing * Vector3d::UnitY(), n,
            n);
  add_plane(design, Vector3d::Zero(), spacing * Vector3d::UnitY(), spacing * Vector3d::UnitZ(), n,
            n);  // looks to +x
  design = finished(design);
  std::vector<Stop> stops;
  for (int i = 0; i <= 60; ++i) {  // passes along y, from the wall on
    const double x = 5.0 + 0.1 * i, y = i % 2 == 0 ? 20.0 : -20.0;
    stops.push_back({{x, -y, 0.0}});
    stops.push_back({{x, y, 0.0}});
  }
  const Surface cut = milled_surface(design, ball_mill, motion_of(stops));
  const WallThickness part(design);
  const auto found = corner_leftover(design, cut, part, ball_mill.radius);
  double kept = 0.0;
  int wrong = 0;
  for (Index i = 0; i < design.vertices.rows(); ++i) {
    if (cut.status[std::size_t(i)] != VertexStatus::Cut) continue;
    const bool is_wall = design.normals(i, 0) > 0.5;
    const double foot = is_wall ? design.vertices(i, 2) : design.vertices(i, 0);
    if (std::abs(foot - 4.9) > 0.11) wrong += (found[std::size_t(i)] != 0) != (foot < 4.9);
    if (!found[std::size_t(i)] && foot < 10.0) kept = std::max(kept, cut.residual[i]);
  }
  std::cout << "up to " << 1e3 * kept << " um are kept\n";
  EXPECT_EQ(wrong, 0);
  EXPECT_LE(kept, 1.01e-3);
  for (const double radius : {0.0, 1e-9}) {  // a flat end fits everywhere
    const auto sharp = corner_leftover(design, cut, part, radius);
    EXPECT_EQ(std::count(sharp.begin(), sharp.end(), 1), 0);
  }
}

/// A ball fits into a groove of its radius and more, and not into one of less.
TEST(Leftover, AGrooveNarrowerThanTheBallIsOutOfItsReach) {
  for (const double groove : {4.0, 4.85, 5.05, 6.0, 20.0}) {
    Design design;
    constexpr int around = 400, along = 20;
    add_plane(design, Vector3d::Zero(), Vector3d::UnitX(), Vector3d::UnitY(), along, around);
    for (Index i = 0; i < design.vertices.rows(); ++i) {
      const double angle = 3.0 * (design.vertices(i, 1) / around - 0.5);
      design.vertices.row(i) << 0.5 * design.vertices(i, 0), groove * std::sin(angle),
          groove * (1.0 - std::cos(angle));
      design.normals.row(i) << 0.0, -std::sin(angle), std::cos(angle);
    }
    design = finished(design);
    Surface left;
    left.status.assign(std::size_t(design.vertices.rows()), VertexStatus::Cut);
    left.residual = VectorXd::Constant(design.vertices.rows(), 0.3);  // an allowance
    const auto found = corner_leftover(design, left, WallThickness(design), 5.0);
    const double share =
        double(std::count(found.begin(), found.end(), 1)) / double(design.vertices.rows());
    std::cout << "groove R " << groove << ": " << 100.0 * share << " % out of reach\n";
    EXPECT_EQ(share > 0.5, groove < 5.0);
    if (groove > 5.0) {
      EXPECT_EQ(share, 0.0);
    }
  }
}

}  // namespace
}  // namespace abbe::cutting
