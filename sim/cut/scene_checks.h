#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "cutting/stock/body.h"
#include "kinematics/units.h"
#include "sim/cut/part.h"
#include "sim/cut/resources.h"
#include "sim/machine/machine.h"
#include "sim/program/path.h"
#include "sim/program/path_meter.h"
#include "sim/program/sample.h"
#include "sim/scene/scene.h"

/// How much a scene asks of the computer, said and refused before it is done.
namespace abbe::sim {

/// A refusal of what keys of the scene ask together: the less each is, the more. It stands at the
/// place of the least of those that the user typed, else of those that are written, else of the
/// section.
/// @param keys  dotted paths, such as "program.step_mm"
BadInput scene_limit_error(const Scene& scene, const std::vector<std::string>& keys,
                           const std::string& expected, const std::string& seen);

/// "; with [thermal] it cannot be run in windows", for such a refusal.
/// @param needs_whole  what of the case does; empty for nothing, of which nothing is said
std::string windows_obstacle_text(const std::string& windows_obstacle);

/// Most samples that a program may have: 50 million, and no more than the memory holds.
std::size_t max_program_samples();

/// What is generated and judged, estimated.
struct Work {
  double passes = 0.0;
  double points = 0.0;   ///< of the passes; 0 for a program from a file
  double samples = 0.0;  ///< of the passes, at least
  double vertices = 0.0;
  Eigen::Vector2d range = Eigen::Vector2d::Zero();  ///< mm of the part that is covered
  double bytes = 0.0;                               ///< for all of them, at least
  std::vector<std::string> by;                      ///< keys that set passes, points and samples
};
Work estimate_work(const Scene& scene, const Part& part);

/// The same of a program that is run in windows, whose samples are not held.
Work windowed_work(Work work);

/// @throws BadInput naming the keys and the figures if the points are more than 5 million, or the
///         memory does not hold all
void check_work(const Scene& scene, const Work& work);

/// One line for a person, empty where it takes a moment only.
std::string remark(const Work& work);

/// Returns what no operator would let a program do: feed while the spindle stands or turns against
/// the teeth, at less than 5 mm/min or 0.5 um a turn, by more than half the cutter a turn, or at
/// more than five times the speed at which a vibration is stated. One sentence each, with the first
/// line. Programs of pvt tables, which bear no spindle, and blocks under G93 or with turning axes,
/// whose feed is not that of the tip, are left out.
std::vector<std::string> feed_warnings(const Scene& scene, const Machine& machine,
                                       const program::Path& path);

/// rad, of the axis that is free at a pole: less than that is nothing to be said.
inline constexpr double min_reported_pole_turn = 10.0 * units::deg;

/// What is to be said of a program that passes a pole of the machine: how close, where, and how far
/// and how fast the axis that is free there turns. Empty where it turns by less than
/// `min_reported_pole_turn`.
/// @param within  rad, what was near  @param more_files  as Path has them
std::string pole_text(const program::NearPole& pole, const kinematics::Chain& chain, double within,
                      const std::vector<std::string>& more_files);

/// The same of a scene whose program is a file. @param machine  compiled from it
std::vector<std::string> pole_warnings(const Scene& scene, const Machine& machine,
                                       const program::Path& path);

/// A program as the error-free machine runs it.
struct NominalRun {
  const program::Samples& samples;
  const std::vector<kinematics::Pose>& T_wt;  ///< (samples)
};

/// Where a design is judged, as far as it is between these places that something is missed.
struct JudgedVertices {
  int vertices = 0;
  double length_mismatch_text = 0.0;  ///< mm, the longest edge between two of them
};
JudgedVertices judged_vertices(const cutting::Design& design);

/// Below this number, or where they are farther apart than the cutter is wide, what is cut between
/// them is in no figure.
inline constexpr int min_judged = 10;
bool is_sparse(const JudgedVertices& places, const ToolDescription& tool);

/// Returns half the width of the narrowest tolerance of a part, mm; empty without one.
std::optional<double> narrowest_half_width(const PartDescription& part);

/// What is to be said of a scene's part and program before anything is cut: poses that the machine
/// does not reach, tools in comments that are not the scene's, no feed, two units, a coarse
/// mesh, a holder that overlaps cutter or spindle or ends short of it.
std::vector<std::string> program_warnings(const Scene& scene, const cutting::Design& design_w,
                                          const program::Path& path,
                                          const program::Unreached& unreached);

/// Where what does not cut of the scene's tool goes into the design.
struct ShankContacts {
  std::optional<cutting::ShankContact> shank, holder;
  bool in_windows = false;  ///< the vertices are the most of any window
};
ShankContacts shank_contacts(const Scene& scene, const cutting::Design& design_w,
                             const NominalRun& run);

/// Of two windows, one after the other.
ShankContacts joined(const ShankContacts& a, const ShankContacts& b);

std::vector<std::string> shank_warnings(const Scene& scene, const ShankContacts& contacts);

}  // namespace abbe::sim
