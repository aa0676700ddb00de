#pragma once

#include <functional>

#include "cutting/part/design_points.h"
#include "cutting/part/mesh.h"
#include "cutting/surface/removal.h"
#include "cutting/surface/surface.h"

namespace abbe::cutting {

/// The machined surface at places of the design, and how it goes on around them.
struct SurfaceProbe {
  Surface surface;
  PassGradients contacts;
};

/// Sounds a design at its vertices; triangles are not asked for.
using SurfaceProber = std::function<SurfaceProbe(const Design& design)>;

struct RefineOptions {
  double resolution = 5e-5;         ///< mm, wanted bound of linear interpolation
  double floor = 2e-3;              ///< mm, no edge is made shorter
  Eigen::Index points = 1'000'000;  ///< vertices at most, unless more are given
  bool can_flip_edges =
      false;  ///< edges may be turned: vertices lie on a surface that is not that of
              ///< the triangles. Triangles then follow the feed, and fewer are needed
  bool probe_all_triangles = false;  ///< triangles too that a parabola follows, from what is known
                                     ///< at their corners: twice the places, for comparison
  std::function<void(double)> progress = {};  ///< now and then, with a finished fraction
};

/// The bound that a map of this PV is asked for where nobody says: a tenth of it, 0.05 um at
/// least; mm.
double default_resolution(double pv);

/// A design whose triangles resolve a residual.
struct RefinementResult {
  Design design;             ///< the vertices given, then those added
  Surface surface;           ///< of the design, as it was sounded; gouges are not listed
  double reached = 0.0;      ///< mm, the bound that all edges meet: that of the options, or more if
                             ///< the points did not suffice; infinite where passes are not parted
  Eigen::Index sounded = 0;  ///< places that were probed
  Eigen::Index left = 0;     ///< edges that miss the bound of the options
};

/// Adds vertices to a design where linear interpolation misses its residual by more than the bound:
/// on edges between judged vertices that are cut. Where two passes meet within an edge the vertex
/// is put on their crest, else near the middle, off it by a little that no feed is commensurable
/// with. The result depends on nothing else than what is given; the number of threads changes no
/// bit.
/// Every edge is probed near its middle; near its quarters too where slopes or passes at its
/// ends leave a doubt, and at the crest where two passes cross; then triangles are probed, in
/// up to four turns, where their corners do not lie on one pass whose parabola stays within 0.56 of
/// the bound (it is seen to miss up to 0.97 of it there). What all of them miss, an independent set
/// of places must show (`interpolation_error`). About 250 bytes a vertex.
/// @throws std::invalid_argument if an option is out of range or sizes differ
RefinementResult refined(const Design& design, const SurfaceInterpolator& on_surface,
                         const SurfaceProber& sound, const RefineOptions& options = {});

}  // namespace abbe::cutting
