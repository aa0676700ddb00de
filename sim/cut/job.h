#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "cutting/part/recognition.h"
#include "cutting/surface/surface.h"
#include "sim/cut/commands.h"
#include "sim/cut/part_regions.h"
#include "sim/cut/process_simulation.h"
#include "sim/cut/tool_use.h"
#include "sim/files/progress.h"
#include "sim/machine/truth.h"
#include "sim/program/sample.h"
#include "sim/scene/scene.h"

/// A job, compiled from a scene: machine, truth, design, program, samples and nominal process,
/// shared by all its cases.
namespace abbe::sim {

/// Area, mm^2, that the scene would judge but the program does not intend to cut, by reason.
struct ExcludedArea {
  double unreached = 0.0;      ///< the error-free tool does not come within the band
  double corner = 0.0;         ///< the corner of the tool does not fit into the design
  double lead_out_area = 0.0;  ///< where the sweep leaves the part beside the other two
  double max_remaining_height =
      0.0;              ///< largest height of material left at corner and lead-out, mm
  double radius = 0.0;  ///< of the corner, mm
  double area() const { return unreached + corner + lead_out_area; }
};

/// The choice of the vertices at which a part is judged.
struct SampledSurface {
  Eigen::Index given = 0;   ///< number of vertices of the design as loaded
  double resolution = 0.0;  ///< requested error of linear interpolation, mm
  double reached = 0.0;     ///< that error with the points available, mm; 0 if not refined
  cutting::Surface::InteriorSample within =
      cutting::Surface::InteriorSample::None;  ///< additional samples within triangles, in every
                                               ///< case
  /// The error-free surface that was cut to choose the vertices.
  std::shared_ptr<const cutting::Surface> error_free = {};
  double judged_area = 0.0;  ///< mm^2
  ExcludedArea excluded_area = {};
};

/// A window of a program: blocks of one tool.
struct Window {
  std::size_t segment = 0;            ///< index in `tool_segments`
  program::SampleWindow blocks;       ///< of the path of that segment
  double start_s = 0.0, end_s = 0.0;  ///< times of its first and last sample
};

/// The division of a program into windows, if its samples exceed the memory.
struct Windows {
  std::vector<Window> all;              ///< in the order of the program
  std::size_t samples = 0;              ///< of all windows
  std::size_t max_window_samples = 0;   ///< of the longest window
  kinematics::AxisVector lower, upper;  ///< range in which the axes move
};

/// A range of a program that one tool runs: the whole program of a single tool, the blocks between
/// two tool changes, or a window of either. Immutable after its preparation.
struct Segment {
  Scene scene;      ///< with the tool of the segment
  Machine machine;  ///< to the tip of that tool
  Truth truth;
  std::shared_ptr<const cutting::Design> body_m;  ///< the design as loaded, part frame; a blank
                                                  ///< may be its offset
  program::Path path;                             ///< as read back from its file
  program::SampleOptions sampling;
  program::Samples samples;  ///< of the error-free machine; all cases use the same times
  std::vector<kinematics::Pose> T_wt_nominal;  ///< (samples) nominal pose of the tool
  Process nominal_process;  ///< of the error-free, rigid machine; empty without [cutting]. One of
                            ///< several segments has its steps without the stock
  std::vector<kinematics::AxisVector>
      accelerations;          ///< (samples) empty unless the compliance has inertia
  FeedUse previous_use = {};  ///< use of the tool in earlier segments
};

/// A compiled scene: the segment of its whole program, and what its segments and its cases share.
/// With several tools, scene, machine and truth are those of the first tool of the scene.
struct Job : Segment {
  cutting::Design design_w = {};  ///< in the workpiece frame, where it is judged
  std::shared_ptr<const cutting::WallThickness> body_w = {};  ///< thickness of the part, which ends
                                                              ///< rays through it
  std::vector<cutting::AnalyticPatch> recognised = {};  ///< surfaces recognised in a mesh, part
                                                        ///< frame
  double recognised_fraction = 0.0;                     ///< fraction of the mesh area
  Eigen::VectorXd facet_uncertainty = {};  ///< (first vertices of the design) mm, of a mesh, as by
                                           ///< `cutting::facet_uncertainty`
  std::optional<SampledSurface> sampled = {};  ///< set by `sampled`
  std::string program_text = {};  ///< text of a generated program, else empty; its name is
                                  ///< path.file
  std::map<std::string, double> timing_s = {};
  program::UnreachedPoints unreached = {};  ///< passes that the generator had to leave out
  std::vector<std::string> warnings = {};   ///< about the scene and its program, before anything is
                                            ///< cut
  std::vector<Segment> segments = {};  ///< of a program with several tools, in its order; empty
                                       ///< with one tool
  FaceGroups face_groups = {};         ///< of a mesh, for the regions of the part
  /// Windows of a milling program whose samples exceed the memory. `samples` and `T_wt_nominal`
  /// then have only the first window, in the job and in its first segment.
  std::shared_ptr<const Windows> windows = {};
};

/// Returns a segment for each call of a tool, or the whole program of a single tool, whose samples
/// are not all held in memory if the job has windows. The result refers to the job.
std::span<const Segment> tool_segments(const Job& job);

/// Returns the same segments of a job without windows, with all their samples.
/// @throws std::logic_error for a job in windows, whose segments are not held in memory
std::span<const Segment> job_segments(const Job& job);

/// Calls `visit` for each segment of a job in order. Windows are made one at a time.
void visit_segments(const Job& job, const std::function<void(const Segment& segment)>& visit);

/// Returns a window as a segment of its own.
/// @param number  index in job.windows
Segment make_window(const Job& job, std::size_t number);

/// The windows of one segment of a job: [first, last) in job.windows; empty if it has no samples.
struct WindowRange {
  std::size_t first = 0, last = 0;
};
/// Returns the windows of each of `tool_segments`.
std::vector<WindowRange> window_ranges(const Job& job);

/// Returns the commands of a window of a job.
/// @param number  index in job.windows
using CommandSource = std::function<Commands(const Segment& window, std::size_t number)>;

/// The program of a case in the windows of a job: that of the job, or a rewritten one.
struct WindowedProgram {
  CommandSource commands;           ///< must not depend on samples outside the window
  const program::Path& path;        ///< of all tools
  std::span<const Window> windows;  ///< (windows of the job) with the times of this program
};

/// Simulates the cut of one segment of a job in windows.
/// @param command_source  returns the actual or the nominal commands
/// @param pose     returns the pose of the tool
/// @param chain    of the nominal or the actual machine
/// @param tool     nominal or actual, as the machine
/// @param before   has the stock that the tools before have left; without one the blank is cut
Process windowed_process(const Job& job, std::size_t segment, const CommandSource& command_source,
                         const WindowedProcess::PoseAt& pose, const kinematics::Chain& chain,
                         const std::variant<cutting::Cutter, cutting::Nose>& tool, Process before,
                         const Progress& progress = {});

/// Limit on the samples of a program held in memory.
struct MemoryBudget {
  /// Returns the number of samples that fit into the memory together with the blocks of the program
  /// and the vertices of the part. A longer program is prepared in windows. Without this function,
  /// or if it returns 0, there is one window with as many samples as the memory holds.
  std::function<std::size_t(std::size_t blocks, std::size_t vertices)> samples = {};
  std::string windows_obstacle = {};  ///< why this job cannot be processed in windows; quoted in
                                      ///< the error message for too many samples
};

/// Returns the program from which the commands of a segment come.
const program::Path& path_of(const Segment& segment, const Commands& commands);
/// Returns (samples of the commands) the nominal poses of the tool.
const std::vector<kinematics::Pose>& target_poses(const Segment& segment, const Commands& commands);

/// Returns the cut of a segment, for the wear of its tool. The result refers to the segment.
ToolRun tool_run(const Segment& segment);
/// Returns the cuts of all segments of a job; empty for a job in windows. The results refer to the
/// job.
std::vector<ToolRun> tool_runs(const Job& job);

/// Compiles a scene: machine, truth, design, program and samples. A generated program is read back
/// from its own text. Writes no file.
/// @param memory_budget  limit on the samples in memory
/// @throws BadInput, also if an axis leaves its travel (with program line, axis and value)
Job prepare(const Scene& scene, const Progress& progress = {},
            const MemoryBudget& memory_budget = {});

/// Returns the job with other errors: errors of every source, actual tool and clamping, beliefs of
/// the control and the compensators. It keeps design, program and samples, so that thousands of
/// machines can run one program.
/// @param described  scene with the part, program, nominal machine and tool of the job
/// @throws BadInput naming the scene if its nominal machine differs or its errors need denser
///     samples than the job has; otherwise as `prepare`
Job replace_errors(Job job, const Scene& described);

/// Returns the shift of the work zero after the control has measured the datum on the actual
/// machine.
/// @param corrector  corrects the commands while the datum is measured; none by default
/// @return mm, workpiece frame
Eigen::Vector3d control_datum_offset(const Segment& segment, const Corrector& corrector = {});

/// Returns the commands of the actual control with its own kinematics and the datum that it
/// measured, without a compensator.
Commands segment_commands(const Segment& segment);
/// Returns the same commands of a whole job. Of several tools each measures the datum.
Commands uncompensated_commands(const Job& job);

/// Returns the sampling options of a scene. The chord tolerance holds up to the height to which the
/// tool shapes the part: the whole flank of a flat end mill, the rounding of a rounded cutter.
program::SampleOptions sample_options(const Scene& scene, const Machine& machine);

}  // namespace abbe::sim
