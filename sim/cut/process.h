#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "cutting/engagement.h"
#include "cutting/mesh.h"
#include "cutting/stock.h"
#include "errors/compliance.h"
#include "sim/machine/machine.h"
#include "sim/scene/scene.h"
#include "sim/program/path.h"
#include "sim/program/sample.h"

namespace abbe::sim {

/// One look at the cut: how the tool is loaded when the axes are there.
struct ProcessStep {
  double time_s = 0.0;
  int line = 0;
  errors::Load load;
  double torque = 0.0;       ///< N mm, on the spindle against its turning
  double power_W = 0.0;      ///< of the cut
  double removed = 0.0;      ///< mm^3 since the step before
  double engaged = 0.0;      ///< mm of cutting edge in material, the mean over a revolution
  double chip = 0.0;         ///< mm, largest uncut chip thickness
  int iterations = 0;        ///< of force and deflection; 0 where nothing was loaded
  double contraction = 0.0;  ///< largest ratio of two corrections running: below 1, the loop closes
                             ///< by repetition; 0 where two were not needed
  double disagreement = 0.0;  ///< mm, last change of the deflection
  bool converged = true;      ///< it is within the scene's tolerance; or the deflection is known to
                              ///< it, between two places where the force jumps
};

/// The cut followed along a program.
struct Process {
  std::vector<ProcessStep> steps;  ///< in time
  std::vector<int> crash_lines;    ///< program lines on which a rapid or the shank met material
  std::optional<cutting::Stock> stock;         ///< what is left after milling
  std::optional<cutting::TurnedStock> turned;  ///< what is left after turning
};

/// Where the tool is at a sample when the cut loads it so.
using PoseUnderLoad = std::function<kinematics::Pose(std::size_t sample, const errors::Load&)>;

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
/// another engagement, until the deflection changes by less than the scene's tolerance (with a
/// contraction c the rest is c / (1 - c) of that change). Plain repetition first, the secant of the
/// last two where that is slow; where both fail, the load between none and that of the rigid tool
/// is bracketed, so a soft machine closes too. The first guess is the load of the step before.
/// Milling looks after every `step` of travel of the tip and of the flank's turning, wherever the
/// motion turns by more than 0.1 rad, and where rapid and feed meet; it takes the mean force of a
/// revolution, the feed as that of the corner's centre (of a flat end mill: of half its flank).
/// Turning looks once a revolution.
/// A rapid, or the shank, that takes material is a crash. Empty for a scene without [cutting].
/// @param design_m  the part in its own frame, for a blank that is its offset
/// @throws BadInput naming the scene or the program line: a blank that cannot be, too many dexels,
/// a
///         cut with a spindle that stands still or turns the other way, a feed per tooth beyond the
///         cutter's radius
Process follow(const Scene& scene, const Machine& machine, const cutting::Design& design_m,
               const FollowedProgram& program, const std::function<void(double)>& progress = {});

/// Sums and largest values over the steps of a process.
struct ProcessTotals {
  double removed = 0.0;     ///< mm^3
  double force_max = 0.0;   ///< N
  double force_sum = 0.0;   ///< N, over the loaded steps
  std::size_t loaded = 0;   ///< steps with a force
  double torque_max = 0.0;  ///< N mm
  double power_max_W = 0.0;
  int iterations_max = 0;
  double contraction_max = 0.0;
  std::size_t open = 0;           ///< steps that did not converge
  double disagreement_max = 0.0;  ///< mm, over those
};
ProcessTotals totals(const Process& process);

/// Load at an instant: linear between two steps, zero before the first and after the last.
errors::Load load_at(const Process& process, double time_s);

/// Accelerations of the axes at every sample, mm/s^2 and rad/s^2: the mean speed over the 20 ms
/// after less that over the 20 ms before, per 20 ms, since blocks meet at corners. @return
/// (samples)
std::vector<kinematics::AxisVector> accelerations(const program::Samples& samples);

}  // namespace abbe::sim
