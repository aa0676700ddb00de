#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "cutting/surface/removal.h"
#include "cutting/surface/surface.h"
#include "kinematics/chain.h"
#include "kinematics/units.h"
#include "sim/cut/job.h"

namespace abbe::sim {

/// A tool, where a program takes it, and the chain whose part turns under a turning tool.
struct ToolSweep {
  const std::variant<cutting::Cutter, cutting::Nose>& tool;
  const program::Samples& samples;
  const std::vector<kinematics::Pose>& T_wt;  ///< (samples)
  const kinematics::Chain& chain;
  std::optional<int> workpiece_spindle;  ///< joint; of a turning tool
};

/// The sweeps of one or several tools through the workpiece, made once and asked for the surface
/// that they leave of any design: the least of all, as `cutting::combined_surface`.
struct Sweep {
  std::function<cutting::Surface(const cutting::Design& design_w)> surface;
  std::function<cutting::PassGradients(const cutting::Design& design_w,
                                       const cutting::Surface& surface)>
      contacts;
};

/// @param sweeps  one at least, one after the other in time; what they refer to outlives the result
Sweep sweep_of(std::vector<ToolSweep> sweeps, const cutting::SurfaceOptions& options);

/// The surface that sweeps leave of one design.
cutting::Surface machined_surface(const cutting::Design& design_w,
                                  const std::vector<ToolSweep>& sweeps,
                                  const cutting::SurfaceOptions& options);

/// A window of a program with where the tool is in it.
struct SweptWindow {
  program::Samples samples;
  std::vector<kinematics::Pose> T_wt;  ///< (samples)
};

/// The sweep of one milling tool through windows, each made as often as it is wanted: the surface
/// takes one pass through all, a second one where a vertex is uncut or gouged, and the contacts
/// one.
/// @param window  each begins where the one before ends
Sweep sweep_in_windows(const cutting::Cutter& cutter, std::size_t windows,
                       const std::function<SweptWindow(std::size_t number)>& window,
                       const cutting::SurfaceOptions& options);

/// The program of a job on the error-free machine, a sweep for each of its parts. They refer to the
/// job.
/// @throws as `parts_of`
std::vector<ToolSweep> error_free_sweeps(const Job& job);

/// The same of a part of a job.
ToolSweep segment_error_free_sweep(const Job& part);

/// All of it, in windows where the job is. It refers to the job.
Sweep error_free_sweep(const Job& job, const cutting::SurfaceOptions& options);

/// The band of the scene, and progress under the name of the stage "surface".
cutting::SurfaceOptions options_of(const Job& job, const Progress& progress);

// How far tool and part reach in the coordinates in which they are held against each other: x y z
// of the part's frame; of a turned part along the spindle and from it.

/// What lies between two values of a coordinate, and the program lines that reach them.
struct Span {
  double low = infinity, high = -infinity;  // mm
  int low_line = 0, high_line = 0;

  void extend(double least, double most, int line);
  double middle() const { return 0.5 * (low + high); }
  double size() const { return high - low; }
};
using Spans = std::array<Span, 3>;  ///< the third is empty of a turned part

/// What a program sweeps on the error-free machine.
struct SweptSpans {
  Spans all, feed;  ///< with the whole cutter; `feed` is `all` where nothing feeds
  Spans tip;        ///< of the tip alone, in feed
};
SweptSpans swept_spans(const Job& job);

/// Of the judged vertices.
Spans part_spans(const Job& job);

/// The coordinate in which a tool keeps farthest from a part, and by how much.
struct ClosestGap {
  double gap = -infinity;  ///< mm, negative where they overlap
  int line = 0;            ///< that comes nearest
  std::string words;       ///< "the lowest cut lies 80.0 mm above the part"
};
ClosestGap closest_gap(const Job& job, const Spans& part, const Spans& tool);

/// Along the spindle, and from it.
std::array<double, 2> spindle_coordinates(const Job& job, const Eigen::Vector3d& p_w);

}  // namespace abbe::sim
