#include "sim/loop/correction_channels.h"

#include <algorithm>
#include <array>
#include <optional>
#include <stdexcept>

#include <tbb/parallel_for.h>

#include "kinematics/inverse_kinematics.h"
#include "kinematics/jacobian.h"
#include "sim/compensation/channels.h"
#include "sim/cut/commands.h"
#include "sim/program/pvt.h"
#include "sim/program/rewrite.h"

namespace abbe::sim {

namespace {

using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Pose;

constexpr double pvt_tolerance = 1e-6;  // mm: the numbers of a PVT program are not rounded, so no
                                        // rounding hides a larger error
constexpr double min_reach = 1.0;  // mm above the tip, so that the direction counts for every tool

/// Returns the joints X Y Z, whose programmed numbers are the tip under G43.4.
std::array<int, 3> tip_words(const kinematics::Chain& chain) {
  return {chain.find('X').value(), chain.find('Y').value(), chain.find('Z').value()};
}

/// Returns the programmed coordinates of a corrected command, in those of its block, without the
/// shift of the datum, which the control adds again.
AxisVector programmed(const ControlView& view, const program::Block& block, const AxisVector& q,
                      const Eigen::Vector3d& offset_w) {
  if (block.coordinates == program::Coordinates::Axis)
    return q - slide_offset(view.machine.control, offset_w);
  const Eigen::Vector3d tip_w = view.machine.control.tool_in_workpiece(q).translation() - offset_w;
  AxisVector words = q;
  const auto axes = tip_words(view.machine.control);
  for (std::size_t k = 0; k < 3; ++k) words[axes[k]] = tip_w[Eigen::Index(k)];
  return words;
}

/// Returns the corrected commands as points of their blocks. A block starts where the one before it
/// left the tool; an axis that reversed has a point before and one after the reversal.
program::CorrectedPath dense_points(const ControlView& view, const std::vector<AxisState>& states,
                                    const Eigen::Vector3d& offset_w) {
  program::CorrectedPath points(view.path.blocks.size());
  std::optional<AxisVector> left;  // position at the end of the block before
  for (std::size_t i = 0; i < states.size(); ++i) {
    const int index = view.samples.block[i];
    const program::Block& block = view.path.blocks[std::size_t(index)];
    if (block.interpolation == program::Interpolation::Dwell) continue;
    const AxisVector at = programmed(view, block, states[i].q, offset_w);
    auto& list = points[std::size_t(index)];
    if (list.empty())
      list.push_back({0.0, left ? programmed(view, block, *left, offset_w) : at, {}, {}});
    const double duration = block.end_s - block.start_s, time_s = view.samples.states[i].time_s;
    // the end is exact, so that neighbouring blocks meet
    const double u = time_s == block.end_s ? 1.0 : (time_s - block.start_s) / duration;
    list.push_back({std::clamp(u, list.back().u, 1.0), at, {}, {}});
    left = states[i].q;
  }
  return points;
}

/// Returns the thinning options. Its levers are the largest displacement of tip and tool axis per
/// rad of each axis along the program.
program::ThinOptions thin_options(const ControlView& view, const std::vector<AxisState>& states) {
  program::ThinOptions options;
  options.word_mm = view.compensation.word_resolution;
  options.tolerance = path_tolerance(view.compensation, view.path);
  const double reach = std::max(min_reach, view.sampling.reach);
  const kinematics::Chain& control = view.machine.control;
  AxisVector& of_tip = options.lever[std::size_t(program::Coordinates::Tip)];
  AxisVector& of_axes = options.lever[std::size_t(program::Coordinates::Axis)];
  of_tip = of_axes = AxisVector::Zero(control.size());
  for (const AxisState& state : states) {
    const kinematics::AxisJacobian J = kinematics::axis_jacobian(control, state.q);
    for (int j = 0; j < control.size(); ++j)
      of_axes[j] = std::max(of_axes[j], J.col(j).head<3>().norm());
  }
  for (int j = 0; j < control.size(); ++j) {
    if (control.joints()[std::size_t(j)].motion != kinematics::Motion::Rotary) continue;
    if (j == view.machine.workpiece_spindle) {
      of_axes[j] = 0.0;  // a turned part is the same all around
      continue;
    }
    of_tip[j] = reach;
    of_axes[j] += reach;
  }
  return options;
}

/// Returns the nominal poses at the samples of a rewritten program, on the segment of the original
/// that its line stands for. A workpiece spindle keeps its sampled angle, since the times of the
/// two programs differ slightly.
std::vector<Pose> rewritten_target_poses(const ControlView& view, const program::Path& path,
                                         const program::Samples& samples,
                                         const std::vector<program::Stretch>& of_line) {
  std::vector<Pose> wanted(samples.states.size());
  tbb::parallel_for(std::size_t(0), wanted.size(), [&](std::size_t i) {
    const program::Block& block = path.blocks[std::size_t(samples.block[i])];
    const program::Stretch& stretch = of_line.at(std::size_t(block.line) - 1);
    const double duration = block.end_s - block.start_s;
    const double part =
        duration > 0.0 ? (samples.states[i].time_s - block.start_s) / duration : 1.0;
    AxisVector q =
        nominal_axes(view.machine, view.path, view.path.blocks.at(std::size_t(stretch.block)),
                     stretch.from + part * (stretch.to - stretch.from));
    if (const auto spindle = view.machine.workpiece_spindle)
      q[*spindle] = samples.states[i].q[*spindle];
    wanted[i] = view.machine.nominal.tool_in_workpiece(q);
  });
  return wanted;
}

}  // namespace

bool is_pvt(const program::Path& path) {
  return std::any_of(path.blocks.begin(), path.blocks.end(), [](const auto& block) {
    return block.interpolation == program::Interpolation::Cubic;
  });
}

double path_tolerance(const CompensationDescription& compensation, const program::Path& path) {
  if (compensation.path_tolerance > 0.0) return compensation.path_tolerance;
  // without a stated tolerance the rounding of the numbers sets it: a finer path would not be
  // written
  return is_pvt(path) ? pvt_tolerance : compensation.word_resolution;
}

AxisVector nominal_axes(const Machine& machine, const program::Path& path,
                        const program::Block& block, double u) {
  const AxisVector q = program::position(path, block, u);
  if (block.coordinates == program::Coordinates::Axis) return q;
  const auto [x, y, z] = tip_words(machine.nominal);
  return kinematics::slides_for_tip(machine.nominal, q, {q[x], q[y], q[z]}).value();
}

// The path is corrected with the shift that the corrector expects, and run with the shift that the
// control finds.
Commands apply_program_channel(const ControlView& view, const Corrector& corrector,
                               const Eigen::Vector3d& expected_w, const Eigen::Vector3d& found_w) {
  const CompensationDescription& words = view.compensation;
  const kinematics::Chain& control = view.machine.control;
  const std::vector<AxisState> uncorrected =
      commanded(control, view.path, view.samples, view.machine.nominal, expected_w);
  const CorrectedCommands ideal = corrector(uncorrected, view.T_wt_nominal);
  const program::CorrectedPath points =
      program::thinned(view.path, dense_points(view, ideal.states, expected_w), view.control,
                       thin_options(view, uncorrected));
  program::RewrittenProgram rewritten = program::rewritten(
      view.path, points, view.control, {words.word_resolution, words.angle_resolution});

  // A corrector that jumps would make a program of unlimited length; the limit of 20 times the
  // original samples stops it before it takes all memory.
  program::SampleOptions options = view.sampling;
  options.max_samples = std::max<std::size_t>(1'000'000, 20 * view.samples.states.size());
  Commands result;
  result.path = is_pvt(view.path) ? program::read_pvt(rewritten.text, "rewritten.csv", view.control)
                                  : program::read_nc(rewritten.text, "rewritten.ngc", view.control);
  result.rewritten_program = std::move(rewritten.text);
  result.samples = program::sample(*result.path, control, options);
  result.samples.states = commanded(control, *result.path, result.samples, control, found_w);
  result.T_wt_nominal =
      rewritten_target_poses(view, *result.path, result.samples, rewritten.of_line);
  result.point_left = ideal.point_left;
  result.direction_left = ideal.direction_left;
  result.not_converged = ideal.not_converged;
  return result;
}

namespace {

using compensation::TimeSeries;
using Eigen::Index;
using Eigen::VectorXd;
using Channel = CaseDescription::Channel;

constexpr double arm = 200.0;  // mm, lever at which an angle counts as a length

// Returns a value for every state as a time series.
template <typename Row>
TimeSeries state_series(const std::vector<AxisState>& states, Index columns, const Row& row) {
  TimeSeries course{VectorXd(Index(states.size())), Eigen::MatrixXd(Index(states.size()), columns)};
  for (std::size_t i = 0; i < states.size(); ++i) {
    course.time_s[Index(i)] = states[i].time_s;
    course.value.row(Index(i)) = row(i).transpose();
  }
  return course;
}

/// Returns the counts of the axes for the pulse channel. An axis without correction gets 0: it
/// receives no pulses and keeps its position.
VectorXd counts_of(const ControlView& view, const TimeSeries& wanted) {
  const auto& joints = view.machine.control.joints();
  const CompensationDescription::Pulses& pulses = view.compensation.pulses;
  VectorXd counts = VectorXd::Zero(Index(joints.size()));
  for (int i = 0; i < view.machine.control.size(); ++i) {
    const bool slide = joints[std::size_t(i)].motion == kinematics::Motion::Linear;
    const double count = slide ? pulses.count : pulses.count_rad;
    // a millionth of a count is rounding of the correction
    if (!is_spindle(view.machine, i) && wanted.value.col(i).cwiseAbs().maxCoeff() > 1e-6 * count)
      counts[i] = count;
  }
  return counts;
}

/// Returns the part of the wanted correction that passes the channel, before the position loop.
TimeSeries arriving_correction(const ControlView& view, Channel channel, const TimeSeries& wanted,
                               const std::vector<AxisState>& commanded) {
  const CompensationDescription& limits = view.compensation;
  if (channel == Channel::Open) return compensation::through(wanted, limits.open);
  if (channel == Channel::Origin)
    return compensation::through(wanted, limits.origin, view.machine.control.joints());
  // Pulses are inserted between the edges of the encoder signals, so they depend on the commanded
  // positions.
  compensation::Pulses pulses;
  pulses.count = counts_of(view, wanted);
  pulses.cycle_s = limits.pulses.cycle_s;
  pulses.pulse_s = limits.pulses.pulse_s;
  pulses.phase_seed = view.seed;
  return compensation::through(
      wanted, pulses, state_series(commanded, wanted.value.cols(), [&](std::size_t i) -> VectorXd {
        return commanded[i].q;
      }));
}

/// The samples of a program with additional samples at the knots of a time series.
struct Merged {
  program::Samples samples;          ///< as commanded
  std::vector<AxisVector> nominal;   ///< (samples) commands of the nominal machine
  std::vector<std::ptrdiff_t> knot;  ///< (samples) number of the knot, -1 between knots
};

AxisState between(const AxisState& a, const AxisState& b, double time_s) {
  AxisState state = b;
  const double u = (time_s - a.time_s) / (b.time_s - a.time_s);
  state.q = a.q + u * (b.q - a.q);
  state.time_s = time_s;
  return state;
}

// Both lists ascend in time and are merged in one pass.
Merged merged(const ControlView& view, const std::vector<AxisState>& commanded,
              const VectorXd& knots) {
  Merged all;
  const auto& nominal = view.samples.states;
  const auto add = [&](const AxisState& state, const AxisVector& q, std::size_t i,
                       std::ptrdiff_t knot) {
    all.samples.states.push_back(state);
    all.samples.line.push_back(view.samples.line[i]);
    all.samples.block.push_back(view.samples.block[i]);
    all.nominal.push_back(q);
    all.knot.push_back(knot);
  };
  Index k = 0;
  for (std::size_t i = 0, next = 0; i < commanded.size(); i = next) {
    const double time_s = commanded[i].time_s;
    for (; k < knots.size() && knots[k] < time_s; ++k)
      if (i > 0)
        add(between(commanded[i - 1], commanded[i], knots[k]),
            between(nominal[i - 1], nominal[i], knots[k]).q, i, k);
    const Index first = k;
    while (k < knots.size() && knots[k] == time_s) ++k;
    const bool knot_here = k > first;
    // samples at one time are a reversal: the first is before a jump of the series, the others
    // after it
    add(commanded[i], nominal[i].q, i, knot_here ? first : -1);
    for (next = i + 1; next < commanded.size() && commanded[next].time_s == time_s; ++next)
      add(commanded[next], nominal[next].q, next, knot_here ? k - 1 : -1);
    // a jump of the series at a sample without reversal: a second sample takes the value after it
    if (next == i + 1 && k - first > 1) add(commanded[i], nominal[i].q, i, k - 1);
  }
  return all;
}

// Returns the value of a time series at a merged sample; exact at a knot, where the series may
// jump.
VectorXd value_at_sample(const TimeSeries& course, compensation::TimeSeriesReader& walk,
                         const Merged& all, std::size_t i) {
  return all.knot[i] >= 0 ? VectorXd(course.value.row(all.knot[i]).transpose())
                          : walk.at(all.samples.states[i].time_s);
}

Commands with_samples(const ControlView& view, Merged& all) {
  Commands result;
  result.T_wt_nominal.resize(all.nominal.size());
  tbb::parallel_for(std::size_t(0), all.nominal.size(), [&](std::size_t i) {
    result.T_wt_nominal[i] = view.machine.nominal.tool_in_workpiece(all.nominal[i]);
  });
  result.samples = std::move(all.samples);
  return result;
}

/// Returns the displacement of the tip that the corrections would make, in the tool frame, mm.
TimeSeries wanted_tool_displacement(const ControlView& view,
                                    const std::vector<AxisState>& commanded,
                                    const std::vector<AxisState>& ideal) {
  return state_series(commanded, 3, [&](std::size_t i) -> VectorXd {
    const kinematics::Pose from = view.machine.control.tool_in_workpiece(commanded[i].q);
    const kinematics::Pose to = view.machine.control.tool_in_workpiece(ideal[i].q);
    return from.linear().transpose() * (to.translation() - from.translation());
  });
}

Commands apply_piezo_channel(const ControlView& view, const std::vector<AxisState>& commanded,
                             const std::vector<AxisState>& ideal) {
  const compensation::Piezo& piezo = view.compensation.piezo;
  const TimeSeries stroke = compensation::thinned(
      compensation::through(wanted_tool_displacement(view, commanded, ideal), piezo),
      // a tenth of the chord tolerance: the thinned stroke adds little to the chord error
      VectorXd::Constant(1, 0.1 * view.chord_tolerance));
  Merged all = merged(view, commanded, stroke.time_s);
  compensation::TimeSeriesReader walk(stroke);
  VectorXd strokes(Index(all.knot.size()));
  for (std::size_t i = 0; i < all.knot.size(); ++i)
    strokes[Index(i)] = value_at_sample(stroke, walk, all, i)[0];
  Commands result = with_samples(view, all);
  result.piezo = {piezo, std::move(strokes)};
  return result;
}

Commands apply_axis_channel(const ControlView& view, Channel channel,
                            const std::vector<AxisState>& commanded,
                            const std::vector<AxisState>& ideal) {
  const Index n = view.machine.control.size();
  const TimeSeries wanted = state_series(
      commanded, n, [&](std::size_t i) -> VectorXd { return ideal[i].q - commanded[i].q; });
  VectorXd tolerance = VectorXd::Constant(n, 0.1 * view.chord_tolerance);
  for (int i = 0; i < n; ++i)
    if (view.machine.control.joints()[std::size_t(i)].motion != kinematics::Motion::Linear)
      tolerance[i] /= arm;
  const TimeSeries course = compensation::thinned(
      compensation::loop_response(arriving_correction(view, channel, wanted, commanded),
                                  view.compensation.loop),
      tolerance);
  Merged all = merged(view, commanded, course.time_s);
  compensation::TimeSeriesReader walk(course);
  std::vector<AxisVector> correction(all.knot.size());
  for (std::size_t i = 0; i < all.knot.size(); ++i) {
    correction[i] = value_at_sample(course, walk, all, i);
    all.samples.states[i].q += correction[i];
  }
  Commands result = with_samples(view, all);
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
  } catch (const std::invalid_argument& fault) {
    throw BadInput(view.file.string(), 0, 0, "a channel that this program can pass through",
                   fault.what());
  }
}

}  // namespace abbe::sim
