#pragma once

#include <cstdint>
#include <vector>

#include "cutting/surface.h"
#include "cutting/thickness.h"

/// Material of a map that is no trace of what a program means to cut.
namespace abbe::cutting {

/// (n) 1 at the vertices that are cut, but where a round corner of the cutter cannot lie against
/// the design: a ball of its radius that touches there comes closer than 0.98 radii to a triangle
/// of the part, as at the foot of a wall. What a tool leaves at the others for that reason is at
/// most 2e-4 of the radius (1 um on R 5), beside a plane. 0 everywhere where the radius is 0.
/// @param part  as design and surface, in their frame
std::vector<std::uint8_t> out_of_corner(const Design& design, const Surface& surface,
                                        const Thickness& part, double radius);

/// (n) 1 at the vertices that are cut where the sweep runs out beside a place that it does not cut:
/// those from which the residual rises without end, edge by edge, by 0.02 mm per mm at least, to a
/// vertex that is uncut or listed, and which have more left than 2e-4 of the radius, so that no
/// vertex in the bottom of a pass is taken, however far apart they are. There the tool leaves the
/// round of its corner, up to the band. Crests between passes do not rise along themselves, so
/// passes that end beside uncut material are not taken with it.
/// @param radius  mm, of the corner
/// @param listed  (n)
/// @throws std::invalid_argument if sizes differ
std::vector<std::uint8_t> run_out_beside(const Design& design, const Surface& surface,
                                         double radius, const std::vector<std::uint8_t>& listed);

}  // namespace abbe::cutting
