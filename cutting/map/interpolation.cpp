#include "cutting/map/interpolation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <tbb/parallel_for.h>
#include <Eigen/Geometry>

#include "cutting/map/residual.h"
#include "kinematics/bad_input.h"
#include "kinematics/hash.h"

namespace abbe::cutting {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

// lengths of an edge: the travel along one pass between the cuts of its ends is at most this
constexpr double pass_travel = 4.0;
// of an edge; a crest nearer to its end is resolved by shorter edges
constexpr double crest_margin = 0.1;

/// Returns the derivative with respect to u of the point on an edge, at its end `from`, by a
/// difference of 1e-3, because the surface is known by its points only.
Vector3d way(const SurfaceInterpolator& on_surface, const Knot& from, const Knot& to) {
  constexpr double little = 1e-3;
  return (between(on_surface, from, to, little).point - from.point) / little;
}

/// Returns the point at which two passes cross between points x0 < x1 of an edge, both with
/// curvature k: the crest.
double crossing(double r0, double s0, double r1, double s1, double width, double k) {
  const double closing = s0 - s1 + k * width;
  const double gap = r1 - r0 - s1 * width + 0.5 * k * width * width;
  return gap / closing;
}

}  // namespace

bool is_one_pass(const Knot& a, const Knot& b, double length) {
  return std::abs(a.travel - b.travel) < pass_travel * length;
}

Contact between(const SurfaceInterpolator& on_surface, const Knot& a, const Knot& b, double u) {
  const std::array<Contact, 2> corners = {a.place(), b.place()};
  const std::array<double, 2> weights = {1.0 - u, u};
  return on_surface(corners, weights);
}

Span span_of(const SurfaceInterpolator& on_surface, const Knot& a, const Knot& b) {
  return {a.residual, b.residual, -a.gradient.dot(way(on_surface, a, b)),
          b.gradient.dot(way(on_surface, b, a)), is_one_pass(a, b, (b.point - a.point).norm())};
}

std::optional<double> crest_of(const SurfaceInterpolator& on_surface, const Knot& a, const Knot& b,
                               const EdgeProbe& probe) {
  if (!probe.knot.cut) return std::nullopt;
  const Span from_a = span_of(on_surface, a, probe.knot), to_b = span_of(on_surface, probe.knot, b);
  if (from_a.one_pass == to_b.one_pass) return std::nullopt;
  const double u = probe.u, rest = 1.0 - u;
  // Slopes with respect to u of the whole edge.
  const double s_a = from_a.slope_a / u, s_m = from_a.slope_b / u, s_b = to_b.slope_b / rest;
  const double m_b = to_b.slope_a / rest;
  const double crest =
      from_a.one_pass
          ? u + crossing(probe.knot.residual, m_b, b.residual, s_b, rest, (s_m - s_a) / u)
          : crossing(a.residual, s_a, probe.knot.residual, s_m, u, (s_b - m_b) / rest);
  const bool inside = crest > crest_margin && crest < 1.0 - crest_margin;
  return inside ? std::optional(crest) : std::nullopt;
}

namespace {

bool all_cut(const Surface& surface, const Eigen::RowVector3i& corners) {
  return std::all_of(corners.begin(), corners.end(),
                     [&](int v) { return surface.status[std::size_t(v)] == VertexStatus::Cut; });
}

}  // namespace

Surface sample_within_triangles(Surface surface, const Design& design, Surface::Within within,
                                const SurfaceInterpolator& on_surface,
                                const std::function<Surface(const Design&)>& cut) {
  require(surface.residual.size() == design.vertices.rows(), "with_places_within: sizes differ");
  surface.sampled_within = within;
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
  const Surface there = cut(design_from_points(places));
  for (std::size_t i = 0; i < places.size(); ++i)
    if (there.status[i] == VertexStatus::Cut)
      surface.within[triangles[i]] = there.residual[Index(i)];
  return surface;
}

InterpolationError interpolation_error(const Design& design, const Surface& surface,
                                       const SurfaceInterpolator& on_surface,
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
    // A number depends on seed and index alone, so the points are reproducible.
    const auto chance = [&](int k) {
      return split_mix::unit(split_mix::stream(options.seed, 3u * i + k));
    };
    const auto which = std::upper_bound(upto.begin(), upto.end(), chance(0) * area) - upto.begin();
    const auto last = std::ptrdiff_t(triangles.size()) - 1;
    const Eigen::RowVector3i corners =
        design.triangles.row(triangles[std::size_t(std::min(which, last))]);
    // the square root makes the points uniform in area
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
  const Surface there = cut(design_from_points(places));
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
