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

/// The sweep of a program's tools through the workpiece, and the extents of tool and part.
namespace abbe::sim {

/// The motion of one tool, and the chain that turns the part under a turning tool.
struct ToolSweep {
  const std::variant<cutting::Cutter, cutting::Nose>& tool;
  const program::Samples& samples;
  const std::vector<kinematics::Pose>& T_wt;  ///< (samples)
  const kinematics::Chain& chain;
  std::optional<int> workpiece_spindle;  ///< joint, for a turning tool
  const program::Path& path;             ///< with the blocks of the samples
};

/// The sweep of one or several tools through the workpiece. It is prepared once and gives the
/// surface on any design: the minimum over all tools, as by `cutting::combined_surface`.
struct Sweep {
  std::function<cutting::Surface(const cutting::Design& design_w)> surface;
  std::function<cutting::PassGradients(const cutting::Design& design_w,
                                       const cutting::Surface& surface)>
      contacts;
};

/// Prepares the sweeps of tools.
/// @param sweeps  at least one, in order of time; their references must outlive the result
Sweep make_sweep(std::vector<ToolSweep> sweeps, const cutting::SurfaceOptions& options);

/// Returns the surface that sweeps leave on one design.
cutting::Surface machined_surface(const cutting::Design& design_w,
                                  const std::vector<ToolSweep>& sweeps,
                                  const cutting::SurfaceOptions& options);

/// A window of a program with the poses of the tool.
struct SweptWindow {
  program::Samples samples;
  std::vector<kinematics::Pose> T_wt;  ///< (samples)
  program::Path path = {};             ///< with the blocks of the samples
};

/// A milling tool and its windows, [first, last).
struct WindowedTool {
  const cutting::Cutter& cutter;
  WindowRange windows;
};

/// Returns the tools of a job in windows, by their nominal or actual shape. They refer to the job.
std::vector<WindowedTool> windowed_tools(
    const Job& job, const std::variant<cutting::Cutter, cutting::Nose> ToolDescription::*shape);

/// Returns the sweep of milling tools through windows. Each window is made once for the surface,
/// again if a vertex is uncut or gouged, and once for the contacts.
/// @param tools   in order of time
/// @param window  returns a window; except for the first of its tool it begins with the last sample
///     of the one before
Sweep sweep_in_windows(const std::vector<WindowedTool>& tools,
                       const std::function<SweptWindow(std::size_t number)>& window,
                       const cutting::SurfaceOptions& options);

/// Returns the sweeps of the segments of a job on the error-free machine. They refer to the job.
/// @throws std::logic_error as `job_segments`
std::vector<ToolSweep> error_free_sweeps(const Job& job);

/// Returns the error-free sweep of a segment.
ToolSweep segment_error_free_sweep(const Segment& segment);

/// Returns the error-free sweep of a whole job, in windows if the job has windows. It refers to the
/// job.
Sweep error_free_sweep(const Job& job, const cutting::SurfaceOptions& options);

/// Returns the options with the band of the scene, and progress as stage "surface".
cutting::SurfaceOptions surface_options(const Job& job, const Progress& progress);

// Extents of tool and part are compared in x y z of the part frame; those of a turned part along
// the spindle and radially.

/// A range of a coordinate, with the program lines that reach its ends.
struct Span {
  double low = infinity, high = -infinity;  // mm
  int low_line = 0, high_line = 0;

  /// Extends the range to contain [lower, upper], which the program reaches on a line.
  void extend(double lower, double upper, int line);
  double middle() const { return 0.5 * (low + high); }
  double size() const { return high - low; }
};
using Spans = std::array<Span, 3>;  ///< the third is empty for a turned part

/// The ranges that a program sweeps on the error-free machine.
struct SweptSpans {
  Spans all, feed;  ///< of the whole cutter; `feed` equals `all` if nothing feeds
  Spans tip;        ///< of the tip alone, in feed
};
/// Returns the ranges swept by a job.
SweptSpans swept_spans(const Job& job);

/// Returns the ranges of the judged vertices.
Spans part_spans(const Job& job);

/// The coordinate with the largest gap between tool and part.
struct ClosestGap {
  double gap = -infinity;  ///< mm, negative if they overlap
  int line = 0;            ///< program line that comes nearest
  std::string words;       ///< text such as "the lowest cut lies 80.0 mm above the part"
};
/// Returns the largest gap between the ranges of part and tool.
ClosestGap closest_gap(const Job& job, const Spans& part, const Spans& tool);

}  // namespace abbe::sim
