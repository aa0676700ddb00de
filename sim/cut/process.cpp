#include "sim/cut/process.h"

#include <algorithm>

namespace abbe::sim {

using errors::Load;

ProcessTotals totals(const Process& process) {
  ProcessTotals all;
  for (const ProcessStep& step : process.steps) {
    const double force = step.load.on_tool_t.head<3>().norm();
    all.removed += step.removed;
    all.force_max = std::max(all.force_max, force);
    all.torque_max = std::max(all.torque_max, step.torque);
    all.power_max_W = std::max(all.power_max_W, step.power_W);
    all.iterations_max = std::max(all.iterations_max, step.iterations);
    all.contraction_max = std::max(all.contraction_max, step.contraction);
    if (force > 0.0) {
      all.force_sum += force;
      ++all.loaded;
    }
    if (step.converged) continue;
    ++all.open;
    all.disagreement_max = std::max(all.disagreement_max, step.disagreement);
  }
  return all;
}

Load load_at(const Process& process, double time_s) {
  const auto& steps = process.steps;
  const auto after =
      std::lower_bound(steps.begin(), steps.end(), time_s,
                       [](const ProcessStep& step, double time) { return step.time_s < time; });
  if (after == steps.end()) return {};
  if (after == steps.begin() || after->time_s == time_s)
    return after->time_s == time_s ? after->load : Load{};
  const ProcessStep& before = *(after - 1);
  const double part = (time_s - before.time_s) / (after->time_s - before.time_s);
  Load load;
  load.on_tool_t = (1 - part) * before.load.on_tool_t + part * after->load.on_tool_t;
  // an unloaded end has no place of its own
  const bool from = !before.load.on_tool_t.isZero(0.0), to = !after->load.on_tool_t.isZero(0.0);
  if (from && to)
    load.contact_t = (1 - part) * before.load.contact_t + part * after->load.contact_t;
  else
    load.contact_t = from ? before.load.contact_t : after->load.contact_t;
  return load;
}

}  // namespace abbe::sim
