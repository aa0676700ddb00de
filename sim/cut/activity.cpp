#include "sim/cut/activity.h"

#include <algorithm>
#include <cmath>

namespace abbe::sim {
namespace {

using errors::Activity;

/// Room at an instant: linear between the rows of its profile, held outside.
double room_T_C(const ThermalDescription& thermal, double time_s) {
  const Eigen::VectorXd &t = thermal.room_time_s, &T = thermal.room_T_C;
  const Eigen::Index n = t.size();
  if (time_s <= t[0]) return T[0];
  if (time_s >= t[n - 1]) return T[n - 1];
  const Eigen::Index i = std::upper_bound(t.data(), t.data() + n, time_s) - t.data();
  const double part = (time_s - t[i - 1]) / (t[i] - t[i - 1]);
  return T[i - 1] + part * (T[i] - T[i - 1]);
}

/// A stretch as knots: at its ends and wherever the room's profile bends between them.
void append(std::vector<Activity>& knots, const ThermalDescription& thermal, Activity activity,
            double from_s, double to_s) {
  std::vector<double> times{from_s};
  for (const double t : thermal.room_time_s)
    if (t > from_s && t < to_s) times.push_back(t);
  times.push_back(to_s);
  for (const double t : times) {
    activity.time_s = t;
    activity.room_T_C = room_T_C(thermal, t);
    knots.push_back(activity);
  }
}

/// Sum over the steps of a process of power times time, up to an instant.
class CuttingEnergy {
 public:
  explicit CuttingEnergy(const Process& process) : steps_(process.steps) {}

  /// J between the end of the last stretch asked for and `to_s`; a step's power holds since the
  /// step before.
  double until(double to_s) {
    double energy_J = 0.0;
    while (next_ < steps_.size() && steps_[next_].time_s <= to_s) {
      energy_J += steps_[next_].power_W * (steps_[next_].time_s - at_s_);
      at_s_ = steps_[next_++].time_s;
    }
    if (next_ < steps_.size() && next_ > 0 && to_s > at_s_) {
      energy_J += steps_[next_].power_W * (to_s - at_s_);
      at_s_ = to_s;
    }
    return energy_J;
  }

 private:
  const std::vector<ProcessStep>& steps_;
  std::size_t next_ = 0;
  double at_s_ = 0.0;
};

Activity of_phase(const ThermalPhase& phase, const ThermalDescription& thermal) {
  Activity activity;
  activity.spindle_speed = phase.spindle_speed;
  activity.axis_speed = phase.axis_speed;
  activity.powered = phase.powered;
  activity.coolant = phase.coolant;
  activity.coolant_T_C = thermal.coolant_T_C;
  return activity;
}

void append_program(std::vector<Activity>& knots, const ThermalDescription& thermal,
                    const program::Samples& samples, CuttingEnergy energy, const Machine& machine) {
  const auto& states = samples.states;
  std::size_t i = 0;
  while (i + 1 < states.size()) {
    const double from_s = states[i].time_s;
    kinematics::AxisVector travel = kinematics::AxisVector::Zero(states[i].q.size());
    double turns = 0.0;
    std::size_t k = i;
    while (k + 1 < states.size() && (k == i || states[k].time_s - from_s < thermal.interval)) {
      travel += (states[k + 1].q - states[k].q).cwiseAbs();
      turns += states[k + 1].spindle_speed * (states[k + 1].time_s - states[k].time_s);
      ++k;
    }
    const double duration = states[k].time_s - from_s;
    i = k;
    if (duration <= 0.0) continue;
    travel /= duration;
    for (int j = 0; j < machine.nominal.size(); ++j)  // a spindle heats by its own law
      if (is_spindle(machine, j)) travel[j] = 0.0;
    Activity stretch =
        of_phase({duration, turns / duration, travel, thermal.powered, thermal.coolant}, thermal);
    stretch.cutting_power_W = energy.until(states[k].time_s) / duration;
    append(knots, thermal, stretch, from_s, states[k].time_s);
  }
  if (states.empty()) return;
  // the last knot says how it goes on: a program that has ended leaves the machine at rest
  const kinematics::AxisVector rest = kinematics::AxisVector::Zero(states.back().q.size());
  const double end_s = states.back().time_s;
  append(knots, thermal, of_phase({0.0, 0.0, rest, thermal.powered, false}, thermal), end_s, end_s);
}

}  // namespace

std::vector<Activity> activity(const Scene& scene, const Machine& machine,
                               const program::Samples& samples, const Process& process) {
  std::vector<Activity> knots;
  if (!scene.thermal) return knots;
  const ThermalDescription& thermal = *scene.thermal;
  double time_s = -history_s(thermal);
  for (const ThermalPhase& phase : thermal.history) {
    // the sum of the durations is not exact: the last phase ends at the start of the program
    const double end = &phase == &thermal.history.back() ? 0.0 : time_s + phase.duration;
    append(knots, thermal, of_phase(phase, thermal), time_s, end);
    time_s = end;
  }
  append_program(knots, thermal, samples, CuttingEnergy(process), machine);
  if (knots.empty()) {
    ThermalPhase rest;
    rest.powered = thermal.powered;
    append(knots, thermal, of_phase(rest, thermal), 0.0, 0.0);
  }
  return knots;
}

}  // namespace abbe::sim
