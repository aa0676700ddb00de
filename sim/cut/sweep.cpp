#include "sim/cut/sweep.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>

#include <fmt/format.h>

#include "cutting/surface/machined_surface.h"
#include "sim/cut/tool_motion.h"

namespace abbe::sim {

namespace {

using cutting::Cutter;
using cutting::Design;
using cutting::PassGradients;
using cutting::Surface;
using cutting::SurfaceOptions;
using cutting::VertexStatus;

cutting::NoseMotion sweep_nose_motion(const ToolSweep& sweep) {
  const int spindle = *sweep.workpiece_spindle;
  return nose_motion(sweep.T_wt, sweep.samples, spindle_line(sweep.chain, spindle), spindle);
}

Sweep single_tool_sweep(const ToolSweep& sweep, const SurfaceOptions& options) {
  if (const auto* cutter = std::get_if<Cutter>(&sweep.tool)) {
    const auto motion =
        std::make_shared<const cutting::CutterMotion>(cutter_motion(sweep.T_wt, sweep.samples));
    return {[motion, search = cutting::prepare_milled_surface(*cutter, *motion, options)](
                const Design& design_w) { return search(design_w); },
            [motion, cutter = *cutter](const Design& design_w, const Surface& surface) {
              return cutting::milled_gradients(design_w, surface, cutter, *motion);
            }};
  }
  const auto& nose = std::get<cutting::Nose>(sweep.tool);
  const auto motion = std::make_shared<const cutting::NoseMotion>(sweep_nose_motion(sweep));
  return {[motion, search = cutting::prepare_turned_surface(nose, *motion, options)](
              const Design& design_w) { return search(design_w); },
          [motion, nose](const Design& design_w, const Surface& surface) {
            return cutting::turned_gradients(design_w, surface, nose, *motion);
          }};
}

/// Returns the surface with only those cuts that are within the time of a sweep.
Surface restrict_to_sweep(Surface surface, const program::Samples& samples) {
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    const double time_s = surface.cut_time_s[Eigen::Index(i)];
    const bool is_during = !samples.states.empty() && time_s >= samples.states.front().time_s &&
                           time_s <= samples.states.back().time_s;
    if (!is_during && surface.status[i] == VertexStatus::Cut)
      surface.status[i] = VertexStatus::Uncut;
  }
  return surface;
}

// NaN marks a vertex without contact.
PassGradients no_contacts(const Design& design_w) {
  const Eigen::Index n = design_w.vertices.rows();
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  return {cutting::Points::Constant(n, 3, nan), Eigen::VectorXd::Constant(n, nan)};
}

/// Adds the contacts of a later sweep at vertices that have none yet.
/// @param previous_travel  path length of the tools before it, mm
/// @return the largest path length, mm
double add_contacts(PassGradients& contacts, const PassGradients& additional,
                    double previous_travel) {
  double max_travel = previous_travel;
  for (Eigen::Index vertex = 0; vertex < contacts.travel.size(); ++vertex) {
    if (std::isnan(additional.travel[vertex]) || !std::isnan(contacts.travel[vertex])) continue;
    contacts.gradient.row(vertex) = additional.gradient.row(vertex);
    contacts.travel[vertex] = previous_travel + additional.travel[vertex];
    max_travel = std::max(max_travel, contacts.travel[vertex]);
  }
  return max_travel;
}

/// The sweep of one of several tools.
struct SweepOfSeveral {
  cutting::SurfaceFunction surface;
  /// Returns the contacts of this tool at the vertices that it has cut.
  std::function<PassGradients(const Design& design_w, const Surface& surface)> contacts;
};

/// Returns the contact at each vertex with the tool that has cut it. The path length of each tool
/// continues that of the tool before.
PassGradients joined_contacts(const Design& design_w, const Surface& surface,
                              const std::vector<SweepOfSeveral>& sweeps) {
  constexpr double between_tools = 1e6;  // mm of path length, so that two tools never share a pass
  PassGradients merged = no_contacts(design_w);
  double previous_travel = 0.0;
  for (const SweepOfSeveral& sweep : sweeps)
    previous_travel =
        add_contacts(merged, sweep.contacts(design_w, surface), previous_travel) + between_tools;
  return merged;
}

/// Returns the sweep of several tools.
Sweep combined(std::vector<SweepOfSeveral> sweeps, double band) {
  std::vector<cutting::SurfaceFunction> surfaces;
  for (const SweepOfSeveral& sweep : sweeps) surfaces.push_back(sweep.surface);
  return {[surfaces, band](const Design& design_w) {
            return cutting::combined_surface(design_w, surfaces, band);
          },
          [sweeps = std::move(sweeps)](const Design& design_w, const Surface& surface) {
            return joined_contacts(design_w, surface, sweeps);
          }};
}

/// Returns the options for one of several tools, which reports its part of the progress.
SurfaceOptions options_of_tool(const SurfaceOptions& options, std::size_t tool, std::size_t tools) {
  SurfaceOptions result{.band = options.band, .progress = {}, .body = options.body};
  if (options.progress)
    result.progress = [progress = options.progress, tool, tools](double fraction) {
      progress((double(tool) + fraction) / double(tools));
    };
  return result;
}

}  // namespace

Sweep make_sweep(std::vector<ToolSweep> sweeps, const SurfaceOptions& options) {
  if (sweeps.size() == 1) return single_tool_sweep(sweeps.front(), options);
  std::vector<SweepOfSeveral> several;
  for (std::size_t i = 0; i < sweeps.size(); ++i) {
    const Sweep prepared = single_tool_sweep(sweeps[i], options_of_tool(options, i, sweeps.size()));
    // A search for gouges with a wider band is rare, so only the default band is prepared.
    several.push_back(
        {[prepared = prepared.surface, sweep = sweeps[i], default_band = options.band](
             const Design& design_w, double band) {
           if (band == default_band) return prepared(design_w);
           return single_tool_sweep(sweep, {.band = band, .progress = {}}).surface(design_w);
         },
         [contacts = prepared.contacts, &samples = sweeps[i].samples](const Design& design_w,
                                                                      const Surface& surface) {
           return contacts(design_w, restrict_to_sweep(surface, samples));
         }});
  }
  return combined(std::move(several), options.band);
}

cutting::Surface machined_surface(const Design& design_w, const std::vector<ToolSweep>& sweeps,
                                  const SurfaceOptions& options) {
  return make_sweep(sweeps, options).surface(design_w);
}

namespace {

/// Returns the sweep of one tool through windows.
Sweep windowed_sweep(const WindowedTool& tool,
                     const std::function<SweptWindow(std::size_t number)>& window,
                     const SurfaceOptions& options) {
  const Cutter& cutter = tool.cutter;
  const WindowRange range = tool.windows;
  const auto begin = [=]() -> cutting::MotionBlocks {
    return [=, next = range.first]() mutable -> std::optional<cutting::MotionBlock> {
      if (next == range.last) return std::nullopt;
      const SweptWindow swept = window(next++);
      return cutting::MotionBlock{cutter_motion(swept.T_wt, swept.samples),
                                  double(next - range.first) / double(range.last - range.first)};
    };
  };
  const auto contacts = [=](const Design& design_w, const Surface& surface) {
    PassGradients merged = no_contacts(design_w);
    double previous_travel = 0.0;
    for (std::size_t k = range.first; k < range.last; ++k) {
      const SweptWindow swept = window(k);
      const cutting::CutterMotion motion = cutter_motion(swept.T_wt, swept.samples);
      const Surface window_surface = restrict_to_sweep(surface, swept.samples);
      add_contacts(
          merged,
          cutting::milled_gradients(design_w, window_surface, cutter, motion, previous_travel),
          0.0);
      // Path lengths continue from window to window, as in a sweep of the whole program.
      previous_travel = cutting::path_lengths(motion, previous_travel).tail(1).value();
    }
    return merged;
  };
  return {[=](const Design& design_w) {
            return cutting::streamed_surface(design_w, cutter, begin, options);
          },
          contacts};
}

}  // namespace

Sweep sweep_in_windows(const std::vector<WindowedTool>& tools,
                       const std::function<SweptWindow(std::size_t number)>& window,
                       const SurfaceOptions& options) {
  if (tools.size() == 1) return windowed_sweep(tools.front(), window, options);
  std::vector<SweepOfSeveral> several;
  for (std::size_t i = 0; i < tools.size(); ++i) {
    const Sweep sweep = windowed_sweep(tools[i], window, options_of_tool(options, i, tools.size()));
    several.push_back(
        {[sweep = sweep.surface, tool = tools[i], window, default_band = options.band](
             const Design& design_w, double band) {
           if (band == default_band) return sweep(design_w);
           return windowed_sweep(tool, window, {.band = band, .progress = {}}).surface(design_w);
         },
         sweep.contacts});
  }
  return combined(std::move(several), options.band);
}

std::vector<WindowedTool> windowed_tools(
    const Job& job, const std::variant<cutting::Cutter, cutting::Nose> ToolDescription::*shape) {
  std::vector<WindowedTool> tools;
  const std::vector<WindowRange> ranges = window_ranges(job);
  const auto segments = tool_segments(job);
  for (std::size_t i = 0; i < ranges.size(); ++i)
    if (ranges[i].first < ranges[i].last)
      tools.push_back({std::get<Cutter>(segments[i].scene.tool.*shape), ranges[i]});
  return tools;
}

ToolSweep segment_error_free_sweep(const Segment& segment) {
  return {segment.scene.tool.nominal,
          segment.samples,
          segment.T_wt_nominal,
          segment.machine.nominal,
          segment.machine.workpiece_spindle,
          segment.path};
}

Sweep error_free_sweep(const Job& job, const SurfaceOptions& options) {
  if (!job.windows) return make_sweep(error_free_sweeps(job), options);
  return sweep_in_windows(
      windowed_tools(job, &ToolDescription::nominal),
      [&job](std::size_t number) {
        Segment window = make_window(job, number);
        return SweptWindow{std::move(window.samples), std::move(window.T_wt_nominal),
                           std::move(window.path)};
      },
      options);
}

std::vector<ToolSweep> error_free_sweeps(const Job& job) {
  std::vector<ToolSweep> sweeps;
  for (const Segment& part : job_segments(job)) sweeps.push_back(segment_error_free_sweep(part));
  return sweeps;
}

SurfaceOptions surface_options(const Job& job, const Progress& progress) {
  SurfaceOptions options{.band = job.scene.band, .progress = {}, .body = job.body_w};
  if (progress) options.progress = [progress](double fraction) { progress("surface", fraction); };
  return options;
}

namespace {

using Eigen::Vector3d;
using kinematics::Pose;

/// The texts for a gap on either side in a coordinate.
struct Coordinate {
  const char* below;
  const char* above;
};
using Coordinates = std::array<Coordinate, 3>;

constexpr Coordinates milled_texts = {
    {{"the nearest cut is {:.1f} mm away from the part, on its -x side",
      "the nearest cut is {:.1f} mm away from the part, on its +x side"},
     {"the nearest cut is {:.1f} mm away from the part, on its -y side",
      "the nearest cut is {:.1f} mm away from the part, on its +y side"},
     {"the highest cut is {:.1f} mm below the part",
      "the lowest cut is {:.1f} mm above the part"}}};
constexpr Coordinates turned_texts = {
    {{"the nearest cut is {:.1f} mm before the part along the spindle",
      "the nearest cut is {:.1f} mm beyond the part along the spindle"},
     {"the largest radius cut is {:.1f} mm below the part's smallest radius",
      "the smallest radius cut is {:.1f} mm above the part's largest radius"},
     {"", ""}}};

bool is_milled(const Job& job) {
  return std::holds_alternative<cutting::Cutter>(job.scene.tool.nominal);
}

/// Returns the position of the outermost point of a cutter along a direction, mm.
/// @param T  tool in the frame of the direction
double reach_along(const cutting::Cutter& cutter, const Pose& T, const Vector3d& direction) {
  const Vector3d axis = T.linear().col(2);
  return direction.dot(T.translation()) +
         cutting::support(cutter, direction.dot(axis), direction.cross(axis).norm());
}

/// The range of the tool at one pose in a coordinate, and the position of its tip.
struct PoseRange {
  double low, high, tip;
};

PoseRange tool_range(const cutting::Cutter& cutter, const Pose& T_mt, int k) {
  return {-reach_along(cutter, T_mt, -Vector3d::Unit(k)),
          reach_along(cutter, T_mt, Vector3d::Unit(k)), T_mt.translation()[k]};
}

void extend(SweptSpans& swept, std::size_t k, const PoseRange& range, int line, bool in_feed) {
  swept.all[k].extend(range.low, range.high, line);
  if (!in_feed) return;
  swept.feed[k].extend(range.low, range.high, line);
  swept.tip[k].extend(range.tip, range.tip, line);
}

}  // namespace

void Span::extend(double lower, double upper, int line) {
  if (lower < low) low_line = line;
  if (upper > high) high_line = line;
  low = std::min(low, lower);
  high = std::max(high, upper);
}

namespace {

/// Returns the coordinates of a point along the spindle and radially, mm.
std::array<double, 2> spindle_coordinates(const Job& job, const Vector3d& p_w) {
  const SpindleLine line = spindle_line(job.machine.nominal, *job.machine.workpiece_spindle);
  const double along = line.direction_w.dot(p_w - line.point_w);
  return {along, (p_w - line.point_w - along * line.direction_w).norm()};
}

/// Returns the distance from the centre of an edge to its outermost point along a direction, mm.
/// @param R  rotation of frame t
double reach_along(const cutting::Nose& nose, const Eigen::Matrix3d& R, const Vector3d& direction) {
  if (!nose.profile) return nose.radius;
  const Eigen::Vector2d direction_t(R.col(0).dot(direction), R.col(2).dot(direction));
  return direction_t.dot(cutting::extreme_point(*nose.profile, direction_t));
}

/// Returns the ranges of the tool at one pose along the spindle and radially.
std::array<PoseRange, 2> tool_range(const cutting::Nose& nose, const SpindleLine& line,
                                    const Pose& T_wt) {
  const Vector3d lever = T_wt.translation() - line.point_w;
  const double along = line.direction_w.dot(lever);
  const Vector3d radial = lever - along * line.direction_w;
  const std::array<double, 2> position{along, radial.norm()};
  // `stableNormalized` returns zero for the zero vector of a tool on the spindle axis.
  const std::array<Vector3d, 2> directions{line.direction_w, radial.stableNormalized()};
  std::array<PoseRange, 2> ranges;
  for (std::size_t k = 0; k < 2; ++k)
    ranges[k] = {position[k] - reach_along(nose, T_wt.linear(), -directions[k]),
                 position[k] + reach_along(nose, T_wt.linear(), directions[k]), position[k]};
  return ranges;
}

/// Extends ranges by the poses of a segment.
/// @param has_feed  false: no block of the job feeds, and every move counts as feed
void extend(SweptSpans& swept, const Segment& segment, bool has_feed) {
  const auto* cutter = std::get_if<cutting::Cutter>(&segment.scene.tool.nominal);
  const auto* nose = std::get_if<cutting::Nose>(&segment.scene.tool.nominal);
  std::optional<SpindleLine> spindle;
  if (nose != nullptr)
    spindle = spindle_line(segment.machine.nominal, *segment.machine.workpiece_spindle);
  const Pose T_mw = segment.scene.part.T_wm.inverse();
  const std::size_t sample_count = segment.T_wt_nominal.size();
  const auto is_feed_sample_at = [&](std::size_t i) {
    return is_feed_sample(segment.path, segment.samples, i);
  };
  for (std::size_t i = 0; i < sample_count; ++i) {
    // A feed begins at the last sample of the block before it.
    const bool is_feed_start =
        has_feed && !is_feed_sample_at(i) && i + 1 < sample_count && is_feed_sample_at(i + 1);
    const bool in_feed = !has_feed || is_feed_start || is_feed_sample_at(i);
    const int line = segment.samples.line[is_feed_start ? i + 1 : i];
    if (cutter != nullptr) {
      const Pose T_mt = T_mw * segment.T_wt_nominal[i];
      for (int k = 0; k < 3; ++k)
        extend(swept, std::size_t(k), tool_range(*cutter, T_mt, k), line, in_feed);
    } else {
      const auto ranges = tool_range(*nose, *spindle, segment.T_wt_nominal[i]);
      for (std::size_t k = 0; k < 2; ++k) extend(swept, k, ranges[k], line, in_feed);
    }
  }
}

}  // namespace

SweptSpans swept_spans(const Job& job) {
  const bool has_feed =
      std::any_of(job.path.blocks.begin(), job.path.blocks.end(), program::is_feed);
  SweptSpans swept;
  visit_segments(job, [&](const Segment& segment) { extend(swept, segment, has_feed); });
  return swept;
}

Spans part_spans(const Job& job) {
  const Pose T_mw = job.scene.part.T_wm.inverse();
  const cutting::Design& design_w = job.design_w;
  Spans spans;
  for (Eigen::Index i = 0; i < design_w.vertices.rows(); ++i) {
    if (!design_w.judged.empty() && !design_w.judged[std::size_t(i)]) continue;
    const Vector3d p_w = design_w.vertices.row(i);
    if (is_milled(job)) {
      const Vector3d p_m = T_mw * p_w;
      for (int k = 0; k < 3; ++k) spans[std::size_t(k)].extend(p_m[k], p_m[k], 0);
    } else {
      const auto coordinates = spindle_coordinates(job, p_w);
      for (std::size_t k = 0; k < 2; ++k) spans[k].extend(coordinates[k], coordinates[k], 0);
    }
  }
  return spans;
}

ClosestGap closest_gap(const Job& job, const Spans& part, const Spans& tool) {
  const Coordinates& texts = is_milled(job) ? milled_texts : turned_texts;
  ClosestGap largest;
  for (std::size_t k = 0; k < part.size(); ++k) {
    const double above = tool[k].low - part[k].high, below = part[k].low - tool[k].high;
    const bool is_above = above > below;
    const double gap = std::max(above, below);
    // An empty range, as without feed or in the third coordinate of turning, is infinite.
    if (!(gap > largest.gap) || !std::isfinite(gap)) continue;
    largest = {gap, is_above ? tool[k].low_line : tool[k].high_line,
               fmt::format(fmt::runtime(is_above ? texts[k].above : texts[k].below), gap)};
  }
  return largest;
}

}  // namespace abbe::sim
