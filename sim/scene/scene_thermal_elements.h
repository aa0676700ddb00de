#pragma once

#include "sim/scene/thermal_setting.h"

/// What heat does to the machine: elements, growing axes, a growing workpiece.
namespace abbe::sim {

/// `element`, `axis`, `workpiece`. @param setting  must outlive the fields
Fields<ThermalDescription> thermal_effect_fields(const ThermalSetting& setting);

}  // namespace abbe::sim
