#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "cutting/stock/body.h"
#include "kinematics/units.h"
#include "sim/cut/part.h"
#include "sim/files/progress.h"
#include "sim/machine/machine.h"
#include "sim/program/path.h"
#include "sim/program/path_meter.h"
#include "sim/program/sample.h"
#include "sim/scene/scene.h"

/// Checks of a scene before anything is cut: its size, feeds, poles, judged vertices, shank and
/// holder.
namespace abbe::sim {

/// Returns the input error for keys that together set a size. Since smaller values mean more work,
/// it points to the smallest value that the user typed, otherwise to the smallest in the file,
/// otherwise to the section.
/// @param keys  dotted paths, such as "program.step_mm"
BadInput scene_limit_error(const Scene& scene, const std::vector<std::string>& keys,
                           const std::string& expected, const std::string& seen);

/// Returns a text such as "; with [thermal] it cannot be run in windows" for that error.
/// @param windows_obstacle  what prevents windows; empty: nothing does, and the text is empty
std::string windows_obstacle_text(const std::string& windows_obstacle);

/// Returns the largest number of samples of a program: 50 million, or the number that fits into
/// memory if that is less.
std::size_t max_program_samples();

/// Estimated size of the program and of the part.
struct WorkEstimate {
  double passes = 0.0;
  double points = 0.0;   ///< on the passes; 0 for a program from a file
  double samples = 0.0;  ///< on the passes, lower bound
  double vertices = 0.0;
  Eigen::Vector2d range = Eigen::Vector2d::Zero();  ///< range of the part in x and y, mm
  double bytes = 0.0;                               ///< lower bound of the memory
  std::vector<std::string> limiting_keys;           ///< keys that set passes, points and samples
};
/// Estimates the size of a scene's program and part; points are 0 for a program from a file.
WorkEstimate estimate_work(const Scene& scene, const Part& part);

/// Returns the work of a program in windows, without the samples, which are not all in memory.
WorkEstimate windowed_work(WorkEstimate work);

/// Throws BadInput naming the keys and the figures if there are more than 5 million points or the
/// memory is too small.
void check_work(const Scene& scene, const WorkEstimate& work);

/// Returns a line about the work for the user; empty if it takes only a moment.
std::string work_remark(const WorkEstimate& work);

/// Returns warnings about feeds that no operator would accept, one sentence each with the first
/// line: with the spindle at rest or turning against the teeth, at less than 5 mm/min or 0.5 um per
/// revolution, at more than half the cutter's width per revolution, or at more than five times the
/// speed at which a vibration is stated. Programs from pvt tables, which state no spindle, and
/// blocks under G93 or with rotary axes, whose feed is not that of the tip, are left out.
std::vector<std::string> feed_warnings(const Scene& scene, const Machine& machine,
                                       const program::Path& path);

/// Returns the warning about a program that passes a pole of the machine: the distance, the line,
/// and the turn and speed of the free axis. Empty if that turns by less than 10 degrees.
/// @param within            distance that counts as near, rad
/// @param subprogram_files  as in `program::Path`
std::string pole_text(const program::PoleApproach& pole, const kinematics::Chain& chain,
                      double within, const std::vector<std::string>& subprogram_files);

/// Returns the same warnings for a scene with a program from a file.
/// @param machine  compiled from the scene
std::vector<std::string> pole_warnings(const Scene& scene, const Machine& machine,
                                       const program::Path& path);

/// A program on the error-free machine.
struct NominalRun {
  const program::Samples& samples;
  const std::vector<kinematics::Pose>& T_wt;  ///< (samples)
};

/// The vertices at which a design is judged, and the largest distance between them.
struct JudgedVertices {
  int vertices = 0;
  double max_distance = 0.0;  ///< length of the longest edge between two of them, mm
};
/// Returns the judged vertices of a design and their largest distance.
JudgedVertices judged_vertices(const cutting::Design& design);

/// Smallest sufficient number of judged vertices. A part with fewer, or with distances between them
/// larger than the cutter's width, is too sparsely judged, because no figure shows a cut between
/// them.
inline constexpr int min_judged_vertices = 10;
/// Returns true if a part is too sparsely judged for a tool.
bool is_sparse(const JudgedVertices& judged, const ToolDescription& tool);

/// Returns half the width of the narrowest tolerance of a part, mm; empty without a tolerance.
std::optional<double> narrowest_half_width(const PartDescription& part);

/// Returns the warnings about part and program of a scene before anything is cut: poses that the
/// machine does not reach, tools in comments that differ from those of the scene, no feed, two
/// units, a coarse mesh, a holder that overlaps cutter or spindle or does not extend to the
/// spindle.
std::vector<std::string> program_warnings(const Scene& scene, const cutting::Design& design_w,
                                          const program::Path& path,
                                          const program::UnreachedPoints& unreached);

/// Contacts of shank and holder of the scene's tool with the design.
struct ShankContacts {
  std::optional<cutting::ShankContact> shank, holder;
  bool in_windows = false;  ///< true if the counts are the largest of any window
};
/// Finds the contacts of shank and holder with a design along a run.
ShankContacts shank_contacts(const Scene& scene, const cutting::Design& design_w,
                             const NominalRun& run);

/// Joins the contacts of two successive windows.
ShankContacts joined(const ShankContacts& a, const ShankContacts& b);

/// Returns the warnings about contacts of shank and holder.
std::vector<std::string> shank_warnings(const Scene& scene, const ShankContacts& contacts);

}  // namespace abbe::sim
