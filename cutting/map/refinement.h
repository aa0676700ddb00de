#pragma once

#include <functional>

#include "cutting/part/design_points.h"
#include "cutting/part/mesh.h"
#include "cutting/surface/removal.h"
#include "cutting/surface/surface.h"

/// Refinement of the triangles of a design until they resolve its residual.
namespace abbe::cutting {

/// The machined surface at the vertices of a design, and its gradients there.
struct SurfaceProbe {
  Surface surface;
  PassGradients gradients;
};

/// Function that computes the surface at the vertices of a design, which may have no triangles.
using SurfaceProber = std::function<SurfaceProbe(const Design& design)>;

struct RefineOptions {
  double resolution = 5e-5;         ///< mm, requested bound of the error of linear interpolation
  double floor = 2e-3;              ///< mm, minimum length of new edges
  Eigen::Index points = 1'000'000;  ///< maximum number of vertices, unless the design has more
  /// Edges may be flipped, because the triangles only approximate the surface of the vertices. Then
  /// the triangles follow the feed, and fewer are needed.
  bool can_flip_edges = false;
  bool probe_all_triangles = false;  ///< also probes triangles for which a parabola through their
                                     ///< corners is accurate enough; needs twice the points, for
                                     ///< comparison
  std::function<void(double)> progress = {};  ///< called repeatedly with the completed fraction
};

/// Returns the default resolution, mm, for a map with this PV: a tenth of it, at least 0.05 um.
double default_resolution(double pv);

/// A design whose triangles resolve a residual.
struct RefinementResult {
  Design design;         ///< the original vertices, then those added
  Surface surface;       ///< of the design, as probed; gouges are not listed
  double reached = 0.0;  ///< mm, the error bound that all edges meet: that of the options, a larger
                         ///< one if the number of vertices did not suffice, or infinity if passes
                         ///< are not separated
  Eigen::Index probed_points = 0;  ///< number of probed points
  Eigen::Index left = 0;           ///< number of edges that do not meet the bound of the options
};

/// Adds vertices to a design where the error of linear interpolation of its residual exceeds the
/// bound, on edges between judged vertices that are cut. If two passes meet within an edge, the
/// vertex is put on their crest; otherwise it is put near the middle, with a small displacement
/// with which no feed is commensurable. The result depends only on the arguments, bit for bit for
/// any number of threads.
/// Every edge is probed near its middle, also near its quarters if slopes or passes at its ends
/// leave a doubt, and at the crest where two passes cross. Then triangles are probed, in up to four
/// scans, unless their corners lie on one tool pass whose parabola stays within 0.56 of the bound
/// (the error observed there is up to 0.97 of it). The remaining error must be measured at an
/// independent set of points (`interpolation_error`). Memory: about 250 bytes per vertex.
/// @throws std::invalid_argument if an option is out of range or sizes differ
RefinementResult refined(const Design& design, const SurfaceInterpolator& on_surface,
                         const SurfaceProber& prober, const RefineOptions& options = {});

}  // namespace abbe::cutting
