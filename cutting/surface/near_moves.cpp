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
  for (int i = 0; i < near.count; ++i) endpoints[i] = move_endpoints(near.moves[i]);
  for (int i = 0; i < int(count) * width; ++i)
    // The last move is repeated to fill the last group.
    groups[i / width].set_lane(i % width, cutter, endpoints[std::min(i, near.count - 1)]);
}

NearPlanes::NearPlanes(const Cutter& cutter, const NearMoves8& moves8, std::span<const Ray> rays)
    : count(moves8.count), reference_point(rays[rays.size() / 2].point) {
  double max_offset = 0.0;
  // 1.001 covers the rounding of `max_offset` to float.
  for (const Ray& ray : rays)
    max_offset = std::max(max_offset, 1.001 * (ray.point - reference_point).lpNorm<1>());
  move_planes(cutter, {moves8.groups.data(), count}, rays[rays.size() / 2], max_offset,
              {planes.data(), count});
}

void NearPairs::add(const NearMoves8& moves8, int move, const Ray& ray) {
  moves[count] = move;
  groups[count / width].set_lane(int(count % width), moves8.groups[std::size_t(move) / width],
                                 move % int(width), ray);
  ++count;
}

void NearPairs::add_candidates(const NearMoves8& moves8, int move_count, const NearPlanes& planes,
                               const Ray& ray, double limit) {
  for (std::size_t group = 0; group < planes.count; ++group) {
    unsigned candidates =
        candidates_before(planes.planes[group], planes.reference_point, ray, limit);
    for (; candidates != 0; candidates &= candidates - 1) {
      const int move = int(group * width) + std::countr_zero(candidates);
      if (move < move_count) add(moves8, move, ray);
    }
  }
}

// Lanes are independent, so copies of the last pair change no bound.
void NearPairs::compute_bounds(const NearMoves8& moves8, const Cutter& cutter, const Ray& filler) {
  while (count % width != 0) add(moves8, moves[count - 1], filler);
  const std::size_t group_count = count / width;
  entry_bounds(cutter, {groups.data(), group_count}, filler.band, {bounds.data(), group_count});
}

namespace {

constexpr double limit_margin = 1e-6;  // mm, much more than rounding; a limit may be too high

void lower_limit(double& limit, double s) { limit = std::min(limit, s + limit_margin); }

/// Returns true if the point of the ray at s lies so deep in the cutter at instant t that the
/// search is certain to find an entry no later than s. A touch does not count, since rounding
/// decides it.
bool is_deep(const Cutter& cutter, const Move& move, double t, const Ray& ray, double s) {
  return depth(cutter, move, t, ray.point + s * ray.normal) > 1e-6 * cutter.radius;
}

/// A ball end that stands still.
class StandingBall {
 public:
  StandingBall(const Cutter& cutter, const Move& move, double t)
      : cutter_(cutter), move_(move), t_(t), axis_(cutter_pose(move, t).axis) {
    centre_ = cutter_pose(move, t).tip + cutter.radius * axis_;
  }

  /// Returns the s at which a ray meets the ball, or slightly more; the end of the band if the ray
  /// misses or only grazes the ball.
  double first_s(const Ray& ray) const {
    const double squared_radius = cutter_.radius * cutter_.radius;
    const Vector3d w = ray.point - centre_;
    const double depth_along_ray = w.dot(ray.normal);
    const double squared_half_chord =
        squared_radius - (w.squaredNorm() - depth_along_ray * depth_along_ray);
    const double s = -depth_along_ray - std::sqrt(std::max(squared_half_chord, 0.0));
    // Closed form for a ray that meets the lower half of the ball without grazing it; its chord is
    // then longer than 0.6 R.
    if (squared_half_chord > 0.1 * squared_radius && axis_.dot(w + s * ray.normal) < 0.0) return s;
    const auto entry = instant_entry(cutter_, move_, t_, ray, -1e30f);
    const double s_inside = entry.value_or(ray.band) + 1e-4 * cutter_.radius;
    return s_inside < ray.band && is_deep(cutter_, move_, t_, ray, s_inside) ? s_inside : ray.band;
  }

 private:
  const Cutter& cutter_;
  const Move& move_;
  double t_;
  Vector3d axis_, centre_;
};

/// Returns the s slightly beyond the bound of a lane if that point lies deep in the cutter of the
/// lane's move.
std::optional<double> s_inside_cutter(const Cutter& cutter, const Move& move,
                                      const EntryBounds& bounds, std::size_t lane, const Ray& ray) {
  const double min_s = bounds.min_s[lane], s = min_s + 1e-4 * cutter.radius;
  if (!(min_s > -ray.band && s < ray.band)) return std::nullopt;
  const double t = instant(move, bounds.fraction[lane]);
  return is_deep(cutter, move, t, ray, s) ? std::optional(s) : std::nullopt;
}

/// Returns approximately the s at which a ray meets the first of eight moves.
double first_s_of_moves(const Cutter& cutter, std::span<const Move> moves,
                        const EntryBounds& bounds, const Ray& ray) {
  const float* min_s = std::min_element(bounds.min_s, bounds.min_s + moves.size());
  const std::size_t nearest = std::size_t(min_s - bounds.min_s);
  const Move& move = moves[nearest];
  if (const auto s = s_inside_cutter(cutter, move, bounds, nearest, ray)) return *s;
  return instant_entry(cutter, move, instant(move, bounds.fraction[nearest]), ray, *min_s)
      .value_or(ray.band);
}

}  // namespace

void lower_limits_to_ball(std::span<double> limits, std::span<const Ray> rays, const Cutter& cutter,
                          const Move& move, double t) {
  const StandingBall ball(cutter, move, t);
  for (std::size_t i = 0; i < rays.size(); ++i) lower_limit(limits[i], ball.first_s(rays[i]));
}

void lower_limits_to_moves(std::span<double> limits, std::span<const Ray> rays,
                           const Cutter& cutter, std::span<const Move> moves) {
  Move8 lanes;
  for (std::size_t lane = 0; lane < Move8::width; ++lane)
    lanes.set_lane(int(lane), cutter, move_endpoints(moves[std::min(lane, moves.size() - 1)]));
  std::array<EntryBounds, 8> bounds;
  for (std::size_t first = 0; first < rays.size(); first += bounds.size()) {
    const std::size_t count = std::min(bounds.size(), rays.size() - first);
    entry_bounds(cutter, lanes, rays.subspan(first, count), {bounds.data(), count});
    for (std::size_t i = 0; i < count; ++i)
      lower_limit(limits[first + i], first_s_of_moves(cutter, moves, bounds[i], rays[first + i]));
  }
}

void lower_limits_by_planes(std::span<double> limits, std::span<const Ray> rays,
                            const Cutter& cutter, const NearMoves& near, const NearMoves8& moves8,
                            const NearPlanes& planes) {
  constexpr int width = Move8::width;
  Pair8 pairs;
  std::array<int, width> nearest;
  for (std::size_t i = 0; i < nearest.size(); ++i) {
    const Ray& ray = rays[std::min(i, rays.size() - 1)];
    const int move =
        nearest_plane({planes.planes.data(), planes.count}, planes.reference_point, ray);
    nearest[i] = std::min(move, near.count - 1);
    pairs.set_lane(int(i), moves8.groups[nearest[i] / width], nearest[i] % width, ray);
  }
  EntryBounds bounds;
  entry_bounds(cutter, {&pairs, 1}, rays.front().band, {&bounds, 1});
  for (std::size_t i = 0; i < rays.size(); ++i)
    if (const auto s = s_inside_cutter(cutter, near.moves[nearest[i]], bounds, i, rays[i]))
      lower_limit(limits[i], *s);
}

}  // namespace abbe::cutting
