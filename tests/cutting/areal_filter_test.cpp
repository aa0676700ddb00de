#include "cutting/map/areal_filter.h"

#include <cmath>
#include <iostream>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "cutting/map/residual.h"
#include "cutting/part/primitive.h"
#include "cutting/part/remeshing.h"
#include "tests/cutting/map_over.h"
#include "tests/oracles/areal_oracle.h"

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
  const double without_triangle_samples = spread(gaussian_form(plane, surface, 2.5));
  surface.interior_sample = Surface::InteriorSample::Random;
  surface.within.resize(plane.triangles.rows());
  for (Index t = 0; t < plane.triangles.rows(); ++t)
    surface.within[t] =
        wave(value_at_sample(surface.interior_sample, plane.vertices, plane.triangles, t));
  const double at_random = spread(gaussian_form(plane, surface, 2.5));
  std::cout << "wave of RMS 0.707 and " << 0.97 * spacing << " mm at vertices every " << spacing
            << " mm: form " << without_triangle_samples << " RMS, with places at random "
            << at_random << "\n";
  EXPECT_GT(without_triangle_samples, 0.4);
  EXPECT_LT(at_random, 0.15 * without_triangle_samples);
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

/// Heights drawn from 0 to 1 at the vertices of a part, and at a place within each triangle.
Surface random_heights(const Design& part, std::mt19937& random) {
  std::uniform_real_distribution<double> height(0.0, 1.0);
  Surface surface = surface_of(part, [&](const Vector3d&) { return height(random); });
  surface.interior_sample = Surface::InteriorSample::Random;
  surface.within.resize(part.triangles.rows());
  for (Index t = 0; t < part.triangles.rows(); ++t) surface.within[t] = height(random);
  return surface;
}

/// What the filter averages.
test::ArealValues values_of(const Design& part, const Surface& surface) {
  const Weights weights = cutting::weights(surface, part);
  test::ArealValues values;
  const auto add = [&](const Vector3d& point, double value, double area) {
    values.point.push_back(point);
    values.value.push_back(value);
    values.area.push_back(std::max(area, 1e-12));
  };
  for (Index i = 0; i < part.vertices.rows(); ++i)
    add(part.vertices.row(i), surface.residual[i], weights.vertex[i]);
  for (Index t = 0; t < surface.within.size(); ++t)
    add(value_at_sample(surface.interior_sample, part.vertices, part.triangles, t),
        surface.within[t], weights.within[t]);
  return values;
}

/// From coarse parts, of which a value carries its own form, to such that thousands do.
TEST(GaussianForm, StaysWithinTheValuesThatItAveragesOfAnyDensity) {
  constexpr unsigned seed = 118;
  std::mt19937 random(seed);
  double worst = 0.0;
  for (const int vertices : {100, 200, 800, 3200, 20000})
    for (const double cutoff : {0.8, 2.5, 8.0})
      for (const Primitive& shape :
           {Primitive(RectanglePlane{60.0, 40.0}), Primitive(Cylinder{12.5, 30.0})}) {
        const Design part = tessellate(shape, {vertices});
        const Surface surface = random_heights(part, random);
        const Eigen::VectorXd form = gaussian_form(part, surface, cutoff);
        const test::ArealValues values = values_of(part, surface);
        for (Index i = 0; i < form.size(); i += 1 + form.size() / 150) {
          // cells let a value in from two of their sizes further away
          const test::BruteFilter brute =
              test::brute_filter(values, part.vertices.row(i), part.normals.row(i), cutoff,
                                 (0.65 + 4.0 / 12.0) * cutoff);
          worst = std::max({worst, brute.low - form[i], form[i] - brute.high});
        }
        EXPECT_GE(form.minCoeff(), -1e-9);
        EXPECT_LE(form.maxCoeff(), 1.0 + 1e-9);
      }
  std::cout << "seed " << seed << ": the form leaves the range of the values about it by "
            << 100.0 * worst << " % of all at most\n";
  EXPECT_LT(worst, 1e-9);
}

/// Of first order where ten values or more carry it, else their mean: each against sums over all.
TEST(GaussianForm, IsAPlaneOfManyValuesAndTheMeanOfFew) {
  std::mt19937 random(5);
  double off = 0.0;
  int planes = 0, means = 0;
  for (const auto& [vertices, cutoff] :
       {std::pair(400, 8.0), {1500, 8.0}, {6000, 8.0}, {6000, 2.5}}) {
    const Design part = tessellate(RectanglePlane{60.0, 40.0}, {vertices});
    Surface surface = random_heights(part, random);
    const auto slope = [](const Vector3d& p) { return 0.3 * p.x() - 0.1 * p.y(); };
    for (Index i = 0; i < part.vertices.rows(); ++i)
      surface.residual[i] = 0.02 * surface.residual[i] + slope(part.vertices.row(i));
    for (Index t = 0; t < surface.within.size(); ++t)
      surface.within[t] =
          0.02 * surface.within[t] +
          slope(value_at_sample(surface.interior_sample, part.vertices, part.triangles, t));
    const Eigen::VectorXd form = gaussian_form(part, surface, cutoff);
    const test::ArealValues values = values_of(part, surface);
    for (Index i = 0; i < form.size(); i += 1 + form.size() / 200) {
      const test::BruteFilter brute =
          test::brute_filter(values, part.vertices.row(i), part.normals.row(i), cutoff, cutoff);
      if (std::abs(brute.carried_by - min_filter_values) < 1.0) continue;  // cells decide
      const bool plane = brute.carried_by > min_filter_values;
      (plane ? planes : means) += 1;
      off = std::max(off, std::abs(form[i] - (plane ? brute.plane : brute.mean)));
    }
  }
  std::cout << planes << " planes and " << means << " means within " << off
            << " of sums over all values, which rise by 0.3 a mm\n";
  EXPECT_GT(planes, 100);
  EXPECT_GT(means, 100);
  EXPECT_LT(off, 0.02);
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
