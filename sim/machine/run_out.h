#pragma once

#include "sim/scene/scene.h"

namespace abbe::sim {

/// The scene with the error motions of a tool spindle over its own angle (`fourier` and
/// `asynchronous` curves of EXS EYS EZS and the tilts of the nose s, times error_scale) taken out
/// of `geometric` and put into `tool.actual`. A cutter is a surface of revolution: over a turn such
/// motion only enlarges it, and as a signal sampled along the program it would alias.
/// The axis goes at most `radial` off its place and `axial` below it at the height of the centre of
/// the cutter's corner (a ball's centre, a flat's tip), tilts through their arm there; the cutter
/// is `cutting::with_run_out` of both, the tool longer by `axial`. Most over 65 536 angles: of one
/// turn, which misses an order k by at most 1.2e-9 k^2 of its amplitude; of 64 turns if the motion
/// does not repeat every turn, 4.8e-6 k^2, and a longer cut may meet a little more.
/// Exact, beside what `with_run_out` says, where the axis goes round a circle and leans nowhere; an
/// axis that moves along a line cuts as wide across it here as along it. Left out: of a tilt t, its
/// t (height - corner radius) up the flank and the t (radius - corner radius) by which a flat's rim
/// dips (10 urad on R 8: 0.08 um). A belief that knows the truth knows the longer tool, as a tool
/// setter reads it off the turning tool; no compensator knows the larger radius.
/// Other curves stay, vibrations too. A scene without such curves or with a turning tool comes back
/// as it is.
/// @throws BadInput naming the scene and the element if `errors::validate` refuses such a curve
Scene with_run_out(const Scene& scene);

}  // namespace abbe::sim
