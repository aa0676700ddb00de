#include "sim/loop/program_channel.h"

#include <algorithm>
#include <array>
#include <optional>

#include <tbb/parallel_for.h>

#include "kinematics/inverse.h"
#include "kinematics/jacobian.h"
#include "sim/cut/datum.h"
#include "sim/program/pvt.h"
#include "sim/program/rewrite.h"

namespace abbe::sim {
namespace {

using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Pose;

constexpr double pvt_tolerance = 1e-6;  // mm: its words are not rounded, so nothing hides more
constexpr double least_reach = 1.0;     // mm above the tip, so that directions count at all

/// X Y Z of programmed coordinates under G43.4.
std::array<int, 3> tip_words(const kinematics::Chain& chain) {
  return {chain.find('X').value(), chain.find('Y').value(), chain.find('Z').value()};
}

/// Programmed coordinates of a corrected command, in those of its block, without the shift of the
/// datum that the control will add again.
AxisVector programmed(const Seen& seen, const program::Block& block, const AxisVector& q,
                      const Eigen::Vector3d& offset_w) {
  if (block.coordinates == program::Coordinates::Axis)
    return q - slides_of_offset(seen.machine.control, offset_w);
  const Eigen::Vector3d tip_w = seen.machine.control.tool_in_workpiece(q).translation() - offset_w;
  AxisVector words = q;
  const auto axes = tip_words(seen.machine.control);
  for (std::size_t k = 0; k < 3; ++k) words[axes[k]] = tip_w[Eigen::Index(k)];
  return words;
}

/// The corrected commands as points of their blocks. A block starts where the one before it left
/// the tool; of an axis that turned back there is a point before and one after.
program::CorrectedPath dense_points(const Seen& seen, const std::vector<AxisState>& states,
                                    const Eigen::Vector3d& offset_w) {
  program::CorrectedPath points(seen.path.blocks.size());
  std::optional<AxisVector> left;  // where the tool was left
  for (std::size_t i = 0; i < states.size(); ++i) {
    const int index = seen.samples.block[i];
    const program::Block& block = seen.path.blocks[std::size_t(index)];
    if (block.interpolation == program::Interpolation::Dwell) continue;
    const AxisVector at = programmed(seen, block, states[i].q, offset_w);
    auto& list = points[std::size_t(index)];
    if (list.empty())
      list.push_back({0.0, left ? programmed(seen, block, *left, offset_w) : at, {}, {}});
    const double duration = block.end_s - block.start_s, time_s = seen.samples.states[i].time_s;
    const double u = time_s == block.end_s ? 1.0 : (time_s - block.start_s) / duration;
    list.push_back({std::clamp(u, list.back().u, 1.0), at, {}, {}});
    left = states[i].q;
  }
  return points;
}

/// How far tip and tool go per rad of each axis, at most along the program.
program::ThinOptions thin_options(const Seen& seen, const std::vector<AxisState>& states) {
  program::ThinOptions options;
  options.word_mm = seen.compensation.word_resolution;
  options.tolerance = path_tolerance(seen.compensation, seen.path);
  const double reach = std::max(least_reach, seen.sampling.reach);
  const kinematics::Chain& control = seen.machine.control;
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
    if (j == seen.machine.workpiece_spindle) {
      of_axes[j] = 0.0;  // a part that turns is the same all around
      continue;
    }
    of_tip[j] = reach;
    of_axes[j] += reach;
  }
  return options;
}

/// Where the tool should be at every sample of a rewritten program: on the stretch of the original
/// that the line stands for. A spindle of the workpiece is where it is: times shift a little.
std::vector<Pose> wanted_of_rewritten(const Seen& seen, const program::Path& path,
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
        nominal_axes(seen.machine, seen.path, seen.path.blocks.at(std::size_t(stretch.block)),
                     stretch.from + part * (stretch.to - stretch.from));
    if (const auto spindle = seen.machine.workpiece_spindle)
      q[*spindle] = samples.states[i].q[*spindle];
    wanted[i] = seen.machine.nominal.tool_in_workpiece(q);
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
  return is_pvt(path) ? pvt_tolerance : compensation.word_resolution;
}

AxisVector nominal_axes(const Machine& machine, const program::Path& path,
                        const program::Block& block, double u) {
  const AxisVector q = program::position(path, block, u);
  if (block.coordinates == program::Coordinates::Axis) return q;
  const auto [x, y, z] = tip_words(machine.nominal);
  return kinematics::slides_for_tip(machine.nominal, q, {q[x], q[y], q[z]}).value();
}

Commands through_program(const Seen& seen, const Corrector& corrector,
                         const Eigen::Vector3d& expected_w, const Eigen::Vector3d& found_w) {
  const CompensationDescription& words = seen.compensation;
  const kinematics::Chain& control = seen.machine.control;
  const std::vector<AxisState> uncorrected =
      commanded(control, seen.path, seen.samples, seen.machine.nominal, expected_w);
  const Corrected ideal = corrector(uncorrected, seen.T_wt_nominal);
  const program::CorrectedPath points =
      program::thinned(seen.path, dense_points(seen, ideal.states, expected_w), seen.control,
                       thin_options(seen, uncorrected));
  program::RewrittenProgram rewritten = program::rewritten(
      seen.path, points, seen.control, {words.word_resolution, words.angle_resolution});

  // a corrector that jumps about is refused before it takes all memory
  program::SampleOptions options = seen.sampling;
  options.max_samples = std::max<std::size_t>(1'000'000, 20 * seen.samples.states.size());
  Commands result;
  result.path = is_pvt(seen.path) ? program::read_pvt(rewritten.text, "rewritten.csv", seen.control)
                                  : program::read_nc(rewritten.text, "rewritten.ngc", seen.control);
  result.rewritten_program = std::move(rewritten.text);
  result.samples = program::sample(*result.path, control, options);
  result.samples.states = commanded(control, *result.path, result.samples, control, found_w);
  result.T_wt_nominal = wanted_of_rewritten(seen, *result.path, result.samples, rewritten.of_line);
  result.point_left = ideal.point_left;
  result.direction_left = ideal.direction_left;
  result.not_converged = ideal.not_converged;
  return result;
}

}  // namespace abbe::sim
