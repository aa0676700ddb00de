#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "cutting/part/mesh.h"
#include "cutting/stock/engagement.h"
#include "cutting/stock/force.h"
#include "cutting/stock/stock.h"
#include "sim/cut/process.h"
#include "sim/cut/tool_motion.h"
#include "sim/machine/machine.h"
#include "sim/program/sample.h"
#include "sim/scene/cutting.h"
#include "sim/scene/scene.h"

/// How a program is followed through a blank: the blank, and the places at which it is looked at.
namespace abbe::sim {

/// The blank of a scene with [cutting], for milling.
/// @param design_m  the part in its own frame, for a blank that is its offset
/// @throws std::invalid_argument for a blank that cannot be, BadInput for a mesh file that cannot
///         be read or is not closed
cutting::Blank blank_of(const Scene& scene, const cutting::Design& design_m);

/// What is to be said of the size of a blank that is a mesh; empty: nothing.
std::string blank_size_warning(const Scene& scene, const cutting::Blank& blank);

/// A blank of the scene as dexels.
/// @throws std::invalid_argument for a blank that cannot be, std::length_error for one that does
///         not fit in its memory
cutting::Stock blank_stock(const Scene& scene, const cutting::Blank& blank);

/// Returns the warning of a blank that does not hold the design: it may be in another unit or
/// frame. Empty if at most a twentieth of the design's vertices lie more than a spacing outside it.
std::string uncovered_text(const Scene& scene, const cutting::Stock& blank,
                           const cutting::Design& design_m);

/// Whether the block that runs at a sample is a rapid.
bool is_rapid(const program::Samples& samples, const program::Path& path, std::size_t sample);

/// Samples between which material is taken away: after every `step` (mm) of travel of the tip and
/// of the turning of what is `reach` (mm) above it, wherever the motion turns by more than 0.1 rad,
/// and where rapid and feed meet. The first is 0, the last the last.
/// @param T_wt  (samples)
std::vector<std::size_t> milling_steps(const program::Samples& samples, const program::Path& path,
                                       const std::vector<kinematics::Pose>& T_wt, double step,
                                       double reach);

// How a program is followed through a blank that turns: the blank, and the places at which it is
// looked at.

/// The turned blank of a scene with [cutting] about a spindle line.
/// @throws std::invalid_argument for another blank or one that cannot be, std::length_error for one
///         of too many nodes
cutting::TurnedStock turned_blank(const Scene& scene, const SpindleLine& line);

/// Samples between which material is taken away: once a revolution, where rapid and feed meet, and
/// after every 0.1 mm of travel of a rapid or with the spindle at rest. The first is 0.
/// @param T_wt     (samples)
/// @param spindle  joint that turns the workpiece, about the line
std::vector<std::size_t> turning_steps(const program::Samples& samples, const program::Path& path,
                                       const std::vector<kinematics::Pose>& T_wt, int spindle,
                                       const SpindleLine& line);

/// Where the tool is at a sample when the cut loads it so.
using PoseUnderLoad = std::function<kinematics::Pose(std::size_t sample, const errors::Load&)>;

/// What one look at the cut gives.
struct ProcessSample {
  cutting::CuttingLoad cut;
  errors::Load load;
  double engaged = 0.0;      ///< mm of edge
  double chip = 0.0;         ///< mm
  double beyond_edge = 0.0;  ///< mm, by which it goes beyond the edges of an insert
};

/// The load of one step, brought to agree with the deflection that it makes to the tolerance of the
/// description (with a contraction c of repetition the rest is c / (1 - c) of the last change).
/// Plain repetition first, the secant of the last two where that is slow; where both fail, the load
/// between none and that of the rigid tool is bracketed, so a soft machine closes too.
/// @param force  what the cut does to a tool that stands at a pose
/// @return without time, line, power and removed volume
ProcessStep converged_step(const CuttingDescription& description, const PoseUnderLoad& pose,
                           std::size_t sample,
                           const std::function<ProcessSample(const kinematics::Pose&)>& force,
                           const errors::Load& guess);

/// What is followed: a program as it runs on some machine.
struct FollowedProgram {
  const program::Samples& samples;
  const program::Path& path;                  ///< from which the samples come
  const std::vector<kinematics::Pose>& T_wt;  ///< (samples) where the tool should be: the feed
  PoseUnderLoad pose;                         ///< where it is
  const kinematics::Chain& chain;             ///< whose spindle line a turned part has
  const std::variant<cutting::Cutter, cutting::Nose>& tool;
};

/// Follows the cut: engagement gives the force, the force moves the tool, the moved tool has
/// another engagement, until force and deflection agree. The first guess is the load of the step
/// before. Milling looks after every `step` of travel of the tip and of the flank's turning,
/// wherever the motion turns by more than 0.1 rad, and where rapid and feed meet; it takes the mean
/// force of a revolution, the feed as that of the corner's centre (of a flat end mill: of half its
/// flank). Turning looks once a revolution.
/// A rapid, or the shank, that takes material is a crash. Empty for a scene without [cutting].
/// @param design_m  the part in its own frame, for a blank that is its offset
/// @throws BadInput naming the scene or the program line: a blank that cannot be, too many dexels,
///         a cut with a spindle that stands still or turns the other way, a feed per tooth beyond
///         the cutter's radius
Process simulate_process(const Scene& scene, const Machine& machine,
                         const cutting::Design& design_m, const FollowedProgram& program,
                         const std::function<void(double)>& progress = {});

}  // namespace abbe::sim
