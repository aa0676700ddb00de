#pragma once

#include "cutting/tool.h"

namespace abbe::cutting {

/// The cutter that stands for one whose spindle runs out: the flat grows by `radial` and with it
/// the radius, the corner stays; its tip lies `axial` below the tip of the cutter at rest (make the
/// tool longer by that), and the flank ends as much above. Its sweep is the union of the cutter's
/// places exactly for radial run-out alone where the flat is at least `radial` wide, and for axial
/// alone. Otherwise it is that union's hull, larger in two ways:
/// - a flat narrower than `radial` leaves a hollow about the axis, r < radial - R(z), no deeper
///   than radial^2 / (corner radius + sqrt(corner radius^2 - radial^2)), 0.1 nm for 1 um on R 5
///   (if `radial` reaches the corner radius: than that); any feed across the axis takes it out;
/// - radial and axial run-out locked in phase reach their largest at one angle only; the union is
///   this one if every height comes up at every angle.
/// @param radial  mm, radius of the circle on which the axis runs, >= 0
/// @param axial   mm, amplitude up and down, >= 0
/// Of a convex form cutter it is the hull of its outline so moved, by the same reasons; of a hollow
/// one see `widened` (hollow_outline.h).
/// @throws std::invalid_argument naming the number, or as `widened`
Cutter with_run_out(const Cutter& cutter, double radial, double axial);

}  // namespace abbe::cutting
