#pragma once

#include <cstdint>
#include <vector>

#include "cutting/stock/part_deviation.h"

/// Volumes between the skin of a machined part and its design, for regions of the skin.
namespace abbe::cutting {

/// The kind of difference between part and design.
enum class DeviationSide : std::uint8_t {
  Excess,   ///< material of the part outside the design
  Missing,  ///< volume of the design outside the part, within the extent of the part
};

/// Regions of the vertices of a skin.
struct SkinRegions {
  static constexpr int within_limit = -1;  ///< deviation from the design within the limit
  static constexpr int excluded = -2;      ///< not compared, or excluded
  std::vector<int> region;  ///< (vertices) number of the region from 0, or one of these constants
  int count = 0;
  double limit = 0.05;  ///< mm, deviation beyond which material without skin is followed
};

/// Returns the volume of each region, mm^3. Samples along lines in three skew directions, for a
/// profile along and across its axis, as dense as the size of a region requires. Each line
/// contributes its length between skin and design times the squared cosine of the angle to the
/// shortest direction to the design. These squares sum to one, so layers are measured along their
/// normal and inner corners are included completely. A length that ends at the skin belongs to the
/// region there. Any other length, such as the inside of a pocket that was never cut, belongs to a
/// connected region, unless it is at most a spacing above skin with `within_limit`, since the mesh
/// of the skin fills edges by that much. Accuracy: within 3 % for regions of 8 spacings (inner
/// corners, steps, slots over an edge, holes, pockets that were never cut), within 1 % at 16. With
/// dexels of one direction only lines along them are used, and walls along them are known to half a
/// spacing. Uses all threads; the result is the same for any number.
/// @throws std::invalid_argument if the regions do not belong to the skin
std::vector<double> volumes_between(const StockSkin& skin, const DesignDistance& design,
                                    const SkinRegions& regions, DeviationSide side);

}  // namespace abbe::cutting
