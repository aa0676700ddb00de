#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "cutting/stock.h"
#include "sim/program/sample.h"
#include "sim/scene/scene.h"

/// How a program is followed through a blank: the blank, and the places at which it is looked at.
namespace abbe::sim {

/// The blank of a scene with [cutting], for milling.
/// @param design_m  the part in its own frame, for a blank that is its offset
/// @throws std::invalid_argument for a blank that cannot be, BadInput for a mesh file that cannot
///         be read or is not closed
cutting::Blank blank_of(const Scene& scene, const cutting::Design& design_m);

/// What is to be said of the size of a blank that is a mesh; empty: nothing.
std::string odd_blank(const Scene& scene, const cutting::Blank& blank);

/// A blank of the scene as dexels.
/// @throws std::invalid_argument for a blank that cannot be, std::length_error for one that does
///         not fit in its memory
cutting::Stock blank_stock(const Scene& scene, const cutting::Blank& blank);

/// Returns the warning of a blank that does not hold the design: it may be in another unit or
/// frame. Empty if at most a twentieth of the design's vertices lie more than a spacing outside it.
std::string uncovered_text(const Scene& scene, const cutting::Stock& blank,
                           const cutting::Design& design_m);

/// Whether the block that runs at a sample is a rapid.
bool is_rapid(const program::Samples& samples, const program::Path& path, std::size_t sample);

/// Samples between which material is taken away: after every `step` (mm) of travel of the tip and
/// of the turning of what is `reach` (mm) above it, wherever the motion turns by more than 0.1 rad,
/// and where rapid and feed meet. The first is 0, the last the last.
/// @param T_wt  (samples)
std::vector<std::size_t> milling_looks(const program::Samples& samples, const program::Path& path,
                                       const std::vector<kinematics::Pose>& T_wt, double step,
                                       double reach);

}  // namespace abbe::sim
