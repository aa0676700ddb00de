#pragma once

#include "sim/scene/scene.h"

/// Run-out of a tool spindle as an enlargement of the cutter.
namespace abbe::sim {

/// Returns the scene with the error motions of a tool spindle over its own angle (`fourier` and
/// `asynchronous` curves of EXS EYS EZS and the tilts of the nose s, times error_scale) moved from
/// `geometric` into `tool.actual`. A cutter is a surface of revolution, so such a motion only
/// enlarges it over a turn; as a signal sampled along the program it would alias.
/// The run-out is stated at the height of the centre of the cutter's corner (the centre of a ball,
/// the tip of a flat end mill), where tilts act through their arm: the axis moves by at most
/// `radial` across itself and `axial` away from the spindle. The cutter is enlarged by
/// `cutting::with_run_out` of both, and the tool is longer by `axial`. The maximum is found over
/// 65 536 angles of one turn, with an error for order k of at most 1.2e-9 k^2 of its amplitude; if
/// the motion does not repeat every turn, over 64 turns with an error of 4.8e-6 k^2, and a longer
/// cut may exceed it slightly.
/// Apart from the limits of `with_run_out` the result is exact if the axis moves on a circle
/// without tilting; an axis that moves on a line is assumed to cut as wide across the line as along
/// it. Two effects of a tilt t are neglected: t (height - corner radius) up the flank, and t
/// (radius - corner radius) by which the rim of a flat end mill dips (10 urad on R 8: 0.08 um). A
/// perfect belief contains the longer tool, since a tool setter measures it on the rotating tool;
/// no compensator knows the larger radius.
/// Other curves, and vibrations, are kept. A scene without such curves or with a turning tool is
/// returned unchanged.
/// @throws BadInput naming the scene and the element if `errors::validate` rejects such a curve
Scene with_run_out(const Scene& scene);

}  // namespace abbe::sim
