#include "cutting/areal_filter.h"

#include <cmath>
#include <iostream>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "cutting/primitive.h"
#include "cutting/residual.h"
#include "cutting/smooth_patches.h"
#include "tests/cutting/map_over.h"

namespace abbe::cutting {
namespace {

using Eigen::Index;
using Eigen::Vector3d;
using std::numbers::pi;

template <class Height>
Surface surface_of(const Design& design, const Height& height) {
  return map_over(design, [&](const Vector3d& p, const Vector3d&) { return height(p); });
}

/// Amplitude of the form of a wave over places whose distance from the rim is beyond a cut-off.
template <class Wave, class Inside>
double transmission(const Design& design, const Wave& wave, const Inside& inside, double cutoff) {
  const Eigen::VectorXd form = gaussian_form(design, surface_of(design, wave), cutoff);
  double product = 0.0, square = 0.0;
  for (Index i = 0; i < form.size(); ++i) {
    const Vector3d p = design.vertices.row(i);
    if (!inside(p)) continue;
    product += form[i] * wave(p);
    square += wave(p) * wave(p);
  }
  return product / square;
}

TEST(GaussianForm, SinesPassAsISO16610Says) {
  const Design plane = tessellate(RectanglePlane{24.0, 24.0}, {150000});
  constexpr double cutoff = 2.5;
  for (const double turned : {0.0, 0.6}) {
    for (const auto& [ratio, expected] : {std::pair(1.0, 0.5), {0.5, 0.0625}, {2.0, 0.8408964}}) {
      const double wave_length = ratio * cutoff;
      const auto wave = [&](const Vector3d& p) {
        return std::sin(2 * pi * (std::cos(turned) * p.x() + std::sin(turned) * p.y()) /
                        wave_length);
      };
      const auto inside = [](const Vector3d& p) { return p.head<2>().cwiseAbs().maxCoeff() < 9.0; };
      const double seen = transmission(plane, wave, inside, cutoff);
      std::cout << "wave of " << ratio << " cut-offs at " << turned << " rad: " << 100 * seen
                << " %\n";
      EXPECT_NEAR(seen, expected, 0.005);
    }
  }
}

TEST(GaussianForm, SinesPassAlikeOnSlopesAndCylinders) {
  constexpr double cutoff = 2.5, radius = 20.0;
  const Design wall = tessellate(Cylinder{radius, 20.0}, {150000});
  const auto along = [&](const Vector3d& p) { return std::sin(2 * pi * p.z() / cutoff); };
  // a whole number of waves around, as near to the cut-off as they come
  const double count = std::round(2 * pi * radius / cutoff);
  const double length = 2 * pi * radius / count;
  const auto around = [&](const Vector3d& p) { return std::sin(count * std::atan2(p.y(), p.x())); };
  const auto inside = [](const Vector3d& p) { return p.z() > 3.0 && p.z() < 17.0; };
  EXPECT_NEAR(transmission(wall, along, inside, cutoff), 0.5, 0.005);
  EXPECT_NEAR(transmission(wall, around, inside, cutoff),
              std::pow(0.5, cutoff * cutoff / (length * length)), 0.005);
}

TEST(GaussianForm, IsTheSumOverAllVerticesWrittenOut) {
  const Design plane = tessellate(RectanglePlane{6.0, 6.0}, {3000});
  constexpr double cutoff = 2.5;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  std::vector<Vector3d> waves;  // of at least half the cut-off, each with its phase
  for (int i = 0; i < 20; ++i)
    waves.emplace_back(8 / cutoff * number(random), 8 / cutoff * number(random),
                       pi * number(random));
  const Surface surface = surface_of(plane, [&](const Vector3d& p) {
    double height = 0.0;
    for (const Vector3d& wave : waves)
      height += 0.05 * std::sin(wave.dot(Vector3d(p.x(), p.y(), 1)));
    return height;
  });
  const Eigen::VectorXd form = gaussian_form(plane, surface, cutoff);
  const double alpha = std::sqrt(std::log(2.0) / pi);
  double worst = 0.0;
  for (Index i = 0; i < form.size(); i += 37) {
    const Vector3d p = plane.vertices.row(i);
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Vector3d b = Vector3d::Zero();
    for (Index j = 0; j < form.size(); ++j) {
      const Vector3d d = plane.vertices.row(j).transpose() - p;
      const double x = d.norm() / (alpha * cutoff);
      const double weight = plane.area[j] * std::exp(-pi * x * x);
      const Vector3d basis(1.0, d.x(), d.y());
      A += weight * basis * basis.transpose();
      b += weight * surface.residual[j] * basis;
    }
    worst = std::max(worst, std::abs(form[i] - A.ldlt().solve(b)[0]));
  }
  const double pv = surface.residual.maxCoeff() - surface.residual.minCoeff();
  std::cout << "cells against all vertices: " << 100 * worst / pv << " % of PV\n";
  EXPECT_LT(worst, 0.01 * pv);
}

TEST(GaussianForm, AWaveFinerThanTheVerticesLeavesNoWaveOfItsOwn) {
  const Design plane = tessellate(RectanglePlane{24.0, 24.0}, {30000});
  const double spacing = std::sqrt(2.0 * 24.0 * 24.0 / double(plane.triangles.rows()));
  const auto wave = [&](const Vector3d& p) { return std::sin(2 * pi * p.x() / (0.97 * spacing)); };
  const auto spread = [](const Eigen::VectorXd& v) {
    return std::sqrt((v.array() - v.mean()).square().mean());
  };
  Surface surface = surface_of(plane, wave);
  const double at_vertices = spread(gaussian_form(plane, surface, 2.5));
  surface.looked_within = Surface::Within::Random;
  surface.within.resize(plane.triangles.rows());
  for (Index t = 0; t < plane.triangles.rows(); ++t)
    surface.within[t] =
        wave(at_place_within(surface.looked_within, plane.vertices, plane.triangles, t));
  const double at_random = spread(gaussian_form(plane, surface, 2.5));
  std::cout << "wave of RMS 0.707 and " << 0.97 * spacing << " mm at vertices every " << spacing
            << " mm: form " << at_vertices << " RMS, with places at random " << at_random << "\n";
  EXPECT_GT(at_vertices, 0.4);
  EXPECT_LT(at_random, 0.15 * at_vertices);
}

TEST(GaussianForm, ASlopePassesWholeToTheRim) {
  const Design plane = tessellate(RectanglePlane{10.0, 8.0}, {20000});
  const auto slope = [](const Vector3d& p) { return 1e-2 * p.x() - 3e-3 * p.y() + 0.1; };
  const Surface surface = surface_of(plane, slope);
  const Eigen::VectorXd form = gaussian_form(plane, surface, 2.5);
  EXPECT_LT((form - surface.residual).cwiseAbs().maxCoeff(), 1e-7);
}

TEST(GaussianForm, FacesOfASharpEdgeDoNotMix) {
  Design step;  // two squares at a right angle
  step.vertices.resize(6, 3);
  step.vertices << 0, 0, 0, 0, 4, 0, 4, 0, 0, 4, 4, 0, 0, 0, -4, 0, 4, -4;
  step.triangles.resize(4, 3);
  step.triangles << 0, 2, 1, 1, 2, 3, 0, 1, 4, 1, 5, 4;
  step.normals = vertex_normals(step.vertices, step.triangles);
  step.area = vertex_area(step.vertices, step.triangles);
  step.facet_error = Eigen::VectorXd::Zero(6);
  const Design split = split_at_edges(step, 0.5);
  ASSERT_EQ(split.vertices.rows(), 8);
  const Surface surface = surface_of(split, [](const Vector3d&) { return 0.0; });
  Surface uneven = surface;
  for (Index i = 0; i < 8; ++i) uneven.residual[i] = split.normals(i, 2) > 0.5 ? 1.0 : -1.0;
  const Eigen::VectorXd form = gaussian_form(split, uneven, 50.0);
  EXPECT_LT((form - uneven.residual).cwiseAbs().maxCoeff(), 1e-9);
}

/// How far the form of heights drawn from 0 to 1 leaves that range, on a part that is too coarse for
/// the filter.
double overshoot(const Primitive& shape, int vertices, double cutoff, std::mt19937& random) {
  std::uniform_real_distribution<double> height(0.0, 1.0);
  const Design part = tessellate(shape, {vertices});
  Surface surface = surface_of(part, [&](const Vector3d&) { return height(random); });
  surface.looked_within = Surface::Within::Random;
  surface.within.resize(part.triangles.rows());
  for (Index t = 0; t < part.triangles.rows(); ++t) surface.within[t] = height(random);
  const Eigen::VectorXd form = gaussian_form(part, surface, cutoff);
  return std::max(-form.minCoeff(), form.maxCoeff() - 1.0);
}

TEST(GaussianForm, NoSlopeIsFollowedFarFromThePlacesThatGiveIt) {
  constexpr unsigned seed = 118;
  std::mt19937 random(seed);
  double worst = 0.0;
  for (const int vertices : {100, 200, 800, 3200})
    for (const double cutoff : {0.8, 2.5, 8.0}) {
      worst = std::max(worst, overshoot(RectanglePlane{60.0, 40.0}, vertices, cutoff, random));
      worst = std::max(worst, overshoot(Cylinder{12.5, 30.0}, vertices, cutoff, random));
    }
  std::cout << "seed " << seed << ": the form leaves the range of the heights by " << 100.0 * worst
            << " % of it at most\n";
  EXPECT_LT(worst, 1.0);
}

TEST(GaussianForm, LeavesOutWhatIsNotCut) {
  const Design plane = tessellate(RectanglePlane{10.0, 8.0}, {2000});
  Surface surface = surface_of(plane, [](const Vector3d&) { return 2.0; });
  surface.status[7] = VertexStatus::Uncut;
  surface.residual[7] = std::nan("");
  const Eigen::VectorXd form = gaussian_form(plane, surface, 1.0);
  EXPECT_TRUE(std::isnan(form[7]));
  EXPECT_NEAR(form[8], 2.0, 1e-12);
}

}  // namespace
}  // namespace abbe::cutting
