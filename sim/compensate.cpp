#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "kinematics/inverse.h"
#include "sim/compensation/correct.h"
#include "sim/datum.h"
#include "sim/loop.h"
#include "sim/part.h"
#include "sim/program/pvt.h"
#include "sim/program/rewrite.h"

namespace abbe::sim {
namespace {

using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Pose;

bool same(const kinematics::Chain& a, const kinematics::Chain& b) {
  if (!a.T_bt_home().isApprox(b.T_bt_home(), 0.0)) return false;
  for (int i = 0; i < a.size(); ++i) {
    const auto &x = a.joints()[std::size_t(i)], &y = b.joints()[std::size_t(i)];
    if (x.direction_b != y.direction_b || x.point_b != y.point_b) return false;
  }
  return true;
}

bool is_tip(const program::Path& path, int block) {
  return path.blocks[std::size_t(block)].coordinates == program::Coordinates::Tip;
}

/// Commands of the real control for a program that was sampled with `sampled_by`: a tip that is
/// programmed is reached by the control's own kinematics, and the datum that it found shifts all.
std::vector<AxisState> told(const Job& job, const program::Path& path,
                            const program::Samples& samples, const kinematics::Chain& sampled_by) {
  std::vector<AxisState> states = samples.states;
  const Eigen::Vector3d offset_w = datum_offset(job.scene.datum, job.machine, job.truth);
  if (same(job.machine.control, sampled_by) && offset_w.isZero(0.0)) return states;
  const AxisVector slides = slides_of_offset(job.machine.control, offset_w);
  tbb::parallel_for(std::size_t(0), states.size(), [&](std::size_t i) {
    if (!is_tip(path, samples.block[i])) {
      states[i].q += slides;
      return;
    }
    const Eigen::Vector3d tip_w =
        sampled_by.tool_in_workpiece(states[i].q).translation() + offset_w;
    const auto q = kinematics::slides_for_tip(job.machine.control, states[i].q, tip_w);
    if (!q)
      throw BadInput(path.file, samples.line[i], 0, "a tip that the control's slides reach",
                     "another");
    states[i].q = *q;
  });
  return states;
}

/// Height above the tip of the point that a compensator restores: a ball's centre, a corner's
/// centre.
double functional_height(const ToolDescription& tool) {
  const auto* cutter = std::get_if<cutting::Cutter>(&tool.nominal);
  return cutter != nullptr ? cutter->corner_radius : 0.0;
}

compensation::CorrectOptions correct_options(const Job& job, const CaseDescription& compensator) {
  compensation::CorrectOptions options;
  options.strategy = compensator.strategy;
  options.rotary_bound = job.scene.compensation.rotary_bound;
  options.functional_height = functional_height(job.scene.tool);
  options.idle_joint = job.machine.workpiece_spindle;
  return options;
}

/// What acts on the nominal, rigid machine at an instant: what a compensated tool meets as well,
/// since it goes where the nominal one would.
errors::Load nominal_load(const Job& job, double time_s) {
  errors::Load load = load_at(job.nominal_process, time_s);
  if (job.accelerations.empty()) return load;
  const auto& states = job.samples.states;
  const auto after =
      std::lower_bound(states.begin(), states.end(), time_s,
                       [](const AxisState& state, double time) { return state.time_s < time; });
  load.acceleration =
      job.accelerations[std::min(std::size_t(after - states.begin()), states.size() - 1)];
  return load;
}

/// The one door between truth and compensation: the perfect belief.
compensation::Belief perfect_belief(const Job& job) {
  return [known = without_random(job.truth), &job](const AxisState& state) {
    return tool_in_workpiece(known, state, nominal_load(job, state.time_s));
  };
}

struct Corrected {
  std::vector<AxisState> states;
  double point_left = 0.0;
  double direction_left = 0.0;
  std::size_t not_converged = 0;
};

Corrected corrected(const Job& job, const CaseDescription& compensator,
                    const std::vector<AxisState>& commanded,
                    const std::vector<Pose>& T_wt_nominal) {
  const compensation::Belief belief = perfect_belief(job);
  const compensation::CorrectOptions options = correct_options(job, compensator);
  Corrected result{commanded, 0.0, 0.0, 0};
  std::vector<compensation::Correction> corrections(commanded.size());
  tbb::parallel_for(std::size_t(0), commanded.size(), [&](std::size_t i) {
    corrections[i] =
        compensation::correct(job.machine.control, belief, T_wt_nominal[i], commanded[i], options);
  });
  for (std::size_t i = 0; i < commanded.size(); ++i) {
    result.states[i].q = corrections[i].q;
    result.point_left = std::max(result.point_left, corrections[i].point_left);
    result.direction_left = std::max(result.direction_left, corrections[i].direction_left);
    if (!corrections[i].converged) ++result.not_converged;
  }
  return result;
}

/// X Y Z of programmed coordinates under G43.4.
std::array<int, 3> tip_words(const kinematics::Chain& chain) {
  return {chain.find('X').value(), chain.find('Y').value(), chain.find('Z').value()};
}

/// Where the nominal machine has the tool at fraction u of a block.
Pose nominal_at(const Job& job, const program::Block& block, double u) {
  AxisVector q = program::position(job.path, block, u);
  if (block.coordinates == program::Coordinates::Tip) {
    const auto [x, y, z] = tip_words(job.machine.nominal);
    q = kinematics::slides_for_tip(job.machine.nominal, q, {q[x], q[y], q[z]}).value();
  }
  return job.machine.nominal.tool_in_workpiece(q);
}

/// A place in the original program.
struct Place {
  int block = 0;
  double u = 0.0;
};

/// The samples at which a rewritten program gets points: those of a path sampled so coarsely that
/// its chords stay within a word; of a block sampled twice (a reversal) the later.
std::vector<std::size_t> rewrite_points(const program::Path& path,
                                        const program::Samples& samples) {
  std::vector<std::size_t> points;
  for (std::size_t i = 0; i < samples.states.size(); ++i) {
    if (path.blocks[std::size_t(samples.block[i])].interpolation == program::Interpolation::Dwell)
      continue;
    const bool again = !points.empty() && samples.block[points.back()] == samples.block[i] &&
                       samples.states[points.back()].time_s == samples.states[i].time_s;
    if (again)
      points.back() = i;
    else
      points.push_back(i);
  }
  return points;
}

/// Programmed coordinates of a corrected command, in those of its block, without the shift of the
/// datum that the control will add again.
AxisVector programmed(const Job& job, const program::Block& block, const AxisVector& q,
                      const Eigen::Vector3d& offset_w) {
  if (block.coordinates == program::Coordinates::Axis)
    return q - slides_of_offset(job.machine.control, offset_w);
  const Eigen::Vector3d tip_w = job.machine.control.tool_in_workpiece(q).translation() - offset_w;
  AxisVector words = q;
  const auto axes = tip_words(job.machine.control);
  for (std::size_t k = 0; k < 3; ++k) words[axes[k]] = tip_w[Eigen::Index(k)];
  return words;
}

/// Where the tool should be at every sample of a rewritten program: its moves are, one by one, the
/// stretches of the original between the places that were corrected.
std::vector<Pose> wanted_of_rewritten(const Job& job, const program::Path& path,
                                      const program::Samples& samples,
                                      const std::vector<Place>& places) {
  std::vector<int> move_of(path.blocks.size());
  const std::size_t first = places.front().u == 0.0 ? 1 : 0;
  int moves = int(first);
  const auto rests = [&](std::size_t i) {
    return path.blocks[i].interpolation == program::Interpolation::Dwell;
  };
  for (std::size_t i = 0; i < path.blocks.size(); ++i) move_of[i] = rests(i) ? moves - 1 : moves++;
  if (moves != int(places.size()))
    throw std::logic_error(
        fmt::format("a rewritten program has {} moves for {} places", moves, places.size()));
  std::vector<Pose> wanted(samples.states.size());
  tbb::parallel_for(std::size_t(0), wanted.size(), [&](std::size_t i) {
    const program::Block& block = path.blocks[std::size_t(samples.block[i])];
    const double duration = block.end_s - block.start_s;
    const bool moving = duration > 0.0 && !rests(std::size_t(samples.block[i]));
    const double part = moving ? (samples.states[i].time_s - block.start_s) / duration : 1.0;
    const int move = std::max(0, move_of[std::size_t(samples.block[i])]);
    const Place& to = places[std::size_t(move)];
    const bool within = move > 0 && places[std::size_t(move) - 1].block == to.block;
    const double from = within ? places[std::size_t(move) - 1].u : 0.0;
    wanted[i] =
        nominal_at(job, job.path.blocks[std::size_t(to.block)], from + part * (to.u - from));
  });
  return wanted;
}

/// The correction written into a program of the same dialect, which the control then reads and
/// runs.
Compensated through_program(const Job& job, const CaseDescription& compensator) {
  const CompensationDescription& words = job.scene.compensation;
  program::SampleOptions coarse = sample_options(job.scene, job.machine);
  coarse.chord_tolerance = std::max(coarse.chord_tolerance, words.word_resolution);
  const program::Samples samples = program::sample(job.path, job.machine.nominal, coarse);
  const std::vector<std::size_t> points = rewrite_points(job.path, samples);

  const std::vector<AxisState> uncorrected = told(job, job.path, samples, job.machine.nominal);
  std::vector<AxisState> commanded;
  std::vector<Pose> wanted;
  std::vector<Place> places;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const std::size_t i = points[k];
    const program::Block& block = job.path.blocks[std::size_t(samples.block[i])];
    const double duration = block.end_s - block.start_s;
    const bool last = k + 1 == points.size() || samples.block[points[k + 1]] != samples.block[i];
    const double u = duration > 0.0 ? (samples.states[i].time_s - block.start_s) / duration : 1.0;
    if (u <= 0.0 && !last && samples.block[i] != 0)
      continue;  // the end of the block before stands there
    commanded.push_back(uncorrected[i]);
    wanted.push_back(job.machine.nominal.tool_in_workpiece(samples.states[i].q));
    places.push_back({samples.block[i], last ? 1.0 : u});
  }
  const Corrected ideal = corrected(job, compensator, commanded, wanted);
  const Eigen::Vector3d offset_w = datum_offset(job.scene.datum, job.machine, job.truth);
  std::vector<std::vector<program::CorrectedPoint>> lists(job.path.blocks.size());
  for (std::size_t k = 0; k < places.size(); ++k) {
    const program::Block& block = job.path.blocks[std::size_t(places[k].block)];
    lists[std::size_t(places[k].block)].push_back(
        {places[k].u, programmed(job, block, ideal.states[k].q, offset_w)});
  }

  const program::NcOptions control = nc_options(job.scene, job.machine);
  Compensated result;
  result.rewritten_program =
      program::rewritten(job.path, lists, control, {words.word_resolution, words.angle_resolution});
  const bool is_pvt = std::any_of(
      job.path.blocks.begin(), job.path.blocks.end(),
      [](const auto& block) { return block.interpolation == program::Interpolation::Cubic; });
  const program::Path path =
      is_pvt ? program::read_pvt(result.rewritten_program, "rewritten.csv", control)
             : program::read_nc(result.rewritten_program, "rewritten.ngc", control);
  result.samples =
      program::sample(path, job.machine.control, sample_options(job.scene, job.machine));
  result.samples.states = told(job, path, result.samples, job.machine.control);
  result.T_wt_nominal = wanted_of_rewritten(job, path, result.samples, places);
  result.path = path;
  result.point_left = ideal.point_left;
  result.direction_left = ideal.direction_left;
  result.not_converged = ideal.not_converged;
  return result;
}

}  // namespace

std::vector<AxisState> commands(const Job& job) {
  return told(job, job.path, job.samples, job.machine.nominal);
}

Compensated compensate(const Job& job, const CaseDescription& compensator) {
  Compensated result;
  if (compensator.channel == CaseDescription::Channel::Ideal) {
    Corrected ideal = corrected(job, compensator, commands(job), job.T_wt_nominal);
    result.samples = job.samples;
    result.samples.states = std::move(ideal.states);
    result.point_left = ideal.point_left;
    result.direction_left = ideal.direction_left;
    result.not_converged = ideal.not_converged;
    return result;
  }
  return through_program(job, compensator);
}

}  // namespace abbe::sim
