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
    return {[motion, search = cutting::milled_search(*cutter, *motion, options)](
                const Design& design_w) { return search(design_w); },
            [motion, cutter = *cutter](const Design& design_w, const Surface& surface) {
              return cutting::milled_gradients(design_w, surface, cutter, *motion);
            }};
  }
  const auto& nose = std::get<cutting::Nose>(sweep.tool);
  const auto motion = std::make_shared<const cutting::NoseMotion>(sweep_nose_motion(sweep));
  return {[motion, search = cutting::turned_search(nose, *motion, options)](
              const Design& design_w) { return search(design_w); },
          [motion, nose](const Design& design_w, const Surface& surface) {
            return cutting::turned_gradients(design_w, surface, nose, *motion);
          }};
}

/// Returns the surface with only those cuts that fall into the time of a sweep.
Surface cut_during(Surface surface, const program::Samples& samples) {
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    const double time_s = surface.cut_time_s[Eigen::Index(i)];
    const bool during = !samples.states.empty() && time_s >= samples.states.front().time_s &&
                        time_s <= samples.states.back().time_s;
    if (!during && surface.status[i] == VertexStatus::Cut) surface.status[i] = VertexStatus::Uncut;
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
/// @param before  mm, path length of the tools before it
/// @return the largest path length, mm
double add_contacts(PassGradients& all, const PassGradients& more, double before) {
  double most = before;
  for (Eigen::Index v = 0; v < all.travel.size(); ++v) {
    if (std::isnan(more.travel[v]) || !std::isnan(all.travel[v])) continue;
    all.gradient.row(v) = more.gradient.row(v);
    all.travel[v] = before + more.travel[v];
    most = std::max(most, all.travel[v]);
  }
  return most;
}

/// Returns the contact at each vertex with the tool that cut there; the path lengths of the tools
/// follow one another.
PassGradients joined_contacts(const Design& design_w, const Surface& surface,
                              const std::vector<ToolSweep>& sweeps,
                              const std::vector<Sweep>& ones) {
  constexpr double between_tools = 1e6;  // mm: separates the path lengths, so that no two tools
                                         // seem to cut in one pass
  PassGradients all = no_contacts(design_w);
  double before = 0.0;
  for (std::size_t k = 0; k < ones.size(); ++k) {
    const PassGradients one = ones[k].contacts(design_w, cut_during(surface, sweeps[k].samples));
    before = add_contacts(all, one, before) + between_tools;
  }
  return all;
}

}  // namespace

Sweep sweep_of(std::vector<ToolSweep> sweeps, const SurfaceOptions& options) {
  // One sweep needs no combination.
  if (sweeps.size() == 1) return single_tool_sweep(sweeps.front(), options);
  std::vector<Sweep> ones;
  for (std::size_t i = 0; i < sweeps.size(); ++i) {
    SurfaceOptions own{.band = options.band, .progress = {}, .body = options.body};
    if (options.progress)
      own.progress = [progress = options.progress, i, n = sweeps.size()](double fraction) {
        progress((double(i) + fraction) / double(n));
      };
    ones.push_back(single_tool_sweep(sweeps[i], own));
  }
  std::vector<cutting::SurfaceFunction> surfaces;
  for (std::size_t i = 0; i < sweeps.size(); ++i)
    // Only the usual band is prepared; a search for gouges with a wider band is rare and made anew.
    surfaces.push_back([prepared = ones[i].surface, sweep = sweeps[i], usual = options.band](
                           const Design& design_w, double band) {
      if (band == usual) return prepared(design_w);
      return single_tool_sweep(sweep, {.band = band, .progress = {}}).surface(design_w);
    });
  return {[surfaces, band = options.band](const Design& design_w) {
            return cutting::combined_surface(design_w, surfaces, band);
          },
          [sweeps = std::move(sweeps), ones](const Design& design_w, const Surface& surface) {
            return joined_contacts(design_w, surface, sweeps, ones);
          }};
}

cutting::Surface machined_surface(const Design& design_w, const std::vector<ToolSweep>& sweeps,
                                  const SurfaceOptions& options) {
  return sweep_of(sweeps, options).surface(design_w);
}

Sweep sweep_in_windows(const Cutter& cutter, std::size_t windows,
                       const std::function<SweptWindow(std::size_t number)>& window,
                       const SurfaceOptions& options) {
  const auto motion_in = [window](std::size_t number) {
    const SweptWindow one = window(number);
    return cutter_motion(one.T_wt, one.samples);
  };
  const auto begin = [=]() -> cutting::MotionBlocks {
    return [=, next = std::size_t(0)]() mutable -> std::optional<cutting::MotionBlock> {
      if (next == windows) return std::nullopt;
      cutting::CutterMotion motion = motion_in(next++);
      return cutting::MotionBlock{std::move(motion), double(next) / double(windows)};
    };
  };
  const auto contacts = [=](const Design& design_w, const Surface& surface) {
    PassGradients all = no_contacts(design_w);
    double before = 0.0;
    for (std::size_t k = 0; k < windows; ++k) {
      const SweptWindow one = window(k);
      const cutting::CutterMotion motion = cutter_motion(one.T_wt, one.samples);
      const Surface during = cut_during(surface, one.samples);
      add_contacts(all, cutting::milled_gradients(design_w, during, cutter, motion, before), 0.0);
      // path lengths continue from window to window, as in the sweep of the whole
      before = cutting::way_of(motion, before).tail(1).value();
    }
    return all;
  };
  return {[=](const Design& design_w) {
            return cutting::streamed_surface(design_w, cutter, begin, options);
          },
          contacts};
}

ToolSweep segment_error_free_sweep(const Job& part) {
  return {part.scene.tool.nominal, part.samples, part.T_wt_nominal, part.machine.nominal,
          part.machine.workpiece_spindle};
}

Sweep error_free_sweep(const Job& job, const SurfaceOptions& options) {
  if (!job.windows) return sweep_of(error_free_sweeps(job), options);
  return sweep_in_windows(
      std::get<Cutter>(job.scene.tool.nominal), job.windows->all.size(),
      [&job](std::size_t number) {
        Job part = window_of(job, number);
        return SweptWindow{std::move(part.samples), std::move(part.T_wt_nominal)};
      },
      options);
}

std::vector<ToolSweep> error_free_sweeps(const Job& job) {
  std::vector<ToolSweep> sweeps;
  for (const Job& part : parts_of(job)) sweeps.push_back(segment_error_free_sweep(part));
  return sweeps;
}

SurfaceOptions options_of(const Job& job, const Progress& progress) {
  SurfaceOptions options{.band = job.scene.band, .progress = {}, .body = job.body_w};
  if (progress) options.progress = [progress](double fraction) { progress("surface", fraction); };
  return options;
}

namespace {

using Eigen::Vector3d;
using kinematics::Pose;

/// A coordinate with the texts for a gap on either side.
struct Coordinate {
  const char* below;
  const char* above;
};
using Coordinates = std::array<Coordinate, 3>;

constexpr Coordinates milled = {{{"the nearest cut lies {:.1f} mm beside the part, towards its -x",
                                  "the nearest cut lies {:.1f} mm beside the part, towards its +x"},
                                 {"the nearest cut lies {:.1f} mm beside the part, towards its -y",
                                  "the nearest cut lies {:.1f} mm beside the part, towards its +y"},
                                 {"the highest cut lies {:.1f} mm below the part",
                                  "the lowest cut lies {:.1f} mm above the part"}}};
constexpr Coordinates turned = {
    {{"the nearest cut lies {:.1f} mm before the part along the spindle",
      "the nearest cut lies {:.1f} mm beyond the part along the spindle"},
     {"the largest radius cut lies {:.1f} mm inside the part's smallest",
      "the smallest radius cut lies {:.1f} mm outside the part's largest"},
     {"", ""}}};

bool is_milled(const Job& job) {
  return std::holds_alternative<cutting::Cutter>(job.scene.tool.nominal);
}

/// Returns how far the cutter reaches along a direction, mm.
/// @param T  tool in the frame of the direction
double reach_along(const cutting::Cutter& cutter, const Pose& T, const Vector3d& direction) {
  const Vector3d axis = T.linear().col(2);
  return direction.dot(T.translation()) +
         cutting::support(cutter, direction.dot(axis), direction.cross(axis).norm());
}

/// Range of one pose of the tool in a coordinate, and the position of its tip.
struct Taken {
  double low, high, tip;
};

Taken taken_by(const cutting::Cutter& cutter, const Pose& T_mt, int k) {
  return {-reach_along(cutter, T_mt, -Vector3d::Unit(k)),
          reach_along(cutter, T_mt, Vector3d::Unit(k)), T_mt.translation()[k]};
}

void extend(SweptSpans& swept, std::size_t k, const Taken& taken, int line, bool in_feed) {
  swept.all[k].extend(taken.low, taken.high, line);
  if (!in_feed) return;
  swept.feed[k].extend(taken.low, taken.high, line);
  swept.tip[k].extend(taken.tip, taken.tip, line);
}

}  // namespace

void Span::extend(double least, double most, int line) {
  if (least < low) low_line = line;
  if (most > high) high_line = line;
  low = std::min(low, least);
  high = std::max(high, most);
}

std::array<double, 2> spindle_coordinates(const Job& job, const Vector3d& p_w) {
  const SpindleLine line = spindle_line(job.machine.nominal, *job.machine.workpiece_spindle);
  const double along = line.direction_w.dot(p_w - line.point_w);
  return {along, (p_w - line.point_w - along * line.direction_w).norm()};
}

namespace {

/// Returns how far an edge reaches from its centre along a direction, mm.
/// @param R  rotation of frame t
double reach_along(const cutting::Nose& nose, const Eigen::Matrix3d& R, const Vector3d& direction) {
  if (!nose.profile) return nose.radius;
  const Eigen::Vector2d way(R.col(0).dot(direction), R.col(2).dot(direction));
  return way.dot(cutting::extreme_point(*nose.profile, way));
}

/// Returns the ranges of one pose along the spindle and radially.
std::array<Taken, 2> taken_by(const cutting::Nose& nose, const SpindleLine& line,
                              const Pose& T_wt) {
  const Vector3d arm = T_wt.translation() - line.point_w;
  const double along = line.direction_w.dot(arm);
  const Vector3d out = arm - along * line.direction_w;
  const std::array<double, 2> at{along, out.norm()};
  // `stableNormalized` leaves zero at zero, for a tool on the spindle axis
  const std::array<Vector3d, 2> ways{line.direction_w, out.stableNormalized()};
  std::array<Taken, 2> taken;
  for (std::size_t k = 0; k < 2; ++k)
    taken[k] = {at[k] - reach_along(nose, T_wt.linear(), -ways[k]),
                at[k] + reach_along(nose, T_wt.linear(), ways[k]), at[k]};
  return taken;
}

void extend_by(SweptSpans& swept, const Job& job, bool feeds) {
  const auto* cutter = std::get_if<cutting::Cutter>(&job.scene.tool.nominal);
  const auto* nose = std::get_if<cutting::Nose>(&job.scene.tool.nominal);
  std::optional<SpindleLine> spindle;
  if (nose != nullptr) spindle = spindle_line(job.machine.nominal, *job.machine.workpiece_spindle);
  const Pose T_mw = job.scene.part.T_wm.inverse();
  const std::size_t n = job.T_wt_nominal.size();
  const auto is_fed_to = [&](std::size_t i) {
    return program::is_feed(job.path.blocks[std::size_t(job.samples.block[i])]);
  };
  for (std::size_t i = 0; i < n; ++i) {
    // a feed begins where the block before it ends
    const bool begins = feeds && !is_fed_to(i) && i + 1 < n && is_fed_to(i + 1);
    const bool in_feed = !feeds || begins || is_fed_to(i);
    const int line = job.samples.line[begins ? i + 1 : i];
    if (cutter != nullptr) {
      const Pose T_mt = T_mw * job.T_wt_nominal[i];
      for (int k = 0; k < 3; ++k)
        extend(swept, std::size_t(k), taken_by(*cutter, T_mt, k), line, in_feed);
    } else {
      const auto taken = taken_by(*nose, *spindle, job.T_wt_nominal[i]);
      for (std::size_t k = 0; k < 2; ++k) extend(swept, k, taken[k], line, in_feed);
    }
  }
}

}  // namespace

SweptSpans swept_spans(const Job& job) {
  const bool feeds = std::any_of(job.path.blocks.begin(), job.path.blocks.end(), program::is_feed);
  SweptSpans swept;
  each_part(job, [&](const Job& part) { extend_by(swept, part, feeds); });
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
      const auto at = spindle_coordinates(job, p_w);
      for (std::size_t k = 0; k < 2; ++k) spans[k].extend(at[k], at[k], 0);
    }
  }
  return spans;
}

ClosestGap closest_gap(const Job& job, const Spans& part, const Spans& tool) {
  const Coordinates& names = is_milled(job) ? milled : turned;
  ClosestGap worst;
  for (std::size_t k = 0; k < part.size(); ++k) {
    const double above = tool[k].low - part[k].high, below = part[k].low - tool[k].high;
    const bool is_above = above > below;
    const double gap = std::max(above, below);
    // an empty range (no feed, a third coordinate of turning) is infinite
    if (!(gap > worst.gap) || !std::isfinite(gap)) continue;
    worst = {gap, is_above ? tool[k].low_line : tool[k].high_line,
             fmt::format(fmt::runtime(is_above ? names[k].above : names[k].below), gap)};
  }
  return worst;
}

}  // namespace abbe::sim
