#include "cutting/gouge.h"

#include <algorithm>
#include <memory>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace abbe::cutting {

using Eigen::Index;

namespace {

/// The stretch of a vertex's normal from `from` to `to`, mm.
ShiftedRay stretch(const Design& design, Index vertex, double from, double to) {
  const Eigen::Vector3d normal = design.normals.row(vertex);
  const double shift = 0.5 * (from + to);
  return {{design.vertices.row(vertex).transpose() + shift * normal, normal, 0.5 * (to - from)},
          shift};
}

/// Whether a place that was removed below an intact skin is nearer to another place of the part by
/// a tenth: then it was cut from there.
bool is_of_another(const Design& design, const Thickness& thickness, Index vertex, double s) {
  constexpr double share = 0.9;
  const Eigen::Vector3d place = design.vertices.row(vertex) + s * design.normals.row(vertex);
  return thickness.comes_within(place, share * std::abs(s));
}

struct Second {
  VertexStatus status = VertexStatus::Uncut;
  FirstCut cut;
  Gouge gouge;
};

/// First cut of a stretch, s counted from the vertex.
std::optional<FirstCut> cut_within(const Design& design, Index vertex, double from, double to,
                                   const FirstCutAlong& first_cut) {
  const ShiftedRay along = stretch(design, vertex, from, to);
  std::optional<FirstCut> cut = first_cut(along.ray);
  if (!cut) return std::nullopt;
  cut->s = cut->s <= -along.ray.band ? from : cut->s + along.shift;
  return cut;
}

/// @param buried  the ray starts in removed material
Second second_look(const Design& design, const Thickness& thickness, Index vertex, double band,
                   bool buried, const FirstCutAlong& first_cut) {
  const double most = gouge_bands * band;
  const auto behind =
      thickness.behind(design.vertices.row(vertex), design.normals.row(vertex), 2.0 * most);
  const double deepest = behind ? 0.5 * *behind : most;
  const bool thin = deepest <= band;
  if (thin && !buried) return {};
  const auto cut = cut_within(design, vertex, -deepest, thin ? band : -band, first_cut);
  if (!cut && buried && !thin)  // it begins at -band, to rounding
    return {VertexStatus::Gouged, {-band, 0.0, 0}, {int(vertex), band, false}};
  if (!cut) return {};
  if (!buried && is_of_another(design, thickness, vertex, cut->s)) return {};
  if (thin && cut->s > -deepest) return {VertexStatus::Cut, *cut, {}};
  return {VertexStatus::Gouged, *cut, {int(vertex), -cut->s, cut->s <= -deepest}};
}

}  // namespace

std::optional<ShiftedRay> ThinRays::of(Index vertex) const {
  std::call_once(once_, [&] { thickness_.emplace(design_); });
  const auto behind =
      thickness_->behind(design_.vertices.row(vertex), design_.normals.row(vertex), 2.0 * band_);
  if (!behind) return std::nullopt;
  return stretch(design_, vertex, -0.5 * *behind, band_);
}

Surface with_gouges(Surface surface, const Design& design, const SurfaceOptions& options,
                    const FirstCutAlong& first_cut) {
  std::vector<Index> doubtful;
  for (std::size_t i = 0; i < surface.status.size(); ++i)
    if (surface.status[i] == VertexStatus::Uncut || surface.status[i] == VertexStatus::Gouged)
      doubtful.push_back(Index(i));
  if (doubtful.empty()) return surface;
  const auto body = options.body ? options.body : std::make_shared<const Thickness>(design);
  std::vector<Second> looks(doubtful.size());
  const auto range_of_all = tbb::blocked_range<std::size_t>(0, doubtful.size(), 64);
  tbb::parallel_for(range_of_all, [&](const auto& range) {
    for (std::size_t k = range.begin(); k < range.end(); ++k) {
      const bool buried = surface.status[std::size_t(doubtful[k])] == VertexStatus::Gouged;
      looks[k] = second_look(design, *body, doubtful[k], options.band, buried, first_cut);
    }
  });
  for (std::size_t k = 0; k < doubtful.size(); ++k) {
    const Index v = doubtful[k];
    const Second& look = looks[k];
    surface.status[std::size_t(v)] = look.status;
    if (look.status == VertexStatus::Uncut) continue;
    surface.cut_time_s[v] = look.cut.time_s;
    surface.cut_line[std::size_t(v)] = look.cut.line;
    if (look.status == VertexStatus::Cut) surface.residual[v] = look.cut.s;
    if (look.status == VertexStatus::Gouged) surface.gouges.push_back(look.gouge);
  }
  return surface;
}

}  // namespace abbe::cutting
