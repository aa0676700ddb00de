#include "cutting/tool.h"

#include <cmath>

#include "kinematics/require.h"

namespace abbe::cutting {

void check_cutter(const Cutter& cutter) {
  require(std::isfinite(cutter.radius) && cutter.radius > 0.0 && cutter.corner_radius >= 0.0 &&
              cutter.corner_radius <= cutter.radius && std::isfinite(cutter.flank_length) &&
              cutter.flank_length >= cutter.corner_radius,
          "cutter: expected radius > 0, corner radius from 0 to radius, flank at least as long");
}

}  // namespace abbe::cutting
