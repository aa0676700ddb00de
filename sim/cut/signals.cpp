#include "sim/cut/signals.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "errors/curve.h"
#include "kinematics/units.h"
#include "sim/cut/tool_motion.h"

namespace abbe::sim {
namespace {

using Eigen::VectorXd;
using kinematics::AxisState;
using kinematics::Joint;
using kinematics::Motion;
using kinematics::Pose;

// Largest number of rows of the program, and of the history.
constexpr std::size_t max_rows = 20000;
constexpr std::array component_names{"EX", "EY", "EZ", "EA", "EB", "EC"};

/// Collects the columns of the signals.
class SignalTable {
 public:
  explicit SignalTable(Eigen::Index rows) : rows_(rows) {}

  void add(std::string name, VectorXd values) {
    names_.push_back(std::move(name));
    values_.push_back(std::move(values));
  }
  void add_unless_zero(std::string name, VectorXd values) {
    if (!values.isZero(0.0)) add(std::move(name), std::move(values));
  }
  Signals take() {
    Signals signals;
    signals.columns = std::move(names_);
    signals.rows.resize(rows_, Eigen::Index(values_.size()));
    for (std::size_t i = 0; i < values_.size(); ++i) signals.rows.col(Eigen::Index(i)) = values_[i];
    return signals;
  }

 private:
  Eigen::Index rows_;
  std::vector<std::string> names_;
  std::vector<VectorXd> values_;
};

/// Returns the spindle speed, rad/s, at an instant of the history.
double history_speed(const Truth& truth, double time_s) {
  const auto& knots = truth.heat->run.knots;
  const auto next_knot = std::upper_bound(
      knots.begin(), knots.end(), time_s,
      [](double time, const errors::Activity& knot) { return time < knot.time_s; });
  return next_knot == knots.begin() ? 0.0 : (next_knot - 1)->spindle_speed;
}

/// Returns the rows of the history, with the axes as at the start of the program.
std::vector<SignalRow> history_rows(const Scene& scene, const Truth& truth,
                                    const SignalRow& start) {
  std::vector<SignalRow> rows;
  if (!truth.heat || !(scene.signals.history_interval > 0.0)) return rows;
  const double start_s = truth.heat->run.knots.front().time_s;
  const double interval_s =
      std::max(scene.signals.history_interval, -start_s / double(max_rows - 1));
  // The rows are at whole multiples of the interval before the program.
  for (double multiple = std::floor(-start_s / interval_s); multiple >= 1.0; --multiple) {
    SignalRow row = start;
    row.state.time_s = -multiple * interval_s;
    row.state.spindle_speed = history_speed(truth, row.state.time_s);
    rows.push_back(row);
  }
  return rows;
}

/// Returns the readings of an instrument with noise, rounded to its resolution.
VectorXd simulate_readings(const VectorXd& truth, double noise, double resolution,
                           std::uint64_t seed) {
  VectorXd reading = truth;
  for (Eigen::Index i = 0; i < reading.size(); ++i) {
    if (noise > 0.0) reading[i] += noise * errors::normal_deviate(seed, std::uint64_t(i));
    if (resolution > 0.0) reading[i] = std::round(reading[i] / resolution) * resolution;
  }
  return reading;
}

/// Returns the first-order response to a signal. It is exact for a signal that is linear between
/// the rows, whatever their spacing.
/// @param bandwidth  Hz
VectorXd low_pass(const VectorXd& input, const VectorXd& time_s, double bandwidth) {
  if (!(bandwidth > 0.0) || input.size() == 0) return input;
  VectorXd output(input.size());
  output[0] = input[0];
  for (Eigen::Index i = 1; i < input.size(); ++i) {
    const double x = (time_s[i] - time_s[i - 1]) * 2 * pi * bandwidth;  // step in time constants
    const double decay = std::exp(-x);
    // Below 1e-8 the quotient loses its digits, but the series 1 - (1 - e^-x) / x = x / 2 is exact.
    const double slope_gain = x > 1e-8 ? 1.0 - (1.0 - decay) / x : 0.5 * x;
    output[i] = decay * output[i - 1] + (1.0 - decay) * input[i - 1] +
                slope_gain * (input[i] - input[i - 1]);
  }
  return output;
}

/// Returns the seed of the noise of a sensor. Each sensor has a number, so that another sensor does
/// not change its readings. The first factor, 2^64 divided by the golden ratio, spreads
/// neighbouring seeds.
std::uint64_t sensor_seed(std::uint64_t seed, std::uint64_t sensor) {
  return seed * 0x9e3779b97f4a7c15u + 0x5151u * (sensor + 1);
}

void add_axes(SignalTable& table, const Scene& scene, const Machine& machine,
              const std::vector<SignalRow>& rows) {
  const auto& joints = machine.nominal.joints();
  const SignalsDescription& description = scene.signals;
  std::vector<std::pair<std::string, VectorXd>> encoder_columns;
  for (int j = 0; j < machine.nominal.size(); ++j) {
    const Joint& joint = joints[std::size_t(j)];
    const bool is_slide = joint.motion == Motion::Linear;
    VectorXd q(Eigen::Index(rows.size()));
    for (std::size_t i = 0; i < rows.size(); ++i) q[Eigen::Index(i)] = rows[i].state.q[j];
    const double unit = is_slide ? 1.0 : units::deg;
    const char* suffix = is_slide ? "_mm" : "_deg";
    table.add(joint.name + std::string(suffix), q / unit);
    if (is_spindle(machine, j)) continue;
    const VectorXd reading = simulate_readings(
        q, is_slide ? description.encoder_noise : description.encoder_noise_rad,
        is_slide ? description.encoder_resolution : description.encoder_resolution_rad,
        sensor_seed(scene.seed, std::uint64_t(j)));
    encoder_columns.emplace_back(joint.name + std::string("_encoder") + suffix, reading / unit);
  }
  // The columns of the encoders follow those of all commands.
  for (auto& [name, reading] : encoder_columns) table.add(name, std::move(reading));
}

void add_corrections(SignalTable& table, const Machine& machine, const std::vector<SignalRow>& rows,
                     std::span<const kinematics::AxisVector> correction,
                     std::span<const double> stroke) {
  VectorXd column(Eigen::Index(rows.size()));
  const auto add = [&](std::string name, const auto& value_at) {
    for (std::size_t i = 0; i < rows.size(); ++i)
      column[Eigen::Index(i)] = value_at(rows[i].sample);
    table.add(std::move(name), column);
  };
  for (int j = 0; j < machine.nominal.size() && !correction.empty(); ++j) {
    if (is_spindle(machine, j)) continue;
    const Joint& joint = machine.nominal.joints()[std::size_t(j)];
    const bool is_slide = joint.motion == Motion::Linear;
    add(joint.name + std::string(is_slide ? "_correction_um" : "_correction_urad"),
        [&](std::size_t i) { return correction[i][j] / (is_slide ? units::um : units::urad); });
  }
  if (!stroke.empty()) add("piezo_um", [&](std::size_t i) { return stroke[i] / units::um; });
}

void add_heat(SignalTable& table, const Scene& scene, const Truth& truth, const VectorXd& time_s) {
  if (!truth.heat) return;
  const auto& nodes = truth.heat->run.network.nodes;
  Eigen::MatrixXd T_C(time_s.size(), Eigen::Index(nodes.size()));
  for (Eigen::Index i = 0; i < time_s.size(); ++i)
    T_C.row(i) = errors::temperatures(truth.heat->run, time_s[i]).transpose();
  for (std::size_t k = 0; k < nodes.size(); ++k)
    table.add("T_" + nodes[k].name + "_C", T_C.col(Eigen::Index(k)));
  for (const errors::TemperatureSensor& sensor : scene.thermal->sensors)
    table.add(sensor.name + "_C", errors::readings(sensor, truth.heat->run, time_s));
}

/// The quantities of `ProcessStep` at the rows of the signals.
struct ProcessRows {
  Eigen::MatrixXd force;  ///< (n x 3) N
  VectorXd torque, power_W, removed, engaged, chip;
};

ProcessRows process_rows(const Process& process, const VectorXd& time_s) {
  const Eigen::Index row_count = time_s.size();
  const VectorXd zero = VectorXd::Zero(row_count);
  ProcessRows rows{Eigen::MatrixXd::Zero(row_count, 3), zero, zero, zero, zero, zero};
  std::size_t next_step = 0;
  for (Eigen::Index i = 0; i < row_count; ++i) {
    rows.force.row(i) = load_at(process, time_s[i]).tool_wrench_t.head<3>().transpose();
    for (; next_step < process.steps.size() && process.steps[next_step].time_s <= time_s[i];
         ++next_step)
      rows.removed[i] += process.steps[next_step].removed;
    // Torque and power of a step hold over the interval that ends at the step.
    const std::size_t last_step = std::min(next_step, process.steps.size() - 1);
    const bool is_at_step = next_step > 0 && process.steps[next_step - 1].time_s == time_s[i];
    const ProcessStep& step = process.steps[is_at_step ? next_step - 1 : last_step];
    rows.torque[i] = step.torque;
    rows.power_W[i] = step.power_W;
    rows.engaged[i] = step.engaged;
    rows.chip[i] = step.chip;
  }
  return rows;
}

void add_process(SignalTable& table, const Scene& scene, const Process& process,
                 const VectorXd& time_s, const VectorXd& spindle_speed) {
  const SignalsDescription& description = scene.signals;
  ProcessRows rows{{}, VectorXd::Zero(time_s.size()), {}, {}, {}, {}};
  if (!process.steps.empty()) {
    rows = process_rows(process, time_s);
    for (int k = 0; k < 3; ++k) table.add(fmt::format("F{}_N", "XYZ"[k]), rows.force.col(k));
    table.add("torque_Nm", rows.torque * 1e-3);
    table.add("power_W", rows.power_W);
    table.add("removed_mm3", rows.removed);
    table.add("engaged_mm", rows.engaged);
    table.add("chip_mm", rows.chip);
  }
  if (description.current) {
    const auto& motor = *description.current;
    VectorXd torque = rows.torque + motor.viscous_torque * spindle_speed;
    for (Eigen::Index i = 0; i < torque.size(); ++i)
      if (spindle_speed[i] > 0.0) torque[i] += motor.idle_torque;
    const VectorXd current = low_pass(torque / motor.torque_per_current, time_s, motor.bandwidth);
    table.add("current_A",
              simulate_readings(current, motor.noise_A, 0.0, sensor_seed(scene.seed, 100)));
  }
  if (description.dynamometer && !process.steps.empty())
    for (int k = 0; k < 3; ++k)
      table.add(
          fmt::format("F{}_dynamometer_N", "XYZ"[k]),
          simulate_readings(low_pass(rows.force.col(k), time_s, description.dynamometer->bandwidth),
                            description.dynamometer->noise, description.dynamometer->resolution,
                            sensor_seed(scene.seed, 101 + std::uint64_t(k))));
}

/// The deviations of a row: motion and location of every joint, then tool, part and tip.
using DeviationRow = Eigen::Matrix<double, 1, Eigen::Dynamic>;

/// Returns the pose of a tool turned back by the spindle that turns the workpiece, with which its
/// deviations would turn otherwise; the pose itself if no spindle turns the workpiece.
Pose derotated_pose(const Machine& machine, const AxisState& state, const Pose& T_wt) {
  if (!machine.workpiece_spindle) return T_wt;
  const int spindle = *machine.workpiece_spindle;
  return slow_pose(spindle_line(machine.nominal, spindle), state.q[spindle], T_wt);
}

DeviationRow deviation_row(const Truth& truth, const Machine& machine,
                           const SignalRow& signal_row) {
  const errors::ForceDeviations row_deviations =
      deviations(truth, signal_row.state, signal_row.load);
  const Eigen::Index joints = Eigen::Index(row_deviations.joints.size());
  DeviationRow row(12 * joints + 18);
  for (Eigen::Index j = 0; j < joints; ++j) {
    row.segment<6>(12 * j) = row_deviations.joints[std::size_t(j)].motion.transpose();
    row.segment<6>(12 * j + 6) = row_deviations.joints[std::size_t(j)].location.transpose();
  }
  row.segment<6>(12 * joints) = row_deviations.tool_t.transpose();
  row.segment<6>(12 * joints + 6) = row_deviations.workpiece_w.transpose();
  const Pose T_wt = derotated_pose(machine, signal_row.state,
                                   tool_in_workpiece(truth, signal_row.state, signal_row.load));
  const Pose T_wt_target = derotated_pose(machine, signal_row.state, signal_row.T_wt_target);
  row.segment<3>(12 * joints + 12) = (T_wt.translation() - T_wt_target.translation()).transpose();
  row.segment<3>(12 * joints + 15) =
      kinematics::rotation_vector(T_wt.linear() * T_wt_target.linear().transpose()).transpose();
  return row;
}

std::string column_name(int component, const std::string& axis) {
  return component_names[std::size_t(component)] + axis + (component < 3 ? "_um" : "_urad");
}

void add_deviations(SignalTable& table, const Machine& machine, const Eigen::MatrixXd& rows) {
  const auto& joints = machine.nominal.joints();
  const auto add = [&](Eigen::Index first, const auto& name) {
    for (int k = 0; k < 6; ++k)
      table.add_unless_zero(name(k), rows.col(first + k) / (k < 3 ? units::um : units::urad));
  };
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const char axis = joints[j].name == 's' ? 'S' : joints[j].name;
    const Eigen::Index first = 12 * Eigen::Index(j);
    add(first, [&](int k) { return column_name(k, std::string(1, axis)); });
    add(first + 6, [&](int k) { return column_name(k, std::string("0") + axis); });
  }
  const Eigen::Index first_extra = 12 * Eigen::Index(joints.size());
  add(first_extra, [](int k) { return "tool_" + column_name(k, ""); });
  add(first_extra + 6, [](int k) { return "part_" + column_name(k, ""); });
  for (int k = 0; k < 6; ++k)  // the tip is always reported
    table.add("tip_" + column_name(k, ""),
              rows.col(first_extra + 12 + k) / (k < 3 ? units::um : units::urad));
}

}  // namespace

bool has_signals(const Scene& scene, bool has_channel) {
  return scene.thermal || scene.cutting || scene.compliance || has_channel;
}

SignalSamples::SignalSamples(double interval_s, double start_s, double end_s)
    : interval_s_(std::max(interval_s, (end_s - start_s) / double(max_rows - 1))),
      start_s_(start_s) {}

void SignalSamples::pick(const std::vector<AxisState>& states, bool is_continued, bool continues,
                         const std::function<void(std::size_t sample)>& use) {
  if (!is_continued) is_picked_ = false;
  const std::size_t last = states.size() - 1;
  for (std::size_t sample = 0; !is_complete_;) {
    if (sample == last && continues) return;  // the next window decides about its last sample
    const double target_s = start_s_ + double(multiple_) * interval_s_;
    if (sample < last && std::abs(states[sample + 1].time_s - target_s) <=
                             std::abs(states[sample].time_s - target_s)) {
      ++sample;
      is_picked_ = false;
      continue;
    }
    // A sample may be the nearest to two multiples.
    if (!is_picked_) use(sample);
    is_picked_ = true;
    is_complete_ = ++multiple_ == max_rows || sample == last;
  }
}

Signals signals(const Scene& scene, const Machine& machine, const Truth& truth,
                const SignalInputs& inputs) {
  const auto& states = inputs.samples.states;
  const bool has_channel = !inputs.correction.empty() || !inputs.stroke.empty();
  if (states.empty() || !has_signals(scene, has_channel)) return {};
  const SignalRow start{states.front(), 0, {}, inputs.T_wt_target.front(), 0};
  std::vector<SignalRow> rows;
  SignalSamples(scene.signals.interval, states.front().time_s, states.back().time_s)
      .pick(states, false, false, [&](std::size_t i) {
        rows.push_back({states[i], inputs.samples.line[i],
                        inputs.loads.empty() ? errors::Load{} : inputs.loads[i],
                        inputs.T_wt_target[i], i});
      });
  return signals(scene, machine, truth, start, std::move(rows), inputs.process, inputs.correction,
                 inputs.stroke);
}

Signals signals(const Scene& scene, const Machine& machine, const Truth& truth,
                const SignalRow& start, std::vector<SignalRow> rows, const Process& process,
                std::span<const kinematics::AxisVector> correction,
                std::span<const double> stroke) {
  const std::vector<SignalRow> history = history_rows(scene, truth, start);
  rows.insert(rows.begin(), history.begin(), history.end());
  const Eigen::Index n = Eigen::Index(rows.size());
  VectorXd time_s(n), line(n), spindle_speed(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    time_s[i] = rows[std::size_t(i)].state.time_s;
    line[i] = rows[std::size_t(i)].line;
    spindle_speed[i] = rows[std::size_t(i)].state.spindle_speed;
  }
  SignalTable table(n);
  table.add("time_s", time_s);
  table.add("line", line);
  add_axes(table, scene, machine, rows);
  add_corrections(table, machine, rows, correction, stroke);
  table.add("spindle_rpm", spindle_speed / units::rpm);
  add_heat(table, scene, truth, time_s);
  add_process(table, scene, process, time_s, spindle_speed);
  Eigen::MatrixXd deviation(n, 12 * machine.nominal.size() + 18);
  tbb::parallel_for(Eigen::Index(0), n, [&](Eigen::Index i) {
    deviation.row(i) = deviation_row(truth, machine, rows[std::size_t(i)]);
  });
  add_deviations(table, machine, deviation);
  return table.take();
}

Signals joined(Signals first, const Signals& second) {
  if (first.columns.empty()) return second;
  if (second.columns.empty()) return first;
  std::vector<Eigen::Index> joined_columns;  // (columns of `second`) column of the joined table
  for (const std::string& name : second.columns) {
    auto column = std::ranges::find(first.columns, name);
    if (column == first.columns.end()) column = first.columns.insert(column, name);
    joined_columns.push_back(column - first.columns.begin());
  }
  const Eigen::Index n = first.rows.rows();
  first.rows.conservativeResizeLike(
      Eigen::MatrixXd::Zero(n + second.rows.rows(), Eigen::Index(first.columns.size())));
  for (std::size_t k = 0; k < joined_columns.size(); ++k)
    first.rows.col(joined_columns[k]).tail(second.rows.rows()) = second.rows.col(Eigen::Index(k));
  return first;
}

std::string to_csv(const Signals& signals) {
  std::string text;
  for (std::size_t k = 0; k < signals.columns.size(); ++k)
    text += (k ? "," : "") + signals.columns[k];
  text += "\n";
  for (Eigen::Index i = 0; i < signals.rows.rows(); ++i) {
    for (Eigen::Index k = 0; k < signals.rows.cols(); ++k)
      text += fmt::format("{}{:.9g}", k ? "," : "", signals.rows(i, k));
    text += "\n";
  }
  return text;
}

}  // namespace abbe::sim
