#include <algorithm>
#include <cmath>
#include <iostream>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cutting/map/form.h"
#include "cutting/part/primitive.h"

namespace abbe::cutting {
namespace {

using Eigen::Vector3d;
using kinematics::Deviation;

Surface blank(const Design& d) {
  const auto n = d.vertices.rows();
  return {Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n),
          std::vector<int>(static_cast<std::size_t>(n), 1),
          std::vector<VertexStatus>(static_cast<std::size_t>(n), VertexStatus::Cut)};
}

/// The map of a surface displaced as a whole: to first order the normal part of the shift.
Surface displaced(const Design& d, const Deviation& D, const Vector3d& point) {
  Surface s = blank(d);
  for (Eigen::Index i = 0; i < d.vertices.rows(); ++i) {
    const Vector3d p = d.vertices.row(i), n = d.normals.row(i);
    s.residual[i] = n.dot(D.head<3>() + D.tail<3>().cross(p - point));
  }
  return s;
}

Deviation some(double shift, double turn) {
  Deviation D;
  D << shift, -0.7 * shift, 0.4 * shift, turn, -0.6 * turn, 0.8 * turn;
  return D;
}

TEST(Alignment, NoneLeavesTheMapAlone) {
  const Design d = tessellate(SphereCap{50, 30}, {1000});
  const Surface s = displaced(d, some(0.01, 1e-4), Vector3d::Zero());
  const AlignmentResult a = aligned(s, d, {Alignment::None});
  EXPECT_EQ(a.surface.residual, s.residual);
  EXPECT_EQ(a.displacement, Deviation::Zero());
}

TEST(Alignment, OffsetTakesOutATranslationOfADome) {
  const Design d = tessellate(SphereCap{50, 30}, {3000});
  Deviation D = Deviation::Zero();
  D.head<3>() << 0.01, -0.02, 0.03;
  const AlignmentResult a = aligned(displaced(d, D, Vector3d::Zero()), d, {Alignment::Offset});
  std::cout << "left " << a.surface.residual.cwiseAbs().maxCoeff() << " mm\n";
  EXPECT_LT((a.displacement - D).norm(), 1e-15);
  EXPECT_LT(a.surface.residual.cwiseAbs().maxCoeff(), 1e-16);
  EXPECT_EQ(a.rank, 3);
  EXPECT_TRUE(a.undetermined.empty());
}

TEST(Alignment, OffsetOfAFlatIsItsMeanAndXAndYAreNamed) {
  const Design d = tessellate(Disc{10, 0}, {1000});
  Surface s = blank(d);
  for (Eigen::Index i = 0; i < d.vertices.rows(); ++i)
    s.residual[i] = 0.005 + 1e-3 * d.vertices(i, 0);
  const AlignmentResult a = aligned(s, d, {Alignment::Offset});
  EXPECT_EQ(a.undetermined, (std::vector<std::string>{"EX", "EY"}));
  EXPECT_NEAR(a.displacement[2], 0.005 + 1e-3 * a.point.x(), 1e-16);
  EXPECT_EQ(a.displacement[0], 0.0);
  EXPECT_NEAR(a.surface.residual.dot(d.area), 0.0, 1e-13);
}

TEST(Alignment, RigidNamesWhatASurfaceCannotTell) {
  const auto names = [](const Primitive& p) {
    const Design d = tessellate(p, {3000});
    auto list = aligned(displaced(d, some(0.01, 1e-4), Vector3d::Zero()), d, {Alignment::Rigid})
                    .undetermined;
    std::sort(list.begin(), list.end());
    return list;
  };
  using Names = std::vector<std::string>;
  EXPECT_EQ(names(RectanglePlane{40, 20}), (Names{"EC", "EX", "EY"}));
  EXPECT_EQ(names(Cylinder{20, 40}), (Names{"EC", "EZ"}));
  EXPECT_EQ(names(Cone{20, 40, 0.3}), (Names{"EC"}));
  EXPECT_EQ(names(Torus{30, 5}), (Names{"EC"}));
  // a sphere turned about its centre: turns about its top go with shifts
  EXPECT_EQ(names(SphereCap{50, 30}), (Names{"EC", "EX+EB", "EY+EA"}));
}

TEST(Alignment, RigidTakesOutAnyDisplacementOfAnySurface) {
  const unsigned seed = 5;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const std::vector<Primitive> all = {
      RectanglePlane{40, 20}, Disc{10.8, 2},        Cylinder{20, 40}, Cone{20, 40, 0.3},
      SphereCap{50, 30},      SphereCap{125.2, 10}, Torus{30, 5}};
  for (std::size_t k = 0; k < all.size(); ++k) {
    SCOPED_TRACE(k);
    Design d = tessellate(all[k], {2000});
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
                     .normalized()
                     .toRotationMatrix();
    T.translation() = 100 * Vector3d(normal(random), normal(random), normal(random));
    d = transformed(d, T);
    const Surface s = displaced(d, some(0.02, 2e-4), Vector3d(10, 20, 30));
    const AlignmentResult a = aligned(s, d, {Alignment::Rigid});
    // what is dropped moves the surface a thousand times less than what is kept, here not at all
    const double left = a.surface.residual.cwiseAbs().maxCoeff();
    std::cout << "surface " << k << ": rank " << a.rank << ", left " << left << " mm of "
              << s.residual.cwiseAbs().maxCoeff() << "\n";
    EXPECT_LT(left, 1e-13);
  }
}

TEST(Alignment, WhatIsLeftIsOrthogonalToEveryDisplacement) {
  const Design d = tessellate(Cone{20, 40, 0.3}, {2000});
  Surface s = blank(d);
  for (Eigen::Index i = 0; i < d.vertices.rows(); ++i)
    s.residual[i] = 1e-3 * std::sin(3.0 * i) + 0.01;
  s.status[5] = VertexStatus::Uncut;
  s.residual[5] = std::nan("");
  const AlignmentResult a = aligned(s, d, {Alignment::Rigid});
  EXPECT_TRUE(std::isnan(a.surface.residual[5]));
  for (int c = 0; c < 6; ++c) {
    Deviation D = Deviation::Zero();
    D[c] = 1.0;
    const Eigen::VectorXd unit = displaced(d, D, a.point).residual;
    double sum = 0.0;
    for (Eigen::Index i = 0; i < unit.size(); ++i)
      if (i != 5) sum += d.area[i] * unit[i] * a.surface.residual[i];
    EXPECT_NEAR(sum / d.area.sum(), 0.0, 1e-15) << c;
  }
}

TEST(Alignment, HoldsItsBoundOnTheTrueSurface) {
  // a dome really turned by 100 urad and shifted by 20 um, its residual by ray against the sphere
  const double R = 50.0;
  const Design d = tessellate(SphereCap{R, 30}, {3000});
  const Vector3d t(0.02, -0.01, 0.015);
  Surface s = blank(d);
  for (Eigen::Index i = 0; i < d.vertices.rows(); ++i) {
    const Vector3d n = d.normals.row(i);  // the vertex stands at R n from the centre
    s.residual[i] = n.dot(t) + std::sqrt(R * R - t.squaredNorm() + std::pow(n.dot(t), 2)) - R;
  }
  const double left = aligned(s, d, {Alignment::Offset}).surface.residual.cwiseAbs().maxCoeff();
  std::cout << "left " << left * 1e6 << " nm, bound " << t.squaredNorm() / (2 * R) * 1e6 << " nm\n";
  EXPECT_LT(left, t.squaredNorm() / (2 * R));
}

TEST(Alignment, OfNothingIsNothing) {
  const Design d = tessellate(Disc{10, 0}, {200});
  Surface s = blank(d);
  s.status.assign(s.status.size(), VertexStatus::Uncut);
  EXPECT_EQ(aligned(s, d, {Alignment::Rigid}).rank, 0);
  EXPECT_THROW(aligned(Surface{}, d, {Alignment::Rigid}), std::invalid_argument);
}

}  // namespace
}  // namespace abbe::cutting
