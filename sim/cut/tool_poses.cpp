#include "sim/cut/tool_poses.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "kinematics/hash.h"
#include "kinematics/units.h"
#include "sim/cut/part.h"
#include "sim/cut/tool_motion.h"
#include "sim/machine/truth.h"

namespace abbe::sim {

using kinematics::Pose;

Pose actual_pose(const ActualRun& run, std::size_t sample, errors::Load load) {
  if (!run.acceleration.empty()) load.acceleration = run.acceleration[sample];
  Pose T_wt = tool_in_workpiece(run.segment.truth, run.commands.samples.states[sample], load);
  // Wear of the length moves the tip towards the spindle.
  if (!run.wear.empty())
    T_wt.translation() +=
        run.wear[sample] * run.segment.scene.tool.wear->length * T_wt.linear().col(2);
  if (const auto& piezo = run.commands.piezo) {
    const Eigen::Vector3d& along_t = piezo->piezo.direction_t;
    const double force = along_t.dot(load.tool_wrench_t.head<3>());
    T_wt.translation() += (piezo->stroke[Eigen::Index(sample)] +
                           compensation::piezo_deflection(piezo->piezo, force)) *
                          (T_wt.linear() * along_t);
  }
  return T_wt;
}

std::vector<errors::Load> sample_loads(const ActualRun& run, const Process& process) {
  // Without compliance and piezo a load moves nothing.
  if (!run.segment.truth.compliance && !run.commands.piezo) return {};
  if (process.steps.empty() && run.acceleration.empty()) return {};
  const auto& states = run.commands.samples.states;
  std::vector<errors::Load> loads(states.size());
  for (std::size_t i = 0; i < loads.size(); ++i) {
    loads[i] = load_at(process, states[i].time_s);
    if (!run.acceleration.empty()) loads[i].acceleration = run.acceleration[i];
  }
  return loads;
}

ActualRun actual_run(const Segment& segment, const Commands& commands) {
  ActualRun run{segment, commands, target_poses(segment, commands)};
  if (!segment.accelerations.empty()) run.acceleration = accelerations(commands.samples);
  run.wear = wear_fractions(tool_run(segment), commands.samples);
  return run;
}

std::vector<Pose> actual_poses(const ActualRun& run, const std::vector<errors::Load>& loads,
                               std::span<const std::size_t> sample_numbers) {
  std::vector<Pose> T_wt(sample_numbers.empty() ? run.commands.samples.states.size()
                                                : sample_numbers.size());
  tbb::parallel_for(std::size_t(0), T_wt.size(), [&](std::size_t i) {
    const std::size_t sample = sample_numbers.empty() ? i : sample_numbers[i];
    T_wt[i] = actual_pose(run, sample, loads.empty() ? errors::Load{} : loads[sample]);
  });
  return T_wt;
}

std::vector<Pose> tool_poses(const Segment& segment, const Commands& commands,
                             const Process& process, std::span<const std::size_t> sample_numbers) {
  const ActualRun run = actual_run(segment, commands);
  return check_table_range(
      segment, [&] { return actual_poses(run, sample_loads(run, process), sample_numbers); });
}

ToolTrack join_tracks(const std::vector<TrackedSegment>& segments) {
  using Eigen::Index;
  Index row_count = 0, axes = 0;
  for (const TrackedSegment& segment : segments) {
    row_count += Index(segment.samples.states.size());
    if (!segment.samples.states.empty()) axes = segment.samples.states.front().q.size();
  }
  using Rows = ToolTrack::Rows;
  ToolTrack track{Eigen::VectorXd(row_count), {},
                  Rows(row_count, axes),      Rows(row_count, 3),
                  Rows(row_count, 3),         Rows(row_count, 3),
                  Rows(row_count, 3)};
  track.line.reserve(std::size_t(row_count));
  Index row = 0;
  for (const TrackedSegment& segment : segments) {
    track.line.insert(track.line.end(), segment.samples.line.begin(), segment.samples.line.end());
    for (std::size_t i = 0; i < segment.samples.states.size(); ++i, ++row) {
      track.time_s[row] = segment.samples.states[i].time_s;
      track.q.row(row) = segment.samples.states[i].q.transpose();
      track.nominal_tip.row(row) = segment.T_wt_nominal[i].translation().transpose();
      track.nominal_direction.row(row) = segment.T_wt_nominal[i].linear().col(2).transpose();
      track.actual_tip.row(row) = segment.T_wt[i].translation().transpose();
      track.actual_direction.row(row) = segment.T_wt[i].linear().col(2).transpose();
    }
  }
  return track;
}

ToolTrack in_part_frame(ToolTrack track, const kinematics::Pose& T_wm) {
  const kinematics::Pose T_mw = T_wm.inverse();
  // Row vectors are multiplied from the right by the transpose of the rotation.
  const Eigen::Matrix3d R_wm = T_mw.linear().transpose();
  for (ToolTrack::Rows* tip : {&track.nominal_tip, &track.actual_tip})
    *tip = ((*tip * R_wm).rowwise() + T_mw.translation().transpose()).eval();
  for (ToolTrack::Rows* direction : {&track.nominal_direction, &track.actual_direction})
    *direction = (*direction * R_wm).eval();
  return track;
}

namespace {

using Eigen::Vector3d;
using kinematics::AxisState;

/// The deviations of the tip and of a point above it on the tool axis, mm.
struct ToolDeviation {
  Vector3d tip, upper_point;
};

/// Samples the deviations of the tool.
struct ErrorSampler {
  const Segment& segment;
  double height;  ///< of the point above the tip, mm

  /// Returns the deviations at an axis state in the workpiece frame, or in the bed frame if a
  /// spindle turns the part, since the sweep turns with the part.
  ToolDeviation at(const AxisState& state) const {
    const kinematics::Chain& chain = segment.machine.nominal;
    const Pose nominal = chain.tool_in_workpiece(state.q);
    const Pose actual = tool_in_workpiece(segment.truth, state);
    const Vector3d upper_point_t = height * Vector3d::UnitZ();
    const ToolDeviation deviation{actual.translation() - nominal.translation(),
                                  actual * upper_point_t - nominal * upper_point_t};
    if (!segment.machine.workpiece_spindle) return deviation;
    const Eigen::Matrix3d R_bw = chain.workpiece_in_bed(state.q).linear();
    return {R_bw * deviation.tip, R_bw * deviation.upper_point};
  }
};

/// Returns true if no axis reverses. The error jumps at a reversal, which no denser sampling could
/// follow.
bool has_no_reversal(const AxisState& from, const AxisState& to) {
  return from.direction == to.direction && from.stroke == to.stroke;
}

AxisState interpolated_state(const AxisState& from, const AxisState& to, double fraction) {
  AxisState state = to;
  state.q = from.q + fraction * (to.q - from.q);
  state.time_s = from.time_s + fraction * (to.time_s - from.time_s);
  state.spindle_speed = from.spindle_speed + fraction * (to.spindle_speed - from.spindle_speed);
  return state;
}

/// Returns the largest distance, mm, of the deviations between two samples from the straight line
/// through those at the samples. They are evaluated in the middle, where long waves deviate most,
/// and at the golden section, which reveals waves that fit in a whole number of times.
double chord_deviation(const ErrorSampler& sampler, const AxisState& from, const AxisState& to) {
  const ToolDeviation start = sampler.at(from), end = sampler.at(to);
  double max_deviation = 0.0;
  for (const double fraction : {0.5, 0.3819660112501051}) {
    const auto [tip, upper_point] = sampler.at(interpolated_state(from, to, fraction));
    const Vector3d tip_sag = tip - start.tip - fraction * (end.tip - start.tip);
    const Vector3d upper_sag =
        upper_point - start.upper_point - fraction * (end.upper_point - start.upper_point);
    max_deviation = std::max({max_deviation, tip_sag.norm(), upper_sag.norm()});
  }
  return max_deviation;
}

/// Returns the numbers of the samples that end feed intervals over which no axis reverses.
std::vector<std::size_t> feed_interval_ends(const program::Samples& samples,
                                            const program::Path& path) {
  std::vector<std::size_t> ends;
  for (std::size_t i = 1; i < samples.states.size(); ++i)
    if (is_feed_sample(path, samples, i) &&
        has_no_reversal(samples.states[i - 1], samples.states[i]))
      ends.push_back(i);
  return ends;
}

/// Returns a random element of each of `max_count` equal groups, since regular steps could miss a
/// wave.
std::vector<std::size_t> random_subset(const std::vector<std::size_t>& numbers,
                                       std::size_t max_count, std::uint64_t seed) {
  if (numbers.size() <= max_count) return numbers;
  std::vector<std::size_t> subset;
  for (std::size_t k = 0; k < max_count; ++k) {
    const double position = double(k) + split_mix::unit(split_mix::stream(seed, k));
    subset.push_back(numbers[std::min(
        numbers.size() - 1, std::size_t(position * double(numbers.size()) / double(max_count)))]);
  }
  return subset;
}

}  // namespace

ChordError chord_error(const Segment& segment, const Commands& commands,
                       std::size_t max_intervals) {
  const program::Samples& samples = commands.samples;
  const kinematics::Chain& nominal = segment.machine.nominal;
  const ErrorSampler sampler{segment, sample_options(segment.scene, segment.machine).reach};
  ChordError result;
  // The numerical floor of a map is below 1 nm.
  result.tolerance = std::max(2.0 * units::nm, segment.scene.chord_tolerance);
  for (const std::size_t i : random_subset(feed_interval_ends(samples, path_of(segment, commands)),
                                           max_intervals, segment.scene.seed)) {
    const AxisState &from = samples.states[i - 1], &to = samples.states[i];
    const double deviation = chord_deviation(sampler, from, to);
    ++result.interval_count;
    result.exceeding_count += deviation > result.tolerance;
    result.rms += deviation * deviation;
    if (!(deviation > result.max)) continue;
    result.max = deviation;
    result.line = samples.line[i];
    result.step = (nominal.tool_in_workpiece(to.q).translation() -
                   nominal.tool_in_workpiece(from.q).translation())
                      .norm();
  }
  result.rms = std::sqrt(result.rms / std::max<double>(1.0, double(result.interval_count)));
  return result;
}

ChordError joined(const ChordError& a, const ChordError& b) {
  if (a.interval_count == 0) return b;
  ChordError result = a.max >= b.max ? a : b;
  const auto n_a = double(a.interval_count), n_b = double(b.interval_count);
  result.interval_count = a.interval_count + b.interval_count;
  result.exceeding_count = a.exceeding_count + b.exceeding_count;
  result.rms = std::sqrt((n_a * a.rms * a.rms + n_b * b.rms * b.rms) / (n_a + n_b));
  return result;
}

std::vector<std::string> chord_error_warnings(const ChordError& chord_error, double tip_rms) {
  // 50 nm is the smallest default resolution of a map. A hundredth of the deviation changes none of
  // its figures.
  constexpr double tip_fraction = 0.01, min_reported = 50.0 * units::nm;
  if (!(chord_error.max > std::max({chord_error.tolerance, min_reported, tip_fraction * tip_rms})))
    return {};
  std::string text = fmt::format(
      "machine errors bend the path between the samples, where the simulated cut is straight: by "
      "{:.3g} um (line {}, a step of {:.3g} mm), RMS {:.3g} um, by more than {:.3g} um in {:.3g} % "
      "of {} tested intervals",
      chord_error.max / units::um, chord_error.line, chord_error.step, chord_error.rms / units::um,
      chord_error.tolerance / units::um,
      100.0 * double(chord_error.exceeding_count) / double(chord_error.interval_count),
      chord_error.interval_count);
  // While the step is shorter than the waves, the chord error grows with its square. 0.9 leaves a
  // margin.
  const double step = 0.9 * chord_error.step * std::sqrt(chord_error.tolerance / chord_error.max);
  if (step > 0.0) {
    // Rounded down to two digits.
    const double unit = std::pow(10.0, std::floor(std::log10(step)) - 1.0);
    text += fmt::format("; to resolve them start with sampling.max_step_mm = {:.4g}",
                        unit * std::floor(step / unit));
  }
  return {text};
}

}  // namespace abbe::sim
