#include "sim/program/surface_speed.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "kinematics/units.h"

namespace abbe::sim::program {
namespace {

// At a feed per turn the time of a piece of path is proportional to one over the speed, that is to
// max(|x|, least), least being the radius at which the largest speed is reached. So the means below
// are means of that.

double mean_along_line(double from, double to, double least) {
  const bool one_side = (from < 0.0) == (to < 0.0);
  // the middle as it is, without the rounding of the integral
  if (one_side && std::min(std::abs(from), std::abs(to)) >= least)
    return std::abs(0.5 * (from + to));
  if (from == to) return std::max(std::abs(from), least);
  const auto integral = [least](double x) {
    const double r = std::abs(x);
    return std::copysign(r <= least ? least * r : 0.5 * (r * r + least * least), x);
  };
  return (integral(to) - integral(from)) / (to - from);
}

/// Integral over at most one turn from `start`.
double integral_along_arc(const RadialMove::Arc& arc, double start, double sweep, double least) {
  const double end = start + sweep;
  std::vector<double> angles{start, end};
  for (const double x : {-least, 0.0, least}) {
    const double cosine = (x - arc.centre) / arc.radius;
    if (!(std::abs(cosine) <= 1.0)) continue;
    for (const double angle : {std::acos(cosine), -std::acos(cosine)}) {
      const double turns = std::ceil((std::min(start, end) - angle) / (2 * pi));
      for (double at = angle + 2 * pi * turns; at < std::max(start, end); at += 2 * pi)
        angles.push_back(at);
    }
  }
  std::sort(angles.begin(), angles.end());
  double sum = 0.0;
  for (std::size_t i = 1; i < angles.size(); ++i) {
    const double a = angles[i - 1], b = angles[i];
    const double middle = arc.centre + arc.radius * std::cos(0.5 * (a + b));
    const double x = arc.centre * (b - a) + arc.radius * (std::sin(b) - std::sin(a));
    sum += std::abs(middle) <= least ? least * (b - a) : std::copysign(x, x * middle);
  }
  return sum;
}

double mean_along_arc(const RadialMove::Arc& arc, double least) {
  const double turns = std::floor(std::abs(arc.sweep) / (2 * pi));
  const double rest = std::abs(arc.sweep) - 2 * pi * turns;
  const double whole =
      turns > 0.0 ? turns * integral_along_arc(arc, arc.start, 2 * pi, least) : 0.0;
  const double sum =
      whole + integral_along_arc(arc, arc.start, std::copysign(rest, arc.sweep), least);
  return sum / std::abs(arc.sweep);
}

}  // namespace

double mean_spindle_speed(const RadialMove& move, double m_per_min, double max_rpm) {
  if (!(m_per_min > 0.0)) return 0.0;
  const double mm_per_turn = m_per_min * 1000.0 / (2 * pi);
  const double least = mm_per_turn / max_rpm;
  const double mean = move.arc && move.arc->sweep != 0.0
                          ? mean_along_arc(*move.arc, least)
                          : mean_along_line(move.from, move.to, least);
  return mean > 0.0 ? std::min(m_per_min * 1000.0 / (2 * pi * mean), max_rpm) : max_rpm;
}

double least_radius(const RadialMove& move) {
  if (!move.arc && (move.from < 0.0) != (move.to < 0.0)) return 0.0;
  return std::min(std::abs(move.from), std::abs(move.to));
}

}  // namespace abbe::sim::program
