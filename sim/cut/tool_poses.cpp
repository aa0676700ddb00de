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
  Pose T_wt = tool_in_workpiece(run.job.truth, run.commands.samples.states[sample], load);
  // a worn tool is shorter: its tip lies nearer to the spindle, along the tool axis
  if (!run.wear.empty())
    T_wt.translation() += run.wear[sample] * run.job.scene.tool.wear->length * T_wt.linear().col(2);
  if (const auto& piezo = run.commands.piezo) {
    const Eigen::Vector3d& along_t = piezo->piezo.direction_t;
    const double force = along_t.dot(load.on_tool_t.head<3>());
    T_wt.translation() += (piezo->stroke[Eigen::Index(sample)] +
                           compensation::piezo_deflection(piezo->piezo, force)) *
                          (T_wt.linear() * along_t);
  }
  return T_wt;
}

std::vector<errors::Load> sample_loads(const ActualRun& run, const Process& process) {
  // without compliance and piezo a load moves nothing
  if (!run.job.truth.compliance && !run.commands.piezo) return {};
  if (process.steps.empty() && run.acceleration.empty()) return {};
  const auto& states = run.commands.samples.states;
  std::vector<errors::Load> loads(states.size());
  for (std::size_t i = 0; i < loads.size(); ++i) {
    loads[i] = load_at(process, states[i].time_s);
    if (!run.acceleration.empty()) loads[i].acceleration = run.acceleration[i];
  }
  return loads;
}

ActualRun actual_run(const Job& job, const Commands& commands) {
  ActualRun run{job, commands, target_poses(job, commands)};
  if (!job.accelerations.empty()) run.acceleration = accelerations(commands.samples);
  run.wear = wear_fractions(tool_run(job), commands.samples);
  return run;
}

std::vector<Pose> poses_of(const ActualRun& run, const std::vector<errors::Load>& loads,
                           std::span<const std::size_t> at) {
  std::vector<Pose> T_wt(at.empty() ? run.commands.samples.states.size() : at.size());
  tbb::parallel_for(std::size_t(0), T_wt.size(), [&](std::size_t i) {
    const std::size_t sample = at.empty() ? i : at[i];
    T_wt[i] = actual_pose(run, sample, loads.empty() ? errors::Load{} : loads[sample]);
  });
  return T_wt;
}

std::vector<Pose> tool_poses(const Job& job, const Commands& commands, const Process& process,
                             std::span<const std::size_t> at) {
  const ActualRun run = actual_run(job, commands);
  return check_table_range(job, [&] { return poses_of(run, sample_loads(run, process), at); });
}

ToolTrack join_tracks(const std::vector<TrackedPart>& parts) {
  using Eigen::Index;
  Index n = 0, axes = 0;
  for (const TrackedPart& part : parts) {
    n += Index(part.samples.states.size());
    if (!part.samples.states.empty()) axes = part.samples.states.front().q.size();
  }
  using Rows = ToolTrack::Rows;
  ToolTrack track{Eigen::VectorXd(n), {},         Rows(n, axes), Rows(n, 3),
                  Rows(n, 3),         Rows(n, 3), Rows(n, 3)};
  track.line.reserve(std::size_t(n));
  Index row = 0;
  for (const TrackedPart& part : parts) {
    track.line.insert(track.line.end(), part.samples.line.begin(), part.samples.line.end());
    for (std::size_t i = 0; i < part.samples.states.size(); ++i, ++row) {
      track.time_s[row] = part.samples.states[i].time_s;
      track.q.row(row) = part.samples.states[i].q.transpose();
      track.nominal_tip.row(row) = part.T_wt_nominal[i].translation().transpose();
      track.nominal_direction.row(row) = part.T_wt_nominal[i].linear().col(2).transpose();
      track.actual_tip.row(row) = part.T_wt[i].translation().transpose();
      track.actual_direction.row(row) = part.T_wt[i].linear().col(2).transpose();
    }
  }
  return track;
}

ToolTrack in_part_frame(ToolTrack track, const kinematics::Pose& T_wm) {
  const kinematics::Pose T_mw = T_wm.inverse();
  // rows are vectors, so they are multiplied from the right by the transpose
  const Eigen::Matrix3d turned = T_mw.linear().transpose();
  for (ToolTrack::Rows* tip : {&track.nominal_tip, &track.actual_tip})
    *tip = ((*tip * turned).rowwise() + T_mw.translation().transpose()).eval();
  for (ToolTrack::Rows* direction : {&track.nominal_direction, &track.actual_direction})
    *direction = (*direction * turned).eval();
  return track;
}

namespace {

using Eigen::Vector3d;
using kinematics::AxisState;

/// Deviation of the tip and of a point on the tool axis above it, mm.
struct Off {
  Vector3d tip, above;
};

// Samples the deviation of the tool at an axis state.
struct ErrorSampler {
  const Job& job;
  double reach;

  /// Returns the deviations; for a part turned by a spindle in the bed frame, since the sweep turns
  /// with the part.
  Off at(const AxisState& state) const {
    const kinematics::Chain& chain = job.machine.nominal;
    const Pose nominal = chain.tool_in_workpiece(state.q);
    const Pose actual = tool_in_workpiece(job.truth, state);
    const Vector3d above = reach * Vector3d::UnitZ();
    const Off off{actual.translation() - nominal.translation(), actual * above - nominal * above};
    if (!job.machine.workpiece_spindle) return off;
    const Eigen::Matrix3d R_bw = chain.workpiece_in_bed(state.q).linear();
    return {R_bw * off.tip, R_bw * off.above};
  }
};

// A reversal makes a step of the error, which no denser sampling would follow.
bool has_no_reversal(const AxisState& from, const AxisState& to) {
  return from.direction == to.direction && from.stroke == to.stroke;
}

AxisState between(const AxisState& from, const AxisState& to, double share) {
  AxisState state = to;
  state.q = from.q + share * (to.q - from.q);
  state.time_s = from.time_s + share * (to.time_s - from.time_s);
  state.spindle_speed = from.spindle_speed + share * (to.spindle_speed - from.spindle_speed);
  return state;
}

/// Returns the distance of the errors between two samples from the line between those at the
/// samples, mm. It is sampled midway, where long waves deviate most, and at the golden section,
/// where waves that divide the interval into whole parts still show.
double chord_deviation(const ErrorSampler& look, const AxisState& from, const AxisState& to) {
  const Off a = look.at(from), b = look.at(to);
  double most = 0.0;
  for (const double share : {0.5, 0.3819660112501051}) {
    const Off off = look.at(between(from, to, share));
    most = std::max({most, (off.tip - a.tip - share * (b.tip - a.tip)).norm(),
                     (off.above - a.above - share * (b.above - a.above)).norm()});
  }
  return most;
}

/// Returns the samples at which an interval in feed ends.
std::vector<std::size_t> feed_ends(const program::Samples& samples, const program::Path& path) {
  std::vector<std::size_t> ends;
  for (std::size_t i = 1; i < samples.states.size(); ++i)
    if (program::is_feed(path.blocks[std::size_t(samples.block[i])]) &&
        has_no_reversal(samples.states[i - 1], samples.states[i]))
      ends.push_back(i);
  return ends;
}

/// Returns one sample from each of `most` equal groups, at random: regular steps could miss a wave.
std::vector<std::size_t> chosen(const std::vector<std::size_t>& from, std::size_t most,
                                std::uint64_t seed) {
  if (from.size() <= most) return from;
  std::vector<std::size_t> few;
  for (std::size_t k = 0; k < most; ++k) {
    const double place = double(k) + split_mix::unit(split_mix::stream(seed, k));
    few.push_back(
        from[std::min(from.size() - 1, std::size_t(place * double(from.size()) / double(most)))]);
  }
  return few;
}

}  // namespace

ChordError chord_error(const Job& job, const Commands& commands, std::size_t most) {
  const program::Samples& samples = commands.samples;
  const kinematics::Chain& nominal = job.machine.nominal;
  const ErrorSampler look{job, sample_options(job.scene, job.machine).reach};
  ChordError found;
  // 2 nm at least: the numerical floor of a map is below 1 nm
  found.tolerance = std::max(2.0 * units::nm, job.scene.chord_tolerance);
  for (const std::size_t i :
       chosen(feed_ends(samples, path_of(job, commands)), most, job.scene.seed)) {
    const AxisState &from = samples.states[i - 1], &to = samples.states[i];
    const double bend = chord_deviation(look, from, to);
    ++found.looked_at;
    found.beyond += bend > found.tolerance;
    found.rms += bend * bend;
    if (!(bend > found.max)) continue;
    found.max = bend;
    found.line = samples.line[i];
    found.step = (nominal.tool_in_workpiece(to.q).translation() -
                  nominal.tool_in_workpiece(from.q).translation())
                     .norm();
  }
  found.rms = std::sqrt(found.rms / std::max<double>(1.0, double(found.looked_at)));
  return found;
}

ChordError joined(const ChordError& a, const ChordError& b) {
  if (a.looked_at == 0) return b;
  ChordError both = a.max >= b.max ? a : b;
  const auto n_a = double(a.looked_at), n_b = double(b.looked_at);
  both.looked_at = a.looked_at + b.looked_at;
  both.beyond = a.beyond + b.beyond;
  both.rms = std::sqrt((n_a * a.rms * a.rms + n_b * b.rms * b.rms) / (n_a + n_b));
  return both;
}

std::vector<std::string> chord_error_warnings(const ChordError& found, double off) {
  // 50 nm: the smallest default resolution of a map; a hundredth of the deviation changes no figure
  constexpr double share = 0.01, least = 50.0 * units::nm;
  if (!(found.max > std::max({found.tolerance, least, share * off}))) return {};
  std::string text = fmt::format(
      "errors of the machine bend the path between the samples, where the cut is straight: by "
      "{:.3g} um (line {}, a step of {:.3g} mm), RMS {:.3g} um, by more than {:.3g} um in {:.3g} % "
      "of {} intervals looked at",
      found.max / units::um, found.line, found.step, found.rms / units::um,
      found.tolerance / units::um, 100.0 * double(found.beyond) / double(found.looked_at),
      found.looked_at);
  // The chord error grows with the square of the step, as long as the step is shorter than the
  // waves; 0.9 leaves a margin.
  const double step = 0.9 * found.step * std::sqrt(found.tolerance / found.max);
  if (step > 0.0) {
    // rounded down to two digits
    const double digit = std::pow(10.0, std::floor(std::log10(step)) - 1.0);
    text += fmt::format("; to follow them begin with sampling.max_step_mm = {:.4g}",
                        digit * std::floor(step / digit));
  }
  return {text};
}

}  // namespace abbe::sim
