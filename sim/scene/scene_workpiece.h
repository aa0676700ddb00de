#pragma once

#include "errors/compliance.h"
#include "sim/scene/fields.h"

namespace abbe::sim {

inline constexpr Range poisson_range{-1.0, 0.5, true, false};
inline constexpr Range bar_diameter{1e-3, 1e5};  // mm

/// `[compliance.workpiece]`: how the part gives way where it is touched.
Fields<errors::ComplianceErrors> workpiece_fields();

}  // namespace abbe::sim
