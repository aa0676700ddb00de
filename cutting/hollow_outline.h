#pragma once

#include <vector>

#include "cutting/outline.h"

/// Hollow tools of revolution: step drills, T-slot cutters, dovetails on a shank, grooved form
/// cutters.
namespace abbe::cutting {

/// mm, the largest distance between an arc that bulges inwards and its chords.
inline constexpr double most_chord_sag = 1e-3;

/// The outline through points, convex or hollow, of lines and arcs. Its heights do not fall from
/// point to point, and it stays off the axis above its tip. A hollow one is exactly the union of
/// its parts, one more than it has corners that bend inwards: the runs between those, each going on
/// along its own line into the next one by half of what that has room for, so that no face between
/// two of them shows. An arc that bulges inwards is as many chords as its sag takes: the tool is
/// larger there, by `most_chord_sag` at most.
/// @param points  from the tip, whose height is 0, upwards
/// @throws std::invalid_argument as outline_through, or for what falls, turns back on itself, comes
///         to the axis or takes more than 200 chords, with the point
ToolOutline profile_through(const std::vector<OutlinePoint>& points);

/// mm, by which the outline through these points is larger than its arcs that bulge inwards; 0
/// without one.
double chord_sag(const std::vector<OutlinePoint>& points);

/// What an outline sweeps that is moved across the axis by up to `radial` and along it by up to
/// `axial`, mm, from where the tip then is at the lowest: of a convex one its hull, of a hollow one
/// as if every height came up at every angle.
/// @throws std::invalid_argument for a hollow one that is moved along the axis, where a corner that
///         bends inwards is the end of an arc, or the groove beside it is lower than that
ToolOutline widened(const ToolOutline& outline, double radial, double axial);

/// What lies inside of a hollow outline by a margin and more, as lines: nowhere less than the
/// margin, nor more than twice that and a five-hundredth of the height.
/// @param margin  mm; half of the narrowest neck at most is taken
/// @throws std::invalid_argument where nothing is left
InnerOutline inside_hollow(const ToolOutline& outline, double margin);

}  // namespace abbe::cutting
