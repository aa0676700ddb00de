#pragma once

#include "cutting/residual.h"
#include "sim/cut/regions.h"

namespace abbe::sim {

/// Limits of the residual at each of the vertices (n) of a design, those of the regions above that
/// of the part; no rows where the part has no tolerance at all.
cutting::ToleranceBands tolerance_bands(const PartDescription& part, const FaceGroups& groups,
                                        const cutting::Design& design_w);

}  // namespace abbe::sim
