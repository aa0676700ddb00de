#include "sim/dialects/siemens_hole.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

namespace abbe::sim::dialects::siemens {

std::vector<double> peck_depths(double total, const PeckWords& words) {
  constexpr std::size_t most_pecks = 100'000;
  constexpr double nothing = 1e-9;  // mm, what is left of a rounded depth
  std::vector<double> depths;
  double depth = 0.0, peck = words.first;
  const double by = words.degression;
  while (total - depth > nothing) {
    if (depths.size() == most_pecks) return {};
    const double rest = total - depth;
    const bool halves =
        by > 0 && !depths.empty() && rest > peck + nothing && rest <= 2 * by + nothing;
    if (halves) {
      depths.push_back(depth + 0.5 * rest);
      depths.push_back(total);
      return depths;
    }
    depth = rest <= peck + nothing ? total : depth + peck;
    depths.push_back(depth);
    if (by > 0) peck = std::min(peck, std::max(peck - by, by));
    if (by < 0) peck = std::max(peck * std::min(-by, 1.0), std::min(words.least, words.first));
    if (!(peck > nothing)) return {};
  }
  return depths;
}

double ahead_of_peck(double total) { return total <= 30.0 ? 0.6 : std::min(total / 50.0, 7.0); }

double coarse_pitch(double size) {
  static constexpr std::pair<double, double> pitches[] = {
      {3, 0.5},  {4, 0.7},  {5, 0.8},  {6, 1.0},  {8, 1.25}, {10, 1.5}, {12, 1.75},
      {14, 2.0}, {16, 2.0}, {18, 2.5}, {20, 2.5}, {22, 2.5}, {24, 3.0}, {27, 3.0},
      {30, 3.5}, {33, 3.5}, {36, 4.0}, {39, 4.0}, {42, 4.5}, {45, 4.5}, {48, 5.0}};
  for (const auto& [diameter, pitch] : pitches)
    if (diameter == size) return pitch;
  return 0.0;
}

}  // namespace abbe::sim::dialects::siemens
