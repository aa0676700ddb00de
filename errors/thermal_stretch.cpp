#include "errors/thermal_stretch.h"

#include <algorithm>

namespace abbe::errors {

using Eigen::Index;
using Eigen::VectorXd;

ThermalStretch stretch_after(const ThermalRun& run, std::size_t knot) {
  const Activity& from = run.knots[knot];
  ThermalStretch stretch;
  stretch.modes = from.coolant ? &run.wet : &run.dry;
  const auto modal_flow = [&](std::size_t i) -> VectorXd {
    const VectorXd surroundings = inflow(run.network, run.knots[i], from.coolant, base_T_C(run));
    return stretch.modes->to_nodes.transpose() *
           (surroundings + run.heat_W.row(Index(i)).transpose());
  };
  stretch.flow = modal_flow(knot);
  stretch.flow_rise = VectorXd::Zero(stretch.flow.size());
  if (knot + 1 < run.knots.size()) stretch.length = run.knots[knot + 1].time_s - from.time_s;
  if (stretch.length > 0.0)
    stretch.flow_rise = (modal_flow(knot + 1) - stretch.flow) / stretch.length;
  return stretch;
}

VectorXd modal(const ThermalRun& run, const ThermalModes& modes, std::size_t knot) {
  return modes.to_modes * (run.T_C.row(Index(knot)).transpose().array() - base_T_C(run)).matrix();
}

std::size_t knot_before(const ThermalRun& run, double time_s) {
  const auto above = std::upper_bound(run.knots.begin(), run.knots.end(), time_s,
                                      [](double t, const Activity& a) { return t < a.time_s; });
  return std::size_t(above - run.knots.begin()) - 1;
}

double base_T_C(const ThermalRun& run) { return run.knots.front().room_T_C; }

VectorXd inflow(const ThermalNetwork& network, const Activity& at, bool coolant, double base_T_C) {
  VectorXd flow = VectorXd::Zero(Index(network.nodes.size()));
  for (const SurroundingsLink& link : network.surroundings) {
    if (link.to == Surroundings::Room)
      flow[link.node] += link.conductance_W_per_K * (at.room_T_C - base_T_C);
    else if (coolant)
      flow[link.node] += link.conductance_W_per_K * (at.coolant_T_C - base_T_C);
  }
  return flow;
}

}  // namespace abbe::errors
