#include "cutting/part/primitive.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

/// A primitive with its surface stated a second time: how far a point is off it, the outward normal
/// there, the whole area.
struct Known {
  std::string name;
  Primitive primitive;
  std::function<double(const Vector3d&)> off;
  std::function<Vector3d(const Vector3d&)> normal;
  double area;
};

Vector3d away_from_axis(const Vector3d& p) { return Vector3d(p.x(), p.y(), 0).normalized(); }

Vector3d away_from_tube(const Vector3d& p, double R) {
  return (p - R * away_from_axis(p)).normalized();
}

std::vector<Known> known() {
  const auto up = [](const Vector3d&) -> Vector3d { return Vector3d::UnitZ(); };
  const auto height = [](const Vector3d& p) { return p.z(); };
  const double a = 15 * pi / 180;
  const double steep = std::atan(10.0 / 0.4);  // the cone of 0.4 mm on a diameter of 20 mm
  const auto cone_normal = [](double angle) {
    return [angle](const Vector3d& p) -> Vector3d {
      return away_from_axis(p) * std::cos(angle) + Vector3d(0, 0, std::sin(angle));
    };
  };
  const auto sphere = [](double R) {
    return Known{
        "",
        {},
        [R](const Vector3d& p) { return (p + Vector3d(0, 0, R)).norm() - R; },
        [R](const Vector3d& p) -> Vector3d { return (p + Vector3d(0, 0, R)).normalized(); },
        0};
  };
  const auto cap = [&](double R, double rim, const std::string& name) {
    Known k = sphere(R);
    k.name = name;
    k.primitive = SphereCap{R, rim};
    k.area = 2 * pi * R * rim * rim / (R + std::sqrt(R * R - rim * rim));
    return k;
  };
  return {
      {"rectangle", RectanglePlane{120, 45}, height, up, 120.0 * 45},
      {"disc", Disc{10.8, 0}, height, up, pi * 10.8 * 10.8},
      {"ring", Disc{30, 12}, height, up, pi * (900 - 144)},
      {"cylinder", Cylinder{25, 40},
       [](const Vector3d& p) { return std::hypot(p.x(), p.y()) - 25; }, away_from_axis,
       2 * pi * 25 * 40},
      {"frustum", Cone{40, 80, a},
       [a](const Vector3d& p) {
         return (std::hypot(p.x(), p.y()) - 40) * std::cos(a) + p.z() * std::sin(a);
       },
       cone_normal(a), pi * (80 - 80 * std::tan(a)) * 80 / std::cos(a)},
      {"shallow cone to its apex", Cone{10, 0.4, steep},
       [steep](const Vector3d& p) {
         return (std::hypot(p.x(), p.y()) - 10) * std::cos(steep) + p.z() * std::sin(steep);
       },
       cone_normal(steep), pi * 10 * std::hypot(10, 0.4)},
      cap(100, 50, "dome"),
      cap(125.2, 10, "shallow cap"),
      cap(20, 20, "hemisphere"),
      cap(1000, 1, "flat cap"),
      {"torus", Torus{30, 5},
       [](const Vector3d& p) { return (p - 30 * away_from_axis(p)).norm() - 5; },
       [](const Vector3d& p) { return away_from_tube(p, 30); }, 2 * pi * pi * 30 * 5},
      {"profile with a groove",
       RevolvedProfile{{{{0, 5}, {10, 5}},         // a flat
                        {{10, 5}, {14, 5}, -2.0},  // half a turn inward: a groove of radius 2
                        {{14, 5}, {14, 0}}}},      // a wall
       [](const Vector3d& p) {
         const double r = std::hypot(p.x(), p.y());
         if (r <= 10) return p.z() - 5;
         if (p.z() <= 5 && r >= 14 - 1e-9) return r - 14;
         return 2 - std::hypot(r - 12, p.z() - 5);
       },
       nullptr,  // kinks: checked apart
       pi * 100 + 2 * pi * pi * 2 * 12 + 2 * pi * 14 * 5},
  };
}

TEST(Tessellate, VerticesAndNormalsAreExact) {
  for (const Known& k : known()) {
    SCOPED_TRACE(k.name);
    const Design d = tessellate(k.primitive, {20000});
    double off = 0, length = 0, tilt = 0;
    for (Index i = 0; i < d.vertices.rows(); ++i) {
      const Vector3d p = d.vertices.row(i), n = d.normals.row(i);
      off = std::max(off, std::abs(k.off(p)));
      length = std::max(length, std::abs(n.norm() - 1));
      if (k.normal && p.head<2>().norm() > 0) tilt = std::max(tilt, (n - k.normal(p)).norm());
    }
    std::cout << k.name << ": " << d.vertices.rows() << " vertices, off " << off << " mm, normal "
              << tilt << " rad\n";
    // mm: the reference itself rounds at the size of its radius
    EXPECT_LT(off, k.name == "flat cap" ? 4e-13 : 5e-14);
    EXPECT_LT(length, 1e-15);
    EXPECT_LT(tilt, 2e-15);
    EXPECT_EQ(d.facet_error.maxCoeff(), 0.0);
  }
}

TEST(Tessellate, NumberAndAreaAreAsAsked) {
  for (const Known& k : known())
    for (const int wanted : {100, 300, 5000, 120000}) {
      SCOPED_TRACE(k.name + " " + std::to_string(wanted));
      const Design d = tessellate(k.primitive, {wanted});
      EXPECT_LE(double(d.vertices.rows()), 1.2 * wanted);
      EXPECT_GE(double(d.vertices.rows()), wanted / 1.2);
      EXPECT_EQ(static_cast<std::size_t>(d.vertices.rows()), d.judged.size());
      // facets of a surface fall short of it by a part of about 1/n
      const double missing = 1.0 - d.area.sum() / k.area;
      EXPECT_LT(std::abs(missing), 12.0 / wanted);
      if (wanted == 120000) std::cout << k.name << ": area short by " << missing << "\n";
    }
}

TEST(Tessellate, TrianglesAreSoundAndLookOutward) {
  for (const Known& k : known())
    for (const int wanted : {100, 2000, 30000}) {
      SCOPED_TRACE(k.name + " " + std::to_string(wanted));
      const Design d = tessellate(k.primitive, {wanted});
      double min_cosine = 1, min_shape = 1;
      std::set<std::pair<int, int>> directed;
      std::vector<char> used(static_cast<std::size_t>(d.vertices.rows()), 0);
      for (Index t = 0; t < d.triangles.rows(); ++t) {
        const Vector3d p = d.vertices.row(d.triangles(t, 0)), q = d.vertices.row(d.triangles(t, 1)),
                       r = d.vertices.row(d.triangles(t, 2));
        const Vector3d cross = (q - p).cross(r - p);
        const double longest =
            std::max({(q - p).squaredNorm(), (r - q).squaredNorm(), (p - r).squaredNorm()});
        min_shape = std::min(min_shape, cross.norm() / longest);
        for (int c = 0; c < 3; ++c) {
          const int v = d.triangles(t, c);
          used[static_cast<std::size_t>(v)] = 1;
          min_cosine = std::min(min_cosine, cross.normalized().dot(d.normals.row(v)));
          EXPECT_TRUE(directed.insert({v, d.triangles(t, (c + 1) % 3)}).second) << "an edge twice";
        }
      }
      EXPECT_EQ(std::count(used.begin(), used.end(), 0), 0) << "a vertex without triangles";
      // the closing flat of an apex and coarse rings lean away, never over
      EXPECT_GT(min_cosine, 0.2);
      EXPECT_GT(min_shape, wanted == 30000 ? 0.05 : 0.01);
      if (wanted == 30000)
        std::cout << k.name << ": cosine above " << min_cosine << ", height over edge " << min_shape
                  << "\n";
    }
}

TEST(Tessellate, NoFeedIsCommensurableWithTheRings) {
  // radii modulo any feed must fill the feed evenly: the discrepancy of a random sample of n is
  // 1/sqrt n
  const Design d = tessellate(Disc{10.8, 0}, {30000});
  std::set<double> seen;
  for (Index i = 0; i < d.vertices.rows(); ++i)
    seen.insert(std::round(d.vertices.row(i).norm() * 1e9) / 1e9);
  std::vector<double> radii(seen.begin(), seen.end());
  const double mean_step = 10.8 / (double(radii.size()) - 1);
  double worst = 0;
  for (double feed :
       {0.02, 0.025, 0.1, 0.2, 0.5, 1.0, mean_step, mean_step / 2, mean_step / 3, 2 * mean_step}) {
    std::vector<double> phase;
    for (double r : radii) phase.push_back(r / feed - std::floor(r / feed));
    std::sort(phase.begin(), phase.end());
    double discrepancy = 0;
    for (std::size_t i = 0; i < phase.size(); ++i)
      discrepancy =
          std::max(discrepancy, std::abs(phase[i] - (double(i) + 0.5) / double(phase.size())));
    std::cout << "feed " << feed << ": discrepancy " << discrepancy << " of " << radii.size()
              << " rings\n";
    worst = std::max(worst, discrepancy);
  }
  EXPECT_LT(worst, 2.0 / std::sqrt(double(radii.size())) + 0.1);
}

TEST(Tessellate, AKinkHasTwoRingsAndASmoothJoinOne) {
  const auto rings_at = [](const Design& d, double r, double z) {
    std::set<std::pair<double, double>> normals;
    for (Index i = 0; i < d.vertices.rows(); ++i) {
      const Vector3d p = d.vertices.row(i), n = d.normals.row(i);
      if (std::abs(std::hypot(p.x(), p.y()) - r) < 1e-9 && std::abs(p.z() - z) < 1e-9)
        normals.insert({std::round(n.dot(away_from_axis(p)) * 1e6), std::round(n.z() * 1e6)});
    }
    return normals;
  };
  const RevolvedProfile step{{{{0, 1}, {5, 1}}, {{5, 1}, {5, 0}}, {{5, 0}, {9, 0}}}};
  const Design d = tessellate(step, {3000});
  EXPECT_EQ(rings_at(d, 5, 1), (std::set<std::pair<double, double>>{{0, 1e6}, {1e6, 0}}));
  EXPECT_EQ(rings_at(d, 5, 0), (std::set<std::pair<double, double>>{{0, 1e6}, {1e6, 0}}));
  EXPECT_EQ(rings_at(tessellate(Torus{30, 5}, {3000}), 30, 5).size(), 1u);
}

TEST(Tessellate, TheAxisCarriesAVertexOnlyWhereTheSurfaceIsSmooth) {
  const auto min_r = [](const Primitive& p) {
    return tessellate(p, {5000}).vertices.leftCols<2>().rowwise().norm().minCoeff();
  };
  EXPECT_EQ(min_r(Disc{10, 0}), 0.0);
  EXPECT_EQ(min_r(SphereCap{20, 10}), 0.0);
  EXPECT_GT(min_r(Cone{10, 0.4, std::atan(10.0 / 0.4)}), 0.01);
  EXPECT_LT(min_r(Cone{10, 0.4, std::atan(10.0 / 0.4)}), 0.2);
  EXPECT_NEAR(min_r(Disc{10, 3}), 3.0, 1e-15);
}

TEST(ContactAbove, IsOnTheSurfaceRightAboveThePoint) {
  SeededRandom random(11);
  std::uniform_real_distribution<double> in(-1, 1);
  for (const Known& k : known()) {
    if (k.name == "cylinder") continue;
    SCOPED_TRACE(k.name);
    const double reach =
        tessellate(k.primitive, {100}).vertices.leftCols<2>().cwiseAbs().maxCoeff();
    double off = 0, tilt = 0;
    int met = 0;
    for (int i = 0; i < 5000; ++i) {
      const double x = reach * in(random), y = reach * in(random);
      const auto c = highest_surface_point(k.primitive, x, y);
      if (!c) continue;
      ++met;
      EXPECT_EQ(c->point.x(), x);
      EXPECT_EQ(c->point.y(), y);
      off = std::max(off, std::abs(k.off(c->point)));
      EXPECT_NEAR(c->normal.norm(), 1.0, 1e-15);
      if (k.normal) tilt = std::max(tilt, (c->normal - k.normal(c->point)).norm());
    }
    std::cout << k.name << ": " << met << " of 5000 met, off " << off << " mm, normal " << tilt
              << "\n";
    EXPECT_GT(met, 1000);
    EXPECT_LT(off, k.name == "flat cap" ? 4e-13 : 5e-14);
    EXPECT_LT(tilt, 1e-13);
  }
}

TEST(ContactAbove, EndsAtTheRimAndKnowsTheAxis) {
  EXPECT_TRUE(highest_surface_point(RectanglePlane{10, 4}, 5, 2));
  EXPECT_FALSE(highest_surface_point(RectanglePlane{10, 4}, 5.000001, 0));
  EXPECT_FALSE(highest_surface_point(RectanglePlane{10, 4}, 0, -2.000001));
  EXPECT_TRUE(highest_surface_point(SphereCap{20, 20}, 0, 20));  // the equator itself
  EXPECT_FALSE(highest_surface_point(SphereCap{20, 20}, 0, 20.000001));
  EXPECT_FALSE(highest_surface_point(Disc{10, 3}, 2.999999, 0));
  EXPECT_FALSE(highest_surface_point(Cylinder{10, 5}, 10, 0));
  EXPECT_FALSE(highest_surface_point(Torus{30, 5}, 24.999, 0));
  EXPECT_EQ(highest_surface_point(Torus{30, 5}, 0, 30)->point.z(), 5.0);
  EXPECT_EQ(highest_surface_point(Cone{10, 10, pi / 4}, 0, 0)->normal, Vector3d::UnitZ());
  EXPECT_NEAR(highest_surface_point(Cone{10, 10, pi / 4}, 0, 0)->point.z(), 10.0, 1e-14);
  EXPECT_EQ(highest_surface_point(SphereCap{20, 10}, 1e-12, 0)->normal.z(), 1.0);
  EXPECT_FALSE(highest_surface_point(Disc{10, 0}, NAN, 0));
  // a step: above the kink the higher sheet counts
  const RevolvedProfile step{{{{0, 0}, {5, 0}}, {{5, 0}, {5, 2}}, {{5, 2}, {9, 2}}}};
  EXPECT_EQ(highest_surface_point(step, 5, 0)->point.z(), 2.0);
}

TEST(Enlarged, ContinuesTheSameSurface) {
  for (const Known& k : known()) {
    SCOPED_TRACE(k.name);
    const Primitive larger = enlarge(k.primitive, 0.25);
    const Design d = tessellate(larger, {3000});
    double off = 0;
    for (Index i = 0; i < d.vertices.rows(); ++i)
      off = std::max(off, std::abs(k.off(d.vertices.row(i).transpose())));
    EXPECT_LT(off, 5e-13);
  }
}

TEST(Enlarged, ReachesTheMarginWhereItCan) {
  const auto rim = [](const Primitive& p) { return profile(p).profile_segments.back().to; };
  const auto inner = [](const Primitive& p) { return profile(p).profile_segments.front().from; };
  EXPECT_NEAR(rim(enlarge(Disc{10, 1}, 2)).x(), 12, 1e-14);
  EXPECT_EQ(inner(enlarge(Disc{10, 1}, 2)).x(), 0);
  EXPECT_NEAR(rim(enlarge(SphereCap{20, 10}, 3)).x(), 13, 1e-14);
  EXPECT_EQ(rim(enlarge(SphereCap{20, 19}, 3)).x(), 20);
  EXPECT_NEAR(rim(enlarge(Cone{10, 5, pi / 4}, 1)).x(), 11, 1e-14);
  EXPECT_NEAR(rim(enlarge(Cone{10, 5, pi / 4}, 1)).y(), -1, 1e-14);
  EXPECT_NEAR(inner(enlarge(Cone{10, 5, pi / 4}, 1)).x(), 4, 1e-14);
  EXPECT_EQ(inner(enlarge(Cone{10, 9.5, pi / 4}, 1)).x(), 0);
  EXPECT_NEAR(rim(enlarge(Cylinder{10, 5}, 1)).y(), -1, 1e-14);
  EXPECT_NEAR(inner(enlarge(Cylinder{10, 5}, 1)).y(), 6, 1e-14);
  EXPECT_EQ(rim(enlarge(Torus{30, 5}, 1)), Vector2d(35, 0));
  EXPECT_EQ(std::get<RectanglePlane>(enlarge(RectanglePlane{10, 4}, 1)).length_y, 6);
  // an arc of a profile ends where it stands upright
  const RevolvedProfile dome{{{{0, 0}, {6, -2}, 10.0}}};
  const Vector2d end = rim(enlarge(dome, 100));
  EXPECT_NEAR(end.x(), 10, 1e-12);
  EXPECT_NEAR(end.y(), -10, 1e-6);  // upright: a rounding of r is its square root in z
  EXPECT_THROW(enlarge(Disc{10, 0}, -1), std::invalid_argument);
}

TEST(Primitive, ImpossibleDimensionsAreRefusedByName) {
  const double inf = std::numeric_limits<double>::infinity();
  const std::vector<std::pair<Primitive, std::string>> bad = {
      {RectanglePlane{0, 5}, "length_x"},
      {RectanglePlane{5, nan}, "length_y"},
      {Disc{-1, 0}, "radius of the disc"},
      {Disc{5, 5}, "inner_radius"},
      {Disc{5, nan}, "inner_radius"},
      {Cylinder{5, 0}, "height of the cylinder"},
      {Cylinder{inf, 1}, "radius of the cylinder"},
      {Cone{10, 10, 0}, "half_apex_angle"},
      {Cone{10, 10, pi / 2}, "half_apex_angle"},
      {Cone{10, 10.01, pi / 4}, "apex"},
      {SphereCap{10, 10.1}, "rim_radius"},
      {SphereCap{10, 0}, "rim_radius"},
      {Torus{5, 6}, "tube_radius"},
      {RevolvedProfile{}, "at least one piece"},
      {RevolvedProfile{{{{-1, 0}, {5, 0}}}}, "below r = 0"},
      {RevolvedProfile{{{{0, 1}, {0, 0}}}}, "end above r = 0"},
      {RevolvedProfile{{{{5, 0}, {4, 0}}}}, "turn back"},
      {RevolvedProfile{{{{5, 0}, {5, 0}}}}, "length"},
      {RevolvedProfile{{{{0, 0}, {5, 0}, 2.4}}}, "half its chord"},
      {RevolvedProfile{{{{0, 0}, {5, 5}, 4.0}}}, "bulge"},
      {RevolvedProfile{{{{0, 0}, {5, 0}}, {{5.1, 0}, {6, 0}}}}, "gap"},
      {RevolvedProfile{{{{0, nan}, {5, 0}}}}, "finite"},
  };
  for (const auto& [primitive, word] : bad) {
    const std::string said = thrown_text<std::invalid_argument>([&] { tessellate(primitive); });
    EXPECT_HAS(said, word);
  }
  EXPECT_THROW(tessellate(Disc{10, 0}, {99}), std::invalid_argument);
  EXPECT_THROW(profile(RectanglePlane{}), std::invalid_argument);
}

}  // namespace
}  // namespace abbe::cutting
