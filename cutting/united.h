#pragma once

#include <functional>
#include <vector>

#include "cutting/surface.h"

namespace abbe::cutting {

/// The surface that one tool alone leaves of a design, searched within a band.
using SurfaceOf = std::function<Surface(const Design& design_w, double band)>;

/// The surface that several tools leave, whatever their order: along each normal the first point,
/// coming from inside the part, that any of them removes; of equal ones the earliest, of equal
/// instants that of the tool that stands first. As of one sweep, a vertex is Gouged where any of
/// them has removed the design at -band (where one cuts within the band, that is looked at to 1e-6
/// mm), and where none cuts within the band and any has cut below it. The depth of a gouge is the
/// largest of those tools that gouge it: what a tool cuts below its own cut within the band is not
/// in it.
/// @param tools  one at least
Surface united(const Design& design_w, const std::vector<SurfaceOf>& tools, double band);

}  // namespace abbe::cutting
