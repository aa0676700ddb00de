#pragma once

#include <cstddef>

#include <Eigen/Core>

#include "errors/thermal_run.h"

namespace abbe::errors {

/// The modes' equations from one knot to the next: z' = -rate z + flow + t flow_rise.
struct ThermalStretch {
  const ThermalModes* modes = nullptr;
  Eigen::VectorXd flow, flow_rise;  ///< (nodes) in modes
  double length = 0.0;              ///< s; 0 after the last knot, whose activity goes on
};

/// After a knot of a run.
ThermalStretch stretch_after(const ThermalRun& run, std::size_t knot);

/// Temperatures of a run at a knot over its base, in modes.
Eigen::VectorXd modal(const ThermalRun& run, const ThermalModes& modes, std::size_t knot);

/// The last knot that is not after an instant, which is not before the first.
std::size_t knot_before(const ThermalRun& run, double time_s);

/// All is counted from the room as it was first, so that a machine at that temperature stays there
/// to the last bit.
double base_T_C(const ThermalRun& run);

/// Heat from the surroundings into every node at an instant if all stood at `base_T_C`, W.
Eigen::VectorXd inflow(const ThermalNetwork& network, const Activity& at, bool coolant,
                       double base_T_C);

}  // namespace abbe::errors
