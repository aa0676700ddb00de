#include "sim/compensation/machine_belief.h"

#include <cmath>
#include <iostream>
#include <random>

#include <gtest/gtest.h>

namespace abbe::sim::compensation {
namespace {

using Eigen::Index;
using Eigen::MatrixX3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

TEST(Mirror, ReadingsThatAreLinearOverThePartAreMetEverywhere) {
  std::mt19937_64 random(20261121);
  std::uniform_real_distribution<double> place(-20, 20);
  MatrixX3d read_at(300, 3), points(500, 3);
  for (Index i = 0; i < read_at.rows(); ++i) read_at.row(i) << place(random), place(random), 3.0;
  for (Index i = 0; i < points.rows(); ++i)
    points.row(i) << 0.8 * place(random), 0.8 * place(random), 3.0;
  const auto linear = [](const auto& p) { return 4e-3 + 1e-4 * p[0] - 2e-4 * p[1]; };
  VectorXd deviation(300);
  for (Index i = 0; i < 300; ++i) deviation[i] = linear(read_at.row(i));
  const VectorXd between = interpolate_readings(read_at, deviation, points, 50.0);
  double worst = 0.0;
  for (Index i = 0; i < 500; ++i)
    worst = std::max(worst, std::abs(between[i] - linear(points.row(i))));
  std::cout << "largest error between readings " << worst << " mm\n";
  EXPECT_LT(worst, 1e-12);
}

TEST(Mirror, ReadingsOwnPlaceHasItsOwnValueAndFarPlacesHaveNone) {
  MatrixX3d read_at(2, 3), points(3, 3);
  read_at << 0, 0, 0, 10, 0, 0;
  points << 0, 0, 0, 10, 0, 0, 200, 0, 0;
  const VectorXd between = interpolate_readings(read_at, Eigen::Vector2d(0.5, -0.25), points, 20.0);
  EXPECT_EQ(between[0], 0.5);
  EXPECT_EQ(between[1], -0.25);
  EXPECT_EQ(between[2], 0.0);
  EXPECT_THROW(interpolate_readings(MatrixX3d(0, 3), VectorXd(0), points, 1.0),
               std::invalid_argument);
}

/// A part whose points are cut one after another by a tool that is displaced by `move(t)`.
template <typename Move, typename Normal>
PartDeviations cut_by(Index n, const Move& move, const Normal& normal) {
  PartDeviations part{MatrixX3d(n, 3), VectorXd(n), VectorXd(n)};
  for (Index i = 0; i < n; ++i) {
    const double t = 0.01 * double(i);
    const Vector3d n_w = normal(i);
    part.normals.row(i) = n_w.transpose();
    part.deviation[i] = n_w.dot(move(t));
    part.time_s[i] = t;
  }
  return part;
}

TEST(Mirror, DisplacementOfTheToolIsFoundWhereNormalsSeeIt) {
  const auto move = [](double t) { return Vector3d(2e-3 + 1e-4 * t, -1e-3, 3e-3); };
  const auto normal = [](Index i) {
    const double a = 2.4 * double(i);
    return Vector3d(std::sin(0.7) * std::cos(a), std::sin(0.7) * std::sin(a), std::cos(0.7));
  };
  DisplacementOptions exact;
  exact.damping = 0.0;
  const DisplacementSeries course = displacement_from_deviations(cut_by(1000, move, normal), exact);
  double worst = 0.0;
  for (double t = 0.1; t < 9.9; t += 0.01)
    worst = std::max(worst, (displacement_at(course, t) - move(t)).norm());
  std::cout << "largest error of the displacement " << worst << " mm\n";
  EXPECT_LT(worst, 1e-6);
}

TEST(Mirror, WhatIsLinearAlongAPassIsMetToItsEndsAndPassesAreKeptApart) {
  // passes that follow one another without a pause, each with a line of its own
  const double slope[] = {3e-3, -5e-3, 0.0, 8e-3}, level[] = {1e-3, -4e-3, 2e-3, 0.0};
  for (const Index in_a_pass : {3, 8, 41, 100}) {
    PartDeviations part{MatrixX3d(4 * in_a_pass, 3), VectorXd(4 * in_a_pass),
                        VectorXd(4 * in_a_pass), Eigen::VectorXi(4 * in_a_pass)};
    for (Index i = 0; i < 4 * in_a_pass; ++i) {
      const Index pass = i / in_a_pass;
      part.normals.row(i) << 0, -0.6, 0.8;
      part.time_s[i] = 0.02 * double(i);
      part.pass[i] = int(pass);
      part.deviation[i] = level[pass] + slope[pass] * part.time_s[i];
    }
    DisplacementOptions exact;
    exact.damping = 1e-6;
    const DisplacementSeries course = displacement_from_deviations(part, exact);
    double worst = 0.0;
    for (Index i = 0; i < part.time_s.size(); ++i)
      worst = std::max(worst,
                       std::abs(part.normals.row(i).dot(displacement_at(course, part.time_s[i])) -
                                part.deviation[i]));
    // a pass of less than two groups has one displacement: half its length is not met
    const double bound = in_a_pass < 16 ? 8e-3 * 0.02 * double(in_a_pass - 1) / 2 + 1e-12 : 1e-12;
    std::cout << in_a_pass << " points a pass: off by " << worst << " mm, bound " << bound << '\n';
    EXPECT_LT(worst, bound);
    for (Index i = 1; i < course.time_s.size(); ++i)
      EXPECT_GT(course.time_s[i], course.time_s[i - 1]);
  }
}

TEST(Mirror, PointsOfOneInstantHaveOneDisplacement) {
  PartDeviations part{MatrixX3d(40, 3), VectorXd(40), VectorXd(40)};
  for (Index i = 0; i < 40; ++i) {
    part.normals.row(i) << 1, 0, 0;
    part.deviation[i] = i % 2 == 0 ? 1e-3 : 3e-3;
    part.time_s[i] = i < 20 ? 1.0 : 2.0;
  }
  DisplacementOptions nearly;
  nearly.damping = 1e-6;
  const DisplacementSeries course = displacement_from_deviations(part, nearly);
  ASSERT_EQ(course.time_s.size(), 2);
  EXPECT_NEAR(displacement_at(course, 1.0).x(), 2e-3, 1e-12);
  EXPECT_NEAR(displacement_at(course, 2.0).x(), 2e-3, 1e-12);
}

TEST(Mirror, DirectionThatNoNormalSeesStaysUnmoved) {
  const auto move = [](double) { return Vector3d(1.0, 1.0, 1e-3); };
  const auto up = [](Index) { return Vector3d(0, 0, 1); };
  const DisplacementSeries course = displacement_from_deviations(cut_by(100, move, up));
  const Vector3d found = displacement_at(course, 0.5);
  EXPECT_EQ(found.x(), 0.0);
  EXPECT_EQ(found.y(), 0.0);
  EXPECT_NEAR(found.z(), 1e-3,
              1e-3 * DisplacementOptions{}.damping * DisplacementOptions{}.damping);
}

TEST(Mirror, GapInTimePartsNeighbours) {
  PartDeviations part{MatrixX3d(20, 3), VectorXd(20), VectorXd(20)};
  for (Index i = 0; i < 20; ++i) {
    part.normals.row(i) << 0, 0, 1;
    part.deviation[i] = i < 12 ? 1e-3 : -1e-3;
    part.time_s[i] = 0.01 * double(i) + (i < 12 ? 0.0 : 100.0);
  }
  DisplacementOptions exact;
  exact.damping = 0.0;
  const DisplacementSeries course = displacement_from_deviations(part, exact);
  EXPECT_NEAR(displacement_at(course, 0.1).z(), 1e-3, 1e-15);
  EXPECT_NEAR(displacement_at(course, 100.15).z(), -1e-3, 1e-15);
  EXPECT_EQ(displacement_at({}, 1.0), Vector3d::Zero());
}

}  // namespace
}  // namespace abbe::sim::compensation
