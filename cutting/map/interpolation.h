#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>

#include "cutting/part/design_points.h"
#include "cutting/surface/surface.h"

/// The residual between the vertices of a design: its interpolation along edges, and the error of
/// linear interpolation.
namespace abbe::cutting {

/// A vertex with the results of its probe.
struct Knot {
  Eigen::Vector3d point, normal, gradient;  ///< gradient: of `PassGradients`
  double residual = 0.0, travel = 0.0;
  bool cut = false;  ///< judged and cut
  double cut_time_s = 0.0;
  int cut_line = 0;
  VertexStatus status = VertexStatus::Outside;
  int face = -1;  ///< of `Contact`

  Contact place() const { return {point, normal, face}; }
};

/// An edge with its residual as a function of u from 0 to 1: values and slopes at both ends, and
/// whether one pass made it.
struct Span {
  double r_a, r_b, slope_a, slope_b;  ///< mm, mm per unit of u; NaN if not known
  bool one_pass;

  /// Returns the u at which the tangents at the ends meet: for a parabola half way, for two lines
  /// at their corner.
  double tangents_meet() const { return (r_b - r_a - slope_b) / (slope_a - slope_b); }
  /// Returns the deviation of a cubic with these ends from the line, at its middle, mm.
  double bend() const { return std::abs(slope_a - slope_b) / 8.0; }
  /// Returns the largest deviation of the cubic from a parabola with the same ends and mean slope,
  /// mm, to within a few hundredths of it.
  double max_beside_bend() const { return 0.1 * std::abs(0.5 * (slope_a + slope_b) - (r_b - r_a)); }
  /// Returns the largest deviation of the cubic from the line, mm, to within a few hundredths of
  /// it.
  double most() const {
    const double rise = r_b - r_a;
    return 0.15 * std::max(std::abs(slope_a - rise), std::abs(slope_b - rise));
  }
};
/// Returns the residual along the edge between two knots.
Span span_of(const SurfaceInterpolator& on_surface, const Knot& a, const Knot& b);

/// Returns true if the tool moved no farther between the cuts of the two ends of an edge than along
/// one pass.
/// @param length  mm, of the edge
bool is_one_pass(const Knot& a, const Knot& b, double length);

/// Returns the residual at fraction u of an edge by linear interpolation.
inline double on_line(const Knot& a, const Knot& b, double u) {
  return a.residual + u * (b.residual - a.residual);
}

/// Returns the point of the surface at fraction u from one knot to another.
Contact between(const SurfaceInterpolator& on_surface, const Knot& a, const Knot& b, double u);

/// The result of probing an edge.
struct EdgeProbe {
  double u = 0.0;      ///< fraction at which the error is largest; 0: not probed
  Knot knot = {};      ///< result at that point
  double error = 0.0;  ///< mm, of linear interpolation
};

/// Returns the fraction of the crest between the probed middle and the end that another pass cut;
/// nothing if the middle belongs to neither pass or if the passes do not cross there.
std::optional<double> crest_of(const SurfaceInterpolator& on_surface, const Knot& a, const Knot& b,
                               const EdgeProbe& probe);

/// Returns the map with a sample within every triangle whose corners are cut, at its
/// `place_within`.
Surface sample_within_triangles(Surface surface, const Design& design, Surface::Within within,
                                const SurfaceInterpolator& on_surface,
                                const std::function<Surface(const Design&)>& cut);

/// The error of linear interpolation between the vertices of a design, measured at independent
/// points: random in area over the triangles whose three vertices are judged and cut.
struct InterpolationError {
  double resolution = 0.0;  ///< mm, as in the options
  int places = 0;           ///< number of points that are cut
  double worst = 0.0;       ///< mm
  double rms = 0.0;         ///< mm
  double mean = 0.0;        ///< mm, signed: straight lines fill the hollows between crests
  double unresolved = 0.0;  ///< fraction of the points at which the error exceeds the resolution
  Eigen::Vector3d at = Eigen::Vector3d::Zero();  ///< mm, point of the worst error
};
struct ProbeOptions {
  int places = 2000;
  std::uint64_t seed = 1;
  double resolution = 5e-5;  ///< mm
};
/// Measures the error of linear interpolation; `cut` computes the surface at the vertices of a
/// design.
InterpolationError interpolation_error(const Design& design, const Surface& surface,
                                       const SurfaceInterpolator& on_surface,
                                       const std::function<Surface(const Design&)>& cut,
                                       const ProbeOptions& options = {});

}  // namespace abbe::cutting
