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

/// A vertex whose ray starts in removed material or meets none, and how far inwards it is followed.
struct SecondLook {
  int vertex = 0;
  bool buried = false;   // it starts in removed material
  bool thin = false;     // the part is thinner there than two bands: the outer band is searched too
  double deepest = 0.0;  // mm below the design
};

/// Along what a vertex is followed.
ShiftedRay ray_of(const SecondLook& look, const Design& design, double band) {
  return stretch(design, look.vertex, -look.deepest, look.thin ? band : -band);
}

struct Second {
  VertexStatus status = VertexStatus::Uncut;
  FirstCut cut;
  Gouge gouge;
};

/// @param cut  along its ray
Second judged(const SecondLook& look, const Design& design, const Thickness& thickness, double band,
              std::optional<FirstCut> cut) {
  const auto& [vertex, buried, thin, deepest] = look;
  if (!cut && buried && !thin)  // it begins at -band, to rounding
    return {VertexStatus::Gouged, {-band, 0.0, 0}, {vertex, band, false}};
  if (!cut) return {};
  const ShiftedRay along = ray_of(look, design, band);
  cut->s = cut->s <= -along.ray.band ? -deepest : cut->s + along.shift;
  if (!buried && is_of_another(design, thickness, vertex, cut->s)) return {};
  if (thin && cut->s > -deepest) return {VertexStatus::Cut, *cut, {}};
  return {VertexStatus::Gouged, *cut, {vertex, -cut->s, cut->s <= -deepest}};
}

template <class Each>
void each_in_parallel(std::size_t count, const Each& each) {
  const auto range_of_all = tbb::blocked_range<std::size_t>(0, count, 64);
  tbb::parallel_for(range_of_all, [&](const auto& range) {
    for (std::size_t k = range.begin(); k < range.end(); ++k) each(k);
  });
}

bool is_doubtful(VertexStatus status) {
  return status == VertexStatus::Uncut || status == VertexStatus::Gouged;
}

/// Every doubtful vertex that has more of the part to look at, in their order.
std::vector<SecondLook> second_looks(const Surface& surface, const Design& design,
                                     const Thickness& body, double band) {
  std::vector<SecondLook> looks;
  for (std::size_t i = 0; i < surface.status.size(); ++i)
    if (is_doubtful(surface.status[i]))
      looks.push_back({int(i), surface.status[i] == VertexStatus::Gouged});
  const double most = gouge_bands * band;
  each_in_parallel(looks.size(), [&](std::size_t k) {
    const int v = looks[k].vertex;
    const auto behind = body.behind(design.vertices.row(v), design.normals.row(v), 2.0 * most);
    looks[k].deepest = behind ? 0.5 * *behind : most;
    looks[k].thin = looks[k].deepest <= band;
  });
  std::erase_if(looks, [](const SecondLook& look) { return look.thin && !look.buried; });
  return looks;
}

/// The map once those vertices are called Gouged, Uncut or, where the part is thin, Cut.
/// @param cuts  (looks) first cuts along their rays
Surface judged_again(Surface surface, const Design& design, const Thickness& body, double band,
                     const std::vector<SecondLook>& looks,
                     const std::vector<std::optional<FirstCut>>& cuts) {
  std::vector<Second> seconds(looks.size());
  each_in_parallel(looks.size(), [&](std::size_t k) {
    seconds[k] = judged(looks[k], design, body, band, cuts[k]);
  });
  for (std::size_t k = 0; k < looks.size(); ++k) {
    const Index v = looks[k].vertex;
    const Second& second = seconds[k];
    surface.status[std::size_t(v)] = second.status;
    if (second.status == VertexStatus::Uncut) continue;
    surface.cut_time_s[v] = second.cut.time_s;
    surface.cut_line[std::size_t(v)] = second.cut.line;
    if (second.status == VertexStatus::Cut) surface.residual[v] = second.cut.s;
    if (second.status == VertexStatus::Gouged) surface.gouges.push_back(second.gouge);
  }
  return surface;
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
  const FirstCutsAlong each = [&](std::size_t count, const std::function<Ray(std::size_t)>& ray) {
    std::vector<std::optional<FirstCut>> cuts(count);
    each_in_parallel(count, [&](std::size_t k) { cuts[k] = first_cut(ray(k)); });
    return cuts;
  };
  return with_gouges(std::move(surface), design, options, each);
}

Surface with_gouges(Surface surface, const Design& design, const SurfaceOptions& options,
                    const FirstCutsAlong& first_cuts) {
  if (std::ranges::none_of(surface.status, is_doubtful)) return surface;
  const auto body = options.body ? options.body : std::make_shared<const Thickness>(design);
  const std::vector<SecondLook> looks = second_looks(surface, design, *body, options.band);
  if (looks.empty()) return surface;
  const auto cuts = first_cuts(
      looks.size(), [&](std::size_t k) { return ray_of(looks[k], design, options.band).ray; });
  return judged_again(std::move(surface), design, *body, options.band, looks, cuts);
}

}  // namespace abbe::cutting
