#pragma once

#include "sim/cut/cut.h"
#include "sim/loop/control_view.h"
#include "sim/loop/learn.h"

namespace abbe::sim {

/// What acts in the run that a perfect belief foresees.
struct PredictedRun {
  Process process;                                    ///< its steps
  std::vector<kinematics::AxisVector> accelerations;  ///< (samples) of the axes; empty where no
                                                      ///< mass has inertia
};

/// The one door between truth and compensation: the perfect belief, without random parts. It refers
/// to the job, which must outlive it.
compensation::Belief perfect_belief(const Job& job, PredictedRun run);

/// Corrects by the perfect belief, which foresees what its own corrections do.
Corrector perfect_corrector(const Job& job, const ControlView& view,
                            const CaseDescription& compensator);

// The loop around a job: its control sees it, its workshop does what a compensator asks for.

/// What a compensator may know of a job, which must outlive it.
ControlView make_control_view(const Job& job);

/// What a compensator can have done with a job, which must outlive it.
MachineAccess make_machine_access(const Job& job);

/// What the control can read while a program runs, the thermal history before it: encoders,
/// temperatures, current, dynamometer, with their noise. What happens inside the machine is left
/// out.
compensation::ControlLog control_log(const Job& job, const Commands& commands,
                                     const Process& process);

/// What corrects the program of a case.
/// @throws as `learned_correction` of what is seen
LearnedCorrection learned_correction(const Job& job, const CaseDescription& compensator,
                                     const Progress& progress = {});

/// A compensator of the scene acting on the commands.
/// @throws as `learned_correction`
Commands compensate(const Job& job, const CaseDescription& compensator,
                    const Progress& progress = {});

/// What of a case needs a program that is sampled as a whole, in a word; empty where it can be run
/// in windows.
std::string find_windows_obstacle(const Scene& scene,
                                  const std::optional<CaseDescription>& compensator);

/// The program on the wrong machine, with a compensator if there is one.
/// @throws as `compensate`, and as `cut` of commands
Cut cut(const Job& job, const std::optional<CaseDescription>& compensator,
        const Progress& progress = {}, Retention keep = Retention::Map);

}  // namespace abbe::sim
