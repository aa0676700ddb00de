#include "sim/cut/reach.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "kinematics/numbers.h"
#include "sim/cut/tool_motion.h"

namespace abbe::sim {
namespace {

using Eigen::Vector3d;
using kinematics::Pose;

/// What lies between two values of a coordinate, and the program lines that reach them.
struct Span {
  double low = infinity, high = -infinity;  // mm
  int low_line = 0, high_line = 0;

  void extend(double least, double most, int line) {
    if (least < low) low_line = line;
    if (most > high) high_line = line;
    low = std::min(low, least);
    high = std::max(high, most);
  }
};

/// By how much a program misses a part in one coordinate, in words.
struct Miss {
  double gap = -infinity;  // mm, negative where they overlap
  int line = 0;
  std::string words;
};

/// Coordinates in which part and tool are held against each other, each with its two ways to miss.
struct Coordinate {
  const char* below;
  const char* above;
};
using Coordinates = std::array<Coordinate, 3>;
using Spans = std::array<Span, 3>;

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

Miss miss(const Spans& part, const Spans& tool, const Coordinates& names) {
  Miss worst;
  for (std::size_t k = 0; k < part.size(); ++k) {
    const double above = tool[k].low - part[k].high, below = part[k].low - tool[k].high;
    const bool is_above = above > below;
    const double gap = std::max(above, below);
    if (!(gap > worst.gap) || !std::isfinite(gap)) continue;
    worst = {gap, is_above ? tool[k].low_line : tool[k].high_line,
             fmt::format(fmt::runtime(is_above ? names[k].above : names[k].below), gap)};
  }
  return worst;
}

/// How far the cutter reaches along a direction. @param T  tool in the frame of the direction
double reach_along(const cutting::Cutter& cutter, const Pose& T, const Vector3d& direction) {
  const Vector3d axis = T.linear().col(2);
  const double along = direction.dot(axis);
  const double across = direction.cross(axis).norm();
  const double corner = direction.dot(T.translation() + cutter.corner_radius * axis);
  if (along > 0.0)
    return corner + (cutter.flank_length - cutter.corner_radius) * along + cutter.radius * across;
  return corner + cutter.corner_radius + (cutter.radius - cutter.corner_radius) * across;
}

/// Spans of all the tool's poses, and of those in feed.
struct Swept {
  Spans all, feed;

  void extend(std::size_t k, double least, double most, int line, bool in_feed) {
    all[k].extend(least, most, line);
    if (in_feed) feed[k].extend(least, most, line);
  }
};

Swept swept_by_cutter(const Job& job, const cutting::Cutter& cutter) {
  const Pose T_mw = job.scene.part.T_wm.inverse();
  Swept swept;
  for (std::size_t i = 0; i < job.T_wt_nominal.size(); ++i) {
    const Pose T_mt = T_mw * job.T_wt_nominal[i];
    const bool feed = program::is_feed(job.path.blocks[std::size_t(job.samples.block[i])]);
    for (int k = 0; k < 3; ++k)
      swept.extend(std::size_t(k), -reach_along(cutter, T_mt, -Vector3d::Unit(k)),
                   reach_along(cutter, T_mt, Vector3d::Unit(k)), job.samples.line[i], feed);
  }
  return swept;
}

Spans spans_of_part(const Job& job) {
  const Pose T_mw = job.scene.part.T_wm.inverse();
  Spans spans;
  for (Eigen::Index i = 0; i < job.design_w.vertices.rows(); ++i) {
    if (!job.design_w.judged.empty() && !job.design_w.judged[std::size_t(i)]) continue;
    const Vector3d p_m = T_mw * Vector3d(job.design_w.vertices.row(i));
    for (int k = 0; k < 3; ++k) spans[std::size_t(k)].extend(p_m[k], p_m[k], 0);
  }
  return spans;
}

/// Along the spindle, and from it.
std::array<double, 2> round_spindle(const SpindleLine& line, const Vector3d& p_w) {
  const double along = line.direction_w.dot(p_w - line.point_w);
  return {along, (p_w - line.point_w - along * line.direction_w).norm()};
}

Swept swept_by_nose(const Job& job, const cutting::Nose& nose, const SpindleLine& line) {
  Swept swept;
  for (std::size_t i = 0; i < job.T_wt_nominal.size(); ++i) {
    const auto at = round_spindle(line, job.T_wt_nominal[i].translation());
    const bool feed = program::is_feed(job.path.blocks[std::size_t(job.samples.block[i])]);
    for (std::size_t k = 0; k < 2; ++k)
      swept.extend(k, at[k] - nose.radius, at[k] + nose.radius, job.samples.line[i], feed);
  }
  return swept;
}

Spans spans_round_spindle(const Job& job, const SpindleLine& line) {
  Spans spans;
  for (Eigen::Index i = 0; i < job.design_w.vertices.rows(); ++i) {
    if (!job.design_w.judged.empty() && !job.design_w.judged[std::size_t(i)]) continue;
    const auto at = round_spindle(line, job.design_w.vertices.row(i));
    for (std::size_t k = 0; k < 2; ++k) spans[k].extend(at[k], at[k], 0);
  }
  return spans;
}

/// The design with few of its vertices judged, for a search that is wide.
cutting::Design thinned(cutting::Design design) {
  constexpr std::ptrdiff_t most = 2000;
  design.judged.resize(std::size_t(design.vertices.rows()), 1);
  const auto every = 1 + std::count(design.judged.begin(), design.judged.end(), 1) / most;
  std::ptrdiff_t number = 0;
  for (std::uint8_t& judged : design.judged) judged = judged && number++ % every == 0;
  return design;
}

}  // namespace

std::optional<BadInput> missed_part(const Job& job) {
  if (job.path.motion_blocks == 0)
    return BadInput(job.path.file, 0, 0, "a program that cuts the part", "one that moves nothing");
  const auto* cutter = std::get_if<cutting::Cutter>(&job.scene.tool.nominal);
  Swept swept;
  Spans part;
  if (cutter != nullptr) {
    swept = swept_by_cutter(job, *cutter);
    part = spans_of_part(job);
  } else {
    const SpindleLine line = spindle_line(job.machine.nominal, *job.machine.workpiece_spindle);
    swept = swept_by_nose(job, std::get<cutting::Nose>(job.scene.tool.nominal), line);
    part = spans_round_spindle(job, line);
  }
  const Coordinates& names = cutter != nullptr ? milled : turned;
  if (!(miss(part, swept.all, names).gap > job.scene.band)) return std::nullopt;
  const bool any_feed = std::isfinite(swept.feed.front().low);
  const Miss by = miss(part, any_feed ? swept.feed : swept.all, names);
  return BadInput(job.path.file, by.line, 0,
                  fmt::format("a program that comes within {} mm of the part", job.scene.band),
                  by.words);
}

void check_reaches_part(const Job& job) {
  if (const auto fault = missed_part(job)) throw *fault;
}

void check_cuts_part(const Job& job, const Cut& cut) {
  using cutting::VertexStatus;
  const auto& status = cut.surface.status;
  if (std::any_of(status.begin(), status.end(), [](VertexStatus one) {
        return one == VertexStatus::Cut || one == VertexStatus::Gouged;
      }))
    return;
  Job wide = job;
  wide.design_w = thinned(job.design_w);
  wide.scene.band = cutting::gouge_bands * job.scene.band;
  const cutting::Surface surface = cut_error_free(wide).surface;
  std::string where =
      fmt::format("nor within {} mm, where {} of its vertices were tried", wide.scene.band,
                  std::count(wide.design_w.judged.begin(), wide.design_w.judged.end(), 1));
  int line = 0;
  double nearest = infinity;
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    const double s = surface.residual[Eigen::Index(i)];
    if (surface.status[i] != VertexStatus::Cut || std::abs(s) >= std::abs(nearest)) continue;
    nearest = s;
    line = surface.cut_line[i];
  }
  if (std::isfinite(nearest))
    where = fmt::format("the nearest cut lies {:.1f} mm {} it", std::abs(nearest),
                        nearest > 0.0 ? "above" : "below");
  throw BadInput(
      job.path.file, line, 0,
      fmt::format("a program that cuts the part within {} mm of the design", job.scene.band),
      fmt::format("nothing cut ({}); {}", cut.name, where));
}

}  // namespace abbe::sim
