#include "sim/cut/process.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <vector>

#include <fmt/format.h>

#include "kinematics/units.h"

// Evaluation of a simulated cut: totals, interpolated loads, chatter and warnings; and the machine
// activity that drives the thermal model.

namespace abbe::sim {

using errors::Load;

void append_part(Process part, Process& process) {
  process.part_starts.push_back(process.steps.size());
  std::ranges::move(part.steps, std::back_inserter(process.steps));
  for (const int line : part.crash_lines)
    if (std::ranges::find(process.crash_lines, line) == process.crash_lines.end())
      process.crash_lines.push_back(line);
  process.stock = std::move(part.stock);
  process.turned = std::move(part.turned);
  add_warnings(std::move(part.warnings), process.warnings);
}

Process part_process(const Process& process, std::size_t part) {
  const auto& starts = process.part_starts;
  const std::size_t first = part < starts.size() ? starts[part] : 0,
                    last = part + 1 < starts.size() ? starts[part + 1] : process.steps.size();
  Process result;
  result.steps.assign(process.steps.begin() + std::ptrdiff_t(first),
                      process.steps.begin() + std::ptrdiff_t(last));
  return result;
}

Process take_stock(Process& process) {
  Process result;
  result.stock = std::exchange(process.stock, std::nullopt);
  result.turned = std::exchange(process.turned, std::nullopt);
  return result;
}

ProcessTotals totals(const Process& process) {
  ProcessTotals process_totals;
  for (const ProcessStep& step : process.steps) {
    const double force = step.load.tool_wrench_t.head<3>().norm();
    process_totals.removed += step.removed;
    process_totals.max_force = std::max(process_totals.max_force, force);
    process_totals.max_torque = std::max(process_totals.max_torque, step.torque);
    process_totals.max_power_W = std::max(process_totals.max_power_W, step.power_W);
    process_totals.max_iterations = std::max(process_totals.max_iterations, step.iterations);
    process_totals.max_loop_gain = std::max(process_totals.max_loop_gain, step.loop_gain);
    if (force > 0.0) {
      process_totals.force_sum += force;
      ++process_totals.loaded_steps;
    }
    if (step.converged) continue;
    ++process_totals.unconverged_steps;
    process_totals.max_disagreement = std::max(process_totals.max_disagreement, step.disagreement);
  }
  return process_totals;
}

Load load_at(const Process& process, double time_s) {
  const auto& steps = process.steps;
  const auto next_step =
      std::lower_bound(steps.begin(), steps.end(), time_s,
                       [](const ProcessStep& step, double time) { return step.time_s < time; });
  if (next_step == steps.end()) return {};
  if (next_step == steps.begin() || next_step->time_s == time_s)
    return next_step->time_s == time_s ? next_step->load : Load{};
  const ProcessStep& previous_step = *(next_step - 1);
  const double fraction =
      (time_s - previous_step.time_s) / (next_step->time_s - previous_step.time_s);
  Load load;
  load.tool_wrench_t =
      (1 - fraction) * previous_step.load.tool_wrench_t + fraction * next_step->load.tool_wrench_t;
  // An unloaded step has no contact point.
  const bool is_loaded_before = !previous_step.load.tool_wrench_t.isZero(0.0),
             is_loaded_after = !next_step->load.tool_wrench_t.isZero(0.0);
  if (is_loaded_before && is_loaded_after)
    load.contact_t =
        (1 - fraction) * previous_step.load.contact_t + fraction * next_step->load.contact_t;
  else
    load.contact_t = is_loaded_before ? previous_step.load.contact_t : next_step->load.contact_t;
  return load;
}

namespace {

// Limits of a swing; `revolution_swing` gives their reasons.
constexpr std::size_t changes_per_window = 10;  // changes of force from one revolution to the next
constexpr double min_change = 0.01;             // fraction of the force
constexpr double min_swing_gain = 0.99;         // a swing that has grown to its full size has 1
constexpr double min_swing_contraction = 0.5;   // with a smaller loop gain every change decays
constexpr std::size_t revolutions_per_leap_window = 40;
constexpr int min_leaps = 3;

/// Returns the factor by which the changes of force grow per revolution, over a window that begins
/// at revolution `first`; nothing if the changes do not alternate throughout the window.
std::optional<double> alternating_gain(const std::vector<double>& force, std::size_t first) {
  if (first + changes_per_window >= force.size()) return std::nullopt;
  double first_sum = 0.0, second_sum = 0.0;
  for (std::size_t i = 0; i < changes_per_window; ++i) {
    const std::size_t k = first + i;
    const double change = force[k + 1] - force[k];
    if (!(std::abs(change) > min_change * std::max(force[k], force[k + 1]))) return std::nullopt;
    if (i > 0 && change * (force[k] - force[k - 1]) > 0.0) return std::nullopt;
    (i < changes_per_window / 2 ? first_sum : second_sum) += std::abs(change);
  }
  // The means of both halves are half a window apart.
  return std::pow(second_sum / first_sum, 2.0 / double(changes_per_window));
}

/// Returns true if the loop of force and deflection is strong enough to cause a swing in the
/// window. Forces may also alternate for another reason, such as error motions of a spindle.
bool is_loop_strong(const Process& process, std::size_t first) {
  for (std::size_t k = first; k <= first + changes_per_window; ++k)
    if (process.steps[k].loop_gain >= min_swing_contraction) return true;
  return false;
}

/// Returns the alternating swing with the largest difference of forces, with the largest gain of
/// all swings; nothing if no forces alternate.
std::optional<RevolutionSwing> find_alternating_swing(const Process& process,
                                                      const std::vector<double>& force) {
  std::optional<RevolutionSwing> widest_swing;
  double max_gain = 0.0;  // over all swings, not only the widest
  for (std::size_t first = 0; first < force.size();) {
    std::size_t k = first;
    for (auto window_gain = alternating_gain(force, k);
         window_gain && *window_gain >= min_swing_gain && is_loop_strong(process, k);
         window_gain = alternating_gain(force, ++k))
      max_gain = std::max(max_gain, *window_gain);
    if (k == first) {
      ++first;
      continue;
    }
    const auto begin = force.begin() + std::ptrdiff_t(first);
    const auto end = force.begin() + std::ptrdiff_t(k + changes_per_window);
    const auto [low, high] = std::minmax_element(begin, end);
    if (!widest_swing || *high - *low > widest_swing->high - widest_swing->low)
      widest_swing = RevolutionSwing{int(end - begin), process.steps[first].line, *low, *high, 0.0};
    first = k + 1;
  }
  if (widest_swing) widest_swing->gain = max_gain;
  return widest_swing;
}

/// Returns the swing from revolution `first` on within one program line, with the number of times
/// the tool leaps out of the work and back.
RevolutionSwing count_leaps(const Process& process, const std::vector<double>& force,
                            std::size_t first) {
  RevolutionSwing swing;
  swing.line = process.steps[first].line;
  for (std::size_t k = first; k < std::min(first + revolutions_per_leap_window, force.size());
       ++k) {
    const ProcessStep& step = process.steps[k];
    if (step.line != swing.line) break;
    ++swing.revolutions;
    swing.high = std::max(swing.high, force[k]);
    swing.gain = std::max(swing.gain, step.loop_gain);
    if (k > first && force[k] > 0.0 && force[k - 1] == 0.0) ++swing.leaps;
  }
  return swing;
}

/// Returns the first swing in which the tool repeatedly leaps out of the work and back; nothing if
/// there is none.
std::optional<RevolutionSwing> find_leaping_swing(const Process& process,
                                                  const std::vector<double>& force) {
  for (std::size_t first = 0; first < force.size(); ++first) {
    const RevolutionSwing swing = count_leaps(process, force, first);
    if (swing.leaps >= min_leaps && swing.gain >= 1.0) return swing;
  }
  return std::nullopt;
}

}  // namespace

std::optional<RevolutionSwing> revolution_swing(const Process& process) {
  if (!process.turned) return std::nullopt;
  std::vector<double> force;
  for (const ProcessStep& step : process.steps)
    force.push_back(step.load.tool_wrench_t.head<3>().norm());
  if (const auto swing = find_alternating_swing(process, force)) return swing;
  // Forces that alternate do not leap: the tool leaves the work only in a stronger swing.
  return find_leaping_swing(process, force);
}

namespace {

std::string swing_text(const RevolutionSwing& swing) {
  const std::string description =
      swing.leaps > 0
          ? fmt::format(
                "on line {} the tool jumps out of the material and back {} times in {} "
                "revolutions, under up to {:.4g} N, with a gain from depth to force of {:.2f}",
                swing.line, swing.leaps, swing.revolutions, swing.high, swing.gain)
          : fmt::format(
                "for {} revolutions from line {} on the force alternates between {:.4g} and {:.4g} "
                "N from one to the next, and a change grows by a factor of {:.2f}",
                swing.revolutions, swing.line, swing.low, swing.high, swing.gain);
  return "the cut is unstable: " + description +
         ": the cutting force deflects the tool too far into the material, and the surface shows "
         "chatter";
}

}  // namespace

std::vector<std::string> process_warnings(const Scene& scene, const Process& process) {
  std::vector<std::string> warnings;
  if (process.steps.empty()) return warnings;
  const ProcessTotals process_totals = totals(process);
  // At a jump of the force one step in thousands oscillates between both sides by some nanometres.
  // It is not reported, since no setting avoids it.
  const double tolerance = scene.cutting->tolerance;
  const bool is_negligible =
      process_totals.max_disagreement < std::min(10.0 * tolerance, 10.0 * units::nm) &&
      1000 * process_totals.unconverged_steps < process.steps.size();
  if (process_totals.unconverged_steps > 0 && !is_negligible)
    warnings.push_back(
        fmt::format("force and deflection did not converge to {:.3g} nm at {} of {} steps; they "
                    "differ by at most {:.3g} nm",
                    tolerance / units::nm, process_totals.unconverged_steps, process.steps.size(),
                    process_totals.max_disagreement / units::nm));
  if (const auto swing = revolution_swing(process)) warnings.push_back(swing_text(*swing));
  if (!(process_totals.removed > 0.0)) warnings.push_back("the tool did not touch the blank");
  if (!process.crash_lines.empty())
    warnings.push_back(
        fmt::format("a rapid move or the shank hit material on {} lines, first line {}",
                    process.crash_lines.size(), process.crash_lines.front()));
  const auto worst_overhang = std::ranges::max_element(process.steps, {}, &ProcessStep::overhang);
  if (worst_overhang->overhang > 0.01)
    warnings.push_back(
        fmt::format("the cut extends {:.3g} mm beyond the edges of the insert (line {}): the "
                    "material there is removed and its force computed as for a radial edge",
                    worst_overhang->overhang, worst_overhang->line));
  return warnings;
}

void add_warnings(std::vector<std::string> additional, std::vector<std::string>& warnings) {
  std::move(additional.begin(), additional.end(), std::back_inserter(warnings));
}

std::vector<std::string> idle_warnings(const Scene& scene) {
  std::vector<std::string> warnings;
  const auto warn = [&](bool applies, const char* text) {
    if (applies) warnings.push_back(text);
  };
  const bool has_forces = has_cutting_force(scene);
  if (scene.compliance) {
    const errors::ComplianceErrors& compliance_errors = *scene.compliance;
    const bool has_weight = (compliance_errors.gravity_b || compliance_errors.inertia) &&
                            !compliance_errors.masses.empty();
    warn(!has_forces && !has_weight && compliance_errors.clamping_w.isZero(0.0),
         "no load acts on the compliance: add [cutting] with a material, masses with gravity or "
         "inertia, or clamping");
    warn((compliance_errors.gravity_b || compliance_errors.inertia) &&
             compliance_errors.masses.empty(),
         "gravity and inertia have no effect without [[compliance.mass]]");
    warn(!compliance_errors.gravity_b && !compliance_errors.inertia &&
             !compliance_errors.masses.empty(),
         "the masses have no effect without gravity or inertia");
  }
  warn(scene.signals.dynamometer && !has_forces,
       "the dynamometer has no signal without cutting forces");
  warn(scene.signals.current && !has_forces && !scene.thermal && !scene.compliance,
       "signals.csv is only written with heat, stock or compliance");
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
  const double fraction = (time_s - t[i - 1]) / (t[i] - t[i - 1]);
  return T[i - 1] + fraction * (T[i] - T[i - 1]);
}

/// Appends the knots of an activity: its ends, and every row of the room profile between them.
void append_knots(std::vector<Activity>& knots, const ThermalDescription& thermal,
                  Activity activity, double from_s, double to_s) {
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

  /// Returns the energy, J, from the previous call to `to_s`. The power of a step applies from the
  /// previous step on.
  double energy_until(double to_s) {
    double energy_J = 0.0;
    while (next_step_ < steps_.size() && steps_[next_step_].time_s <= to_s) {
      energy_J += steps_[next_step_].power_W * (steps_[next_step_].time_s - time_s_);
      time_s_ = steps_[next_step_++].time_s;
    }
    // The remainder of a step belongs to the next call.
    if (next_step_ < steps_.size() && next_step_ > 0 && to_s > time_s_) {
      energy_J += steps_[next_step_].power_W * (to_s - time_s_);
      time_s_ = to_s;
    }
    return energy_J;
  }

 private:
  const std::vector<ProcessStep>& steps_;
  std::size_t next_step_ = 0;
  double time_s_ = 0.0;
};

/// Returns the constant activity of a phase; its time and room temperature are set by
/// `append_knots`.
Activity phase_activity(const ThermalPhase& phase, const ThermalDescription& thermal) {
  Activity activity;
  activity.spindle_speed = phase.spindle_speed;
  activity.axis_speed = phase.axis_speed;
  activity.powered = phase.powered;
  activity.coolant = phase.coolant;
  activity.coolant_T_C = thermal.coolant_T_C;
  return activity;
}

/// Divides a program into intervals with mean speeds, which suffice because temperatures follow
/// slowly, and appends their activity. The samples are added one by one.
class ProgramActivity {
 public:
  ProgramActivity(const ThermalDescription& thermal, const Machine& machine, const Process& process,
                  std::vector<Activity>& knots)
      : thermal_(thermal), machine_(machine), energy_(process), knots_(knots) {}

  void add(const kinematics::AxisState& state) {
    if (has_moved_ && last_->time_s - from_s_ >= thermal_.interval) end_interval();
    if (!last_) {
      travel_ = kinematics::AxisVector::Zero(state.q.size());
      from_s_ = state.time_s;
    } else {
      travel_ += (state.q - last_->q).cwiseAbs();
      spindle_angle_ += state.spindle_speed * (state.time_s - last_->time_s);
      has_moved_ = true;
    }
    last_ = state;
  }

  /// Appends the last interval, then the machine at rest.
  void finish() {
    if (!last_) return;
    if (has_moved_) end_interval();
    const kinematics::AxisVector zero_speeds = kinematics::AxisVector::Zero(last_->q.size());
    // The run continues with the activity of the last knot.
    append_knots(knots_, thermal_,
                 phase_activity({0.0, 0.0, zero_speeds, thermal_.powered, false}, thermal_),
                 last_->time_s, last_->time_s);
  }

 private:
  void end_interval() {
    const double duration = last_->time_s - from_s_;
    if (duration > 0.0) {
      kinematics::AxisVector axis_speeds = travel_ / duration;
      for (int j = 0; j < machine_.nominal.size(); ++j)  // spindles have a heat law of their own
        if (is_spindle(machine_, j)) axis_speeds[j] = 0.0;
      Activity interval = phase_activity(
          {duration, spindle_angle_ / duration, axis_speeds, thermal_.powered, thermal_.coolant},
          thermal_);
      interval.cutting_power_W = energy_.energy_until(last_->time_s) / duration;
      append_knots(knots_, thermal_, interval, from_s_, last_->time_s);
    }
    from_s_ = last_->time_s;
    travel_.setZero();
    spindle_angle_ = 0.0;
    has_moved_ = false;
  }

  const ThermalDescription& thermal_;
  const Machine& machine_;
  CuttingEnergy energy_;
  std::vector<Activity>& knots_;
  std::optional<kinematics::AxisState> last_;
  double from_s_ = 0.0;  // start of the interval
  kinematics::AxisVector travel_;
  double spindle_angle_ = 0.0;
  bool has_moved_ = false;
};

}  // namespace

std::vector<Activity> activity(const Scene& scene, const Machine& machine,
                               const SamplesVisitor& visit_samples, const Process& process) {
  std::vector<Activity> knots;
  if (!scene.thermal) return knots;
  const ThermalDescription& thermal = *scene.thermal;
  double time_s = -history_duration(thermal);
  for (const ThermalPhase& phase : thermal.history) {
    // The last phase ends exactly at the start of the program; a sum of durations is rounded.
    const double end_s = &phase == &thermal.history.back() ? 0.0 : time_s + phase.duration;
    append_knots(knots, thermal, phase_activity(phase, thermal), time_s, end_s);
    time_s = end_s;
  }
  ProgramActivity program(thermal, machine, process, knots);
  if (visit_samples)
    visit_samples([&](const program::Samples& samples, std::size_t first) {
      for (std::size_t i = first; i < samples.states.size(); ++i) program.add(samples.states[i]);
    });
  program.finish();
  // A machine without history and program is at rest in the room.
  if (knots.empty()) {
    ThermalPhase rest_phase;
    rest_phase.powered = thermal.powered;
    append_knots(knots, thermal, phase_activity(rest_phase, thermal), 0.0, 0.0);
  }
  return knots;
}

namespace {

// Bearings run below 120 deg C, windings below 155 deg C, the limit of their insulation (class F).
constexpr double coldest_T_C = -40.0, hottest_T_C = 150.0;
// The power law of a source holds near the speed at which it is stated. The limits lie between
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
      "thermal.node \"{}\" reaches {:.4g} deg C at {:.4g} h, outside the plausible range {:g} to "
      "{:g}: check the units of power, capacity, conductance, speed and duration in [thermal]",
      run.network.nodes[std::size_t(node)].name, run.T_C(knot, node),
      run.knots[std::size_t(knot)].time_s / 3600.0, coldest_T_C, hottest_T_C);
}

/// Returns the largest speed, rad/s, that is unusual for a source stated at a reference speed; 0 if
/// there is none. Slow speeds are unusual only in the history, since a program may tap or ream.
double unusual_speed(const errors::ThermalRun& run, double reference_speed) {
  double result = 0.0;
  for (const errors::Activity& knot : run.knots) {
    const double ratio = std::abs(knot.spindle_speed) / reference_speed;
    const bool is_slow = ratio > 0.0 && ratio < min_speed_ratio && knot.time_s < 0.0;
    if (is_slow || ratio > max_speed_ratio) result = std::max(result, std::abs(knot.spindle_speed));
  }
  return result;
}

std::string speed_text(const errors::ThermalRun& run) {
  for (const errors::HeatSource& source : run.network.sources) {
    const auto* heat = std::get_if<errors::SpindleHeat>(&source.law);
    if (heat == nullptr || heat->power_W == 0.0) continue;
    const double speed = unusual_speed(run, heat->reference_speed);
    if (speed == 0.0) continue;
    return fmt::format(
        "the spindle runs at {:.4g} rpm, {:.3g} times the speed at which the heat of "
        "thermal.source \"{}\" is stated (at_rpm = {:.4g}): check both units (1/s, rad/s or 1000 "
        "rpm?)",
        speed / units::rpm, speed / heat->reference_speed,
        run.network.nodes[std::size_t(source.node)].name, heat->reference_speed / units::rpm);
  }
  return {};
}

std::string datum_text(const DatumDescription& datum, const errors::ThermalRun& run) {
  constexpr double rounding_s = 1.0;  // of durations stated in hours
  if (datum.kind == DatumDescription::Kind::None) return {};
  const double begin_s = run.knots.front().time_s, end_s = run.knots.back().time_s;
  if (datum.time_s < begin_s - rounding_s)
    return fmt::format(
        "datum.time_h is {:.4g}, before the history begins at {:.4g} h: the machine is then in its "
        "initial state",
        datum.time_s / 3600.0, begin_s / 3600.0);
  if (datum.time_s > end_s + rounding_s)
    return fmt::format(
        "datum.time_h is {:.4g}, after the program ends at {:.4g} h: a datum measured before the "
        "program has a negative time",
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
