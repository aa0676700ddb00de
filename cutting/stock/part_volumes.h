#pragma once

#include <cstdint>
#include <vector>

#include "cutting/stock/part_deviation.h"

/// Volumes between the skin of a machined part and its design, for regions of the skin.
namespace abbe::cutting {

/// The kind of difference between part and design.
enum class DeviationSide : std::uint8_t {
  Excess,   ///< material of the part outside the design
  Missing,  ///< volume of the design that the part lacks, within the bounding box of the part
};

/// Regions of the vertices of a skin.
struct SkinRegions {
  static constexpr int within_limit = -1;  ///< deviation from the design within the limit
  static constexpr int excluded = -2;      ///< not compared, or excluded
  std::vector<int> region;  ///< (vertices) number of the region from 0, or one of these constants
  int count = 0;
  double limit = 0.05;  ///< mm; a difference without the skin of a region at its ends (such as a
                        ///< pocket that was never cut) is added to a neighbouring region only if
                        ///< its largest deviation exceeds this limit
};

/// Returns the volume of each region, mm^3. The volume is sampled along lines: in three skew
/// directions for dexels, or along and across the axis for a profile. Smaller regions get denser
/// lines. Each line contributes its length between skin and design times the squared cosine of the
/// angle to the shortest direction to the design. Over all directions the squared cosines add up to
/// one. A thin layer therefore counts with its thickness along the normal, and inner corners are
/// counted in full. A length that ends at the skin belongs to the region there. A length that does
/// not end at the skin of a region (for example inside a pocket that was never cut) belongs to the
/// region it is connected to. Exception: next to skin that is `within_limit`, lengths whose
/// deviation is no more than `limit` plus one spacing are ignored, because the mesh of the skin
/// rounds edges by up to one spacing. Accuracy: within 3 % for regions 8 dexel spacings across
/// (inner corners, steps, slots over an edge, holes, pockets that were never cut), within 1 %
/// at 16. If the dexels have one direction, only lines in that direction are used, and walls
/// parallel to them are located to within half a spacing. Uses all threads; the result is the same
/// for any number.
/// @throws std::invalid_argument if the regions do not belong to the skin
std::vector<double> volumes_between(const StockSkin& skin, const DesignDistance& design,
                                    const SkinRegions& regions, DeviationSide side);

}  // namespace abbe::cutting
