#pragma once

#include "sim/cut/cut.h"
#include "sim/loop/control_view.h"
#include "sim/loop/learn.h"

/// The control loop around a job: what its control sees, what a compensator may request, and the
/// cut with the commands it returns.
namespace abbe::sim {

/// The process and accelerations in the run that a perfect belief predicts.
struct PredictedRun {
  Process process;                                    ///< only its steps are used
  std::vector<kinematics::AxisVector> accelerations;  ///< (samples) of the axes; empty if no mass
                                                      ///< has inertia
};

/// Returns the perfect belief: the truth without its random parts. This is the only passage from
/// the truth to the compensation. The job must outlive the result.
compensation::Belief perfect_belief(const Job& job, PredictedRun run);

/// Returns a corrector with the perfect belief, which predicts the effect of its own corrections.
Corrector perfect_corrector(const Job& job, const ControlView& view,
                            const CaseDescription& compensator);

// The control and the shop floor of a job.

/// Returns what a compensator may know of a job. The job must outlive the result.
ControlView make_control_view(const Job& job);

/// Returns the operations that a compensator may request. The job must outlive the result.
MachineAccess make_machine_access(const Job& job);

/// Returns what the control can read while a program runs, with the thermal history before it:
/// encoders, temperatures, current and dynamometer, with their noise. The true deviations are
/// excluded.
compensation::ControlLog control_log(const Job& job, const Commands& commands,
                                     const Process& process);

/// Learns the correction of the program of a case.
/// @throws BadInput, PlugInFailure  as `learned_correction` of a control view
LearnedCorrection learned_correction(const Job& job, const CaseDescription& compensator,
                                     const Progress& progress = {});

/// Returns the commands with a compensator of the scene applied.
/// @throws BadInput, PlugInFailure  as `learned_correction`
Commands compensate(const Job& job, const CaseDescription& compensator,
                    const Progress& progress = {});

/// Returns the reason why a case needs a program that is sampled as a whole, for the error message;
/// empty if it can be run in windows.
std::string find_windows_obstacle(const Scene& scene,
                                  const std::optional<CaseDescription>& compensator);

/// Cuts the program on the machine with errors, with a compensator if there is one.
/// @throws BadInput, CollisionStop, PlugInFailure  as `compensate` and as `cut` of commands
Cut cut(const Job& job, const std::optional<CaseDescription>& compensator,
        const Progress& progress = {}, Retention keep = Retention::Map);

}  // namespace abbe::sim
