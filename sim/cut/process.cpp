#include "sim/cut/process.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <vector>

#include <fmt/format.h>

#include "kinematics/units.h"

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
  // linear between two steps
  load.on_tool_t = (1 - part) * before.load.on_tool_t + part * after->load.on_tool_t;
  // an unloaded step has no contact point
  const bool from = !before.load.on_tool_t.isZero(0.0), to = !after->load.on_tool_t.isZero(0.0);
  if (from && to)
    load.contact_t = (1 - part) * before.load.contact_t + part * after->load.contact_t;
  else
    load.contact_t = from ? before.load.contact_t : after->load.contact_t;
  return load;
}

namespace {

constexpr std::size_t window = 10;             // changes of force from one revolution to the next
constexpr double min_change = 0.01;            // fraction of the force
constexpr double min_swing_gain = 0.99;        // a swing at its full size has a gain of 1
constexpr double min_swing_contraction = 0.5;  // with a smaller contraction every change decays,
                                               // see `revolution_swing`
constexpr std::size_t leap_window = 40;        // revolutions
constexpr int min_leaps = 3;

/// Returns by what factor the changes of force from `first` on grow in a revolution; none if they
/// do not alternate for a whole window.
std::optional<double> gain_from(const std::vector<double>& force, std::size_t first) {
  if (first + window >= force.size()) return std::nullopt;
  double before = 0.0, after = 0.0;
  for (std::size_t i = 0; i < window; ++i) {
    const std::size_t k = first + i;
    const double change = force[k + 1] - force[k];
    // a change of up to 1 % of the force ends the window
    if (!(std::abs(change) > min_change * std::max(force[k], force[k + 1]))) return std::nullopt;
    if (i > 0 && change * (force[k] - force[k - 1]) > 0.0) return std::nullopt;
    (i < window / 2 ? before : after) += std::abs(change);
  }
  // The means of both halves are half a window apart, so the ratio of a revolution is that root.
  return std::pow(after / before, 2.0 / double(window));
}

/// Returns true if the loop of force and deflection is strong enough to swing somewhere in the
/// window. Forces may also alternate without it, as under error motions of a spindle.
bool is_drawn_in(const Process& process, std::size_t first) {
  for (std::size_t k = first; k <= first + window; ++k)
    if (process.steps[k].contraction >= min_swing_contraction) return true;
  return false;
}

/// Returns the swing of alternating forces with the largest difference; none if there is none.
std::optional<RevolutionSwing> alternating(const Process& process,
                                           const std::vector<double>& force) {
  std::optional<RevolutionSwing> widest;
  double gain = 0.0;
  for (std::size_t first = 0; first < force.size();) {
    std::size_t k = first;
    for (auto one = gain_from(force, k); one && *one >= min_swing_gain && is_drawn_in(process, k);
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

/// Counts how often the tool leaps out of the work and back from one step on, within one program
/// line.
RevolutionSwing count_leaps(const Process& process, const std::vector<double>& force,
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

// Returns the first segment where the tool leaps out of the work and back; none if there is none.
std::optional<RevolutionSwing> find_leaping_swing(const Process& process,
                                                  const std::vector<double>& force) {
  for (std::size_t first = 0; first < force.size(); ++first) {
    const RevolutionSwing found = count_leaps(process, force, first);
    if (found.leaps >= min_leaps && found.gain >= 1.0) return found;
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
  // Alternation comes first: beyond it the tool leaves the work, and the forces no longer
  // alternate.
  return find_leaping_swing(process, force);
}

namespace {

std::string swing_text(const RevolutionSwing& swing) {
  const std::string how =
      swing.leaps > 0
          ? fmt::format(
                "on line {} the tool leaps out of the work and back {} times in {} "
                "revolutions, under up to {:.4g} N, with a gain of force by depth of {:.2f}",
                swing.line, swing.leaps, swing.revolutions, swing.high, swing.gain)
          : fmt::format(
                "for {} revolutions from line {} on the force swings between {:.4g} and "
                "{:.4g} N from one to the next, a change returns {:.2f} times as large",
                swing.revolutions, swing.line, swing.low, swing.high, swing.gain);
  return "the cut does not settle: " + how +
         ": under the cutting force the tool goes too far into the work, and the surface is one of "
         "chatter";
}

}  // namespace

std::vector<std::string> process_warnings(const Scene& scene, const Process& process) {
  std::vector<std::string> warnings;
  if (process.steps.empty()) return warnings;
  const ProcessTotals all = totals(process);
  // One step in thousands, at a jump of the force, oscillates by some nanometres between both sides
  // of the jump, at any step length. No setting avoids that, so it is not reported.
  const double tolerance = scene.cutting->tolerance;
  const bool is_stray = all.disagreement_max < std::min(10.0 * tolerance, 10.0 * units::nm) &&
                        1000 * all.open < process.steps.size();
  if (all.open > 0 && !is_stray)
    warnings.push_back(fmt::format(
        "force and deflection did not agree to {:.3g} nm at {} of {} steps; they "
        "differ by {:.3g} nm at most",
        tolerance / units::nm, all.open, process.steps.size(), all.disagreement_max / units::nm));
  if (const auto swing = revolution_swing(process)) warnings.push_back(swing_text(*swing));
  if (!(all.removed > 0.0)) warnings.push_back("the tool met no material of the blank");
  if (!process.crash_lines.empty())
    warnings.push_back(fmt::format("a rapid or the shank met material on {} lines, first line {}",
                                   process.crash_lines.size(), process.crash_lines.front()));
  const auto beyond = std::ranges::max_element(process.steps, {}, &ProcessStep::beyond_edge);
  if (beyond->beyond_edge > 0.01)
    warnings.push_back(fmt::format(
        "the cut goes {:.3g} mm beyond the edges of the insert (line {}): what lies there is "
        "removed and counts in the force as if an edge along the radius cut it",
        beyond->beyond_edge, beyond->line));
  return warnings;
}

void add_warnings(std::vector<std::string> more, std::vector<std::string>& warnings) {
  std::move(more.begin(), more.end(), std::back_inserter(warnings));
}

std::vector<std::string> idle_warnings(const Scene& scene) {
  std::vector<std::string> warnings;
  const auto warn = [&](bool is, const char* what) {
    if (is) warnings.push_back(what);
  };
  const bool cuts = scene.cutting && scene.cutting->material;
  if (scene.compliance) {
    const errors::ComplianceErrors& soft = *scene.compliance;
    const bool weighs = (soft.gravity_b || soft.inertia) && !soft.masses.empty();
    warn(!cuts && !weighs && soft.clamping_w.isZero(0.0),
         "nothing loads the compliance: it wants [cutting] with a material, masses with gravity or "
         "inertia, or clamping");
    warn((soft.gravity_b || soft.inertia) && soft.masses.empty(),
         "gravity and inertia act on [[compliance.mass]], and there is none");
    warn(!soft.gravity_b && !soft.inertia && !soft.masses.empty(),
         "the masses do nothing without gravity or inertia");
  }
  warn(scene.signals.dynamometer && !cuts, "the dynamometer reads nothing without cutting forces");
  warn(scene.signals.current && !cuts && !scene.thermal && !scene.compliance,
       "signals.csv is written where there is heat, stock or compliance");
  return warnings;
}

namespace {

using errors::Activity;

/// Returns the room temperature at an instant: linear between the rows of its profile, constant
/// outside.
double room_T_C(const ThermalDescription& thermal, double time_s) {
  const Eigen::VectorXd &t = thermal.room_time_s, &T = thermal.room_T_C;
  const Eigen::Index n = t.size();
  if (time_s <= t[0]) return T[0];
  if (time_s >= t[n - 1]) return T[n - 1];
  const Eigen::Index i = std::upper_bound(t.data(), t.data() + n, time_s) - t.data();
  const double part = (time_s - t[i - 1]) / (t[i] - t[i - 1]);
  return T[i - 1] + part * (T[i] - T[i - 1]);
}

/// Appends an activity as knots: at its ends and at every row of the room profile between them.
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

/// Integrates the cutting power over the steps of a process.
class CuttingEnergy {
 public:
  explicit CuttingEnergy(const Process& process) : steps_(process.steps) {}

  /// Returns the energy in J from the last `to_s` to this one. The power of a step holds from the
  /// step before it.
  double until(double to_s) {
    double energy_J = 0.0;
    while (next_ < steps_.size() && steps_[next_].time_s <= to_s) {
      energy_J += steps_[next_].power_W * (steps_[next_].time_s - at_s_);
      at_s_ = steps_[next_++].time_s;
    }
    // the rest of an interval is left to the next call
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

Activity phase_activity(const ThermalPhase& phase, const ThermalDescription& thermal) {
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
    // heat follows slowly, so mean speeds over the interval suffice
    i = k;
    if (duration <= 0.0) continue;
    travel /= duration;
    for (int j = 0; j < machine.nominal.size(); ++j)  // a spindle heats by its own law
      if (is_spindle(machine, j)) travel[j] = 0.0;
    Activity stretch = phase_activity(
        {duration, turns / duration, travel, thermal.powered, thermal.coolant}, thermal);
    stretch.cutting_power_W = energy.until(states[k].time_s) / duration;
    append(knots, thermal, stretch, from_s, states[k].time_s);
  }
  if (states.empty()) return;
  // The last knot sets how the run continues: after the program the machine is at rest.
  const kinematics::AxisVector rest = kinematics::AxisVector::Zero(states.back().q.size());
  const double end_s = states.back().time_s;
  append(knots, thermal, phase_activity({0.0, 0.0, rest, thermal.powered, false}, thermal), end_s,
         end_s);
}

}  // namespace

std::vector<Activity> activity(const Scene& scene, const Machine& machine,
                               const program::Samples& samples, const Process& process) {
  std::vector<Activity> knots;
  if (!scene.thermal) return knots;
  const ThermalDescription& thermal = *scene.thermal;
  double time_s = -history_s(thermal);
  for (const ThermalPhase& phase : thermal.history) {
    // The sum of the durations is rounded; the last phase ends exactly at the start of the program.
    const double end = &phase == &thermal.history.back() ? 0.0 : time_s + phase.duration;
    append(knots, thermal, phase_activity(phase, thermal), time_s, end);
    time_s = end;
  }
  append_program(knots, thermal, samples, CuttingEnergy(process), machine);
  // A machine that never runs still has a state: at rest in the room.
  if (knots.empty()) {
    ThermalPhase rest;
    rest.powered = thermal.powered;
    append(knots, thermal, phase_activity(rest, thermal), 0.0, 0.0);
  }
  return knots;
}

namespace {

// Bearings run below 120 deg C, windings below 155 deg C, where their insulation (class F) ends.
constexpr double coldest_T_C = -40.0, hottest_T_C = 150.0;
// The power law of a source holds near the speed for which it is stated. The limits lie between
// usual ratios and those of a wrong unit: 60 for 1/s and 9.55 for rad/s instead of rpm.
constexpr double max_speed_ratio = 5.0, min_speed_ratio = 1.0 / 30;

std::string temperature_text(const errors::ThermalRun& run) {
  Eigen::Index knot = 0, node = 0;
  const double hottest = run.T_C.maxCoeff(&knot, &node);
  if (!(hottest > hottest_T_C)) {
    const double coldest = run.T_C.minCoeff(&knot, &node);
    if (!(coldest < coldest_T_C)) return {};
  }
  return fmt::format(
      "thermal.node \"{}\" comes to {:.4g} deg C at {:.4g} h, and no machine runs beyond {:g} to "
      "{:g}: a power, capacity, conductance, speed or duration of [thermal] looks like another "
      "unit",
      run.network.nodes[std::size_t(node)].name, run.T_C(knot, node),
      run.knots[std::size_t(knot)].time_s / 3600.0, coldest_T_C, hottest_T_C);
}

/// Returns the speed that is unusual for a source stated at a reference speed; 0 if there is none.
/// Slow speeds are unusual only in the history, since a program may tap or ream.
double unusual_speed(const errors::ThermalRun& run, double stated) {
  double odd = 0.0;
  for (const errors::Activity& knot : run.knots) {
    const double times = std::abs(knot.spindle_speed) / stated;
    const bool slow = times > 0.0 && times < min_speed_ratio && knot.time_s < 0.0;
    if (slow || times > max_speed_ratio) odd = std::max(odd, std::abs(knot.spindle_speed));
  }
  return odd;
}

std::string speed_text(const errors::ThermalRun& run) {
  for (const errors::HeatSource& source : run.network.sources) {
    const auto* heat = std::get_if<errors::SpindleHeat>(&source.law);
    if (heat == nullptr || heat->power_W == 0.0) continue;
    const double speed = unusual_speed(run, heat->reference_speed);
    if (speed == 0.0) continue;
    return fmt::format(
        "the spindle runs at {:.4g} rpm, {:.3g} times the speed at which the heat of "
        "thermal.source \"{}\" is stated (at_rpm = {:.4g}): one of the two looks like 1/s, rad/s "
        "or "
        "1000 rpm",
        speed / units::rpm, speed / heat->reference_speed,
        run.network.nodes[std::size_t(source.node)].name, heat->reference_speed / units::rpm);
  }
  return {};
}

std::string datum_text(const DatumDescription& datum, const errors::ThermalRun& run) {
  constexpr double rounding_s = 1.0;  // durations in hours do not add up to whole seconds
  if (datum.kind == DatumDescription::Kind::None) return {};
  const double begin_s = run.knots.front().time_s, end_s = run.knots.back().time_s;
  if (datum.time_s < begin_s - rounding_s)
    return fmt::format(
        "datum.time_h is {:.4g} and the history begins at {:.4g} h: the machine is then as at its "
        "beginning",
        datum.time_s / 3600.0, begin_s / 3600.0);
  if (datum.time_s > end_s + rounding_s)
    return fmt::format(
        "datum.time_h is {:.4g} and the program ends at {:.4g} h: a datum found before the program "
        "has a negative time",
        datum.time_s / 3600.0, end_s / 3600.0);
  return {};
}

}  // namespace

std::vector<std::string> heat_warnings(const DatumDescription& datum, const Truth& truth) {
  std::vector<std::string> warnings;
  if (!truth.heat) return warnings;
  const errors::ThermalRun& run = truth.heat->run;
  for (std::string text : {temperature_text(run), speed_text(run), datum_text(datum, run)})
    if (!text.empty()) warnings.push_back(std::move(text));
  return warnings;
}

}  // namespace abbe::sim
