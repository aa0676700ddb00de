#pragma once

#include "sim/study/box.h"
#include "sim/study/response_function.h"

namespace abbe::sim::study {

/// What of a response no machine in a box exceeds, mm, by the maps without alignment: every rival's
/// slopes at their magnitudes, its curvature at the largest shift.
///   pv: over pairs of vertices, the inputs that lift both taken once; exact for linear maps with
///       one rival a vertex, as far as 1e9 products reach to look at pairs, beyond them less tight
///   rms, std: norm of base and slopes, products of slopes at their magnitudes
///   max_abs, p95_abs: the farthest vertex; mean: the mean of all
/// InTolerance: 0, of which none is worse.
/// @param found  a value in the box: pairs that cannot exceed it are not looked at
double bound_over(const InfluenceMap& influence, const Box& box, Response response, double found);

}  // namespace abbe::sim::study
