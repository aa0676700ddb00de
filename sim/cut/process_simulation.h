#pragma once

#include <cstddef>
#include <functional>
#include <optional>
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

/// Simulation of the cutting process: the blank, the steps at which it is cut, and the loop of
/// force and deflection.
namespace abbe::sim {

/// Returns the blank of a scene with [cutting], for milling.
/// @param design_m  the part in its own frame, for a blank that is its offset
/// @throws std::invalid_argument if the blank is not valid
/// @throws BadInput if a mesh file cannot be read or is not closed
cutting::Blank make_blank(const Scene& scene, const cutting::Design& design_m);

/// Returns a blank as dexels.
/// @throws std::invalid_argument if the blank is not valid, std::length_error if it exceeds its
///     memory
cutting::Stock blank_stock(const Scene& scene, const cutting::Blank& blank);

/// Returns true if a sample belongs to a rapid.
bool is_rapid(const program::Samples& samples, const program::Path& path, std::size_t sample);

/// Returns the samples between which milling removes material: after every `step` (mm) of travel of
/// the tip plus the rotation of a point `reach` (mm) above it, wherever the motion turns by more
/// than 0.1 rad, and where rapid and feed meet. The first is 0, the last the last sample.
/// @param T_wt        (samples)
/// @param continues    true if further samples follow: then the last one is not a step for being
///     last
/// @param from_travel  travel from sample 0 to sample 1, mm, if it is longer than the line between
///     them because samples were left out
std::vector<std::size_t> milling_steps(const program::Samples& samples, const program::Path& path,
                                       const std::vector<kinematics::Pose>& T_wt, double step,
                                       double reach, bool continues = false,
                                       const std::optional<double>& from_travel = {});

/// Returns the turned blank of a scene with [cutting] about a spindle axis.
/// @throws std::invalid_argument if the blank is of another kind or not valid, std::length_error if
///     it has too many nodes
cutting::TurnedStock turned_blank(const Scene& scene, const SpindleLine& line);

/// Returns the samples between which turning removes material: once a revolution, where rapid and
/// feed meet, and after every 0.1 mm of travel of a rapid or with the spindle at rest. The first is
/// 0.
/// @param T_wt     (samples)
/// @param spindle  joint that turns the workpiece, about `line`
std::vector<std::size_t> turning_steps(const program::Samples& samples, const program::Path& path,
                                       const std::vector<kinematics::Pose>& T_wt, int spindle,
                                       const SpindleLine& line);

/// Returns the pose of the tool at a sample under a cutting load.
using PoseUnderLoad = std::function<kinematics::Pose(std::size_t sample, const errors::Load&)>;

/// A program on a machine.
struct FollowedProgram {
  const program::Samples& samples;
  const program::Path& path;                  ///< program of the samples
  const std::vector<kinematics::Pose>& T_wt;  ///< (samples) nominal poses, for the feed
  PoseUnderLoad pose;                         ///< actual poses
  const kinematics::Chain& chain;             ///< whose spindle axis turns the part
  const std::variant<cutting::Cutter, cutting::Nose>& tool;
  bool is_continued = false;  ///< true if the process before it ends at its first sample
  bool continues = false;     ///< true if further samples of the same tool follow
  std::optional<double> from_travel = {};  ///< as for `milling_steps`
};

/// Simulates the cut. The engagement gives the force, which displaces the tool, which then has
/// another engagement, and so on until force and deflection agree; the first guess is the load of
/// the step before. Milling is evaluated after every `step` of travel of the tip plus rotation of
/// the flank, wherever the motion turns by more than 0.1 rad, and where rapid and feed meet. It
/// uses the mean force of a revolution, and the feed of the centre of the corner, or of the middle
/// of the flank of a flat end mill. Turning is evaluated once a revolution. A rapid, or the shank,
/// that removes material is a crash. Empty for a scene without [cutting].
/// @param design_m  the part in its own frame, for a blank that is its offset
/// @param before    has the stock that the tools before have left, or without one the blank is cut;
///     of a continued program it is the process so far, to which the steps are appended
/// @throws BadInput naming the scene or the program line: a blank that is not valid, too many
///     dexels, a cut with a spindle at rest or in the wrong direction, or a feed per tooth larger
///     than the radius of the cutter
Process simulate_process(const Scene& scene, const Machine& machine,
                         const cutting::Design& design_m, const FollowedProgram& program,
                         const std::function<void(double)>& progress = {}, Process before = {});

/// The samples of a program that comes in windows: those of a window behind the last step and the
/// last sample of the windows before.
class CarriedSamples {
 public:
  /// Appends a window. A continued window begins with the last sample of the one before.
  void add(const FollowedProgram& window);
  /// Keeps a step and the last sample, with the travel between them.
  /// @param step   a sample
  /// @param reach  as for `milling_steps`
  void keep(std::size_t step, double reach);

  program::Samples samples;
  program::Path path;  ///< with the blocks of the samples, of which those before the window have
                       ///< only feed or rapid
  std::vector<kinematics::Pose> T_wt;  ///< (samples)
  std::optional<double> travel;        ///< from sample 0 to sample 1, as for `milling_steps`
  std::vector<std::size_t> numbers;    ///< (samples) in the whole program of the tool
};

/// Simulates the milling of a program that comes in windows. Its steps are those of the whole
/// program: the last step of a window and its last sample are kept for the next window.
class WindowedProcess {
 public:
  /// Returns the actual pose of the tool at a state under a load.
  using PoseAt = std::function<kinematics::Pose(
      const kinematics::AxisState& state, const kinematics::Pose& T_wt, const errors::Load& load)>;

  /// @param before  has the stock that the tools before have left; without one the blank is cut
  explicit WindowedProcess(Process before) : process_(std::move(before)) {}

  /// Simulates a window.
  /// @param window  whose poses are those of `pose`
  void add(const Scene& scene, const Machine& machine, const cutting::Design& design_m,
           const FollowedProgram& window, const PoseAt& pose,
           const std::function<void(double)>& progress = {});
  Process take() { return std::move(process_); }

 private:
  Process process_;
  CarriedSamples carried_;
};

}  // namespace abbe::sim
