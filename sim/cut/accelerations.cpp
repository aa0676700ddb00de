#include "sim/cut/accelerations.h"

namespace abbe::sim {

std::vector<kinematics::AxisVector> accelerations(const program::Samples& samples) {
  constexpr double window_s = 0.02;
  const auto& states = samples.states;
  std::vector<kinematics::AxisVector> all(states.size());
  const auto at = [&](double time_s, std::size_t near) -> kinematics::AxisVector {
    std::size_t i = near;
    while (i + 1 < states.size() && states[i + 1].time_s <= time_s) ++i;
    while (i > 0 && states[i].time_s > time_s) --i;
    if (i + 1 == states.size() || time_s <= states[i].time_s) return states[i].q;
    const double part = (time_s - states[i].time_s) / (states[i + 1].time_s - states[i].time_s);
    return (1 - part) * states[i].q + part * states[i + 1].q;
  };
  for (std::size_t i = 0; i < states.size(); ++i) {
    const double t = states[i].time_s;
    all[i] = (at(t + window_s, i) - 2 * states[i].q + at(t - window_s, i)) / (window_s * window_s);
  }
  return all;
}

}  // namespace abbe::sim
