#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "cutting/part/design_points.h"
#include "cutting/surface/surface.h"

/// The milled surface of a motion that is too long to be held at once.
namespace abbe::cutting {

/// A stretch of a motion: one sample at least, the first of them the last of the block before.
struct MotionBlock {
  CutterMotion motion;
  double finished = 0.0;  ///< share of the whole motion that ends with it, for progress
};
/// Makes the next block on request; none at the end.
using MotionBlocks = std::function<std::optional<MotionBlock>()>;

/// What milled_surface answers of the blocks joined, to the bit, in memory for the longest block:
/// about 150 bytes a move of it, and 60 bytes a vertex besides the arrays given and returned. Of a
/// gouge that goes deeper than was searched, cut_time_s and cut_line are of any move that removed
/// the place where the search began, as in milled_surface, but not of the same one.
/// @param begin  begins the motion again: called once, and once more if any vertex is uncut or
/// gouged
/// @throws std::invalid_argument as milled_surface, or if a block has no sample or does not begin
///         where the one before ended
Surface streamed_surface(const Design& design_w, const Cutter& cutter,
                         const std::function<MotionBlocks()>& begin,
                         const SurfaceOptions& options = {});

/// The surface that one tool alone leaves of a design, searched within a band.
using SurfaceFunction = std::function<Surface(const Design& design_w, double band)>;

/// The surface that several tools leave, whatever their order: along each normal the first point,
/// coming from inside the part, that any of them removes; of equal ones the earliest, of equal
/// instants that of the tool that stands first. As of one sweep, a vertex is Gouged where any of
/// them has removed the design at -band (where one cuts within the band, that is looked at to 1e-6
/// mm), and where none cuts within the band and any has cut below it. The depth of a gouge is the
/// largest of those tools that gouge it: what a tool cuts below its own cut within the band is not
/// in it.
/// @param tools  one at least
Surface combined_surface(const Design& design_w, const std::vector<SurfaceFunction>& tools,
                         double band);

// Material of a map that is no trace of what a program means to cut.

/// (n) 1 at the vertices that are cut, but where a round corner of the cutter cannot lie against
/// the design: a ball of its radius that touches there comes closer than 0.98 radii to a triangle
/// of the part, as at the foot of a wall. What a tool leaves at the others for that reason is at
/// most 2e-4 of the radius (1 um on R 5), beside a plane. 0 everywhere where the radius is 0.
/// @param part  as design and surface, in their frame
std::vector<std::uint8_t> corner_leftover(const Design& design, const Surface& surface,
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
std::vector<std::uint8_t> lead_out_leftover(const Design& design, const Surface& surface,
                                            double radius, const std::vector<std::uint8_t>& listed);

}  // namespace abbe::cutting
