#pragma once

#include "cutting/nearest.h"
#include "sim/cut/job.h"

namespace abbe::sim {

/// Of the surface: where more of it misses the resolution, a map is too coarse.
inline constexpr double unresolved_most = 0.02;

/// The surface of the part between its vertices, workpiece frame: the declared one, or the facets
/// of a mesh.
cutting::OnSurface on_surface(const Job& job);

/// The range of a map without the hundredth of its area at either end, so that a corner that no
/// tool enters says nothing of the rest; mm.
double usual_range(const cutting::Surface& surface, const cutting::Design& design);

/// The job with its part sampled as the scene asks, for the error-free cut, which every case then
/// shares; and, unless the scene judges all, only what that cut reaches judged.
Job sampled(Job job, const Progress& progress = {});

}  // namespace abbe::sim
