#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "cutting/part/design_points.h"
#include "cutting/surface/surface.h"

/// The surface left by several tools, or by a motion that is too long for the memory; and the
/// material left on a surface by the shape of the tool or by a lead-out rather than by errors.
namespace abbe::cutting {

/// A block of a motion, of at least one sample; the first sample is the last one of the previous
/// block.
struct MotionBlock {
  CutterMotion motion;
  double finished =
      0.0;  ///< fraction of the whole motion up to the end of this block, for progress
};
/// Function that returns the next block, or nothing at the end.
using MotionBlocks = std::function<std::optional<MotionBlock>()>;

/// Returns the same bits as milled_surface for the joined blocks, but needs memory only for the
/// longest block: about 150 bytes per move of it, and 60 bytes per vertex in addition to arguments
/// and result. For a gouge deeper than the search depth, cut_time_s and cut_line are those of any
/// move that removed the point where the search began, not necessarily of the same move as in
/// milled_surface.
/// @param begin  restarts the motion; called once, and once more if any vertex is uncut or gouged
/// @throws std::invalid_argument as milled_surface, or if a block has no sample or does not begin
///         where the previous one ended
Surface streamed_surface(const Design& design_w, const Cutter& cutter,
                         const std::function<MotionBlocks()>& begin,
                         const SurfaceOptions& options = {});

/// Function that returns the surface left by one tool alone, searched within a band (mm).
using SurfaceFunction = std::function<Surface(const Design& design_w, double band)>;

/// Returns the surface left by several tools, in whatever order they cut: on each normal the first
/// point, from inside the part outwards, that any tool removes. Of equal points the earliest
/// counts, of equal instants that of the tool listed first. As for a single sweep, a vertex is
/// Gouged if any tool removes the design at -band (tested to 1e-6 mm if another tool cuts within
/// the band), or if no tool cuts within the band and one cuts below it. The depth of a gouge is the
/// maximum over the tools that gouge the vertex; it does not include a removal below a tool's own
/// cut within the band.
/// @param tools  at least one
Surface combined_surface(const Design& design_w, const std::vector<SurfaceFunction>& tools,
                         double band);

// Material left by the geometry of the tool or its path, not by errors.

/// Returns (n) 1 at the cut vertices that the cutter's round corner cannot reach: a ball of the
/// corner's radius that touches the vertex comes closer than 0.98 radii to a triangle of the part,
/// as at the foot of a wall. At all other vertices the tool leaves for this reason at most 2e-4 of
/// the radius (1 um on R 5), beside a plane. Returns 0 everywhere if the radius is 0.
/// @param part    in the frame of design and surface
/// @param radius  mm, of the corner
std::vector<std::uint8_t> corner_leftover(const Design& design, const Surface& surface,
                                          const WallThickness& part, double radius);

/// Returns (n) 1 at the cut vertices of a lead-out, where the sweep ends beside a region that it
/// does not cut and the tool leaves the round of its corner, up to the band. From such a vertex the
/// residual rises along the edges by at least 0.02 mm per mm up to an uncut or start vertex, and
/// the residual exceeds 2e-4 of the radius; the latter excludes the bottom of a pass for any
/// spacing of the vertices. A crest between passes does not rise along itself, so passes that end
/// beside uncut material are not included.
/// @param radius       mm, of the corner
/// @param start_flags  (n) 1 at further vertices to start from
/// @throws std::invalid_argument if sizes differ
std::vector<std::uint8_t> lead_out_leftover(const Design& design, const Surface& surface,
                                            double radius,
                                            const std::vector<std::uint8_t>& start_flags);

}  // namespace abbe::cutting
