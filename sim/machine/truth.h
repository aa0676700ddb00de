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

/// Returns the nominal machine of a scene, with its tool mounted.
/// @throws BadInput naming the scene if its description is not a valid chain
Machine make_machine(const Scene& scene);

/// The actual behaviour of the machine; injected errors act only here. The control loop and the
/// virtual instruments read it; a compensator never does. The sources of errors are added element
/// by element; a source that the scene does not have changes no bit of the result.
struct Truth {
  kinematics::Chain actual;  ///< as built, with the actual tool and clamping of the part
  errors::GeometricModel geometric;
  struct Heat {
    errors::ThermalModel model;
    errors::ThermalRun run;
  };
  std::optional<Heat> heat;
  std::optional<errors::ComplianceModel> compliance;
  std::optional<errors::VibrationModel> vibration;
  std::optional<int> spindle;  ///< index of the joint that turns the tool or the workpiece
};

/// Returns the truth of a scene.
/// @param activity  activity of the machine from the beginning of its thermal history to the end of
///     the program; ignored if the scene has no thermal errors
/// @throws BadInput naming the scene if an element does not fit the machine, or if a node of the
///     thermal network leaves the range of temperatures that a scene may state
Truth make_truth(const Scene& scene, const Machine& machine,
                 const std::vector<errors::Activity>& activity = {});

/// Returns the truth without its random parts, i.e. the content of a `perfect` belief.
Truth without_random_errors(const Truth& truth);

/// Returns the sums of the deviations from all sources, of every joint in the order of the chain,
/// of the tool and of the workpiece.
/// @throws std::out_of_range if a position lies outside an error table that does not extrapolate
errors::ForceDeviations deviations(const Truth& truth, const kinematics::AxisState& state,
                                   const errors::Load& load = {});

/// Returns the actual pose of the tool in the workpiece, T_wt; with heat, in the workpiece after it
/// has returned to 20 deg C.
/// @throws std::out_of_range if a position lies outside an error table that does not extrapolate
kinematics::Pose tool_in_workpiece(const Truth& truth, const kinematics::AxisState& state,
                                   const errors::Load& load = {});

}  // namespace abbe::sim
