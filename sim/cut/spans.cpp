#include "sim/cut/spans.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "sim/cut/tool_motion.h"

namespace abbe::sim {
namespace {

using Eigen::Vector3d;
using kinematics::Pose;

/// A coordinate with its two ways to miss.
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

/// How far the cutter reaches along a direction. @param T  tool in the frame of the direction
double reach_along(const cutting::Cutter& cutter, const Pose& T, const Vector3d& direction) {
  const Vector3d axis = T.linear().col(2);
  return direction.dot(T.translation()) +
         cutting::support(cutter, direction.dot(axis), direction.cross(axis).norm());
}

/// Low and high end of what one pose of the tool takes in a coordinate, and the tip's place in it.
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

std::array<double, 2> round_spindle(const Job& job, const Vector3d& p_w) {
  const SpindleLine line = spindle_line(job.machine.nominal, *job.machine.workpiece_spindle);
  const double along = line.direction_w.dot(p_w - line.point_w);
  return {along, (p_w - line.point_w - along * line.direction_w).norm()};
}

namespace {

/// How far an edge reaches from its centre along a direction. @param R  turn of frame t
double reach_along(const cutting::Nose& nose, const Eigen::Matrix3d& R, const Vector3d& direction) {
  if (!nose.profile) return nose.radius;
  const Eigen::Vector2d way(R.col(0).dot(direction), R.col(2).dot(direction));
  return way.dot(cutting::foremost(*nose.profile, way));
}

/// Along the spindle, and from it.
std::array<Taken, 2> taken_by(const cutting::Nose& nose, const SpindleLine& line,
                              const Pose& T_wt) {
  const Vector3d arm = T_wt.translation() - line.point_w;
  const double along = line.direction_w.dot(arm);
  const Vector3d out = arm - along * line.direction_w;
  const std::array<double, 2> at{along, out.norm()};
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
      const auto at = round_spindle(job, p_w);
      for (std::size_t k = 0; k < 2; ++k) spans[k].extend(at[k], at[k], 0);
    }
  }
  return spans;
}

Miss miss(const Job& job, const Spans& part, const Spans& tool) {
  const Coordinates& names = is_milled(job) ? milled : turned;
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

}  // namespace abbe::sim
