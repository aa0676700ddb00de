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

/// The true machine: its chain as built, with all injected errors.
namespace abbe::sim {

/// Compiles the machine of a scene from its description, with its tool mounted.
/// @throws BadInput naming the scene if the description makes no chain
Machine compile(const Scene& scene);

/// Compiles the machine as built: actual tool and clamping, before any error.
/// @throws BadInput as `compile`
kinematics::Chain compile_actual(const Scene& scene);

/// The actual behaviour of the machine; the only place where the injected errors act. The control
/// loop and the virtual instruments read it, a compensator never does. The sources add element by
/// element; a source that the scene leaves out does not change a bit.
struct Truth {
  kinematics::Chain actual;  ///< as built: actual tool and clamping, before any error
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

/// Returns the truth of a scene.
/// @param activity  of the machine, from the beginning of its thermal history to the end of the
///     program; not used without heat
/// @throws BadInput naming the scene if an element does not fit the machine, or a node of the
///     thermal network leaves the temperatures that a scene may state
Truth make_truth(const Scene& scene, const Machine& machine,
                 const std::vector<errors::Activity>& activity = {});

/// Returns the truth without its random parts, which is what a `perfect` belief may know.
Truth without_random(const Truth& truth);

/// Returns the sum of all sources for every joint, in the order of the chain, and for tool and
/// workpiece.
/// @throws std::out_of_range if a position lies outside an error table that does not extrapolate
errors::ForceDeviations deviations(const Truth& truth, const kinematics::AxisState& state,
                                   const errors::Load& load = {});

/// Returns the actual pose of the tool in the part, T_wt; with heat, in the part after it has
/// returned to 20 deg C.
/// @throws std::out_of_range if a position lies outside an error table that does not extrapolate
kinematics::Pose tool_in_workpiece(const Truth& truth, const kinematics::AxisState& state,
                                   const errors::Load& load = {});

}  // namespace abbe::sim
