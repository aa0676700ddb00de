#include "sim/loop/correction_channels.h"

#include <algorithm>
#include <array>
#include <optional>
#include <stdexcept>

#include <tbb/parallel_for.h>

#include "kinematics/inverse_kinematics.h"
#include "sim/compensation/channels.h"
#include "sim/cut/commands.h"
#include "sim/program/program_writers.h"
#include "sim/program/rewrite.h"

namespace abbe::sim {

namespace {

using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Pose;

// mm; the values of a PVT program are not rounded, so a larger error would be visible.
constexpr double pvt_tolerance = 1e-6;
// mm above the tip; above 0, so that the direction of every tool counts.
constexpr double min_reach = 1.0;

/// Returns the joints X Y Z, whose programmed values are the tip position under G43.4.
std::array<int, 3> tip_axes(const kinematics::Chain& chain) {
  return {chain.find('X').value(), chain.find('Y').value(), chain.find('Z').value()};
}

/// Returns the programmed values of a corrected command in the coordinates of its block, without
/// the shift of the datum, which the control adds again.
AxisVector programmed_position(const ControlView& view, const program::Block& block,
                               const AxisVector& q, const Eigen::Vector3d& offset_w) {
  if (block.coordinates == program::Coordinates::Axis)
    return q - slide_offset(view.machine.control, offset_w);
  const Eigen::Vector3d tip_w = view.machine.control.tool_in_workpiece(q).translation() - offset_w;
  AxisVector programmed = q;
  const auto axes = tip_axes(view.machine.control);
  for (std::size_t k = 0; k < 3; ++k) programmed[axes[k]] = tip_w[Eigen::Index(k)];
  return programmed;
}

/// Returns true if a range of a program begins with the last block of the range before.
bool is_continued(const ControlView& range) { return range.sampling.continued_from.has_value(); }

/// Returns the corrected commands as points of their blocks. A block starts at the end of the
/// previous one. An axis that reverses has one point before and one after the reversal.
/// @param previous_end  corrected axes at the end of the last motion of the range before; none
///     without a motion before
program::CorrectedPath dense_points(const ControlView& view, const std::vector<AxisState>& states,
                                    const Eigen::Vector3d& offset_w,
                                    std::optional<AxisVector> previous_end) {
  program::CorrectedPath points(view.path.blocks.size());
  const std::size_t first = is_continued(view) ? 1 : 0;
  if (first == 1 && previous_end) {
    const AxisVector end =
        programmed_position(view, view.path.blocks.front(), *previous_end, offset_w);
    points.front() = {{0.0, end, {}, {}}, {1.0, end, {}, {}}};
  }
  for (std::size_t i = first; i < states.size(); ++i) {
    const int index = view.samples.block[i];
    const program::Block& block = view.path.blocks[std::size_t(index)];
    if (block.interpolation == program::Interpolation::Dwell) continue;
    const AxisVector position = programmed_position(view, block, states[i].q, offset_w);
    auto& block_points = points[std::size_t(index)];
    if (block_points.empty())
      block_points.push_back(
          {0.0,
           previous_end ? programmed_position(view, block, *previous_end, offset_w) : position,
           {},
           {}});
    const double duration = block.end_s - block.start_s, time_s = view.samples.states[i].time_s;
    // The end is exact, so that neighbouring blocks meet.
    const double u = time_s == block.end_s ? 1.0 : (time_s - block.start_s) / duration;
    block_points.push_back({std::clamp(u, block_points.back().u, 1.0), position, {}, {}});
    previous_end = states[i].q;
  }
  return points;
}

/// Returns the corrected axes at the end of the last motion of a range.
/// @param before  the same of the range before
std::optional<AxisVector> end_of_motion(const ControlView& view,
                                        const std::vector<AxisState>& states,
                                        const std::optional<AxisVector>& before) {
  for (std::size_t i = states.size(); i > (is_continued(view) ? 1u : 0u); --i)
    if (view.path.blocks[std::size_t(view.samples.block[i - 1])].interpolation !=
        program::Interpolation::Dwell)
      return states[i - 1].q;
  return before;
}

/// Returns (axes) the largest displacements of the tip along a range of a program, per mm or rad of
/// each axis.
AxisVector tip_displacements(const kinematics::Chain& control,
                             const std::vector<AxisState>& states) {
  AxisVector lever = AxisVector::Zero(control.size());
  for (const AxisState& state : states) {
    const kinematics::AxisJacobian J = kinematics::axis_jacobian(control, state.q);
    for (int j = 0; j < control.size(); ++j)
      lever[j] = std::max(lever[j], J.col(j).head<3>().norm());
  }
  return lever;
}

/// Returns the thinning options of a program. The levers are the largest displacements of tip and
/// tool axis along it, per mm or rad of each axis.
/// @param view        of any range of the program
/// @param tip_displacements  (axes) of the whole program, as by the function
program::ThinOptions thin_options(const ControlView& view, const AxisVector& tip_displacements) {
  program::ThinOptions options;
  options.word_mm = view.compensation.word_resolution;
  options.tolerance = path_tolerance(view.compensation, view.path);
  const double reach = std::max(min_reach, view.sampling.reach);
  const kinematics::Chain& control = view.machine.control;
  AxisVector& tip_lever = options.lever[std::size_t(program::Coordinates::Tip)];
  AxisVector& axis_lever = options.lever[std::size_t(program::Coordinates::Axis)];
  axis_lever = tip_displacements;
  tip_lever = AxisVector::Zero(control.size());
  for (int j = 0; j < control.size(); ++j) {
    if (control.joints()[std::size_t(j)].motion != kinematics::Motion::Rotary) continue;
    if (j == view.machine.workpiece_spindle) {
      axis_lever[j] = 0.0;  // a turned part is rotationally symmetric
      continue;
    }
    tip_lever[j] = reach;
    axis_lever[j] += reach;
  }
  return options;
}

/// Returns the nominal poses at the samples of a range of a rewritten program, on the original
/// block that corresponds to the line. A workpiece spindle keeps its sampled angle, since the times
/// of the two programs differ slightly.
/// @param view         with the original program of the tool
/// @param path         of the range
/// @param first_block  number of the first block of that original program in the whole program
std::vector<Pose> rewritten_target_poses(const ControlView& view, const program::Path& path,
                                         const program::Samples& samples,
                                         const std::vector<program::LineOrigin>& line_origins,
                                         std::size_t first_block) {
  std::vector<Pose> target_poses(samples.states.size());
  tbb::parallel_for(std::size_t(0), target_poses.size(), [&](std::size_t i) {
    const program::Block& block = path.blocks[std::size_t(samples.block[i])];
    const program::LineOrigin& origin = line_origins.at(std::size_t(block.line) - 1);
    const double duration = block.end_s - block.start_s;
    const double fraction =
        duration > 0.0 ? (samples.states[i].time_s - block.start_s) / duration : 1.0;
    AxisVector q = nominal_axes(view.machine, view.path,
                                view.path.blocks.at(std::size_t(origin.block) - first_block),
                                origin.from + fraction * (origin.to - origin.from));
    if (const auto spindle = view.machine.workpiece_spindle)
      q[*spindle] = samples.states[i].q[*spindle];
    target_poses[i] = view.machine.nominal.tool_in_workpiece(q);
  });
  return target_poses;
}

}  // namespace

bool is_pvt(const program::Path& path) {
  return std::any_of(path.blocks.begin(), path.blocks.end(), [](const auto& block) {
    return block.interpolation == program::Interpolation::Cubic;
  });
}

double path_tolerance(const CompensationDescription& compensation, const program::Path& path) {
  if (compensation.path_tolerance > 0.0) return compensation.path_tolerance;
  // Without a stated tolerance the rounding of the values determines it, since a finer path could
  // not be written.
  return is_pvt(path) ? pvt_tolerance : compensation.word_resolution;
}

AxisVector nominal_axes(const Machine& machine, const program::Path& path,
                        const program::Block& block, double u) {
  const AxisVector q = program::position(path, block, u);
  if (block.coordinates == program::Coordinates::Axis) return q;
  const auto [x, y, z] = tip_axes(machine.nominal);
  return kinematics::solve_slides(machine.nominal, q, {q[x], q[y], q[z]}).value();
}

// The path is corrected with the shift that the corrector expects. It is run with the shift that
// the control measures.
CorrectedProgram correct_program(const RangeVisitor& visit_ranges, const Corrector& corrector,
                                 const Eigen::Vector3d& expected_w,
                                 const Eigen::Vector3d& measured_w) {
  const auto uncorrected = [&](const ControlView& range) {
    return commanded(range.machine.control, range.path, range.samples, range.machine.nominal,
                     expected_w);
  };
  AxisVector lever;
  visit_ranges([&](const ControlView& range) {
    const AxisVector of_range = tip_displacements(range.machine.control, uncorrected(range));
    lever = lever.size() == 0 ? of_range : AxisVector(lever.cwiseMax(of_range));
  });
  CorrectedProgram result{{}, {}, measured_w, {}};
  std::optional<AxisVector> end;  // of the last motion so far
  visit_ranges([&](const ControlView& range) {
    CorrectedCommands ideal = corrector(uncorrected(range), range.T_wt_nominal);
    program::CorrectedPath points =
        program::thin_out(range.path, dense_points(range, ideal.states, expected_w, end),
                          range.control, thin_options(range, lever));
    result.points.insert(result.points.end(), points.begin() + (is_continued(range) ? 1 : 0),
                         points.end());
    end = end_of_motion(range, ideal.states, end);
    CorrectedCommands& all = result.ideal;
    all.remaining_point_error = std::max(all.remaining_point_error, ideal.remaining_point_error);
    all.remaining_direction_error =
        std::max(all.remaining_direction_error, ideal.remaining_direction_error);
    all.not_converged += ideal.not_converged;
    // States of several ranges would need the memory of the whole program.
    all.states = is_continued(range) ? std::vector<AxisState>() : std::move(ideal.states);
  });
  return result;
}

RewrittenPath rewrite(std::span<const CorrectedProgram> corrected,
                      const CompensationDescription& compensation, const program::Path& path,
                      const program::NcOptions& control) {
  program::CorrectedPath points;
  for (const CorrectedProgram& tool : corrected)
    points.insert(points.end(), tool.points.begin(), tool.points.end());
  program::RewrittenProgram rewritten = program::rewrite_program(
      path, points, control, {compensation.word_resolution, compensation.angle_resolution});
  program::Path whole = is_pvt(path) ? program::read_pvt(rewritten.text, "rewritten.csv", control)
                                     : program::read_nc(rewritten.text, "rewritten.ngc", control);
  return {std::move(whole), std::move(rewritten.line_origins), std::move(rewritten.text)};
}

std::size_t find_rewritten_block(const RewrittenPath& rewritten, std::size_t original_block,
                                 std::size_t from) {
  const auto comes_later = [&](const program::Block& block) {
    return rewritten.line_origins.at(std::size_t(block.line) - 1).block >=
           std::ptrdiff_t(original_block);
  };
  const auto& blocks = rewritten.path.blocks;
  return std::size_t(
      std::find_if(blocks.begin() + std::ptrdiff_t(from), blocks.end(), comes_later) -
      blocks.begin());
}

program::SampleOptions rewritten_sampling(const ControlView& view, std::size_t original_samples) {
  program::SampleOptions options = view.sampling;
  options.continued_from.reset();
  // A corrector with jumps would give a program of unlimited length. The limit of 20 times the
  // original samples stops it before the memory is exhausted.
  options.max_samples = std::max<std::size_t>(1'000'000, 20 * original_samples);
  return options;
}

Commands rewritten_commands(const ControlView& view, program::Path path,
                            const program::SampleOptions& sampling,
                            const CorrectedProgram& corrected,
                            const std::vector<program::LineOrigin>& line_origins,
                            std::size_t first_block) {
  const kinematics::Chain& control = view.machine.control;
  Commands result;
  result.path = std::move(path);
  result.samples = program::sample(*result.path, control, sampling);
  result.samples.states =
      commanded(control, *result.path, result.samples, control, corrected.measured_w);
  result.T_wt_nominal =
      rewritten_target_poses(view, *result.path, result.samples, line_origins, first_block);
  result.remaining_point_error = corrected.ideal.remaining_point_error;
  result.remaining_direction_error = corrected.ideal.remaining_direction_error;
  result.not_converged = corrected.ideal.not_converged;
  result.warnings = corrected.warnings;
  return result;
}

Commands run_corrected_program(std::span<const ControlView> tools,
                               std::span<const CorrectedProgram> corrected,
                               const program::Path& path, const program::NcOptions& control) {
  RewrittenPath rewritten = rewrite(corrected, tools.front().compensation, path, control);
  std::vector<Commands> commands;
  AxisState last_state;  // of the tools so far, for directions of approach
  std::size_t original_block = 0, block = 0;
  for (std::size_t i = 0; i < tools.size(); ++i) {
    const std::size_t next_original_block = original_block + tools[i].path.blocks.size();
    const std::size_t next_block = find_rewritten_block(rewritten, next_original_block, block);
    program::SampleOptions sampling = rewritten_sampling(tools[i], tools[i].samples.states.size());
    sampling.before = last_state;
    commands.push_back(
        rewritten_commands(tools[i], program::path_segment(rewritten.path, block, next_block),
                           sampling, corrected[i], rewritten.line_origins, original_block));
    const std::vector<AxisState>& states = commands.back().samples.states;
    if (!states.empty()) last_state = states.back();
    original_block = next_original_block;
    block = next_block;
  }
  Commands result = joined(std::move(commands));
  result.path = std::move(rewritten.path);
  result.rewritten_program = std::move(rewritten.text);
  return result;
}

namespace {

using compensation::TimeSeries;
using Eigen::Index;
using Eigen::VectorXd;
using Channel = CaseDescription::Channel;

constexpr double lever_arm = 200.0;  // mm, converts angles into lengths

/// Returns a time series with one row for every state.
template <typename Row>
TimeSeries state_series(const std::vector<AxisState>& states, Index columns, const Row& row) {
  TimeSeries series{VectorXd(Index(states.size())), Eigen::MatrixXd(Index(states.size()), columns)};
  for (std::size_t i = 0; i < states.size(); ++i) {
    series.time_s[Index(i)] = states[i].time_s;
    series.value.row(Index(i)) = row(i).transpose();
  }
  return series;
}

/// Returns the size of one count of every axis, for the pulse channel. It is 0 for an axis without
/// correction, which receives no pulses.
VectorXd axis_counts(const ControlView& view, const TimeSeries& ideal_correction) {
  const auto& joints = view.machine.control.joints();
  const CompensationDescription::PulseInsertion& pulses = view.compensation.pulses;
  VectorXd counts = VectorXd::Zero(Index(joints.size()));
  for (int i = 0; i < view.machine.control.size(); ++i) {
    const bool is_slide = joints[std::size_t(i)].motion == kinematics::Motion::Linear;
    const double count = is_slide ? pulses.count : pulses.count_rad;
    // A millionth of a count is rounding of the correction.
    if (!is_spindle(view.machine, i) &&
        ideal_correction.value.col(i).cwiseAbs().maxCoeff() > 1e-6 * count)
      counts[i] = count;
  }
  return counts;
}

/// Returns the correction that the channel transmits to the position loop.
TimeSeries transmitted_correction(const ControlView& view, Channel channel,
                                  const TimeSeries& ideal_correction,
                                  const std::vector<AxisState>& commanded) {
  const CompensationDescription& limits = view.compensation;
  if (channel == Channel::Open) return compensation::apply_channel(ideal_correction, limits.open);
  if (channel == Channel::Origin)
    return compensation::apply_channel(ideal_correction, limits.origin,
                                       view.machine.control.joints());
  // Pulses are inserted between the edges of the encoder signals, so they depend on the commanded
  // positions as well.
  compensation::PulseInsertion pulses;
  pulses.count = axis_counts(view, ideal_correction);
  pulses.cycle_s = limits.pulses.cycle_s;
  pulses.pulse_s = limits.pulses.pulse_s;
  pulses.phase_seed = view.seed;
  return compensation::apply_channel(
      ideal_correction, pulses,
      state_series(commanded, ideal_correction.value.cols(),
                   [&](std::size_t i) -> VectorXd { return commanded[i].q; }));
}

/// Samples of a program, with additional samples at the knots of a time series.
struct MergedSamples {
  program::Samples samples;          ///< as commanded
  std::vector<AxisVector> nominal;   ///< (samples) commands of the nominal machine
  std::vector<std::ptrdiff_t> knot;  ///< (samples) index of the knot; -1 between knots
};

/// Returns the state at a time between two states.
AxisState interpolate(const AxisState& a, const AxisState& b, double time_s) {
  AxisState state = b;
  const double u = (time_s - a.time_s) / (b.time_s - a.time_s);
  state.q = a.q + u * (b.q - a.q);
  state.time_s = time_s;
  return state;
}

/// Merges samples and knots. Both ascend in time, so one pass suffices.
MergedSamples merge_samples(const ControlView& view, const std::vector<AxisState>& commanded,
                            const VectorXd& knots) {
  MergedSamples result;
  const auto& nominal = view.samples.states;
  const auto add = [&](const AxisState& state, const AxisVector& q, std::size_t i,
                       std::ptrdiff_t knot) {
    result.samples.states.push_back(state);
    result.samples.line.push_back(view.samples.line[i]);
    result.samples.block.push_back(view.samples.block[i]);
    result.nominal.push_back(q);
    result.knot.push_back(knot);
  };
  Index k = 0;
  for (std::size_t i = 0, next = 0; i < commanded.size(); i = next) {
    const double time_s = commanded[i].time_s;
    for (; k < knots.size() && knots[k] < time_s; ++k)
      if (i > 0)
        add(interpolate(commanded[i - 1], commanded[i], knots[k]),
            interpolate(nominal[i - 1], nominal[i], knots[k]).q, i, k);
    const Index first = k;
    while (k < knots.size() && knots[k] == time_s) ++k;
    const bool has_knot = k > first;
    // Several samples at one time are a reversal: the first one is before a jump of the series, the
    // others after it.
    add(commanded[i], nominal[i].q, i, has_knot ? first : -1);
    for (next = i + 1; next < commanded.size() && commanded[next].time_s == time_s; ++next)
      add(commanded[next], nominal[next].q, next, has_knot ? k - 1 : -1);
    // At a jump of the series without reversal, a second sample gets the value after the jump.
    if (next == i + 1 && k - first > 1) add(commanded[i], nominal[i].q, i, k - 1);
  }
  return result;
}

/// Returns the value of a time series at a merged sample. At a knot it is that of the knot, since
/// the series may jump there.
VectorXd value_at_sample(const TimeSeries& series, compensation::TimeSeriesReader& reader,
                         const MergedSamples& merged, std::size_t i) {
  return merged.knot[i] >= 0 ? VectorXd(series.value.row(merged.knot[i]).transpose())
                             : reader.at(merged.samples.states[i].time_s);
}

/// Converts merged samples into commands, with their target poses.
Commands to_commands(const ControlView& view, MergedSamples& merged) {
  Commands result;
  result.T_wt_nominal.resize(merged.nominal.size());
  tbb::parallel_for(std::size_t(0), merged.nominal.size(), [&](std::size_t i) {
    result.T_wt_nominal[i] = view.machine.nominal.tool_in_workpiece(merged.nominal[i]);
  });
  result.samples = std::move(merged.samples);
  return result;
}

/// Returns the displacement of the tip by the ideal correction, in the tool frame, mm.
TimeSeries ideal_tool_displacement(const ControlView& view, const std::vector<AxisState>& commanded,
                                   const std::vector<AxisState>& ideal) {
  return state_series(commanded, 3, [&](std::size_t i) -> VectorXd {
    const kinematics::Pose from = view.machine.control.tool_in_workpiece(commanded[i].q);
    const kinematics::Pose to = view.machine.control.tool_in_workpiece(ideal[i].q);
    return from.linear().transpose() * (to.translation() - from.translation());
  });
}

/// Returns the commands with the strokes of a piezo at the tool.
Commands apply_piezo_channel(const ControlView& view, const std::vector<AxisState>& commanded,
                             const std::vector<AxisState>& ideal) {
  const compensation::Piezo& piezo = view.compensation.piezo;
  const TimeSeries stroke = compensation::thin_out(
      compensation::apply_channel(ideal_tool_displacement(view, commanded, ideal), piezo),
      // A tenth of the chord tolerance: thinning the stroke then adds little to the chord error.
      VectorXd::Constant(1, 0.1 * view.chord_tolerance));
  MergedSamples merged = merge_samples(view, commanded, stroke.time_s);
  compensation::TimeSeriesReader reader(stroke);
  VectorXd strokes(Index(merged.knot.size()));
  for (std::size_t i = 0; i < merged.knot.size(); ++i)
    strokes[Index(i)] = value_at_sample(stroke, reader, merged, i)[0];
  Commands result = to_commands(view, merged);
  result.piezo = {piezo, std::move(strokes)};
  return result;
}

/// Returns the commands with the correction that reaches the axes.
Commands apply_axis_channel(const ControlView& view, Channel channel,
                            const std::vector<AxisState>& commanded,
                            const std::vector<AxisState>& ideal) {
  const Index n = view.machine.control.size();
  const TimeSeries ideal_correction = state_series(
      commanded, n, [&](std::size_t i) -> VectorXd { return ideal[i].q - commanded[i].q; });
  VectorXd tolerance = VectorXd::Constant(n, 0.1 * view.chord_tolerance);
  for (int i = 0; i < n; ++i)
    if (view.machine.control.joints()[std::size_t(i)].motion != kinematics::Motion::Linear)
      tolerance[i] /= lever_arm;
  const TimeSeries series =
      compensation::thin_out(compensation::loop_response(
                                 transmitted_correction(view, channel, ideal_correction, commanded),
                                 view.compensation.loop),
                             tolerance);
  MergedSamples merged = merge_samples(view, commanded, series.time_s);
  compensation::TimeSeriesReader reader(series);
  std::vector<AxisVector> correction(merged.knot.size());
  for (std::size_t i = 0; i < merged.knot.size(); ++i) {
    correction[i] = value_at_sample(series, reader, merged, i);
    merged.samples.states[i].q += correction[i];
  }
  Commands result = to_commands(view, merged);
  result.correction = std::move(correction);
  return result;
}

}  // namespace

Commands apply_real_time_channel(const ControlView& view, Channel channel,
                                 const std::vector<AxisState>& commanded,
                                 const std::vector<AxisState>& ideal) {
  try {
    return channel == Channel::Piezo ? apply_piezo_channel(view, commanded, ideal)
                                     : apply_axis_channel(view, channel, commanded, ideal);
  } catch (const std::invalid_argument& exception) {
    throw BadInput(view.file.string(), 0, 0,
                   "a channel that can apply the corrections of this program", exception.what());
  }
}

}  // namespace abbe::sim
