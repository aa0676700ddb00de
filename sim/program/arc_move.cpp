#include "sim/program/arc_move.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::sim::program {
namespace {

using Eigen::Vector2d;

constexpr double largest_radius = 1e6;  // mm
constexpr double most_growth = 0.5;     // mm, see README: when an arc's two radii differ too much
constexpr double free_growth = 0.005;   // mm
constexpr double relative_growth = 1e-3;
constexpr double one_point = 1e-8;  // mm, an arc that ends this near to its start has no R

[[noreturn]] void refuse_arc(const NcPlace& place, const Cause& cause, std::string expected,
                             std::optional<std::string> seen = {}) {
  throw BadGeometry(place.file, place.line, cause.column, std::move(expected),
                    seen ? *std::move(seen) : shown(cause.text));
}

}  // namespace

Vector2d centre_by_radius(const ArcWords& ends, double r, const NcPlace& place,
                          const Cause& cause) {
  const Vector2d chord = ends.end - ends.start;
  if (chord.norm() < one_point) refuse_arc(place, cause, "an end that is not the start beside R");
  if (std::abs(r) < one_point) refuse_arc(place, cause, "a radius that is not zero");
  if (chord.norm() > 2 * std::abs(r) + free_growth)
    refuse_arc(place, cause,
               fmt::format("a radius of at least half the chord of {} mm", chord.norm()));
  const double height = std::sqrt(std::max(0.0, r * r - 0.25 * chord.squaredNorm()));
  const Vector2d left = Vector2d(-chord.y(), chord.x()).normalized();
  const bool centre_is_left = !ends.clockwise == (r > 0);
  return ends.start + 0.5 * chord + (centre_is_left ? height : -height) * left;
}

Arc checked_arc(const ArcWords& words, int turns, const NcPlace& place, const Cause& cause) {
  Arc arc = arc_through(words);
  if (turns > 1) arc.sweep += std::copysign(2 * pi * (turns - 1), arc.sweep);
  const double end_radius = (words.end - words.centre).norm();
  if (std::min(arc.radius, end_radius) < one_point)
    refuse_arc(place, cause, "a radius that is not zero", "a centre at an end of the arc");
  if (arc.radius > largest_radius) refuse_arc(place, cause, "a radius of at most 1e6 mm");
  const double off = std::abs(arc.growth);
  if (off > most_growth || (off > free_growth && off > relative_growth * arc.radius))
    refuse_arc(place, cause, "one radius at both ends of the arc",
               fmt::format("{} mm at the start and {} mm at the end", arc.radius, end_radius));
  return arc;
}

}  // namespace abbe::sim::program
