// The cut part against its design: distances against brute force, findings against closed forms.

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <iostream>
#include <map>
#include <random>

#include <tbb/global_control.h>

#include "cutting/part_findings.h"
#include "cutting/turned_mesh.h"
#include "kinematics/units.h"
#include "tests/cutting/stock_parts.h"

namespace abbe::cutting {
namespace {

using Eigen::Vector3d;

/// Quads, corners counter-clockwise from outside, as a design whose facets are the surface.
struct Quads {
  std::vector<Vector3d> corners;
  std::vector<std::array<int, 3>> triangles;

  int corner(const Vector3d& p) {
    for (std::size_t i = 0; i < corners.size(); ++i)
      if ((corners[i] - p).norm() < 1e-12) return int(i);
    corners.push_back(p);
    return int(corners.size()) - 1;
  }
  void add(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
    const int i = corner(a), j = corner(b), k = corner(c), l = corner(d);
    triangles.push_back({i, j, k});
    triangles.push_back({i, k, l});
  }
  Design design(const Eigen::Isometry3d& T = Eigen::Isometry3d::Identity()) const {
    Design made;
    made.vertices.resize(Eigen::Index(corners.size()), 3);
    for (std::size_t i = 0; i < corners.size(); ++i)
      made.vertices.row(Eigen::Index(i)) = T * corners[i];
    made.triangles.resize(Eigen::Index(triangles.size()), 3);
    for (std::size_t t = 0; t < triangles.size(); ++t)
      for (int k = 0; k < 3; ++k) made.triangles(Eigen::Index(t), k) = triangles[t][std::size_t(k)];
    made.normals = vertex_normals(made.vertices, made.triangles);
    return made;
  }
};

const Vector3d block(40, 30, 20);

/// The block from the origin with a pocket in its top, its corners at x and y, down to z.
Quads pocketed(const std::array<double, 2>& x, const std::array<double, 2>& y, double z) {
  Quads quads;
  const std::array<double, 4> xs{0, x[0], x[1], block.x()}, ys{0, y[0], y[1], block.y()};
  const double top = block.z();
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      const double a = xs[i], b = xs[i + 1], c = ys[j], d = ys[j + 1];
      const double up = i == 1 && j == 1 ? z : top;
      quads.add({a, c, up}, {b, c, up}, {b, d, up}, {a, d, up});
      quads.add({a, d, 0}, {b, d, 0}, {b, c, 0}, {a, c, 0});
    }
  for (std::size_t i = 0; i < 3; ++i) {
    const double a = xs[i], b = xs[i + 1], c = ys[i], d = ys[i + 1];
    quads.add({a, 0, 0}, {b, 0, 0}, {b, 0, top}, {a, 0, top});
    quads.add({b, block.y(), 0}, {a, block.y(), 0}, {a, block.y(), top}, {b, block.y(), top});
    quads.add({0, d, 0}, {0, c, 0}, {0, c, top}, {0, d, top});
    quads.add({block.x(), c, 0}, {block.x(), d, 0}, {block.x(), d, top}, {block.x(), c, top});
  }
  quads.add({x[0], y[0], top}, {x[1], y[0], top}, {x[1], y[0], z}, {x[0], y[0], z});
  quads.add({x[1], y[1], top}, {x[0], y[1], top}, {x[0], y[1], z}, {x[1], y[1], z});
  quads.add({x[0], y[1], top}, {x[0], y[0], top}, {x[0], y[0], z}, {x[0], y[1], z});
  quads.add({x[1], y[0], top}, {x[1], y[1], top}, {x[1], y[1], z}, {x[1], y[0], z});
  return quads;
}

const std::array<double, 2> pocket_x{8.13, 31.37}, pocket_y{6.21, 24.79};
constexpr double pocket_floor = 9.87;

/// Takes a box, in the grid's frame, out of a stock, exactly.
void carve(Stock& stock, const Vector3d& lower, const Vector3d& upper, int line) {
  const auto inside = [&](int axis, double at) { return at > lower[axis] && at < upper[axis]; };
  for (DexelField& field : stock.fields) {
    const int first = (field.along + 1) % 3, second = (field.along + 2) % 3;
    for (int j = 0; j < field.size[1]; ++j)
      for (int i = 0; i < field.size[0]; ++i) {
        const double p = stock.origin_k[first] + i * stock.spacing,
                     q = stock.origin_k[second] + j * stock.spacing;
        if (!inside(first, p) || !inside(second, q)) continue;
        const double from = stock.origin_k[field.along];
        field.lines[std::size_t(i) + std::size_t(field.size[0]) * std::size_t(j)].take(
            lower[field.along] - from, upper[field.along] - from, line);
      }
  }
}

Eigen::Isometry3d any_pose(std::mt19937& random) {
  std::normal_distribution<double> normal;
  const Eigen::Quaterniond turn(normal(random), normal(random), normal(random), normal(random));
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = turn.normalized().toRotationMatrix();
  T.translation() = 50.0 * Vector3d(normal(random), normal(random), normal(random));
  return T;
}

Stock full_block(const Eigen::Isometry3d& T_wk, double spacing, bool three = true) {
  return make_stock(BoxBlank{Vector3d::Zero(), block}, T_wk, {spacing, three});
}

/// The pocket to a floor, but for a box in it that is left higher.
void mill_pocket(Stock& stock, double floor, double left_to, const std::array<double, 2>& x,
                 const std::array<double, 2>& y) {
  const double top = block.z() + 1;
  carve(stock, {pocket_x[0], pocket_y[0], left_to}, {pocket_x[1], pocket_y[1], top}, 7);
  carve(stock, {pocket_x[0], pocket_y[0], floor}, {x[0], pocket_y[1], top}, 8);
  carve(stock, {x[1], pocket_y[0], floor}, {pocket_x[1], pocket_y[1], top}, 8);
  carve(stock, {pocket_x[0], pocket_y[0], floor}, {pocket_x[1], y[0], top}, 8);
  carve(stock, {pocket_x[0], y[1], floor}, {pocket_x[1], pocket_y[1], top}, 8);
}

struct Held {
  StockSkin skin;
  PartDeviation part;
  Findings found;
};
DeviationOptions facets() {
  DeviationOptions options;
  options.smooth = false;
  return options;
}
Held held(const StockSkin& skin, const Design& design, const FindingOptions& options = {}) {
  Held all{skin, part_deviation(skin, DesignDistance(design, facets()), facets()), {}};
  all.found = findings(all.skin, all.part, options);
  return all;
}
Held held(const Stock& stock, const Design& design, const FindingOptions& options = {}) {
  return held(stock_skin(stock), design, options);
}

FindingOptions along_grid(const Eigen::Isometry3d& T_wk, double limit = 0.05) {
  FindingOptions options;
  options.rest = options.gouge = limit;
  options.undercut_along = T_wk.linear().col(2);
  return options;
}

std::size_t regions(const Findings& found, FindingKind kind) {
  return found.sums[std::size_t(kind)].regions;
}
void expect_none(const Held& all) {
  for (const Findings::Sums& sums : all.found.sums) {
    EXPECT_EQ(sums.regions, 0u);
    EXPECT_EQ(sums.speckles, 0u);
  }
}

/// Largest magnitude of what is compared, which must be something.
double worst(const PartDeviation& part) {
  double most = -1.0;
  for (const double d : part.largest)
    if (std::isfinite(d)) most = std::max(most, std::abs(d));
  EXPECT_GE(most, 0.0);
  return most;
}

// ---- skin ---------------------------------------------------------------------------------------

TEST(StockSkin, HasTheMeshOfTheStockAndPlacesOnTheSkin) {
  std::mt19937 random(20261);
  const Eigen::Isometry3d T = any_pose(random);
  Stock stock = full_block(T, 0.7);
  mill_pocket(stock, pocket_floor, pocket_floor, pocket_x, pocket_y);
  const StockSkin skin = stock_skin(stock);
  const StockMesh mesh = stock_mesh(stock);
  EXPECT_EQ(skin.mesh.vertices_w, mesh.vertices_w);
  EXPECT_EQ(skin.mesh.triangles, mesh.triangles);
  EXPECT_EQ(skin.mesh.line, mesh.line);
  const DesignDistance distance(pocketed(pocket_x, pocket_y, pocket_floor).design(T), facets());
  std::map<std::vector<double>, int> seen;
  for (Eigen::Index i = 0; i < skin.places_w.rows(); ++i) {
    const Vector3d p = skin.places_w.row(i);
    EXPECT_NEAR(distance.at(p).value, 0.0, 1e-9) << p.transpose();
    const int times = ++seen[std::vector<double>{p.x(), p.y(), p.z()}];
    EXPECT_EQ(times, 1) << "the four cells around an edge share its place";
  }
  for (std::size_t v = 0; v + 1 < skin.first.size(); ++v) {
    Vector3d mean = Vector3d::Zero();
    for (int k = skin.first[v]; k < skin.first[v + 1]; ++k)
      mean += skin.places_w.row(skin.place[std::size_t(k)]);
    mean /= skin.first[v + 1] - skin.first[v];
    ASSERT_LT((mean - mesh.vertices_w.row(Eigen::Index(v)).transpose()).norm(), 1e-12);
  }
}

// ---- distance -----------------------------------------------------------------------------------

/// Nearest point of a triangle: of its plane if that is inside, else of its sides.
double distance_by_sides(const Vector3d& p, const std::array<Vector3d, 3>& t) {
  const Vector3d n = (t[1] - t[0]).cross(t[2] - t[0]).normalized();
  bool inside = true;
  double nearest = INFINITY;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vector3d a = t[k], b = t[(k + 1) % 3];
    inside = inside && n.dot((b - a).cross(p - a)) >= 0;
    const double part = std::clamp((p - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
    nearest = std::min(nearest, (p - a - part * (b - a)).norm());
  }
  return inside ? std::abs(n.dot(p - t[0])) : nearest;
}

/// Solid angle of a triangle (van Oosterom and Strackee 1983).
double solid_angle(const Vector3d& p, const std::array<Vector3d, 3>& t) {
  const Vector3d a = t[0] - p, b = t[1] - p, c = t[2] - p;
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  return 2 * std::atan2(a.dot(b.cross(c)),
                        la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

/// A body with dents and sharp edges: a sphere of triangles whose radii are drawn.
Design dented(std::mt19937& random, int rings) {
  std::uniform_real_distribution<double> radius(6, 12);
  Quads body;
  const int around = 2 * rings;
  std::vector<Vector3d> at;
  at.push_back({0, 0, radius(random)});
  for (int i = 1; i < rings; ++i)
    for (int k = 0; k < around; ++k) {
      const double t = pi * i / rings, f = 2 * pi * k / around;
      at.push_back(radius(random) *
                   Vector3d(std::sin(t) * std::cos(f), std::sin(t) * std::sin(f), std::cos(t)));
    }
  at.push_back({0, 0, -radius(random)});
  body.corners = at;
  const auto ring = [&](int i, int k) { return 1 + (i - 1) * around + k % around; };
  for (int k = 0; k < around; ++k) {
    body.triangles.push_back({0, ring(1, k), ring(1, k + 1)});
    for (int i = 1; i + 1 < rings; ++i) {
      body.triangles.push_back({ring(i, k), ring(i + 1, k), ring(i + 1, k + 1)});
      body.triangles.push_back({ring(i, k), ring(i + 1, k + 1), ring(i, k + 1)});
    }
    body.triangles.push_back({ring(rings - 1, k), int(at.size()) - 1, ring(rings - 1, k + 1)});
  }
  return body.design();
}

TEST(DesignDistance, IsThatOfAllTrianglesWithTheSideOfTheSolidAngle) {
  const unsigned seed = 20262;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  double off = 0.0;
  for (int body = 0; body < 12; ++body) {
    const Design design = dented(random, 4 + body);
    const DesignDistance distance(design, facets());
    EXPECT_TRUE(distance.is_closed());
    for (int i = 0; i < 400; ++i) {
      // near corners and edges too: half of the places are drawn about a vertex
      Vector3d p = 14.0 * Vector3d(unit(random), unit(random), unit(random));
      if (i % 2 == 0)
        p = Vector3d(design.vertices.row(i % design.vertices.rows())) +
            0.5 * Vector3d(unit(random), unit(random), unit(random));
      double nearest = INFINITY, angle = 0.0;
      for (const auto& t : design.triangles.rowwise()) {
        const std::array<Vector3d, 3> corners{design.vertices.row(t[0]), design.vertices.row(t[1]),
                                              design.vertices.row(t[2])};
        nearest = std::min(nearest, distance_by_sides(p, corners));
        angle += solid_angle(p, corners);
      }
      const double expected = std::abs(angle) > 2 * pi ? -nearest : nearest;
      const DesignDistance::At at = distance.at(p, i % int(design.triangles.rows()));
      off = std::max(off, std::abs(at.value - expected));
      ASSERT_NEAR(at.value, expected, 1e-11) << "body " << body << " at " << p.transpose();
      ASSERT_NEAR(at.from.norm(), nearest, 1e-11);
      ASSERT_FALSE(at.is_beyond);
    }
  }
  std::cout << "signed distance off brute force by " << off << " mm at most\n";
}

TEST(DesignDistance, KnowsWhatLiesBeyondTheBorderOfAnOpenDesign) {
  Quads flat;
  flat.add({0, 0, 0}, {10, 0, 0}, {10, 10, 0}, {0, 10, 0});
  const DesignDistance distance(flat.design(), facets());
  EXPECT_FALSE(distance.is_closed());
  EXPECT_FALSE(distance.at({5, 5, 0.3}).is_beyond);
  EXPECT_NEAR(distance.at({5, 5, -0.3}).value, -0.3, 1e-15);
  EXPECT_FALSE(distance.at({10, 5, 0.3}).is_beyond) << "above the border, along its normal";
  EXPECT_TRUE(distance.at({10.01, 5, 0.3}).is_beyond);
  EXPECT_TRUE(distance.at({10.01, 10.01, 0.3}).is_beyond);
  EXPECT_TRUE(distance.at({10, 5, -0.3}).is_beyond) << "a side of the blank below";
}

TEST(DesignDistance, OfASmoothSurfaceIsNotThatOfItsFacets) {
  // a coarse sphere: facets sag by 0.12 mm
  const double R = 20;
  Quads sphere;
  const int rings = 24, around = 48;
  const auto at = [&](int i, int k) {
    const double t = 0.2 + 0.05 * i, f = 0.4 * 2 * pi * k / around;
    return Vector3d(R * std::sin(t) * std::cos(f), R * std::sin(t) * std::sin(f), R * std::cos(t));
  };
  for (int i = 0; i < rings; i += 2)
    for (int k = 0; k < around; k += 6)
      sphere.add(at(i, k), at(i + 2, k), at(i + 2, k + 6), at(i, k + 6));
  Design design = sphere.design();
  design.normals = design.vertices.rowwise().normalized();
  const DesignDistance smooth(design), flat(design, facets());
  double off = 0.0, off_flat = 0.0;
  for (int i = 4; i < rings - 4; ++i)
    for (int k = 6; k < around - 6; ++k)
      for (const double d : {-0.4, 0.0, 0.3}) {
        const Vector3d p = at(i, k) * (1 + d / R);
        off = std::max(off, std::abs(smooth.at(p).value - d));
        off_flat = std::max(off_flat, std::abs(flat.at(p).value - d));
      }
  std::cout << "smooth within " << off << " mm, facets " << off_flat << " mm\n";
  EXPECT_GT(off_flat, 0.05);
  EXPECT_LT(off, 0.05 * off_flat);
}

// ---- nothing to find ----------------------------------------------------------------------------

TEST(PartFindings, AnExactCutHasNone) {
  const unsigned seed = 20263;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  for (const double spacing : {0.9, 0.5}) {
    const Eigen::Isometry3d T = any_pose(random);
    Stock stock = full_block(T, spacing);
    mill_pocket(stock, pocket_floor, pocket_floor, pocket_x, pocket_y);
    const Held all =
        held(stock, pocketed(pocket_x, pocket_y, pocket_floor).design(T), along_grid(T, 1e-6));
    expect_none(all);
    EXPECT_LT(worst(all.part), 1e-8);
    EXPECT_EQ(all.found.no_design, 0.0);
    EXPECT_EQ(all.found.unresolved, 0.0);
    EXPECT_NEAR(all.found.compared,
                2 * (40 * 30 + 40 * 20 + 30 * 20) + 2 * (23.24 + 18.58) * (20 - pocket_floor),
                0.6 * spacing * (4 * 90 + 4 * 41.82 + 4 * (20 - pocket_floor)));
  }
}

TEST(PartFindings, SharpEdgesHoweverTheyLieMakeNoFinding) {
  // the blank is the design, turned at random against the grid: its edges run through the cells
  const unsigned seed = 20264;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  double most = 0.0, off_skin = 0.0;
  for (int i = 0; i < 6; ++i) {
    const Eigen::Isometry3d T = any_pose(random), T_wk = any_pose(random);
    const Design design = pocketed(pocket_x, pocket_y, pocket_floor).design(T);
    const Design in_k = pocketed(pocket_x, pocket_y, pocket_floor).design(T_wk.inverse() * T);
    const Stock stock = make_stock(MeshBlank{in_k.vertices, in_k.triangles}, T_wk, {1.1, true});
    FindingOptions options;
    options.rest = options.gouge = 1e-6;
    options.undercut_along = std::nullopt;
    const Held all = held(stock, design, options);
    expect_none(all);
    EXPECT_EQ(all.found.too_small, 0.0);
    EXPECT_LT(all.found.unresolved, 0.02 * all.found.compared);
    most = std::max(most, worst(all.part));
    const DesignDistance distance(design, facets());
    for (const auto& v : all.skin.mesh.vertices_w.rowwise())
      off_skin = std::max(off_skin, std::abs(distance.at(v.transpose()).value));
  }
  std::cout << "places off the design by " << most << " mm, vertices by " << off_skin << " mm\n";
  EXPECT_LT(most, 1e-8);
  EXPECT_GT(off_skin, 0.1) << "the vertices themselves would be findings";
}

// ---- findings of known size ---------------------------------------------------------------------

TEST(PartFindings, APlaceThatIsLeftTooHighHasItsVolumeDepthAndPlace) {
  const unsigned seed = 20265;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  const std::array<double, 2> x{14.3, 26.9}, y{9.1, 19.6};
  const double left = 0.3, expected = left * (x[1] - x[0]) * (y[1] - y[0]);
  for (const double spacing : {1.0, 0.5, 0.25}) {
    const Eigen::Isometry3d T = any_pose(random);
    Stock stock = full_block(T, spacing);
    mill_pocket(stock, pocket_floor, pocket_floor + left, x, y);
    const Held all =
        held(stock, pocketed(pocket_x, pocket_y, pocket_floor).design(T), along_grid(T));
    ASSERT_EQ(regions(all.found, FindingKind::Rest), 1u);
    EXPECT_EQ(regions(all.found, FindingKind::Gouge), 0u);
    EXPECT_EQ(regions(all.found, FindingKind::Undercut), 0u);
    const Finding& rest = all.found.list.front();
    std::cout << "spacing " << spacing << " mm: rest material " << rest.volume << " of " << expected
              << " mm^3, area " << rest.area << " of " << expected / left << " mm^2\n";
    EXPECT_NEAR(rest.volume, expected, left * 2 * (12.6 + 10.5) * 0.5 * spacing);
    EXPECT_NEAR(rest.depth, left, 1e-8);
    EXPECT_EQ(rest.line, 7);
    EXPECT_FALSE(rest.is_at_least);
    const Vector3d place = T.inverse() * rest.place_w;
    EXPECT_NEAR(place.z(), pocket_floor + left, 1e-8);
    EXPECT_GT(place.x(), x[0] - 1e-8);
    EXPECT_LT(place.x(), x[1] + 1e-8);
    EXPECT_GT(place.y(), y[0] - 1e-8);
    EXPECT_LT(place.y(), y[1] + 1e-8);
    for (Eigen::Index i = 0; i < all.skin.mesh.vertices_w.rows(); ++i) {
      const Vector3d p = T.inverse() * Vector3d(all.skin.mesh.vertices_w.row(i));
      const bool within = p.x() > x[0] + spacing && p.x() < x[1] - spacing &&
                          p.y() > y[0] + spacing && p.y() < y[1] - spacing && p.z() > 5;
      if (within) {
        ASSERT_EQ(all.found.number[std::size_t(i)], 1);
      }
    }
  }
}

TEST(PartFindings, ABallThatDipsIntoAFlatGougesACap) {
  const unsigned seed = 20266;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> shift(-0.5, 0.5);
  const double R = 6, h = 0.4, limit = 0.05;
  const auto cap = [&](double height) { return pi * height * height * (3 * R - height) / 3; };
  // the region ends where the depth is the limit: what it misses of the cap lies around it
  const double lower = h - limit, a2 = lower * (2 * R - lower);
  const double within = cap(lower) + limit * pi * a2;
  for (const double spacing : {0.5, 0.25}) {
    const Eigen::Isometry3d T = any_pose(random);
    Stock stock = full_block(T, spacing);
    const Vector3d tip(20 + shift(random), 15 + shift(random), block.z() - h);
    remove(stock, Cutter{R, R, 30}, {T * pose(tip + Vector3d(0, 0, 10)), T * pose(tip), 42, false});
    const Design flat = pocketed(pocket_x, pocket_y, block.z()).design(T);  // of no depth
    const Held all = held(stock, flat, along_grid(T, limit));
    ASSERT_EQ(regions(all.found, FindingKind::Gouge), 1u);
    EXPECT_EQ(regions(all.found, FindingKind::Rest), 0u);
    EXPECT_EQ(regions(all.found, FindingKind::Undercut), 0u);
    const Finding& gouge = all.found.list.front();
    std::cout << "spacing " << spacing << " mm: gouge " << gouge.volume << " of " << within
              << " mm^3 beyond the limit, of " << cap(h) << " in all\n";
    EXPECT_NEAR(gouge.volume, within, 0.03 * within);
    EXPECT_LT(gouge.depth, h + 1e-8);
    EXPECT_GT(gouge.depth, h - spacing * spacing / (4 * R));  // the deepest place between the lines
    EXPECT_LT((T.inverse() * gouge.place_w - tip).norm(), spacing);
    EXPECT_EQ(gouge.line, 42);
    EXPECT_FALSE(gouge.by_crash);
  }
}

TEST(PartFindings, ACrashIsAGougeByThatLineAndABlankThatIsTooSmallIsNone) {
  Stock stock = make_stock(BoxBlank{{0, 0, 0}, {40, 30, 19.5}}, Eigen::Isometry3d::Identity(), {});
  remove(stock, Cutter{5, 0, 30}, {pose({-10, 15, 18}), pose({50, 15, 18}), 9, true});
  const Held all = held(stock, pocketed(pocket_x, pocket_y, block.z()).design());
  ASSERT_EQ(regions(all.found, FindingKind::Gouge), 1u);
  const Finding& gouge = all.found.list.front();
  EXPECT_EQ(gouge.line, 9);
  EXPECT_TRUE(gouge.by_crash);
  EXPECT_NEAR(gouge.depth, 2.0, 1e-8);
  // the slot alone; at its two ends it runs out over an edge of the design
  EXPECT_NEAR(gouge.volume, 2 * 10 * 40, 2 * 10 * 2.0 * 2.0 / 2 + 40);
  EXPECT_LT(gouge.area, 10 * 40 + 2 * 40 * 1.5 + 60);
  EXPECT_NEAR(all.found.too_small, 40 * 20, 0.05 * 800) << "beside the slot the blank is too low";
}

TEST(PartFindings, MaterialFurtherOffThanTheBandIsSaidToBeAtLeastThat) {
  const Stock stock = full_block(Eigen::Isometry3d::Identity(), 1.0);
  const Held all = held(stock, pocketed(pocket_x, pocket_y, pocket_floor).design());
  ASSERT_EQ(regions(all.found, FindingKind::Rest), 1u);
  const Finding& rest = all.found.list.front();
  EXPECT_TRUE(rest.is_at_least);
  EXPECT_EQ(rest.depth, 5.0);
  EXPECT_EQ(rest.line, 0) << "never cut";
  EXPECT_GT(all.found.cut_off, 50.0);
}

// ---- undercuts ----------------------------------------------------------------------------------

TEST(PartFindings, TheSidesOfATSlotAreUndercut) {
  const unsigned seed = 20267;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  const double low = 5.15, high = 10.3, from = 12.3, to = 27.4, neck_from = 17.1, neck_to = 22.3;
  for (const double spacing : {0.8, 0.4}) {
    const Eigen::Isometry3d T = any_pose(random);
    Stock stock = full_block(T, spacing);
    carve(stock, {neck_from, 5.1, low}, {neck_to, 25.2, 21}, 3);
    carve(stock, {from, 5.1, low}, {to, 25.2, high}, 4);
    const Held all = held(stock, pocketed(pocket_x, pocket_y, block.z()).design(T), along_grid(T));
    ASSERT_EQ(regions(all.found, FindingKind::Undercut), 2u);
    double sum = 0.0;
    for (const Finding& one : all.found.list) {
      if (one.kind != FindingKind::Undercut) continue;
      sum += one.volume;
      EXPECT_NEAR(one.depth, high - low, spacing);
      EXPECT_EQ(one.line, 4);
    }
    const double expected = (to - from - (neck_to - neck_from)) * (high - low) * 20.1;
    std::cout << "spacing " << spacing << " mm: void under the overhangs " << sum << " of "
              << expected << " mm^3\n";
    EXPECT_NEAR(sum, expected, 2 * (20.1 + 2 * 5) * (high - low) * 0.5 * spacing);
  }
}

TEST(PartFindings, AHoleFromTheSideIsUndercutAndAPocketIsNot) {
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  Stock stock = full_block(T, 0.5);
  mill_pocket(stock, 15, 15, pocket_x, pocket_y);
  const Design design = pocketed(pocket_x, pocket_y, 15).design(T);
  EXPECT_EQ(regions(held(stock, design).found, FindingKind::Undercut), 0u);
  remove(stock, Cutter{3, 0, 30},
         {pose({-5, 15.2, 7.1}, -Vector3d::UnitX()), pose({15, 15.2, 7.1}, -Vector3d::UnitX()), 6,
          false});
  const Held all = held(stock, design);
  ASSERT_EQ(regions(all.found, FindingKind::Undercut), 1u);
  const Finding& hole = all.found.list.back();
  const double expected = pi * 9 * 15;
  std::cout << "hole from the side " << hole.volume << " of " << expected << " mm^3\n";
  EXPECT_NEAR(hole.volume, expected, 0.05 * expected);
  EXPECT_NEAR(hole.depth, 6.0, 0.1);
  EXPECT_EQ(hole.line, 6);
}

TEST(PartFindings, WallsThatLeanByLessThanASpacingAreNoUndercut) {
  // a cutter that leans by 1 mrad mills a wall 20 mm high: it overhangs by 20 um
  Stock stock = full_block(Eigen::Isometry3d::Identity(), 0.5);
  const Vector3d axis = Vector3d(-1e-3, 0, 1).normalized();
  remove(stock, Cutter{5, 0, 60}, {pose({10, -10, 2}, axis), pose({10, 40, 2}, axis), 1, false});
  EXPECT_EQ(
      regions(held(stock, pocketed(pocket_x, pocket_y, 20).design()).found, FindingKind::Undercut),
      0u);
}

// ---- what is not compared, not resolved, not listed ---------------------------------------------

/// A dome cap of an open design over a block.
Design dome(double R, double radius, const Vector3d& centre, int rings, int around) {
  Quads cap;
  const auto at = [&](int i, int k) {
    const double r = radius * i / rings, f = 2 * pi * (k % around) / around;
    return Vector3d(centre + Vector3d(r * std::cos(f), r * std::sin(f), std::sqrt(R * R - r * r)));
  };
  cap.corners.push_back(at(0, 0));
  for (int i = 1; i <= rings; ++i)
    for (int k = 0; k < around; ++k) cap.corners.push_back(at(i, k));
  const auto ring = [&](int i, int k) { return 1 + (i - 1) * around + k % around; };
  for (int k = 0; k < around; ++k) {
    cap.triangles.push_back({0, ring(1, k), ring(1, k + 1)});
    for (int i = 1; i < rings; ++i) {
      cap.triangles.push_back({ring(i, k), ring(i + 1, k), ring(i + 1, k + 1)});
      cap.triangles.push_back({ring(i, k), ring(i + 1, k + 1), ring(i, k + 1)});
    }
  }
  Design design = cap.design();
  design.normals = (design.vertices.rowwise() - centre.transpose()).rowwise().normalized();
  return design;
}

/// A blank around a design, of its own shape: a cap on a cylinder.
TEST(PartDeviation, SidesAndBottomUnderAnOpenDesignAreNotCompared) {
  const Vector3d centre(20, 15, -10);
  const Design design = dome(25, 10, centre, 60, 180);
  Stock stock = full_block(Eigen::Isometry3d::Identity(), 0.5);
  // raw everywhere but for a flat on top that touches the dome
  carve(stock, {-1, -1, 15}, {41, 31, 21}, 3);
  const Held all = held(stock, design);
  EXPECT_EQ(regions(all.found, FindingKind::Gouge), 0u);
  ASSERT_EQ(regions(all.found, FindingKind::Rest), 1u);
  // seen against the dome itself: what stands over it within its normals
  const double limit = 0.05;
  EXPECT_NEAR(all.found.list.front().depth, 25 / std::cos(std::asin(10.0 / 25)) - 25, 0.02);
  EXPECT_LT(all.found.compared, pi * 11.5 * 11.5);
  for (Eigen::Index i = 0; i < all.part.deviation.size(); ++i) {
    const Vector3d p = all.skin.mesh.vertices_w.row(i);
    if (p.z() < 14) {
      ASSERT_EQ(all.part.status[std::size_t(i)], SkinStatus::NoDesign) << p.transpose();
    }
    if ((p - centre).head<2>().norm() > 12) {
      ASSERT_TRUE(std::isnan(all.part.deviation[i])) << p.transpose();
    }
    if (std::isfinite(all.part.deviation[i]) && (p - centre).head<2>().norm() < 10) {
      ASSERT_NEAR(all.part.deviation[i], (p - centre).norm() - 25, limit) << p.transpose();
    }
  }
}

TEST(PartDeviation, WallsOfOneDirectionAreNotResolvedAndSaidSo) {
  Stock stock = full_block(Eigen::Isometry3d::Identity(), 0.5, false);
  mill_pocket(stock, pocket_floor, pocket_floor, pocket_x, pocket_y);
  const Held all = held(stock, pocketed(pocket_x, pocket_y, pocket_floor).design());
  expect_none(all);
  EXPECT_LT(worst(all.part), 1e-8);
  EXPECT_NEAR(all.found.unresolved, 2 * (40 + 30) * 20 + 2 * (23.24 + 18.58) * 10.13,
              0.1 * all.found.unresolved);
}

TEST(PartFindings, SpecklesAreCountedAndALongListIsSummedUp) {
  Stock stock = full_block(Eigen::Isometry3d::Identity(), 0.5);
  // holes of known depth in a flat top: one after the other deeper; and pits of one dexel
  double sum = 0.0;
  for (int i = 0; i < 12; ++i) {
    const double x = 3.0 * i + 2.1, deep = 0.1 + 0.02 * i;
    carve(stock, {x, 10.1, 20 - deep}, {x + 1.6, 12.7, 21}, 100 + i);
    sum += deep * 1.6 * 2.6;
  }
  const double z = stock.origin_k.z();
  DexelField& upright = stock.fields.back();
  ASSERT_EQ(upright.along, 2);
  upright.lines[std::size_t(30) + std::size_t(upright.size[0]) * 45].take(19.8 - z, 21 - z, 200);
  FindingOptions options;
  options.most = 5;
  const Held all = held(stock, pocketed(pocket_x, pocket_y, 20).design(), options);
  const Findings::Sums& gouges = all.found.sums[std::size_t(FindingKind::Gouge)];
  ASSERT_EQ(gouges.regions + gouges.speckles, 13u);
  EXPECT_EQ(gouges.listed, 5u);
  ASSERT_EQ(all.found.list.size(), 5u);
  EXPECT_EQ(all.found.list.front().line, 111);
  double listed = 0.0;
  for (std::size_t i = 0; i < 5; ++i) {
    listed += all.found.list[i].volume;
    if (i > 0) {
      EXPECT_LE(all.found.list[i].volume, all.found.list[i - 1].volume);
    }
  }
  EXPECT_NEAR(listed + gouges.unlisted_volume, gouges.volume, 1e-12);
  EXPECT_NEAR(gouges.volume, sum, 0.3 * sum);
}

TEST(PartFindings, FewerVerticesThanTheDexelsResolveAreASpeckle) {
  // by hand: a strip of skin with two vertices up
  StockSkin skin;
  skin.mesh.vertices_w.resize(6, 3);
  skin.mesh.vertices_w << 0, 0, 0, 1, 0, 0.2, 1, 1, 0.3, 0, 1, 0, 2, 0, 0, 2, 1, 0;
  skin.mesh.triangles.resize(4, 3);
  skin.mesh.triangles << 0, 1, 2, 0, 2, 3, 1, 4, 5, 1, 5, 2;
  skin.mesh.line.assign(6, 5);
  skin.places_w = skin.mesh.vertices_w;
  skin.line = skin.mesh.line;
  for (int i = 0; i < 6; ++i) skin.place.push_back(i);
  for (int i = 0; i <= 6; ++i) skin.first.push_back(i);
  skin.spacing = 1;
  Quads flat;
  flat.add({-5, -5, 0}, {5, -5, 0}, {5, 5, 0}, {-5, 5, 0});
  const Held all = held(skin, flat.design());
  const Findings::Sums& rest = all.found.sums[std::size_t(FindingKind::Rest)];
  EXPECT_EQ(rest.regions, 0u);
  EXPECT_EQ(rest.speckles, 1u);
  EXPECT_NEAR(rest.speckle_depth, 0.3, 1e-15);
  EXPECT_GT(rest.speckle_volume, 0.0);
  EXPECT_TRUE(all.found.list.empty());
}

// ---- turning ------------------------------------------------------------------------------------

TEST(PartFindings, AGrooveTurnedTooDeepIsFoundAllAround) {
  const double R = 10, deep = 0.2, from = 12, to = 17;
  Eigen::Matrix<double, Eigen::Dynamic, 2> profile(2, 2);
  profile << 0, R, 30, R;
  TurnedStock stock = make_turned_stock(profile, 0.05, {1, 2, 3}, Vector3d::UnitX());
  for (Eigen::Index i = 0; i < stock.radius.size(); ++i) {
    const double along = stock.first + stock.spacing * double(i);
    stock.line[std::size_t(i)] = 4;
    if (along <= from || along >= to) continue;
    stock.radius[i] = R - deep;
    stock.line[std::size_t(i)] = 17;
  }
  // an open design, the cylinder alone, of 48 facets with the normals of the round
  Quads cylinder;
  const int around = 48;
  const auto at = [&](double along, int k) {
    const double f = 2 * pi * k / around;
    return Vector3d(1 + along, 2 + R * std::cos(f), 3 + R * std::sin(f));
  };
  for (int k = 0; k < around; ++k)
    for (int i = 0; i < 15; ++i)
      cylinder.add(at(2 * i, k), at(2 * i, k + 1), at(2 * i + 2, k + 1), at(2 * i + 2, k));
  Design design = cylinder.design();
  for (Eigen::Index i = 0; i < design.normals.rows(); ++i)
    design.normals.row(i) =
        Eigen::RowVector3d(0, design.vertices(i, 1) - 2, design.vertices(i, 2) - 3).normalized();
  ASSERT_GT(vertex_normals(design.vertices, design.triangles).row(0).dot(design.normals.row(0)), 0);
  const StockSkin skin = stock_skin(stock);
  const PartDeviation part = part_deviation(skin, DesignDistance(design));
  FindingOptions options;
  options.undercut_along = std::nullopt;
  const Findings found = findings(skin, part, options);
  ASSERT_EQ(regions(found, FindingKind::Gouge), 1u);
  EXPECT_EQ(regions(found, FindingKind::Rest), 0u);
  const double expected = pi * (R * R - (R - deep) * (R - deep)) * (to - from);
  std::cout << "groove " << found.list.front().volume << " of " << expected << " mm^3\n";
  EXPECT_NEAR(found.list.front().volume, expected, (deep / R + 0.02) * expected);
  EXPECT_NEAR(found.list.front().depth, deep, 1e-3);  // facets 21 um lower: 48 of R 10
  EXPECT_EQ(found.list.front().line, 17);
}

// ---- threads and time ---------------------------------------------------------------------------

TEST(PartFindings, AreTheSameForAnyNumberOfThreads) {
  Stock stock = full_block(Eigen::Isometry3d::Identity(), 0.5);
  mill_pocket(stock, pocket_floor, pocket_floor + 0.3, {14.3, 26.9}, {9.1, 19.6});
  const Design design = pocketed(pocket_x, pocket_y, pocket_floor - 0.2).design();
  const Held all = held(stock, design);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const Held alone = held(stock, design);
  for (Eigen::Index i = 0; i < all.part.deviation.size(); ++i) {
    const double a = all.part.deviation[i], b = alone.part.deviation[i];
    ASSERT_TRUE(a == b || (std::isnan(a) && std::isnan(b)));
  }
  EXPECT_EQ(all.found.number, alone.found.number);
  ASSERT_EQ(all.found.list.size(), alone.found.list.size());
  for (std::size_t i = 0; i < all.found.list.size(); ++i)
    EXPECT_EQ(all.found.list[i].volume, alone.found.list[i].volume);
}

TEST(PartFindings, ADomeOf120000TrianglesTakesASecond) {
  const Vector3d centre(50, 50, -30);
  const Design design = dome(60, 45, centre, 150, 400);
  Stock stock =
      make_stock(BoxBlank{{0, 0, 0}, {100, 100, 31}}, Eigen::Isometry3d::Identity(), {0.5, true});
  remove(stock, Cutter{10, 10, 60}, {pose({50, -20, 28}), pose({50, 120, 28}), 1, false});
  const auto start = std::chrono::steady_clock::now();
  const auto seconds = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  const StockSkin skin = stock_skin(stock);
  const double skinned = seconds();
  const DesignDistance distance(design);
  const double built = seconds();
  const PartDeviation part = part_deviation(skin, distance);
  const double compared = seconds();
  const Findings found = findings(skin, part);
  std::cout << design.triangles.rows() << " triangles, " << skin.mesh.vertices_w.rows()
            << " vertices, " << skin.places_w.rows() << " places: skin " << skinned << " s, design "
            << built - skinned << " s, deviation " << compared - built << " s, findings "
            << seconds() - compared << " s\n";
  EXPECT_EQ(regions(found, FindingKind::Gouge), 1u);
}

}  // namespace
}  // namespace abbe::cutting
