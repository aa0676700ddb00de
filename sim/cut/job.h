#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "cutting/surface.h"
#include "sim/cut/commands.h"
#include "sim/cut/corrector.h"
#include "sim/cut/process.h"
#include "sim/files/progress.h"
#include "sim/machine/truth.h"
#include "sim/program/sample.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

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

/// Shift of the work zero after the control found the datum on the real machine.
/// @param corrector  acts meanwhile; without one nothing does
/// @return mm, workpiece frame
Eigen::Vector3d found_datum(const Job& job, const Corrector& corrector = {});

/// The commands of the real control: its own kinematics and the datum it found, no compensator.
Commands as_programmed(const Job& job);

/// How densely a scene wants its program sampled. The chord tolerance holds up to the height to
/// which the tool shapes the part: a flat end mill may work with its whole flank, a rounded cutter
/// works with its rounding.
program::SampleOptions sample_options(const Scene& scene, const Machine& machine);

}  // namespace abbe::sim
