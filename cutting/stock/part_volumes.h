#pragma once

#include <cstdint>
#include <vector>

#include "cutting/stock/part_deviation.h"

/// What lies between the skin of a machined part and its design, by regions of the skin.
namespace abbe::cutting {

/// Which material is meant.
enum class Between : std::uint8_t {
  Left,  ///< in the part, outside the design
  Lost,  ///< in the design, outside the part, within the extent of the part
};

/// Regions of a skin by its vertices.
struct SkinRegions {
  static constexpr int within = -1;  ///< off the design by no more than the limit
  static constexpr int never = -2;   ///< not compared, or of no interest
  std::vector<int> of;               ///< (vertices) region from 0, or one of these
  int count = 0;
  double limit = 0.05;  ///< mm, beyond which material without skin is followed
};

/// (regions) mm^3. Lines are laid askew through the skin in three directions, of a profile along
/// its axis and across it, as close as the size of a region asks for; each counts the part of it
/// that is off the design, by the square of the cosine between it and the shortest way to the
/// design, which sum to one: so layers are measured along their normal, and inner corners are
/// filled to the last. What ends at the skin belongs to the region there; what does not, such as
/// the inside of a pocket that was never cut, to a region that it hangs together with, unless it
/// lies by no more than a spacing over skin that is `within`: the mesh of the skin fills edges so
/// far. For regions 8 spacings across within 3 % (inner corners, steps, slots over an edge, holes,
/// pockets that were never cut), at 16 within 1 %. With dexels of one direction these alone are
/// counted, and walls along them are known to half a spacing. Uses all threads, the same for any
/// number.
/// @throws std::invalid_argument if the regions are not those of the skin
std::vector<double> volumes_between(const StockSkin& skin, const DesignDistance& design,
                                    const SkinRegions& regions, Between which);

}  // namespace abbe::cutting
