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

// Maximum tool travel between the cuts of the two ends of an edge on one pass, in edge lengths.
constexpr double max_pass_travel = 4.0;
// A crest nearer to an end than this fraction of the edge is left to shorter edges.
constexpr double crest_margin = 0.1;

/// Returns the derivative with respect to u of the point on an edge at its end `from`, by a
/// difference quotient, because the surface is given only by its points.
Vector3d edge_tangent(const SurfaceInterpolator& on_surface, const Knot& from, const Knot& to) {
  constexpr double step = 1e-3;
  return (point_between(on_surface, from, to, step).point - from.point) / step;
}

/// Returns the distance from the first of two points of an edge to the crest at which the passes
/// through them cross, both with curvature k.
/// @param r0, s0, r1, s1  residual and slope at the first and the second point
/// @param width  distance between the two points
double crossing(double r0, double s0, double r1, double s1, double width, double k) {
  // Residual and slope of the second pass, minus those of the first, at the first point. The
  // curvatures are equal, so the difference is linear: gap - closing_rate * distance.
  const double closing_rate = s0 - s1 + k * width;
  const double gap = r1 - r0 - s1 * width + 0.5 * k * width * width;
  return gap / closing_rate;
}

}  // namespace

bool are_on_one_pass(const Knot& a, const Knot& b, double length) {
  return std::abs(a.travel - b.travel) < max_pass_travel * length;
}

Contact point_between(const SurfaceInterpolator& on_surface, const Knot& a, const Knot& b,
                      double u) {
  const std::array<Contact, 2> corners = {a.contact(), b.contact()};
  const std::array<double, 2> weights = {1.0 - u, u};
  return on_surface(corners, weights);
}

Span edge_span(const SurfaceInterpolator& on_surface, const Knot& a, const Knot& b) {
  return {a.residual, b.residual, -a.gradient.dot(edge_tangent(on_surface, a, b)),
          b.gradient.dot(edge_tangent(on_surface, b, a)),
          are_on_one_pass(a, b, (b.point - a.point).norm())};
}

std::optional<double> crest_fraction(const SurfaceInterpolator& on_surface, const Knot& a,
                                     const Knot& b, const EdgeProbe& probe) {
  if (!probe.knot.is_cut) return std::nullopt;
  const Span from_a = edge_span(on_surface, a, probe.knot),
             to_b = edge_span(on_surface, probe.knot, b);
  if (from_a.has_one_pass == to_b.has_one_pass) return std::nullopt;
  const double u = probe.u, remaining_fraction = 1.0 - u;
  // Slopes with respect to u of the whole edge.
  const double slope_at_a = from_a.slope_a / u, slope_before_middle = from_a.slope_b / u,
               slope_at_b = to_b.slope_b / remaining_fraction;
  const double slope_after_middle = to_b.slope_a / remaining_fraction;
  const double crest =
      from_a.has_one_pass
          ? u + crossing(probe.knot.residual, slope_after_middle, b.residual, slope_at_b,
                         remaining_fraction, (slope_before_middle - slope_at_a) / u)
          : crossing(a.residual, slope_at_a, probe.knot.residual, slope_before_middle, u,
                     (slope_at_b - slope_after_middle) / remaining_fraction);
  const bool is_inside = crest > crest_margin && crest < 1.0 - crest_margin;
  return is_inside ? std::optional(crest) : std::nullopt;
}

namespace {

bool are_all_cut(const Surface& surface, const Eigen::RowVector3i& corners) {
  return std::all_of(corners.begin(), corners.end(),
                     [&](int v) { return surface.status[std::size_t(v)] == VertexStatus::Cut; });
}

}  // namespace

Surface sample_within_triangles(Surface surface, const Design& design,
                                Surface::InteriorSample sample,
                                const SurfaceInterpolator& on_surface,
                                const std::function<Surface(const Design&)>& surface_at) {
  require(surface.residual.size() == design.vertices.rows(),
          "sample_within_triangles: sizes differ");
  surface.interior_sample = sample;
  surface.within.resize(0);
  if (sample == Surface::InteriorSample::None) return surface;
  std::vector<Index> triangles;
  for (Index t = 0; t < design.triangles.rows(); ++t)
    if (are_all_cut(surface, design.triangles.row(t))) triangles.push_back(t);
  std::vector<Contact> contacts(triangles.size());
  tbb::parallel_for(std::size_t(0), triangles.size(), [&](std::size_t i) {
    const Eigen::RowVector3i corners = design.triangles.row(triangles[i]);
    std::array<Contact, 3> corner_contacts;
    for (Index k = 0; k < 3; ++k)
      corner_contacts[std::size_t(k)] = vertex_contact(design, corners[k]);
    contacts[i] = on_surface(corner_contacts, sample_barycentric(sample, triangles[i]));
  });
  surface.within =
      Eigen::VectorXd::Constant(design.triangles.rows(), std::numeric_limits<double>::quiet_NaN());
  if (contacts.empty()) return surface;
  const Surface samples = surface_at(design_from_points(contacts));
  for (std::size_t i = 0; i < contacts.size(); ++i)
    if (samples.status[i] == VertexStatus::Cut)
      surface.within[triangles[i]] = samples.residual[Index(i)];
  return surface;
}

InterpolationError interpolation_error(const Design& design, const Surface& surface,
                                       const SurfaceInterpolator& on_surface,
                                       const std::function<Surface(const Design&)>& surface_at,
                                       const ProbeOptions& options) {
  require(surface.residual.size() == design.vertices.rows(), "interpolation_error: sizes differ");
  std::vector<Index> triangles;
  std::vector<double> cumulative_area;  // mm^2, of the triangles up to and including each
  double area = 0.0;
  for (Index t = 0; t < design.triangles.rows(); ++t) {
    const Eigen::RowVector3i corners = design.triangles.row(t);
    if (!are_all_cut(surface, corners)) continue;
    const Vector3d a = design.vertices.row(corners[0]), b = design.vertices.row(corners[1]),
                   c = design.vertices.row(corners[2]);
    triangles.push_back(t);
    cumulative_area.push_back(area += 0.5 * (b - a).cross(c - a).norm());
  }
  InterpolationError result;
  result.resolution = options.resolution;
  if (!(area > 0.0)) return result;
  std::vector<Contact> contacts;
  std::vector<double> interpolated_values;
  for (int i = 0; i < options.places; ++i) {
    // A random number depends only on seed and index, so the points are reproducible.
    const auto random_number = [&](int k) {
      return split_mix::unit(split_mix::stream(options.seed, 3u * i + k));
    };
    const auto index =
        std::upper_bound(cumulative_area.begin(), cumulative_area.end(), random_number(0) * area) -
        cumulative_area.begin();
    const auto last_index = std::ptrdiff_t(triangles.size()) - 1;
    const Eigen::RowVector3i corners =
        design.triangles.row(triangles[std::size_t(std::min(index, last_index))]);
    // The square root makes the points uniform in area.
    const double root = std::sqrt(random_number(1)), fraction = random_number(2);
    const std::array<double, 3> weight = {1.0 - root, root * (1.0 - fraction), root * fraction};
    std::array<Contact, 3> corner_contacts;
    double interpolated = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const int v = corners[Index(k)];
      corner_contacts[k] = vertex_contact(design, v);
      interpolated += weight[k] * surface.residual[v];
    }
    contacts.push_back(on_surface(corner_contacts, weight));
    interpolated_values.push_back(interpolated);
  }
  const Surface samples = surface_at(design_from_points(contacts));
  double squared_errors = 0.0;
  int unresolved_count = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (samples.status[i] != VertexStatus::Cut) continue;
    const double error = std::abs(samples.residual[Index(i)] - interpolated_values[i]);
    result.mean += interpolated_values[i] - samples.residual[Index(i)];
    ++result.places;
    squared_errors += error * error;
    if (error > options.resolution) ++unresolved_count;
    if (error <= result.worst) continue;
    result.worst = error;
    result.at = contacts[i].point;
  }
  if (result.places > 0) {
    result.rms = std::sqrt(squared_errors / result.places);
    result.mean /= result.places;
    result.unresolved = double(unresolved_count) / result.places;
  }
  return result;
}

}  // namespace abbe::cutting
