#pragma once

#include <optional>

#include "errors/geometric.h"
#include "sim/compensation/correct.h"
#include "sim/compensation/force_belief.h"
#include "sim/compensation/mirror.h"
#include "sim/compensation/thermal_belief.h"

namespace abbe::sim::compensation {

/// All that a compensator believes of a machine, from readings alone: the sources add element by
/// element (Guo 2016), one correction serves them all. Immutable.
struct MachineBelief {
  kinematics::Chain chain;            ///< as the control knows it
  std::optional<int> turns_the_part;  ///< the workpiece spindle, whose turning `part` leaves out
  std::optional<errors::GeometricModel> geometric;
  std::optional<ThermalCourse> thermal;
  struct Force {
    errors::ComplianceModel compliance;
    LoadCourse load;
  };
  std::optional<Force> force;
  std::optional<Course> bending;  ///< one column, mm: the tool gives way along its own axis z_t
  std::optional<PartCourse> part;
};

/// The same under a load, instead of that which the belief has of the instant.
kinematics::Pose tool_in_workpiece(const MachineBelief& belief, const kinematics::AxisState& state,
                                   const errors::Load& load);

/// Where the tool is believed to be, T_wt. @throws std::out_of_range where a table of the belief is
/// left
kinematics::Pose tool_in_workpiece(const MachineBelief& belief, const kinematics::AxisState& state);

}  // namespace abbe::sim::compensation
