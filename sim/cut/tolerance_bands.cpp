#include "sim/cut/tolerance_bands.h"

#include <algorithm>
#include <limits>

namespace abbe::sim {
namespace {

bool holds(const PartRegion& region, const Eigen::Vector3d& p_m) {
  constexpr double rounding = 1e-6;  // mm, of a place that was moved with the part and back
  const auto within = [](const std::optional<Eigen::VectorXd>& limits, double value) {
    return !limits || ((*limits)[0] - rounding <= value && value <= (*limits)[1] + rounding);
  };
  const auto& box = region.box;
  return within(region.z, p_m.z()) && within(region.radius, p_m.head<2>().norm()) &&
         (!box || ((box->head<3>().array() - rounding <= p_m.array()).all() &&
                   (p_m.array() <= box->tail<3>().array() + rounding).all()));
}

}  // namespace

const PartRegion* region_at(const PartDescription& part, const Eigen::Vector3d& p_m) {
  const PartRegion* found = nullptr;
  for (const PartRegion& region : part.regions)
    if (holds(region, p_m)) found = &region;
  return found;
}

cutting::ToleranceBands tolerance_bands(const PartDescription& part,
                                        const cutting::Points& vertices_w) {
  const bool any = std::ranges::any_of(
      part.regions, [](const PartRegion& region) { return region.tolerance.has_value(); });
  if (!part.tolerance && !any) return {};
  const double inf = std::numeric_limits<double>::infinity();
  const Tolerance usual = part.tolerance.value_or(Tolerance{-inf, inf});
  const kinematics::Pose T_mw = part.T_wm.inverse();
  cutting::ToleranceBands bands(vertices_w.rows(), 2);
  for (Eigen::Index i = 0; i < vertices_w.rows(); ++i) {
    const Eigen::Vector3d p_m = T_mw * vertices_w.row(i).transpose();
    bands.row(i) << usual.lower, usual.upper;
    for (const PartRegion& region : part.regions)
      if (region.tolerance && holds(region, p_m))
        bands.row(i) << region.tolerance->lower, region.tolerance->upper;
  }
  return bands;
}

}  // namespace abbe::sim
