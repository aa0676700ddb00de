#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "sim/program/nc.h"
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

}  // namespace abbe::sim::program
