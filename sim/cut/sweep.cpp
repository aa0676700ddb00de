#include "sim/cut/sweep.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "cutting/streamed_surface.h"
#include "cutting/united.h"
#include "sim/cut/tool_motion.h"

namespace abbe::sim {
namespace {

using cutting::Contacts;
using cutting::Cutter;
using cutting::Design;
using cutting::Surface;
using cutting::SurfaceOptions;
using cutting::VertexStatus;

cutting::NoseMotion nose_motion_of(const ToolSweep& sweep) {
  const int spindle = *sweep.workpiece_spindle;
  return nose_motion(sweep.T_wt, sweep.samples, spindle_line(sweep.chain, spindle), spindle);
}

Sweep sweep_of_one(const ToolSweep& sweep, const SurfaceOptions& options) {
  if (const auto* cutter = std::get_if<Cutter>(&sweep.tool)) {
    const auto motion =
        std::make_shared<const cutting::CutterMotion>(cutter_motion(sweep.T_wt, sweep.samples));
    return {[motion, search = cutting::milled_search(*cutter, *motion, options)](
                const Design& design_w) { return search(design_w); },
            [motion, cutter = *cutter](const Design& design_w, const Surface& surface) {
              return cutting::milled_contacts(design_w, surface, cutter, *motion);
            }};
  }
  const auto& nose = std::get<cutting::Nose>(sweep.tool);
  const auto motion = std::make_shared<const cutting::NoseMotion>(nose_motion_of(sweep));
  return {[motion, search = cutting::turned_search(nose, *motion, options)](
              const Design& design_w) { return search(design_w); },
          [motion, nose](const Design& design_w, const Surface& surface) {
            return cutting::turned_contacts(design_w, surface, nose, *motion);
          }};
}

/// The surface with only those cuts that fall into the time of a sweep.
Surface cut_during(Surface surface, const program::Samples& samples) {
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    const double time_s = surface.cut_time_s[Eigen::Index(i)];
    const bool during = !samples.states.empty() && time_s >= samples.states.front().time_s &&
                        time_s <= samples.states.back().time_s;
    if (!during && surface.status[i] == VertexStatus::Cut) surface.status[i] = VertexStatus::Uncut;
  }
  return surface;
}

Contacts no_contacts(const Design& design_w) {
  const Eigen::Index n = design_w.vertices.rows();
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  return {cutting::Points::Constant(n, 3, nan), Eigen::VectorXd::Constant(n, nan)};
}

/// Adds those of what follows. @param before  mm, way of the tools until then @return mm, the
/// farthest
double add_contacts(Contacts& all, const Contacts& more, double before) {
  double most = before;
  for (Eigen::Index v = 0; v < all.travel.size(); ++v) {
    if (std::isnan(more.travel[v]) || !std::isnan(all.travel[v])) continue;
    all.gradient.row(v) = more.gradient.row(v);
    all.travel[v] = before + more.travel[v];
    most = std::max(most, all.travel[v]);
  }
  return most;
}

/// Each contact by the tool that cut there; the ways of the tools follow one another.
Contacts joined_contacts(const Design& design_w, const Surface& surface,
                         const std::vector<ToolSweep>& sweeps, const std::vector<Sweep>& ones) {
  constexpr double between_tools = 1e6;  // mm: no two tools cut in one pass
  Contacts all = no_contacts(design_w);
  double before = 0.0;
  for (std::size_t k = 0; k < ones.size(); ++k) {
    const Contacts one = ones[k].contacts(design_w, cut_during(surface, sweeps[k].samples));
    before = add_contacts(all, one, before) + between_tools;
  }
  return all;
}

}  // namespace

Sweep sweep_of(std::vector<ToolSweep> sweeps, const SurfaceOptions& options) {
  if (sweeps.size() == 1) return sweep_of_one(sweeps.front(), options);
  std::vector<Sweep> ones;
  for (std::size_t i = 0; i < sweeps.size(); ++i) {
    SurfaceOptions own{.band = options.band, .progress = {}, .body = options.body};
    if (options.progress)
      own.progress = [progress = options.progress, i, n = sweeps.size()](double fraction) {
        progress((double(i) + fraction) / double(n));
      };
    ones.push_back(sweep_of_one(sweeps[i], own));
  }
  std::vector<cutting::SurfaceOf> surfaces;
  for (std::size_t i = 0; i < sweeps.size(); ++i)
    surfaces.push_back([prepared = ones[i].surface, sweep = sweeps[i], usual = options.band](
                           const Design& design_w, double band) {
      if (band == usual) return prepared(design_w);
      return sweep_of_one(sweep, {.band = band, .progress = {}}).surface(design_w);
    });
  return {[surfaces, band = options.band](const Design& design_w) {
            return cutting::united(design_w, surfaces, band);
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
    Contacts all = no_contacts(design_w);
    double before = 0.0;
    for (std::size_t k = 0; k < windows; ++k) {
      const SweptWindow one = window(k);
      const cutting::CutterMotion motion = cutter_motion(one.T_wt, one.samples);
      const Surface during = cut_during(surface, one.samples);
      add_contacts(all, cutting::milled_contacts(design_w, during, cutter, motion, before), 0.0);
      before = cutting::way_of(motion, before).tail(1).value();
    }
    return all;
  };
  return {[=](const Design& design_w) {
            return cutting::streamed_surface(design_w, cutter, begin, options);
          },
          contacts};
}

ToolSweep error_free_sweep_of(const Job& part) {
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
  for (const Job& part : parts_of(job)) sweeps.push_back(error_free_sweep_of(part));
  return sweeps;
}

SurfaceOptions options_of(const Job& job, const Progress& progress) {
  SurfaceOptions options{.band = job.scene.band, .progress = {}, .body = job.body_w};
  if (progress) options.progress = [progress](double fraction) { progress("surface", fraction); };
  return options;
}

}  // namespace abbe::sim
