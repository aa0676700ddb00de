#pragma once

#include <limits>
#include <optional>

#include "cutting/residual.h"
#include "kinematics/units.h"
#include "render/figures.h"
#include "render/map.h"

namespace abbe::sim {

/// What a map comes to, as pictures print it.
inline render::Figures figures(const cutting::Statistics& s) {
  const auto um = [](const std::optional<double>& mm) {
    return mm ? *mm / units::um : std::numeric_limits<double>::quiet_NaN();
  };
  return {um(s.pv), um(s.rms), um(s.mean)};
}

inline render::ToleranceShares shares(const cutting::Conformance& c) {
  return {c.in, c.over, c.under, c.uncut};
}

}  // namespace abbe::sim
