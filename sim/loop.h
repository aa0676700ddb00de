#pragma once

#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cutting/surface.h"
#include "sim/process.h"
#include "sim/program/sample.h"
#include "sim/scene.h"
#include "sim/signals.h"
#include "sim/truth.h"

namespace abbe::sim {

/// Told now and then how far the named stage has come, fraction in [0, 1]; below zero the text is a
/// remark, which is for a line of its own.
using Progress = std::function<void(const std::string& stage, double fraction)>;

/// A scene compiled: all that its cases share. Immutable once made.
struct Job {
  Scene scene;
  Machine machine;
  Truth truth;
  cutting::Design design_w;  ///< the design in the workpiece frame
  program::Path path;        ///< as read back from its file
  program::SampleOptions sampling;
  program::Samples samples;  ///< of the error-free machine; every case shares their times
  std::vector<kinematics::Pose> T_wt_nominal;  ///< (samples) where the tool should be
  Process nominal_process;  ///< the cut on the error-free, rigid machine; empty without [cutting]
  std::vector<kinematics::AxisVector>
      accelerations;         ///< (samples) empty unless masses have inertia
  std::string program_text;  ///< of a generated program, else empty; its name is path.file
  std::map<std::string, double> timing_s;
  program::Unreached unreached;       ///< what the generator had to leave out
  std::vector<std::string> warnings;  ///< of the scene and its program, before anything is cut
};

/// Compiles a scene: machine, truth, design, program (a generated one is read back from its own
/// text), samples. Writes nothing.
/// @throws BadInput, also if an axis leaves its travel (program line, axis, value)
Job prepare(const Scene& scene, const Progress& progress = {});

/// The job of a scene that differs from its own only in what is wrong: errors of every source, the
/// tool and the clamping as they really are, what the control and the compensators believe. Design,
/// program and samples stay, so that thousands of machines can be tried on one program.
/// @param described  its part, program, nominal machine and tool are those of the job
/// @throws BadInput naming the scene if its nominal machine is another one or its errors want the
///         program sampled more densely than it is, else as `prepare`
Job with_errors(Job job, const Scene& described);

/// How densely a scene wants its program sampled. The chord tolerance holds up to the height to
/// which the tool shapes the part: a flat end mill may work with its whole flank, a rounded cutter
/// works with its rounding.
program::SampleOptions sample_options(const Scene& scene, const Machine& machine);

/// Largest and root mean square over the samples of a program.
struct Spread {
  double rms = 0.0;
  double max = 0.0;
};

/// One case cut.
struct Cut {
  std::string name;       ///< as it is told: of a variant, with its name in front
  std::string case_name;  ///< what `run --case` would be told
  cutting::Surface surface;
  Spread tip_error;               ///< mm, tip where it is against where it should be
  Spread direction_error;         ///< rad
  double point_left = 0.0;        ///< mm, most that the compensator knew it could not restore
  double direction_left = 0.0;    ///< rad, the same of the direction
  Process process;                ///< the cut as it went; empty without [cutting]
  Signals signals;                ///< empty without heat, force or channels
  std::string rewritten_program;  ///< text of the program channel, else empty
  std::vector<std::string> warnings;
  std::map<std::string, double> timing_s;
};

/// The same program on the machine without any error, and with a perfect tool, setup and control.
Cut cut_error_free(const Job& job, const Progress& progress = {});

/// The program on the wrong machine, by default without a compensator.
/// @throws BadInput if a commanded axis leaves its travel (program line, axis, value) or a table of
/// the
///         errors
Cut cut(const Job& job, const std::optional<CaseDescription>& compensator = std::nullopt,
        const Progress& progress = {});

/// What a piezo does to the tool beside the axes.
struct PiezoMotion {
  compensation::Piezo piezo;
  Eigen::VectorXd stroke;  ///< (samples) mm along its direction
};

/// What the axes are really told.
struct Compensated {
  program::Samples samples;
  std::optional<program::Path>
      path;  ///< from which the samples come, where it is not the job's own
  std::vector<kinematics::Pose>
      T_wt_nominal;  ///< (samples) empty where the times are the job's own
  std::vector<kinematics::AxisVector>
      correction;  ///< (samples) that a channel of the axes adds; else empty
  std::optional<PiezoMotion> piezo;
  double point_left = 0.0;
  double direction_left = 0.0;
  std::size_t not_converged = 0;
  std::string rewritten_program;
  std::vector<std::string> warnings;
};

/// The commands of the real control: its own kinematics and the datum it found, no compensator.
Compensated as_programmed(const Job& job);

/// A compensator of the scene acting on the commands.
/// @throws BadInput where the scene does not give what the case wants,
///         compensation::PlugInFailure
Compensated compensate(const Job& job, const CaseDescription& compensator,
                       const Progress& progress = {});

/// The program as it is told, on the wrong machine.
/// @throws BadInput as `cut`
Cut cut_as_told(const Job& job, const Compensated& told, const Progress& progress = {});

/// Where the tool really is in the part at samples of a program as it is told, T_wt.
/// @param process  that cut, for its forces; empty for none
/// @param at       numbers of samples; empty: all of them
/// @throws BadInput where a table of the errors is left
std::vector<kinematics::Pose> tool_poses(const Job& job, const Compensated& told,
                                         const Process& process,
                                         std::span<const std::size_t> at = {});

/// Refuses the line of the program on which an axis first leaves its travel.
/// @throws BadInput
void check_travel(const Job& job, const Compensated& told);

/// The cut alone, without the surface.
Process cut_process(const Job& job, const Compensated& told);

}  // namespace abbe::sim
