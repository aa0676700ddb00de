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

// Limit on the rows of the program, and on those of the history.
constexpr std::size_t most_rows = 20000;
constexpr std::array component_names{"EX", "EY", "EZ", "EA", "EB", "EC"};

/// Collects the columns of the signals in the order they are added.
class Table {
 public:
  explicit Table(Eigen::Index rows) : rows_(rows) {}

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

/// A row of the signals: its instant and the state of the machine.
struct Row {
  AxisState state;
  int line = 0;
  errors::Load load;
  Pose T_wt_wanted;
  std::size_t sample = 0;
};

/// Returns the spindle speed in the phase of the history that contains an instant.
double history_speed(const Truth& truth, double time_s) {
  const auto& knots = truth.heat->run.knots;
  const auto after = std::upper_bound(
      knots.begin(), knots.end(), time_s,
      [](double time, const errors::Activity& knot) { return time < knot.time_s; });
  return after == knots.begin() ? 0.0 : (after - 1)->spindle_speed;
}

void add_history(std::vector<Row>& rows, const Scene& scene, const Truth& truth,
                 const SignalInputs& recorded) {
  if (!truth.heat || !(scene.signals.history_interval > 0.0)) return;
  const double start = truth.heat->run.knots.front().time_s;
  const double interval = std::max(scene.signals.history_interval, -start / double(most_rows - 1));
  // Rows at whole multiples of the interval before the program, the earliest first.
  for (double k = std::floor(-start / interval); k >= 1.0; --k) {
    Row row{recorded.samples.states.front(), 0, {}, recorded.T_wt_wanted.front(), 0};
    row.state.time_s = -k * interval;
    row.state.spindle_speed = history_speed(truth, row.state.time_s);
    rows.push_back(row);
  }
}

/// Adds the samples nearest to the whole multiples of the interval.
void add_program(std::vector<Row>& rows, const Scene& scene, const SignalInputs& recorded) {
  const auto& states = recorded.samples.states;
  const double start = states.front().time_s, length = states.back().time_s - start;
  const double interval = std::max(scene.signals.interval, length / double(most_rows - 1));
  std::size_t i = 0;
  std::optional<std::size_t> last;
  for (std::size_t k = 0; k < most_rows && last != states.size() - 1; ++k) {
    const double time = start + double(k) * interval;
    while (i + 1 < states.size() &&
           std::abs(states[i + 1].time_s - time) <= std::abs(states[i].time_s - time))
      ++i;
    // a sample nearest to two multiples makes one row
    if (last == i) continue;
    last = i;
    rows.push_back({states[i], recorded.samples.line[i],
                    recorded.loads.empty() ? errors::Load{} : recorded.loads[i],
                    recorded.T_wt_wanted[i], i});
  }
}

/// Returns the readings of an instrument: with noise, rounded to its resolution.
VectorXd read(const VectorXd& truth, double noise, double resolution, std::uint64_t seed) {
  VectorXd reading = truth;
  for (Eigen::Index i = 0; i < reading.size(); ++i) {
    if (noise > 0.0) reading[i] += noise * errors::normal_deviate(seed, std::uint64_t(i));
    if (resolution > 0.0) reading[i] = std::round(reading[i] / resolution) * resolution;
  }
  return reading;
}

/// Returns the first-order response to a signal, with a bandwidth in Hz; exact for a signal that is
/// linear between the rows, whatever their spacing.
VectorXd filtered(const VectorXd& input, const VectorXd& time_s, double bandwidth) {
  if (!(bandwidth > 0.0) || input.size() == 0) return input;
  VectorXd output(input.size());
  output[0] = input[0];
  for (Eigen::Index i = 1; i < input.size(); ++i) {
    const double x = (time_s[i] - time_s[i - 1]) * 2 * pi * bandwidth;  // step in time constants
    const double decay = std::exp(-x);
    // below 1e-8 the quotient loses its digits; the series 1 - (1 - e^-x) / x = x / 2 is exact
    // there
    const double slope_gain = x > 1e-8 ? 1.0 - (1.0 - decay) / x : 0.5 * x;
    output[i] = decay * output[i - 1] + (1.0 - decay) * input[i - 1] +
                slope_gain * (input[i] - input[i - 1]);
  }
  return output;
}

/// Returns the seed of the noise of a sensor, by its number, so that adding a sensor does not
/// change the readings of the others. The first factor is 2^64 divided by the golden ratio, which
/// spreads neighbouring seeds.
std::uint64_t stream(std::uint64_t seed, std::uint64_t sensor) {
  return seed * 0x9e3779b97f4a7c15u + 0x5151u * (sensor + 1);
}

void add_axes(Table& table, const Scene& scene, const Machine& machine,
              const std::vector<Row>& rows) {
  const auto& joints = machine.nominal.joints();
  const SignalsDescription& wanted = scene.signals;
  std::vector<std::pair<std::string, VectorXd>> encoders;
  for (int j = 0; j < machine.nominal.size(); ++j) {
    const Joint& joint = joints[std::size_t(j)];
    const bool slide = joint.motion == Motion::Linear;
    VectorXd q(Eigen::Index(rows.size()));
    for (std::size_t i = 0; i < rows.size(); ++i) q[Eigen::Index(i)] = rows[i].state.q[j];
    const double unit = slide ? 1.0 : units::deg;
    const char* suffix = slide ? "_mm" : "_deg";
    table.add(joint.name + std::string(suffix), q / unit);
    if (is_spindle(machine, j)) continue;
    const VectorXd reading = read(q, slide ? wanted.encoder_noise : wanted.encoder_noise_rad,
                                  slide ? wanted.encoder_resolution : wanted.encoder_resolution_rad,
                                  stream(scene.seed, std::uint64_t(j)));
    encoders.emplace_back(joint.name + std::string("_encoder") + suffix, reading / unit);
  }
  // the columns of the encoders come after those of all commands
  for (auto& [name, reading] : encoders) table.add(name, std::move(reading));
}

void add_corrections(Table& table, const Machine& machine, const std::vector<Row>& rows,
                     const SignalInputs& recorded) {
  VectorXd column(Eigen::Index(rows.size()));
  const auto add = [&](std::string name, const auto& of_sample) {
    for (std::size_t i = 0; i < rows.size(); ++i)
      column[Eigen::Index(i)] = of_sample(rows[i].sample);
    table.add(std::move(name), column);
  };
  for (int j = 0; j < machine.nominal.size() && !recorded.correction.empty(); ++j) {
    if (is_spindle(machine, j)) continue;
    const Joint& joint = machine.nominal.joints()[std::size_t(j)];
    const bool slide = joint.motion == Motion::Linear;
    add(joint.name + std::string(slide ? "_correction_um" : "_correction_urad"),
        [&](std::size_t i) {
          return recorded.correction[i][j] / (slide ? units::um : units::urad);
        });
  }
  if (!recorded.stroke.empty())
    add("piezo_um", [&](std::size_t i) { return recorded.stroke[i] / units::um; });
}

void add_heat(Table& table, const Scene& scene, const Truth& truth, const VectorXd& time_s) {
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

struct ProcessRows {
  Eigen::MatrixXd force;  ///< (n x 3) N
  VectorXd torque, power_W, removed, engaged, chip;
};

ProcessRows process_rows(const Process& process, const VectorXd& time_s) {
  const Eigen::Index n = time_s.size();
  const VectorXd none = VectorXd::Zero(n);
  ProcessRows rows{Eigen::MatrixXd::Zero(n, 3), none, none, none, none, none};
  std::size_t step = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    rows.force.row(i) = load_at(process, time_s[i]).on_tool_t.head<3>().transpose();
    for (; step < process.steps.size() && process.steps[step].time_s <= time_s[i]; ++step)
      rows.removed[i] += process.steps[step].removed;
    // Torque and power of a step hold over the interval that ends at the step.
    const std::size_t at = std::min(step, process.steps.size() - 1);
    const bool here = step > 0 && process.steps[step - 1].time_s == time_s[i];
    const ProcessStep& now = process.steps[here ? step - 1 : at];
    rows.torque[i] = now.torque;
    rows.power_W[i] = now.power_W;
    rows.engaged[i] = now.engaged;
    rows.chip[i] = now.chip;
  }
  return rows;
}

void add_process(Table& table, const Scene& scene, const Process& process, const VectorXd& time_s,
                 const VectorXd& spindle_speed) {
  const SignalsDescription& wanted = scene.signals;
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
  if (wanted.current) {
    const auto& motor = *wanted.current;
    VectorXd torque = rows.torque + motor.viscous_torque * spindle_speed;
    for (Eigen::Index i = 0; i < torque.size(); ++i)
      // a spindle at rest needs no idle torque
      if (spindle_speed[i] > 0.0) torque[i] += motor.idle_torque;
    const VectorXd current = filtered(torque / motor.torque_per_current, time_s, motor.bandwidth);
    table.add("current_A", read(current, motor.noise_A, 0.0, stream(scene.seed, 100)));
  }
  if (wanted.dynamometer && !process.steps.empty())
    for (int k = 0; k < 3; ++k)
      table.add(fmt::format("F{}_dynamometer_N", "XYZ"[k]),
                read(filtered(rows.force.col(k), time_s, wanted.dynamometer->bandwidth),
                     wanted.dynamometer->noise, wanted.dynamometer->resolution,
                     stream(scene.seed, 101 + std::uint64_t(k))));
}

/// All deviations of a row: motion and location of every joint, tool, part, tip.
using DeviationRow = Eigen::Matrix<double, 1, Eigen::Dynamic>;

/// Returns the tool as seen from the bed if the workpiece turns under it; otherwise the deviations
/// would turn with the spindle.
Pose seen(const Machine& machine, const AxisState& state, const Pose& T_wt) {
  if (!machine.workpiece_spindle) return T_wt;
  const int spindle = *machine.workpiece_spindle;
  return slow_pose(spindle_line(machine.nominal, spindle), state.q[spindle], T_wt);
}

DeviationRow deviation_row(const Truth& truth, const Machine& machine, const Row& at) {
  const errors::ForceDeviations all = deviations(truth, at.state, at.load);
  const Eigen::Index joints = Eigen::Index(all.joints.size());
  DeviationRow row(12 * joints + 18);
  for (Eigen::Index j = 0; j < joints; ++j) {
    row.segment<6>(12 * j) = all.joints[std::size_t(j)].motion.transpose();
    row.segment<6>(12 * j + 6) = all.joints[std::size_t(j)].location.transpose();
  }
  row.segment<6>(12 * joints) = all.tool_t.transpose();
  row.segment<6>(12 * joints + 6) = all.workpiece_w.transpose();
  const Pose T_wt = seen(machine, at.state, tool_in_workpiece(truth, at.state, at.load));
  const Pose T_wt_wanted = seen(machine, at.state, at.T_wt_wanted);
  row.segment<3>(12 * joints + 12) = (T_wt.translation() - T_wt_wanted.translation()).transpose();
  row.segment<3>(12 * joints + 15) =
      kinematics::rotation_vector(T_wt.linear() * T_wt_wanted.linear().transpose()).transpose();
  return row;
}

std::string element_name(int component, const std::string& rest) {
  return component_names[std::size_t(component)] + rest + (component < 3 ? "_um" : "_urad");
}

void add_deviations(Table& table, const Machine& machine, const Eigen::MatrixXd& rows) {
  const auto& joints = machine.nominal.joints();
  const auto add = [&](Eigen::Index first, const auto& name) {
    for (int k = 0; k < 6; ++k)
      table.add_unless_zero(name(k), rows.col(first + k) / (k < 3 ? units::um : units::urad));
  };
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const char letter = joints[j].name == 's' ? 'S' : joints[j].name;
    const Eigen::Index first = 12 * Eigen::Index(j);
    add(first, [&](int k) { return element_name(k, std::string(1, letter)); });
    add(first + 6, [&](int k) { return element_name(k, std::string("0") + letter); });
  }
  const Eigen::Index rest = 12 * Eigen::Index(joints.size());
  add(rest, [](int k) { return "tool_" + element_name(k, ""); });
  add(rest + 6, [](int k) { return "part_" + element_name(k, ""); });
  for (int k = 0; k < 6; ++k)  // the tip is always reported
    table.add("tip_" + element_name(k, ""),
              rows.col(rest + 12 + k) / (k < 3 ? units::um : units::urad));
}

}  // namespace

Signals signals(const Scene& scene, const Machine& machine, const Truth& truth,
                const SignalInputs& recorded) {
  const bool channel = !recorded.correction.empty() || !recorded.stroke.empty();
  if (!scene.thermal && !scene.cutting && !scene.compliance && !channel) return {};
  if (recorded.samples.states.empty()) return {};
  std::vector<Row> rows;
  add_history(rows, scene, truth, recorded);
  add_program(rows, scene, recorded);
  const Eigen::Index n = Eigen::Index(rows.size());
  VectorXd time_s(n), line(n), spindle_speed(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    time_s[i] = rows[std::size_t(i)].state.time_s;
    line[i] = rows[std::size_t(i)].line;
    spindle_speed[i] = rows[std::size_t(i)].state.spindle_speed;
  }
  Table table(n);
  table.add("time_s", time_s);
  table.add("line", line);
  add_axes(table, scene, machine, rows);
  add_corrections(table, machine, rows, recorded);
  table.add("spindle_rpm", spindle_speed / units::rpm);
  add_heat(table, scene, truth, time_s);
  add_process(table, scene, recorded.process, time_s, spindle_speed);
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
  std::vector<Eigen::Index> of_second;  // column of the joined table for each column of `second`
  for (const std::string& name : second.columns) {
    auto there = std::ranges::find(first.columns, name);
    if (there == first.columns.end()) there = first.columns.insert(there, name);
    of_second.push_back(there - first.columns.begin());
  }
  const Eigen::Index n = first.rows.rows();
  first.rows.conservativeResizeLike(
      Eigen::MatrixXd::Zero(n + second.rows.rows(), Eigen::Index(first.columns.size())));
  for (std::size_t k = 0; k < of_second.size(); ++k)
    first.rows.col(of_second[k]).tail(second.rows.rows()) = second.rows.col(Eigen::Index(k));
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
