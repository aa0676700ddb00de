#pragma once

#include "cutting/residual.h"
#include "sim/scene/part_description.h"

namespace abbe::sim {

/// The last of the regions that hold a place of the part frame; null where none does.
const PartRegion* region_at(const PartDescription& part, const Eigen::Vector3d& p_m);

/// Limits of the residual at each of the vertices (n), those of the regions above that of the part;
/// no rows where the part has no tolerance at all.
cutting::ToleranceBands tolerance_bands(const PartDescription& part,
                                        const cutting::Points& vertices_w);

}  // namespace abbe::sim
