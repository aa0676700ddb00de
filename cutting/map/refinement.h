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
  PassGradients contacts;
};

/// Computes the surface at the vertices of a design; the design may have no triangles.
using SurfaceProber = std::function<SurfaceProbe(const Design& design)>;

struct RefineOptions {
  double resolution = 5e-5;         ///< mm, requested bound of linear interpolation
  double floor = 2e-3;              ///< mm, shortest edge that is made
  Eigen::Index points = 1'000'000;  ///< largest number of vertices, unless more are given
  /// Edges may be flipped: vertices lie on a surface that is not that of the triangles. Triangles
  /// then follow the feed, and fewer are needed.
  bool can_flip_edges = false;
  bool probe_all_triangles = false;  ///< probes also triangles for which a parabola through their
                                     ///< corners is accurate enough: twice the points, for
                                     ///< comparison
  std::function<void(double)> progress = {};  ///< called from time to time with the finished
                                              ///< fraction
};

/// Returns the default bound for a map with this PV: a tenth of it, at least 0.05 um; mm.
double default_resolution(double pv);

/// A design whose triangles resolve a residual.
struct RefinementResult {
  Design design;         ///< the given vertices, then those added
  Surface surface;       ///< of the design, as probed; gouges are not listed
  double reached = 0.0;  ///< mm, the bound that all edges meet: that of the options, or more if the
                         ///< number of vertices did not suffice; infinite if passes are not
                         ///< separated
  Eigen::Index sounded = 0;  ///< number of probed points
  Eigen::Index left = 0;     ///< number of edges that do not meet the bound of the options
};

/// Adds vertices to a design where the error of linear interpolation of its residual exceeds the
/// bound: on edges between judged vertices that are cut. Where two passes meet within an edge, the
/// vertex is put on their crest; otherwise near the middle, displaced by a little that no feed is
/// commensurable with. The result depends on the arguments alone, to the bit for any number of
/// threads.
/// Every edge is probed near its middle; near its quarters too if slopes or passes at its ends
/// leave a doubt, and at the crest where two passes cross. Then triangles are probed, in up to four
/// turns, unless their corners lie on one pass whose parabola stays within 0.56 of the bound (the
/// error observed there is up to 0.97 of it). The remaining error must be measured at an
/// independent set of points (`interpolation_error`). About 250 bytes per vertex.
/// @throws std::invalid_argument if an option is out of range or sizes differ
RefinementResult refined(const Design& design, const SurfaceInterpolator& on_surface,
                         const SurfaceProber& sound, const RefineOptions& options = {});

}  // namespace abbe::cutting
