#include "cutting/interpolation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <tbb/parallel_for.h>
#include <Eigen/Geometry>

#include "cutting/residual.h"
#include "kinematics/hash.h"
#include "kinematics/require.h"

namespace abbe::cutting {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

bool all_cut(const Surface& surface, const Eigen::RowVector3i& corners) {
  return std::all_of(corners.begin(), corners.end(),
                     [&](int v) { return surface.status[std::size_t(v)] == VertexStatus::Cut; });
}

}  // namespace

Surface with_places_within(Surface surface, const Design& design, Surface::Within within,
                           const OnSurface& on_surface,
                           const std::function<Surface(const Design&)>& cut) {
  require(surface.residual.size() == design.vertices.rows(), "with_places_within: sizes differ");
  surface.looked_within = within;
  surface.within.resize(0);
  if (within == Surface::Within::None) return surface;
  std::vector<Index> triangles;
  for (Index t = 0; t < design.triangles.rows(); ++t)
    if (all_cut(surface, design.triangles.row(t))) triangles.push_back(t);
  std::vector<Contact> places(triangles.size());
  tbb::parallel_for(std::size_t(0), triangles.size(), [&](std::size_t i) {
    const Eigen::RowVector3i corners = design.triangles.row(triangles[i]);
    std::array<Contact, 3> at;
    for (Index k = 0; k < 3; ++k) at[std::size_t(k)] = place_of(design, corners[k]);
    places[i] = on_surface(at, place_within(within, triangles[i]));
  });
  surface.within =
      Eigen::VectorXd::Constant(design.triangles.rows(), std::numeric_limits<double>::quiet_NaN());
  if (places.empty()) return surface;
  const Surface there = cut(design_of_places(places));
  for (std::size_t i = 0; i < places.size(); ++i)
    if (there.status[i] == VertexStatus::Cut)
      surface.within[triangles[i]] = there.residual[Index(i)];
  return surface;
}

InterpolationError interpolation_error(const Design& design, const Surface& surface,
                                       const OnSurface& on_surface,
                                       const std::function<Surface(const Design&)>& cut,
                                       const ProbeOptions& options) {
  require(surface.residual.size() == design.vertices.rows(), "interpolation_error: sizes differ");
  std::vector<Index> triangles;
  std::vector<double> upto;  // mm^2, area of the triangles until then
  double area = 0.0;
  for (Index t = 0; t < design.triangles.rows(); ++t) {
    const Eigen::RowVector3i corners = design.triangles.row(t);
    if (!all_cut(surface, corners)) continue;
    const Vector3d a = design.vertices.row(corners[0]), b = design.vertices.row(corners[1]),
                   c = design.vertices.row(corners[2]);
    triangles.push_back(t);
    upto.push_back(area += 0.5 * (b - a).cross(c - a).norm());
  }
  InterpolationError found;
  found.resolution = options.resolution;
  if (!(area > 0.0)) return found;
  std::vector<Contact> places;
  std::vector<double> line;
  for (int i = 0; i < options.places; ++i) {
    const auto chance = [&](int k) {
      return split_mix::unit(split_mix::stream(options.seed, 3u * i + k));
    };
    const auto which = std::upper_bound(upto.begin(), upto.end(), chance(0) * area) - upto.begin();
    const auto last = std::ptrdiff_t(triangles.size()) - 1;
    const Eigen::RowVector3i corners =
        design.triangles.row(triangles[std::size_t(std::min(which, last))]);
    const double root = std::sqrt(chance(1)), share = chance(2);
    const std::array<double, 3> weight = {1.0 - root, root * (1.0 - share), root * share};
    std::array<Contact, 3> at;
    double value = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const int v = corners[Index(k)];
      at[k] = place_of(design, v);
      value += weight[k] * surface.residual[v];
    }
    places.push_back(on_surface(at, weight));
    line.push_back(value);
  }
  const Surface there = cut(design_of_places(places));
  double squares = 0.0;
  int beyond = 0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (there.status[i] != VertexStatus::Cut) continue;
    const double error = std::abs(there.residual[Index(i)] - line[i]);
    found.mean += line[i] - there.residual[Index(i)];
    ++found.places;
    squares += error * error;
    if (error > options.resolution) ++beyond;
    if (error <= found.worst) continue;
    found.worst = error;
    found.at = places[i].point;
  }
  if (found.places > 0) {
    found.rms = std::sqrt(squares / found.places);
    found.mean /= found.places;
    found.unresolved = double(beyond) / found.places;
  }
  return found;
}

}  // namespace abbe::cutting
