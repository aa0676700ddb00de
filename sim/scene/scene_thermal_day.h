#pragma once

#include "sim/scene/thermal_setting.h"

/// The day of a machine: its room, and what it did before the program.
namespace abbe::sim {

/// `room_C` and `room`.
Fields<ThermalDescription> room_fields();

/// `history`. @param setting  must outlive the fields
Fields<ThermalDescription> history_fields(const ThermalSetting& setting);

}  // namespace abbe::sim
