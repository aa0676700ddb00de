#pragma once

#include "sim/cut/cut.h"
#include "sim/loop/control_view.h"
#include "sim/loop/learn.h"

/// Control loop around a job: the knowledge and the operations available to a compensator, and the
/// cut with the commands that it returns.
namespace abbe::sim {

/// Run that a perfect belief predicts.
struct PredictedRun {
  Process process;                                    ///< cutting process; only its steps are used
  std::vector<kinematics::AxisVector> accelerations;  ///< (samples) accelerations of the axes;
                                                      ///< empty if no mass has inertia
};

/// Returns the perfect belief: the truth without its random parts. This is the only passage from
/// the truth to the compensation. The segment must outlive the result.
compensation::Belief perfect_belief(const Segment& segment, PredictedRun run);

/// Returns a corrector with the perfect belief, which predicts the effect of its own corrections.
/// @param before  has the stock that earlier tools have left; without a stock the blank is cut
Corrector perfect_corrector(const Segment& segment, const ControlView& view,
                            const CaseDescription& compensator, const Process& before = {});

/// Returns the channel of a case; that of a plug-in is set by the scene.
CaseDescription::Channel channel_of(const Scene& scene, const CaseDescription& compensator);

/// Returns the knowledge of a segment of a job that is available to a compensator. Job and segment
/// must outlive the result.
ControlView make_control_view(const Job& job, const Segment& segment);

/// Returns the view for which the tables of a control are made: the tool of the scene's key, or the
/// first of the program, and the program of all tools.
/// @throws BadInput if the program does not call that tool
ControlView make_table_view(const Job& job);
/// Returns a text that names the tool of that view; empty for a single tool.
std::string table_tool_text(const Job& job);

/// Returns the operations that a compensator may request from the machine while it runs a segment
/// of a job. The arguments must outlive the result.
/// @param before  has the stock that earlier tools have left; without a stock the blank is cut
MachineAccess make_machine_access(const Job& job, const Segment& segment, const Process& before);

/// Returns the signals that the control can read while a program runs and during the thermal
/// history before it: encoders, temperatures, current and dynamometer, with their noise. True
/// deviations are excluded.
compensation::ControlLog control_log(const Segment& segment, const Commands& commands,
                                     const Process& process);

/// Learns the correction of a case for the tool of `make_table_view`.
/// @throws BadInput, PlugInFailure  as `learn_correction` with a control view
LearnedCorrection learn_correction(const Job& job, const CaseDescription& compensator,
                                   const Progress& progress = {});

/// Returns the commands of the program, corrected by a compensator.
/// @throws BadInput, PlugInFailure  as `learn_correction`
Commands compensate(const Job& job, const CaseDescription& compensator,
                    const Progress& progress = {});

/// Returns the reason why a case cannot be processed in windows, for an error message; empty if it
/// can.
std::string find_windows_obstacle(const Scene& scene,
                                  const std::optional<CaseDescription>& compensator);

/// Cuts the program on the actual machine, with or without a compensator.
/// @throws BadInput, CollisionStop, PlugInFailure  as `compensate` and as `cut` of commands
Cut cut(const Job& job, const std::optional<CaseDescription>& compensator,
        const Progress& progress = {}, Retention keep = Retention::Map);

}  // namespace abbe::sim
