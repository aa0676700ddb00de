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

/// A probed point of the surface with its results, e.g. a vertex.
struct Knot {
  Eigen::Vector3d point, normal, gradient;  ///< gradient: of `PassGradients`
  double residual = 0.0, travel = 0.0;
  bool is_cut = false;  ///< judged and cut
  double cut_time_s = 0.0;
  int cut_line = 0;
  VertexStatus status = VertexStatus::Outside;
  int face = -1;  ///< of `Contact`

  Contact contact() const { return {point, normal, face}; }
};

/// The residual along an edge as a function of u from 0 to 1, given by the values and slopes at
/// both ends.
struct Span {
  double r_a, r_b, slope_a, slope_b;  ///< mm, mm per unit of u; NaN if not known
  bool has_one_pass;                  ///< one pass of the tool has cut the whole edge

  /// Returns the u at which the tangents at the ends meet: half way for a parabola, the corner for
  /// two lines.
  double tangent_crossing() const { return (r_b - r_a - slope_b) / (slope_a - slope_b); }
  /// Returns the deviation of the cubic with these ends from the straight line at the middle, mm.
  double middle_deviation() const { return std::abs(slope_a - slope_b) / 8.0; }
  /// Returns the maximum deviation of the cubic from a parabola with the same ends and mean slope,
  /// mm, to within a few per cent.
  double max_parabola_deviation() const {
    return 0.1 * std::abs(0.5 * (slope_a + slope_b) - (r_b - r_a));
  }
  /// Returns the maximum deviation of the cubic from the straight line, mm, within a few per cent.
  double max_deviation() const {
    const double rise = r_b - r_a;
    return 0.15 * std::max(std::abs(slope_a - rise), std::abs(slope_b - rise));
  }
};
/// Returns the residual along the edge between two knots.
Span edge_span(const SurfaceInterpolator& on_surface, const Knot& a, const Knot& b);

/// Returns true if the travel of the tool between the cuts of the two ends of an edge is short
/// enough for a single pass.
/// @param length  mm, of the edge
bool are_on_one_pass(const Knot& a, const Knot& b, double length);

/// Returns the residual at fraction u of an edge by linear interpolation.
inline double interpolate_linearly(const Knot& a, const Knot& b, double u) {
  return a.residual + u * (b.residual - a.residual);
}

/// Returns the point of the surface at fraction u from one knot to another.
Contact point_between(const SurfaceInterpolator& on_surface, const Knot& a, const Knot& b,
                      double u);

/// The result of probing an edge.
struct EdgeProbe {
  double u = 0.0;      ///< fraction at which the error is largest; 0: not probed
  Knot knot = {};      ///< result at that point
  double error = 0.0;  ///< mm, of linear interpolation
};

/// Returns the fraction of an edge at which two passes cross, i.e. of the crest between the probed
/// middle and the end that another pass has cut; empty if the middle belongs to neither pass or the
/// passes do not cross there.
std::optional<double> crest_fraction(const SurfaceInterpolator& on_surface, const Knot& a,
                                     const Knot& b, const EdgeProbe& probe);

/// Returns the map with a sample within every triangle whose corners are cut, at the point of
/// `sample_barycentric`.
/// @param surface_at  computes the surface at the vertices of a design
Surface sample_within_triangles(Surface surface, const Design& design,
                                Surface::InteriorSample sample,
                                const SurfaceInterpolator& on_surface,
                                const std::function<Surface(const Design&)>& surface_at);

/// The error of linear interpolation between the vertices of a design, measured at independent
/// points: random in area over the triangles whose three vertices are judged and cut.
struct InterpolationError {
  double resolution = 0.0;  ///< mm, as in the options
  int places = 0;           ///< number of points that are cut
  double worst = 0.0;       ///< mm
  double rms = 0.0;         ///< mm
  double mean = 0.0;        ///< mm, signed: positive if lines fill the hollows between crests
  double unresolved = 0.0;  ///< fraction of the points at which the error exceeds the resolution
  Eigen::Vector3d at = Eigen::Vector3d::Zero();  ///< mm, point of the worst error
};
struct ProbeOptions {
  int places = 2000;
  std::uint64_t seed = 1;
  double resolution = 5e-5;  ///< mm
};
/// Measures the error of linear interpolation.
/// @param surface_at  computes the surface at the vertices of a design
InterpolationError interpolation_error(const Design& design, const Surface& surface,
                                       const SurfaceInterpolator& on_surface,
                                       const std::function<Surface(const Design&)>& surface_at,
                                       const ProbeOptions& options = {});

}  // namespace abbe::cutting
