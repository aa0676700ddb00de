#include "sim/program/nc_arc.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include <fmt/format.h>

namespace abbe::sim::program {
namespace {

using Eigen::Vector2d;

constexpr double largest_radius = 1e6;  // mm
constexpr double most_growth = 0.5;     // mm, see README: when an arc's two radii differ too much
constexpr double free_growth = 0.005;   // mm
constexpr double relative_growth = 1e-3;
constexpr double same_point = 1e-8;  // mm, an arc that ends this near to its start has no R

Vector2d centre_from_offsets(const NcArc& block) {
  const int plane = block.plane;
  const std::string_view letters = plane == 170 ? "IJK" : plane == 180 ? "KIJ" : "JKI";
  const std::string pair = plane == 170 ? "I J" : plane == 180 ? "I K" : "J K";
  const NcWord& first = block.words[letters[0]];
  const NcWord& second = block.words[letters[1]];
  if (const NcWord& outside = block.words[letters[2]])
    refuse(block.place, outside, fmt::format("{} in the plane of G{}", pair, plane / 10));
  if (!first && !second)
    refuse(block.place, block.cause,
           fmt::format("{} or R beside {}", pair, block.clockwise ? "G2" : "G3"), "none");
  const Vector2d words(first.value * block.unit, second.value * block.unit);
  if (!block.absolute_centre) return block.start + words;
  if (!first || !second) refuse(block.place, block.cause, "both " + pair + " under G90.1", "one");
  return words + block.zero;
}

Vector2d centre_from_radius(const NcArc& block, const NcWord& radius) {
  const double r = radius.value * block.unit;
  const Vector2d chord = block.end - block.start;
  if (chord.norm() < same_point)
    refuse(block.place, radius, "an end that is not the start beside R");
  if (std::abs(r) < same_point) refuse(block.place, radius, "a radius that is not zero");
  if (chord.norm() > 2 * std::abs(r) + free_growth)
    refuse(block.place, radius,
           fmt::format("a radius of at least half the chord of {} mm", chord.norm()));
  const double height = std::sqrt(std::max(0.0, r * r - 0.25 * chord.squaredNorm()));
  const Vector2d left = Vector2d(-chord.y(), chord.x()).normalized();
  const bool centre_is_left = !block.clockwise == (r > 0);
  return block.start + 0.5 * chord + (centre_is_left ? height : -height) * left;
}

}  // namespace

Arc arc_of(const NcArc& block) {
  const NcWord& radius = block.words['R'];
  if (radius)
    for (const char letter : {'I', 'J', 'K'})
      if (block.words[letter]) refuse(block.place, block.words[letter], "either R or I J K");
  const Vector2d centre = radius ? centre_from_radius(block, radius) : centre_from_offsets(block);
  const Arc arc = arc_through({block.start, block.end, centre, block.clockwise});
  const double end_radius = (block.end - centre).norm();
  const NcWord& named = radius ? radius : block.cause;
  if (std::min(arc.radius, end_radius) < same_point)
    refuse(block.place, named, "a radius that is not zero", "a centre at an end of the arc");
  if (arc.radius > largest_radius) refuse(block.place, named, "a radius of at most 1e6 mm");
  const double off = std::abs(arc.growth);
  if (off > most_growth || (off > free_growth && off > relative_growth * arc.radius))
    refuse(block.place, named, "one radius at both ends of the arc",
           fmt::format("{} mm at the start and {} mm at the end", arc.radius, end_radius));
  return arc;
}

}  // namespace abbe::sim::program
