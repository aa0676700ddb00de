#include "sim/cut/tolerance_bands.h"

#include <algorithm>
#include <limits>

namespace abbe::sim {

cutting::ToleranceBands tolerance_bands(const PartDescription& part, const FaceGroups& groups,
                                        const cutting::Design& design_w) {
  const bool any = std::ranges::any_of(
      part.regions, [](const PartRegion& region) { return region.tolerance.has_value(); });
  if (!part.tolerance && !any) return {};
  const double inf = std::numeric_limits<double>::infinity();
  const Tolerance usual = part.tolerance.value_or(Tolerance{-inf, inf});
  const kinematics::Pose T_mw = part.T_wm.inverse();
  cutting::ToleranceBands bands(design_w.vertices.rows(), 2);
  for (Eigen::Index i = 0; i < design_w.vertices.rows(); ++i) {
    RegionPlace place = region_place(design_w, i);
    place.p_m = T_mw * place.p_m;
    bands.row(i) << usual.lower, usual.upper;
    for (std::size_t r = 0; r < part.regions.size(); ++r)
      if (holds(part, r, groups, place)) {
        const Tolerance own = part.regions[r].tolerance.value_or(usual);
        bands.row(i) << own.lower, own.upper;
      }
  }
  return bands;
}

}  // namespace abbe::sim
