#pragma once

#include <functional>
#include <optional>

#include "cutting/surface.h"

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
/// @param begin  begins the motion again: called once, and once more if any vertex is uncut or gouged
/// @throws std::invalid_argument as milled_surface, or if a block has no sample or does not begin
///         where the one before ended
Surface streamed_surface(const Design& design_w, const Cutter& cutter,
                         const std::function<MotionBlocks()>& begin,
                         const SurfaceOptions& options = {});

}  // namespace abbe::cutting
