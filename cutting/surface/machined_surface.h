#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "cutting/part/design_points.h"
#include "cutting/surface/surface.h"

/// The surface left by a motion that is too long to be held in memory or by several tools together,
/// and the material on a surface that is left by the shape of the tool or by a lead-out rather than
/// by errors.
namespace abbe::cutting {

/// A block of a motion: at least one sample, the first of which is the last of the block before.
struct MotionBlock {
  CutterMotion motion;
  double finished = 0.0;  ///< fraction of the whole motion that is finished with this block, for
                          ///< progress
};
/// Returns the next block; nothing at the end.
using MotionBlocks = std::function<std::optional<MotionBlock>()>;

/// Returns what milled_surface returns for the joined blocks, to the bit, in memory for the longest
/// block: about 150 bytes per move of it, and 60 bytes per vertex besides the arrays given and
/// returned. For a gouge deeper than the search depth, cut_time_s and cut_line are those of some
/// move that removed the point where the search began, as in milled_surface, but not necessarily of
/// the same move.
/// @param begin  restarts the motion: called once, and once more if any vertex is uncut or gouged
/// @throws std::invalid_argument as milled_surface, or if a block has no sample or does not begin
///         where the one before ended
Surface streamed_surface(const Design& design_w, const Cutter& cutter,
                         const std::function<MotionBlocks()>& begin,
                         const SurfaceOptions& options = {});

/// Returns the surface that one tool alone leaves of a design, searched within a band (mm).
using SurfaceFunction = std::function<Surface(const Design& design_w, double band)>;

/// Returns the surface that several tools leave, whatever their order: along each normal the first
/// point, coming from inside the part, that any of them removes; of equal ones the earliest, of
/// equal instants that of the tool listed first. As for a single sweep, a vertex is Gouged if any
/// tool has removed the design at -band (where another tool cuts within the band this is tested to
/// 1e-6 mm), or if no tool cuts within the band and any has cut below it. The depth of a gouge is
/// the largest among the tools that gouge the vertex; it does not include what a tool cuts below
/// its own cut within the band.
/// @param tools  at least one
Surface combined_surface(const Design& design_w, const std::vector<SurfaceFunction>& tools,
                         double band);

// Material of a map that is left by the geometry of the tool or its path, not by errors.

/// Returns (n) 1 at the vertices that are cut and where a round corner of the cutter cannot lie
/// against the design: a ball of its radius that touches the vertex comes closer than 0.98 radii to
/// a triangle of the part, as at the foot of a wall. At all other vertices the tool leaves for this
/// reason at most 2e-4 of the radius (1 um on R 5), beside a plane. Returns 0 everywhere if the
/// radius is 0.
/// @param part    in the frame of design and surface
/// @param radius  mm, of the corner
std::vector<std::uint8_t> corner_leftover(const Design& design, const Surface& surface,
                                          const Thickness& part, double radius);

/// Returns (n) 1 at the vertices that are cut where the sweep ends beside a region that it does not
/// cut, i.e. at a lead-out: vertices from which the residual rises along the edges, by at least
/// 0.02 mm per mm, up to a vertex that is uncut or listed, and whose residual exceeds 2e-4 of the
/// radius. The latter excludes every vertex in the bottom of a pass, however far apart the vertices
/// are. At these vertices the tool leaves the round of its corner, up to the band. Crests between
/// passes do not rise along themselves, so passes that end beside uncut material are not included.
/// @param radius  mm, of the corner
/// @param listed  (n) 1 at further vertices to start from
/// @throws std::invalid_argument if sizes differ
std::vector<std::uint8_t> lead_out_leftover(const Design& design, const Surface& surface,
                                            double radius, const std::vector<std::uint8_t>& listed);

}  // namespace abbe::cutting
