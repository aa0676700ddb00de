#pragma once

#include <span>
#include <string>
#include <vector>

#include "sim/program/nc.h"
#include "sim/program/path.h"

namespace abbe::sim::program {

/// Where a block shall be at a fraction of its time, in the block's own coordinates.
struct CorrectedPoint {
  double u = 1.0;             ///< in [0, 1]
  kinematics::AxisVector at;  ///< (axes) mm and rad, offsets in, as Block::end
};

struct RewriteOptions {
  double word_mm = 1e-4;                          ///< mm, step of the words of slides
  double word_rad = 1e-4 * 0.017453292519943295;  ///< rad, step of the words of turns
};

/// The program again with corrected points, in its own dialect.
/// NC: every block becomes lines (arcs too) through its points under G93, so that they keep their
/// times; words round to the nearest step; rapids stay rapids; the spindle and dwells stay.
/// PVT: positions and velocities (the correction's own rate added) with the fewest digits that read
/// back as the same bits; a point at u = 0 of the first block moves the start.
/// @param corrected  one list a block, u increasing, ending with u = 1; empty leaves the block's
/// end
/// @param control    as the program was read with; NC is written under G54 and its first H number
/// @throws std::invalid_argument if a list does not fit its block, or the words have no H for G43.4
std::string rewritten(const Path& path, std::span<const std::vector<CorrectedPoint>> corrected,
                      const NcOptions& control, const RewriteOptions& options = {});

}  // namespace abbe::sim::program
