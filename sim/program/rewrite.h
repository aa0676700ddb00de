#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sim/program/nc_reader.h"
#include "sim/program/path.h"

/// Thinning of corrected points, and rewriting of a program through them.
namespace abbe::sim::program {

/// The corrected position at a fraction of a block's time, in the coordinates of the block.
struct CorrectedPoint {
  double u = 1.0;             ///< in [0, 1]
  kinematics::AxisVector at;  ///< (axes) mm and rad, offsets included, as Block::end
  /// mm, centre of the arc that ends here, in the plane of the block's arc; empty for a line
  std::optional<Eigen::Vector2d> centre;
  /// (axes) mm/s and rad/s, rate of the correction, for cubics; empty: from the neighbouring points
  kinematics::AxisVector rate;
};

/// Corrected points of a path, one list for each block.
using CorrectedPath = std::vector<std::vector<CorrectedPoint>>;

/// Tolerance and levers for thinning.
struct ThinOptions {
  double tolerance = 1e-4;  ///< mm
  /// (axes) mm by which a point of the tool moves per rad of an axis, indexed by Coordinates. In
  /// axis coordinates it is the distance of tip and tool from the axis line, in tip coordinates
  /// only the length of the tool above the tip. Linear axes and spindles have none. Empty: 0.
  std::array<kinematics::AxisVector, 2> lever;
  double word_mm = 1e-4;  ///< mm, resolution of NC words: arcs of a few steps become lines
};

/// Selects from dense points as few as possible, greedily one after the other, so that the blocks
/// between them pass every omitted point within the tolerance at the time of that point. Lines
/// become lines; arcs become arcs of the same sense as long as the correction changes little along
/// them; and cubics become Hermite cubics. The ends of blocks are kept; of rapids only the ends.
/// Bound: at every dense point |slides| + sum of lever * |rotation| deviates by at most the
/// tolerance, before words are rounded. `dense` has one list for each block, with u from 0 to 1, or
/// an empty one if nothing is corrected. Of two points at one u the second is the target of a jump
/// (an axis reverses). A block that does not begin at the end of the previous one begins with a
/// jump. Jumps within the tolerance are smoothed, and in cubics every jump is spread to the next
/// point. The result is the input of `rewrite_program`: it has points at u = 0 only for a jump, in
/// the first block, and after a change of coordinates. Throws std::invalid_argument if a list does
/// not fit its block.
CorrectedPath thin_out(const Path& path, std::span<const std::vector<CorrectedPoint>> dense,
                       const NcOptions& control, const ThinOptions& options = {});

/// Resolution of the words of a rewritten program.
struct RewriteOptions {
  /// mm, resolution of slide positions; an inch program uses the largest power of ten inches that
  /// does not exceed it
  double word_mm = 1e-4;
  double word_rad = 1e-4 * 0.017453292519943295;  ///< rad, resolution of rotary positions
};

/// The part of an original block from which one line of the rewritten program comes.
struct LineOrigin {
  int block = -1;  ///< -1 for a line without motion
  double from = 0.0;
  double to = 0.0;  ///< fractions of the block's time
};

/// The text of the rewritten program and the origin of its lines.
struct RewrittenProgram {
  std::string text;
  std::vector<LineOrigin> line_origins;  ///< indexed by line - 1
};

/// Writes the program with corrected positions, as NC or as PVT like the source.
/// NC: units and inverse time are those of the source; lines and arcs lead through the points,
/// timed by an F of 9 digits; positions are rounded to nearest; rapids stay rapids; coordinates
/// (G43.4), spindle, dwells and auxiliary words (T M0 M1 M6 M7 M8 M9) are kept. A jump takes a
/// millisecond of the motion that follows; a part that moves by less than one step becomes a dwell.
/// Comments, N and H words are not kept: the program is written under G54, and under the first H
/// number or, if lengths were added, G49. PVT: positions and velocities (with the rate of the
/// correction added) have the fewest digits that read back as the same bits. A point at u = 0 of
/// the first block moves the start. `corrected` has one list for each block, with u increasing to
/// 1; the same u twice is a jump, u = 0 a jump from the current position, and an empty list keeps
/// the end of the block. `control` must be the options with which the program was read. Throws
/// std::invalid_argument if a list does not fit its block, the resolution is below 1e-9, G43.4 has
/// no H, or cubics and other blocks are mixed.
RewrittenProgram rewrite_program(const Path& path,
                                 std::span<const std::vector<CorrectedPoint>> corrected,
                                 const NcOptions& control, const RewriteOptions& options = {});

}  // namespace abbe::sim::program
