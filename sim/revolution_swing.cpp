#include "sim/revolution_swing.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace abbe::sim {
namespace {

constexpr std::size_t window = 10;     // changes
constexpr double least_change = 0.01;  // of the force
constexpr double undamped = 0.99;      // gain; a swing at its full size has 1
constexpr double can_swing = 0.5;        // contraction, below which every change dies out
constexpr std::size_t leap_window = 40;  // revolutions
constexpr int least_leaps = 3;

/// How large the changes from `first` on become in a revolution, if they alternate for a window.
std::optional<double> gain_from(const std::vector<double>& force, std::size_t first) {
  if (first + window >= force.size()) return std::nullopt;
  double before = 0.0, after = 0.0;
  for (std::size_t i = 0; i < window; ++i) {
    const std::size_t k = first + i;
    const double change = force[k + 1] - force[k];
    if (!(std::abs(change) > least_change * std::max(force[k], force[k + 1]))) return std::nullopt;
    if (i > 0 && change * (force[k] - force[k - 1]) > 0.0) return std::nullopt;
    (i < window / 2 ? before : after) += std::abs(change);
  }
  return std::pow(after / before, 2.0 / double(window));
}

/// Whether the loop of force and deflection is strong enough to swing somewhere in the window.
/// Forces that alternate by chance, as under error motions of a spindle, are no swing.
bool is_drawn_in(const Process& process, std::size_t first) {
  for (std::size_t k = first; k <= first + window; ++k)
    if (process.steps[k].contraction >= can_swing) return true;
  return false;
}

/// The swing of forces that alternate.
std::optional<RevolutionSwing> alternating(const Process& process,
                                           const std::vector<double>& force) {
  std::optional<RevolutionSwing> widest;
  double gain = 0.0;
  for (std::size_t first = 0; first < force.size();) {
    std::size_t k = first;
    for (auto one = gain_from(force, k); one && *one >= undamped && is_drawn_in(process, k);
         one = gain_from(force, ++k))
      gain = std::max(gain, *one);
    if (k == first) {
      ++first;
      continue;
    }
    const auto begin = force.begin() + std::ptrdiff_t(first);
    const auto end = force.begin() + std::ptrdiff_t(k + window);
    const auto [low, high] = std::minmax_element(begin, end);
    if (!widest || *high - *low > widest->high - widest->low)
      widest = RevolutionSwing{int(end - begin), process.steps[first].line, *low, *high, 0.0};
    first = k + 1;
  }
  if (widest) widest->gain = gain;
  return widest;
}

/// The leaps of a tool from one step on, within one line.
RevolutionSwing leaps_from(const Process& process, const std::vector<double>& force,
                           std::size_t first) {
  RevolutionSwing found;
  found.line = process.steps[first].line;
  for (std::size_t k = first; k < std::min(first + leap_window, force.size()); ++k) {
    const ProcessStep& step = process.steps[k];
    if (step.line != found.line) break;
    ++found.revolutions;
    found.high = std::max(found.high, force[k]);
    found.gain = std::max(found.gain, step.contraction);
    if (k > first && force[k] > 0.0 && force[k - 1] == 0.0) ++found.leaps;
  }
  return found;
}

std::optional<RevolutionSwing> leaping(const Process& process, const std::vector<double>& force) {
  for (std::size_t first = 0; first < force.size(); ++first) {
    const RevolutionSwing found = leaps_from(process, force, first);
    if (found.leaps >= least_leaps && found.gain >= 1.0) return found;
  }
  return std::nullopt;
}

}  // namespace

std::optional<RevolutionSwing> revolution_swing(const Process& process) {
  if (!process.turned) return std::nullopt;
  std::vector<double> force;
  for (const ProcessStep& step : process.steps)
    force.push_back(step.load.on_tool_t.head<3>().norm());
  if (const auto swing = alternating(process, force)) return swing;
  return leaping(process, force);
}

}  // namespace abbe::sim
