#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sim/program/nc_reader.h"
#include "sim/program/path.h"

namespace abbe::sim::program {

/// Where a block shall be at a fraction of its time, in the block's own coordinates.
struct CorrectedPoint {
  double u = 1.0;                         ///< in [0, 1]
  kinematics::AxisVector at;              ///< (axes) mm and rad, offsets in, as Block::end
  std::optional<Eigen::Vector2d> centre;  ///< mm, of the arc that ends here, in the plane of the
                                          ///< block's own; none: a line
  kinematics::AxisVector rate;  ///< (axes) mm/s and rad/s at which the correction changes, for
                                ///< cubics; empty: as the neighbours say
};

/// Corrected points of a path, one list a block.
using CorrectedPath = std::vector<std::vector<CorrectedPoint>>;

struct ThinOptions {
  double tolerance = 1e-4;  ///< mm
  /// (axes) mm that a point of the tool goes per rad of an axis, by Coordinates: in axis
  /// coordinates how far tip and tool lie from its line, of a tip only how far the tool reaches
  /// above it. Slides and spindles have none; empty: 0.
  std::array<kinematics::AxisVector, 2> lever;
  double word_mm = 1e-4;  ///< mm, step of the words: arcs of a few steps become lines
};

/// The fewest of densely given points, chosen one after the other, so that the blocks between them
/// pass every point that is left out within the tolerance at its own time: lines, arcs of an arc's
/// own sense where the correction changes little along them, Hermite cubics between cubics. The
/// ends of blocks stay, rapids keep nothing else. Bound: |slides| + sum of lever * |turn| off <=
/// tolerance at every dense point (between them the dense path is as it was given), before words
/// are rounded.
/// @param dense  one list a block, empty where nothing is corrected, u from 0 to 1. Of two points
/// at
///               one u the second is where a jump goes (an axis turns back), and a block that
///               begins elsewhere than the one before ended begins with one; jumps within the
///               tolerance are smoothed, and in cubics all are spread to the next point.
/// @return as `rewritten` takes them: points at u = 0 only of a jump, in the first block, and where
///         the coordinates have changed
/// @throws std::invalid_argument if a list does not fit its block
CorrectedPath thinned(const Path& path, std::span<const std::vector<CorrectedPoint>> dense,
                      const NcOptions& control, const ThinOptions& options = {});

struct RewriteOptions {
  double word_mm = 1e-4;  ///< mm, step of the words of slides; in an inch program the power of ten
                          ///< inches that is not above it
  double word_rad = 1e-4 * 0.017453292519943295;  ///< rad, step of the words of turns
};

/// What a line of a rewritten program does: the stretch of a block of the original.
struct Stretch {
  int block = -1;  ///< -1: a line without motion
  double from = 0.0;
  double to = 0.0;  ///< fractions of the block's time
};

struct RewrittenProgram {
  std::string text;
  std::vector<Stretch> of_line;  ///< by line - 1
};

/// The program again with corrected points, in its own dialect.
/// NC: inches and inverse time where the source had them; lines and arcs through the points, at
/// their times by an F of 9 digits; words round to the nearest step; rapids stay rapids;
/// coordinates (G43.4), the spindle, dwells and words without motion (T M0 M1 M6 M7 M8 M9) stay. A
/// jump takes a millisecond of what follows; what no longer moves by a word waits. Comments, N and
/// H words are not kept: it is written under G54, and under the first H number or, of lengths that
/// were added, G49. PVT: positions and velocities (the correction's own rate added) with the fewest
/// digits that read back as the same bits; a point at u = 0 of the first block moves the start.
/// @param corrected  one list a block, u increasing to 1 (twice the same: a jump; one at u = 0 is a
///                   jump from where the tool stands); empty leaves the block's end
/// @param control    as the program was read with
/// @throws std::invalid_argument if a list does not fit its block, the words are below 1e-9, there
/// is
///         no H for G43.4, or cubics stand beside other blocks
RewrittenProgram rewritten(const Path& path, std::span<const std::vector<CorrectedPoint>> corrected,
                           const NcOptions& control, const RewriteOptions& options = {});

}  // namespace abbe::sim::program
