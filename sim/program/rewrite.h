#pragma once

#include <span>
#include <string>
#include <vector>

#include "sim/program/thin.h"

namespace abbe::sim::program {

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
