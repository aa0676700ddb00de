#include "cutting/map/form.h"
#include "tests/cutting/map_over.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

std::map<std::string, double> numbers(const Primitive& p, const Design& d, const Surface& s) {
  std::map<std::string, double> result;
  for (const FormNumber& number : form(p, d, s)) result[number.name] = number.value_mm;
  return result;
}

TEST(FitCircle, FindsAnyCircleExactly) {
  for (const double span : {2 * pi, pi, 0.3}) {
    Eigen::Matrix<double, Eigen::Dynamic, 2> points(40, 2);
    for (int i = 0; i < 40; ++i)
      points.row(i) << 120 + 25 * std::cos(span * i / 40 + 0.2),
          -70 + 25 * std::sin(span * i / 40 + 0.2);
    const Circle c = fit_circle(points);
    std::cout << "span " << span << ": centre off " << (c.centre - Vector2d(120, -70)).norm()
              << ", roundness " << c.roundness << " mm\n";
    EXPECT_LT((c.centre - Vector2d(120, -70)).norm(), span < 1 ? 1e-10 : 1e-13);
    EXPECT_NEAR(c.radius, 25, span < 1 ? 1e-10 : 1e-13);
    EXPECT_LT(c.roundness, 1e-13);
  }
}

TEST(FitCircle, SeesLobesAndNotTheEccentricity) {
  const int n = 720;
  Eigen::Matrix<double, Eigen::Dynamic, 2> points(n, 2);
  for (int i = 0; i < n; ++i) {
    const double a = 2 * pi * i / n, r = 30 + 0.004 * std::cos(3 * a);
    points.row(i) << 0.05 + r * std::cos(a), -0.02 + r * std::sin(a);
  }
  const Circle c = fit_circle(points);
  EXPECT_NEAR(c.roundness, 0.008, 1e-9);
  EXPECT_LT((c.centre - Vector2d(0.05, -0.02)).norm(), 1e-6);  // lobes couple in at a^2 / R
  EXPECT_NEAR(c.radius, 30, 1e-6);
}

TEST(FitCircle, IsAMinimumOfTheSquares) {
  SeededRandom random(17);
  std::normal_distribution<double> noise(0, 0.05);
  Eigen::Matrix<double, Eigen::Dynamic, 2> points(30, 2);
  for (int i = 0; i < 30; ++i)
    points.row(i) << 3 * std::cos(0.1 * i) + noise(random), 3 * std::sin(0.1 * i) + noise(random);
  const Circle best = fit_circle(points);
  const auto cost = [&](const Vector2d& c, double r) {
    return ((points.rowwise() - c.transpose()).rowwise().norm().array() - r).square().sum();
  };
  const double least = cost(best.centre, best.radius);
  for (const double h : {1e-2, 1e-3, 1e-4})
    for (const Vector3d& d : {Vector3d(h, 0, 0), Vector3d(0, h, 0), Vector3d(0, 0, h)})
      for (const double sign : {-1.0, 1.0})
        EXPECT_GT(cost(best.centre + sign * d.head<2>(), best.radius + sign * d.z()), least);
}

TEST(FitCircle, RefusesWhatIsNoCircle) {
  Eigen::Matrix<double, Eigen::Dynamic, 2> line(5, 2);
  for (int i = 0; i < 5; ++i) line.row(i) << i, 2 * i + 1;
  EXPECT_THROW(fit_circle(line), std::invalid_argument);
  EXPECT_THROW(fit_circle(line.topRows(2)), std::invalid_argument);
  EXPECT_THROW(fit_circle(Eigen::Matrix<double, Eigen::Dynamic, 2>::Zero(5, 2)),
               std::invalid_argument);
  line(2, 1) = std::nan("");
  EXPECT_THROW(fit_circle(line), std::invalid_argument);
}

TEST(Form, OfATiltedFlatIsZero) {
  for (const Primitive& p : {Primitive(RectanglePlane{80, 40}), Primitive(Disc{10.8, 0})}) {
    const Design d = tessellate(p, {2000});
    const auto f = numbers(p, d, map_over(d, [](const Vector3d& x, const Vector3d&) {
                             return 0.01 + 1e-4 * x.x() - 2e-4 * x.y();
                           }));
    EXPECT_LT(f.at("flatness_lsq"), 1e-15);
    EXPECT_LT(f.at("flatness_minimum_zone"), 1e-15);
  }
}

TEST(Form, OfABowlAndASaddleAreTheirClosedForms) {
  const double R = 10, h = 0.006;
  const Disc disc{R, 0};
  const Design d = tessellate(disc, {20000});
  // a bowl: no plane is better than a level one
  auto f = numbers(disc, d, map_over(d, [&](const Vector3d& x, const Vector3d&) {
                     return h * x.squaredNorm() / (R * R);
                   }));
  std::cout << "bowl: lsq " << f["flatness_lsq"] << ", zone " << f["flatness_minimum_zone"] << "\n";
  EXPECT_NEAR(f["flatness_lsq"], h, 1e-4 * h);
  EXPECT_NEAR(f["flatness_minimum_zone"], h, 1e-9);
  // a saddle: from -h to h whatever the tilt
  f = numbers(disc, d, map_over(d, [&](const Vector3d& x, const Vector3d&) {
                return h * (x.x() * x.x() - x.y() * x.y()) / (R * R);
              }));
  EXPECT_NEAR(f["flatness_minimum_zone"], 2 * h, 1e-3 * h);
  EXPECT_GE(f["flatness_lsq"], f["flatness_minimum_zone"] - 1e-12);
}

TEST(Form, MinimumZoneIsNotBeatenByAnyPlaneOfASearch) {
  SeededRandom random(23);
  std::normal_distribution<double> noise(0, 0.002);
  const RectanglePlane plane{60, 30};
  const Design d = tessellate(plane, {1500});
  double most = 0;
  for (int round = 0; round < 20; ++round) {
    const Surface s = map_over(d, [&](const Vector3d& x, const Vector3d&) {
      return noise(random) + 0.003 * std::sin(0.1 * round * x.x()) * x.y() / 15 + 1e-4 * x.x();
    });
    const auto f = numbers(plane, d, s);
    EXPECT_LE(f.at("flatness_minimum_zone"), f.at("flatness_lsq"));
    // the width is convex in the two tilts: pattern search from the least-squares plane finds its
    // minimum
    const auto width = [&](double b, double c) {
      const VectorXd z = s.residual - b * d.vertices.col(0) - c * d.vertices.col(1);
      return (z.maxCoeff() - z.minCoeff()) / std::sqrt(1 + b * b + c * c);
    };
    double b = 0, c = 0;
    for (double step = 1e-3; step > 1e-13; step *= 0.5)
      for (bool better = true; better;) {
        better = false;
        for (int k = 0; k < 16; ++k) {
          const double tb = b + step * std::cos(pi * k / 8), tc = c + step * std::sin(pi * k / 8);
          if (width(tb, tc) >= width(b, c)) continue;
          b = tb, c = tc, better = true;
        }
      }
    most = std::max(most, std::abs(f.at("flatness_minimum_zone") - width(b, c)));
    EXPECT_LE(f.at("flatness_minimum_zone"), width(b, c) + 1e-12);
  }
  std::cout << "minimum zone against search: " << most << " mm\n";
}

TEST(Form, OfACylinderLeavesPositionTiltAndSizeOut) {
  const Cylinder cylinder{25, 40};
  const Design d = tessellate(cylinder, {8000});
  const auto shifted = [](const Vector3d& x, const Vector3d& n) {
    return n.dot(Vector3d(2e-3, -1e-3, 0) + Vector3d(1e-5, 2e-5, 0).cross(x)) + 4e-3;
  };
  auto f = numbers(cylinder, d, map_over(d, shifted));
  EXPECT_LT(f.at("cylindricity_lsq"), 1e-14);
  // roundness sees the true circle: an eccentricity e leaves e^2 / 2R
  EXPECT_LT(f.at("roundness_lsc"), 5e-6 / 25);
  f = numbers(cylinder, d, map_over(d, [&](const Vector3d& x, const Vector3d& n) {
                return shifted(x, n) + 3e-3 * std::cos(2 * std::atan2(x.y(), x.x()));
              }));
  std::cout << "oval: cylindricity " << f["cylindricity_lsq"] << ", roundness "
            << f["roundness_lsc"] << "\n";
  EXPECT_NEAR(f["cylindricity_lsq"], 6e-3, 2e-5);
  EXPECT_NEAR(f["roundness_lsc"], 6e-3, 2e-5);
}

TEST(Form, OfAConeIsToldAcrossItsAxis) {
  const double a = 0.5;
  const Cone cone{30, 20, a};
  const Design d = tessellate(cone, {8000});
  const auto f = numbers(cone, d, map_over(d, [&](const Vector3d& x, const Vector3d&) {
                           return 2e-3 * std::cos(2 * std::atan2(x.y(), x.x()));
                         }));
  EXPECT_NEAR(f.at("roundness_lsc"), 4e-3 / std::cos(a), 2e-5);
  EXPECT_NEAR(f.at("conicity_lsq"), 4e-3, 2e-5);
  EXPECT_EQ(numbers(Cone{10, 0.4, 1.5}, d, map_over(d, [](auto&&...) { return 0.0; }))
                .count("roundness_lsc"),
            0u);
}

TEST(Form, OfASphereLeavesCentreAndRadiusOut) {
  for (const SphereCap& cap : {SphereCap{50, 30}, SphereCap{125.2, 10}}) {
    const Design d = tessellate(cap, {5000});
    const auto moved = [](const Vector3d&, const Vector3d& n) {
      return n.dot(Vector3d(3e-3, 1e-3, -2e-3)) + 5e-3;
    };
    const double zero = numbers(cap, d, map_over(d, moved)).at("sphericity_lsq");
    std::cout << "sphere " << cap.radius << ": " << zero << " mm left\n";
    EXPECT_LT(zero, 1e-13);
    const double coma =
        numbers(cap, d,
                map_over(d,
                         [&](const Vector3d& x, const Vector3d& n) {
                           return moved(x, n) + 1e-3 * std::cos(5 * std::atan2(x.y(), x.x()));
                         }))
            .at("sphericity_lsq");
    EXPECT_NEAR(coma, 2e-3, 4e-5);
  }
}

TEST(Form, OfALargeMapNeedsNoLuckWithMemory) {
  // used to crash: temporaries beyond the stack's share come from malloc, aligned to 16 bytes only
  const Primitive sphere = SphereCap{100.0, 50.0};
  const Design d = tessellate(sphere, {120000});
  const auto form =
      numbers(sphere, d, map_over(d, [](const Vector3d&, const Vector3d&) { return 0.01; }));
  std::cout << "120 000 vertices, allowance 0.01 mm: sphericity " << form.at("sphericity_lsq")
            << " mm\n";
  EXPECT_LT(form.at("sphericity_lsq"), 1e-12);
}

TEST(Form, CountsCutVerticesOnly) {
  const Disc disc{10, 0};
  const Design d = tessellate(disc, {1000});
  Surface s = map_over(d, [](auto&&...) { return 0.0; });
  s.residual[3] = 1.0;
  s.status[3] = VertexStatus::Outside;
  EXPECT_LT(numbers(disc, d, s).at("flatness_lsq"), 1e-15);
  s.status.assign(s.status.size(), VertexStatus::Uncut);
  EXPECT_TRUE(form(disc, d, s).empty());
  EXPECT_THROW(form(disc, d, Surface{}), std::invalid_argument);
}

TEST(Form, OfAProfileAndATorusIsToldToo) {
  for (const Primitive& p : {Primitive(Torus{30, 5}),
                             Primitive(RevolvedProfile{{{{0, 1}, {5, 1}}, {{5, 1}, {9, 0}}}})}) {
    const Design d = tessellate(p, {3000});
    const auto f =
        form(p, d, map_over(d, [](const Vector3d& x, const Vector3d& n) {
               return n.dot(Vector3d(1e-3, 2e-3, 3e-3) + Vector3d(1e-5, 0, 0).cross(x)) + 2e-3;
             }));
    ASSERT_EQ(f.size(), 1u);
    EXPECT_LT(f[0].value_mm, 1e-14);
  }
}

}  // namespace
}  // namespace abbe::cutting
