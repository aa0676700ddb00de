#pragma once

#include <optional>
#include <vector>

#include "errors/compliance.h"
#include "errors/geometric.h"
#include "errors/thermal_elements.h"
#include "errors/thermal_run.h"
#include "errors/vibration.h"
#include "sim/machine/machine.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// A machine compiled from its description, with its tool mounted.
/// @throws BadInput naming the scene if the description makes no chain
Machine compile(const Scene& scene);

/// The same as built: tool and clamping as they really are, before any error.
/// @throws as `compile`
kinematics::Chain compile_as_built(const Scene& scene);

/// What the machine really does: the one place where the injected errors act. Read by the loop and
/// by the virtual instruments, never by a compensator. The sources add element by element; one that
/// a scene leaves out costs no bit.
struct Truth {
  kinematics::Chain actual;  ///< as built: tool and clamping as they are, before any error
  errors::GeometricModel geometric;
  struct Heat {
    errors::ThermalModel model;
    errors::ThermalRun run;
  };
  std::optional<Heat> heat;
  std::optional<errors::ComplianceModel> compliance;
  std::optional<errors::VibrationModel> vibration;
  std::optional<int> spindle;  ///< joint that turns the tool or the workpiece
};

/// @param activity  what the machine does, from the beginning of its thermal history to the end of
///                  the program; not used without heat
/// @throws BadInput naming the scene if an element does not fit the machine, or a node of the
///         network leaves the temperatures that a scene may state
Truth truth_of(const Scene& scene, const Machine& machine,
               const std::vector<errors::Activity>& activity = {});

/// The truth without its random parts: what a `perfect` belief may know.
Truth without_random(const Truth& truth);

/// Sum of all sources for every joint, in the order of the chain, and what is not at a joint.
/// @throws std::out_of_range where a table that refuses is left
errors::ForceDeviations deviations(const Truth& truth, const kinematics::AxisState& state,
                                   const errors::Load& load = {});

/// Where the tool really is in the part, T_wt: with heat, where it is in the part once that is back
/// at 20 deg C.
/// @throws std::out_of_range where a table that refuses is left
kinematics::Pose tool_in_workpiece(const Truth& truth, const kinematics::AxisState& state,
                                   const errors::Load& load = {});

}  // namespace abbe::sim
