#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>

#include "cutting/part/design_points.h"
#include "cutting/surface/surface.h"

/// The residual along an edge of a design, from what is known at its ends.
namespace abbe::cutting {

/// A vertex and what was found there.
struct Knot {
  Eigen::Vector3d point, normal, gradient;  ///< gradient: of `PassGradients`
  double residual = 0.0, travel = 0.0;
  bool cut = false;  ///< judged, and cut
  double cut_time_s = 0.0;
  int cut_line = 0;
  VertexStatus status = VertexStatus::Outside;
  int face = -1;  ///< of `Contact`

  Contact place() const { return {point, normal, face}; }
};

/// An edge with its residual as a function of u from 0 to 1: values, slopes, passes at both ends.
struct Span {
  double r_a, r_b, slope_a, slope_b;  ///< mm, mm a unit of u; NaN where not known
  bool one_pass;

  /// Where the tangents at the ends meet: of a parabola half way, of two lines at their corner.
  double tangents_meet() const { return (r_b - r_a - slope_b) / (slope_a - slope_b); }
  /// Of a cubic with these ends at its middle, against the line.
  double bend() const { return std::abs(slope_a - slope_b) / 8.0; }
  /// Most that it is off a parabola with the same ends and mean slope, within a few hundredths of
  /// it.
  double max_beside_bend() const { return 0.1 * std::abs(0.5 * (slope_a + slope_b) - (r_b - r_a)); }
  /// Most that it is off the line anywhere, within a few hundredths of it.
  double most() const {
    const double rise = r_b - r_a;
    return 0.15 * std::max(std::abs(slope_a - rise), std::abs(slope_b - rise));
  }
};
Span span_of(const SurfaceInterpolator& on_surface, const Knot& a, const Knot& b);

/// Whether the tool has gone no farther between the cuts of two places of an edge than along one
/// pass. @param length  mm, of the edge
bool is_one_pass(const Knot& a, const Knot& b, double length);

/// The residual at a share of the way, by the straight line between two knots.
inline double on_line(const Knot& a, const Knot& b, double u) {
  return a.residual + u * (b.residual - a.residual);
}

/// The place at a share of the way from one knot to another.
Contact between(const SurfaceInterpolator& on_surface, const Knot& a, const Knot& b, double u);

/// An edge probed.
struct EdgeProbe {
  double u = 0.0;      ///< share of the way where it was probed; 0: nowhere
  Knot knot = {};      ///< what was found there
  double error = 0.0;  ///< mm, of the line
};

/// The place of a crest between the middle that was probed and the end that another pass cut;
/// none where the middle belongs to neither pass, or they do not cross there.
std::optional<double> crest_of(const SurfaceInterpolator& on_surface, const Knot& a, const Knot& b,
                               const EdgeProbe& probe);

/// The map sampled within every triangle whose corners are cut, at its `place_within`.
Surface sample_within_triangles(Surface surface, const Design& design, Surface::Within within,
                                const SurfaceInterpolator& on_surface,
                                const std::function<Surface(const Design&)>& cut);

/// How well linear interpolation between the vertices of a design meets its residual, found at
/// places of their own: random in area over the triangles whose three vertices are judged and cut.
struct InterpolationError {
  double resolution = 0.0;  ///< mm, as asked
  int places = 0;           ///< that are cut
  double worst = 0.0;       ///< mm
  double rms = 0.0;         ///< mm
  double mean = 0.0;        ///< mm, signed: straight lines fill hollows between crests
  double unresolved = 0.0;  ///< share of the places at which it exceeds the resolution
  Eigen::Vector3d at = Eigen::Vector3d::Zero();  ///< mm, the worst
};
struct ProbeOptions {
  int places = 2000;
  std::uint64_t seed = 1;
  double resolution = 5e-5;  ///< mm
};
InterpolationError interpolation_error(const Design& design, const Surface& surface,
                                       const SurfaceInterpolator& on_surface,
                                       const std::function<Surface(const Design&)>& cut,
                                       const ProbeOptions& options = {});

}  // namespace abbe::cutting
