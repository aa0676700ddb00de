#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cutting/part/recognition.h"
#include "cutting/surface/surface.h"
#include "sim/cut/commands.h"
#include "sim/cut/part_regions.h"
#include "sim/cut/process.h"
#include "sim/cut/tool_use.h"
#include "sim/files/progress.h"
#include "sim/machine/truth.h"
#include "sim/program/sample.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// What the scene would judge and the program does not mean to cut, mm^2, by the reason.
struct ExcludedArea {
  double unreached = 0.0;  ///< the error-free tool does not come within the band
  double corner = 0.0;     ///< its corner does not fit into the design
  double lead_out = 0.0;   ///< its sweep runs out beside the two
  double max_left = 0.0;   ///< mm, that it leaves there, of corner and run-out
  double radius = 0.0;     ///< mm, of the corner
  double area() const { return unreached + corner + lead_out; }
};

/// How the places at which a part is judged were chosen.
struct SampledSurface {
  Eigen::Index given = 0;   ///< vertices of the design as it was loaded
  double resolution = 0.0;  ///< mm, of linear interpolation, wanted
  double reached = 0.0;     ///< mm, that the points sufficed for; 0 where not looked for
  cutting::Surface::Within within =
      cutting::Surface::Within::None;  ///< where every case is looked at besides
  std::shared_ptr<const cutting::Surface> error_free = {};  ///< as it was cut to choose them
  double judged_area = 0.0;                                 ///< mm^2
  ExcludedArea excluded_area = {};
};

/// The program of a job that is too long to be held sampled.
struct Windows {
  std::vector<program::Window> all;
  std::size_t samples = 0;             ///< of all of them
  std::size_t max_at_once = 0;         ///< of the longest
  kinematics::AxisVector least, most;  ///< positions that the axes come to
};

/// A scene compiled: all that its cases share. Immutable once made.
struct Job {
  Scene scene;
  Machine machine;
  Truth truth;
  cutting::Design design_w;  ///< the design in the workpiece frame, where it is judged
  std::shared_ptr<const cutting::Design> body_m;  ///< as it was loaded, part frame: a blank's shape
  std::shared_ptr<const cutting::Thickness> body_w;  ///< of the part, where rays through it end
  std::vector<cutting::AnalyticPatch> recognised;    ///< of a mesh, part frame
  double recognised_fraction = 0.0;                  ///< of its area
  Eigen::VectorXd facet_uncertainty;  ///< (first vertices of the design) mm, of a mesh: see cutting
  std::optional<SampledSurface> sampled;  ///< how `sampled` chose the vertices
  program::Path path;                     ///< as read back from its file
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
  /// Of a program that changes between several tools: the jobs of its stretches, one after the
  /// other, each with its tool, the machine to that tool's tip, and its blocks and samples alone.
  /// Scene, machine and truth of the whole are those of the scene's first tool. Empty with one
  /// tool.
  std::vector<Job> stretches = {};
  FaceGroups face_groups = {};  ///< of a mesh, for the regions of the part
  FeedUse cut_before = {};      ///< of a stretch: what its tool has cut in those before
  /// Of a program that is run in windows, of one milling tool; samples and poses above are then
  /// those of the first window alone.
  std::shared_ptr<const Windows> windows = {};
};

/// What is cut one after the other: the stretches of a job, or the job itself. It refers to the
/// job.
/// @throws std::logic_error of a job in windows, no part of which is held
std::span<const Job> parts_of(const Job& job);

/// The parts of a job one after the other, those of a job in windows made one at a time.
void each_part(const Job& job, const std::function<void(const Job& part)>& use);

/// A window of a job as a job of its own, without the design. @param number  among job.windows
Job window_of(const Job& job, std::size_t number);

/// How much of a program is held sampled.
struct MemoryBudget {
  /// Samples that may be beside the blocks of the program and the vertices of the part, a program
  /// of more being prepared in windows; 0, or no function: as many as the memory holds, in one.
  std::function<std::size_t(std::size_t blocks, std::size_t vertices)> samples = {};
  std::string windows_obstacle =
      {};  ///< what allows no windows, in a word, for the refusal of too many
};

/// The program from which the commands of a part come.
const program::Path& path_of(const Job& part, const Commands& commands);
/// (samples of the commands) where the tool should be.
const std::vector<kinematics::Pose>& target_poses(const Job& part, const Commands& commands);

/// What the parts of a job cut, for the wear of their tools. They refer to the job.
ToolRun tool_run(const Job& part);
std::vector<ToolRun> tool_runs(const Job& job);

/// Compiles a scene: machine, truth, design, program (a generated one is read back from its own
/// text), samples. Writes nothing.
/// @throws BadInput, also if an axis leaves its travel (program line, axis, value)
Job prepare(const Scene& scene, const Progress& progress = {}, const MemoryBudget& holding = {});

/// The job of a scene that differs from its own only in what is wrong: errors of every source, the
/// tool and the clamping as they really are, what the control and the compensators believe. Design,
/// program and samples stay, so that thousands of machines can be tried on one program.
/// @param described  its part, program, nominal machine and tool are those of the job
/// @throws BadInput naming the scene if its nominal machine is another one or its errors want the
///         program sampled more densely than it is, else as `prepare`
Job replace_errors(Job job, const Scene& described);

/// Shift of the work zero after the control found the datum on the real machine.
/// @param corrector  acts meanwhile; without one nothing does
/// @return mm, workpiece frame
Eigen::Vector3d control_datum_offset(const Job& job, const Corrector& corrector = {});

/// The commands of the real control: its own kinematics and the datum it found, no compensator. Of
/// several tools each finds the datum itself.
Commands uncompensated_commands(const Job& job);

/// How densely a scene wants its program sampled. The chord tolerance holds up to the height to
/// which the tool shapes the part: a flat end mill may work with its whole flank, a rounded cutter
/// works with its rounding.
program::SampleOptions sample_options(const Scene& scene, const Machine& machine);

}  // namespace abbe::sim
