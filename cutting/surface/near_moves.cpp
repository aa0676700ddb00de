#include "cutting/surface/near_moves.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>

#include "cutting/surface/cutter_entry.h"

namespace abbe::cutting {

using Eigen::Vector3d;

NearMoves8::NearMoves8(const Cutter& cutter, const NearMoves& near)
    : count(std::size_t(near.count + width - 1) / width) {
  for (int k = 0; k < near.count; ++k) ends[k] = ends_of(near.moves[k]);
  for (int k = 0; k < int(count) * width; ++k)
    // the last move is repeated to fill the last eight
    eights[k / width].put(k % width, cutter, ends[std::min(k, near.count - 1)]);
}

NearPlanes::NearPlanes(const Cutter& cutter, const NearMoves8& all, std::span<const Ray> rays)
    : count(all.count), middle(rays[rays.size() / 2].point) {
  double around = 0.0;
  // 1.001 covers the rounding of `around` to float
  for (const Ray& ray : rays) around = std::max(around, 1.001 * (ray.point - middle).lpNorm<1>());
  move_planes(cutter, {all.eights.data(), count}, rays[rays.size() / 2], around,
              {planes.data(), count});
}

void NearPairs::add(const NearMoves8& all, int move, const Ray& ray) {
  moves[count] = move;
  eights[count / width].put(int(count % width), all.eights[std::size_t(move) / width],
                            move % int(width), ray);
  ++count;
}

void NearPairs::add_open(const NearMoves8& all, int near, const NearPlanes& planes, const Ray& ray,
                         double limit) {
  for (std::size_t e = 0; e < planes.count; ++e) {
    unsigned open = open_before(planes.planes[e], planes.middle, ray, limit);
    for (; open != 0; open &= open - 1) {
      const int move = int(e * width) + std::countr_zero(open);
      if (move < near) add(all, move, ray);
    }
  }
}

// Lanes are independent, so repeating the last pair changes no bound.
void NearPairs::bound(const NearMoves8& all, const Cutter& cutter, const Ray& last) {
  while (count % width != 0) add(all, moves[count - 1], last);
  const std::size_t used = count / width;
  entry_bounds(cutter, {eights.data(), used}, last.band, {bounds.data(), used});
}

namespace {

constexpr double more_than_rounding = 1e-6;  // mm, by which a limit may be too high

void lower_to(double& limit, double met) { limit = std::min(limit, met + more_than_rounding); }

/// Returns true if a point of the ray lies so deep in the cutter at instant t that the search is
/// certain to enter no later than there. A touch, which rounding decides, does not count.
bool is_deep(const Cutter& cutter, const Move& move, double t, const Ray& ray, double s) {
  return depth(cutter, move, t, ray.point + s * ray.normal) > 1e-6 * cutter.radius;
}

/// The first point at which a ray meets a ball end that stands still, or slightly beyond; the end
/// of the band if it is missed or only grazed.
class StandingBall {
 public:
  StandingBall(const Cutter& cutter, const Move& move, double t)
      : cutter_(cutter), move_(move), t_(t), axis_(position(move, t).axis) {
    centre_ = position(move, t).tip + cutter.radius * axis_;
  }

  double met(const Ray& ray) const {
    const double radius2 = cutter_.radius * cutter_.radius;
    const Vector3d w = ray.point - centre_;
    const double along = w.dot(ray.normal);
    const double deep = radius2 - (w.squaredNorm() - along * along);
    const double s = -along - std::sqrt(std::max(deep, 0.0));
    // Closed form for a ray that meets the lower half of the ball and is no graze; the chord is
    // then above 0.6 R.
    if (deep > 0.1 * radius2 && axis_.dot(w + s * ray.normal) < 0.0) return s;
    const auto entry = standing_entry(cutter_, move_, t_, ray, -1e30f);
    const double beyond = entry.value_or(ray.band) + 1e-4 * cutter_.radius;
    return beyond < ray.band && is_deep(cutter_, move_, t_, ray, beyond) ? beyond : ray.band;
  }

 private:
  const Cutter& cutter_;
  const Move& move_;
  double t_;
  Vector3d axis_, centre_;
};

/// Returns a point slightly beyond the bound of a lane if it lies deep in the cutter of its move.
std::optional<double> met_beyond(const Cutter& cutter, const Move& move, const EntryBounds& bounds,
                                 std::size_t lane, const Ray& ray) {
  const double least = bounds.least[lane], s = least + 1e-4 * cutter.radius;
  if (!(least > -ray.band && s < ray.band)) return std::nullopt;
  const double t = instant(move, bounds.part[lane]);
  return is_deep(cutter, move, t, ray, s) ? std::optional(s) : std::nullopt;
}

/// Returns approximately the s at which a ray meets the first of eight moves.
double met_of_eight(const Cutter& cutter, std::span<const Move> moves, const EntryBounds& bounds,
                    const Ray& ray) {
  const float* least = std::min_element(bounds.least, bounds.least + moves.size());
  const std::size_t k = std::size_t(least - bounds.least);
  const Move& move = moves[k];
  if (const auto s = met_beyond(cutter, move, bounds, k, ray)) return *s;
  return standing_entry(cutter, move, instant(move, bounds.part[k]), ray, *least)
      .value_or(ray.band);
}

}  // namespace

void lower_to_ball(std::span<double> limits, std::span<const Ray> rays, const Cutter& cutter,
                   const Move& move, double t) {
  const StandingBall ball(cutter, move, t);
  for (std::size_t i = 0; i < rays.size(); ++i) lower_to(limits[i], ball.met(rays[i]));
}

void lower_to_eight(std::span<double> limits, std::span<const Ray> rays, const Cutter& cutter,
                    std::span<const Move> moves) {
  Move8 eight;
  for (std::size_t k = 0; k < Move8::width; ++k)
    eight.put(int(k), cutter, ends_of(moves[std::min(k, moves.size() - 1)]));
  std::array<EntryBounds, 8> bounds;
  for (std::size_t first = 0; first < rays.size(); first += bounds.size()) {
    const std::size_t count = std::min(bounds.size(), rays.size() - first);
    entry_bounds(cutter, eight, rays.subspan(first, count), {bounds.data(), count});
    for (std::size_t i = 0; i < count; ++i)
      lower_to(limits[first + i], met_of_eight(cutter, moves, bounds[i], rays[first + i]));
  }
}

void lower_by_planes(std::span<double> limits, std::span<const Ray> rays, const Cutter& cutter,
                     const NearMoves& near, const NearMoves8& all, const NearPlanes& planes) {
  constexpr int width = Move8::width;
  Pair8 pairs;
  std::array<int, width> nearest;
  for (std::size_t i = 0; i < nearest.size(); ++i) {
    const Ray& ray = rays[std::min(i, rays.size() - 1)];
    const int first = nearest_plane({planes.planes.data(), planes.count}, planes.middle, ray);
    nearest[i] = std::min(first, near.count - 1);
    pairs.put(int(i), all.eights[nearest[i] / width], nearest[i] % width, ray);
  }
  EntryBounds bounds;
  entry_bounds(cutter, {&pairs, 1}, rays.front().band, {&bounds, 1});
  for (std::size_t i = 0; i < rays.size(); ++i)
    if (const auto s = met_beyond(cutter, near.moves[nearest[i]], bounds, i, rays[i]))
      lower_to(limits[i], *s);
}

}  // namespace abbe::cutting
