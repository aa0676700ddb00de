#include "sim/loop.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>

#include <Eigen/Dense>
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "kinematics/inverse.h"
#include "kinematics/jacobian.h"
#include "kinematics/units.h"
#include "sim/compensation/correct.h"
#include "sim/datum.h"
#include "sim/output.h"
#include "sim/part.h"
#include "sim/program/pvt.h"
#include "sim/program/rewrite.h"

namespace abbe::sim {
namespace {

using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Pose;
using Seconds = std::chrono::duration<double>;

class Stopwatch {
 public:
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = Seconds(now - last_).count();
    last_ = now;
    return seconds;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

std::vector<Pose> poses(const std::vector<AxisState>& states,
                        const std::function<Pose(const AxisState&)>& pose) {
  std::vector<Pose> T(states.size());
  tbb::parallel_for(std::size_t(0), states.size(), [&](std::size_t i) { T[i] = pose(states[i]); });
  return T;
}

/// Line of the program on which an axis first leaves its travel.
void check_travel(const Job& job, const program::Samples& samples) {
  constexpr double slack = 1e-6;  // mm or rad: words are rounded, limits are not exact
  for (std::size_t i = 0; i < samples.states.size(); ++i) {
    for (int k = 0; k < job.machine.nominal.size(); ++k) {
      const kinematics::Joint& joint = job.machine.nominal.joints()[std::size_t(k)];
      const double q = samples.states[i].q[k];
      if (joint.motion == kinematics::Motion::Spindle || job.machine.workpiece_spindle == k) continue;
      if (q >= joint.min - slack && q <= joint.max + slack) continue;
      const bool turns = joint.motion == kinematics::Motion::Rotary;
      const double unit = turns ? units::deg : 1.0;
      throw BadInput(job.path.file, samples.line[i], 0,
                     fmt::format("{} between {:.6g} and {:.6g} {}", joint.name, joint.min / unit,
                                 joint.max / unit, turns ? "deg" : "mm"),
                     fmt::format("{} = {:.9g} in this block", joint.name, q / unit));
    }
  }
}

cutting::CutterMotion cutter_motion(const std::vector<Pose>& T_wt, const program::Samples& samples) {
  cutting::CutterMotion motion;
  const Eigen::Index n = Eigen::Index(T_wt.size());
  motion.tip.resize(n, 3);
  motion.axis.resize(n, 3);
  motion.time_s.resize(n);
  motion.line = samples.line;
  for (Eigen::Index i = 0; i < n; ++i) {
    motion.tip.row(i) = T_wt[std::size_t(i)].translation().transpose();
    motion.axis.row(i) = T_wt[std::size_t(i)].linear().col(2).normalized().transpose();
    motion.time_s[i] = samples.states[std::size_t(i)].time_s;
  }
  return motion;
}

/// Line about which the workpiece turns, seen from the workpiece of a chain.
struct SpindleLine {
  Eigen::Vector3d point_w;
  Eigen::Vector3d direction_w;
};

SpindleLine spindle_line(const kinematics::Chain& chain, int joint) {
  const Pose T_wb = chain.T_bw_home().inverse();
  return {T_wb * chain.joints()[std::size_t(joint)].point_b,
          T_wb.linear() * chain.joints()[std::size_t(joint)].direction_b};
}

/// The tool turned back by the spindle, so that only slow motion is left to interpolate; the turning
/// itself is then exact.
cutting::NoseMotion nose_motion(const std::vector<Pose>& T_wt, const program::Samples& samples,
                                const kinematics::Chain& chain, int spindle) {
  const SpindleLine line = spindle_line(chain, spindle);
  cutting::NoseMotion motion;
  motion.spindle_point = line.point_w;
  motion.spindle_direction = line.direction_w;
  std::vector<double> angle, time;
  for (std::size_t i = 0; i < T_wt.size(); ++i) {
    const AxisState& state = samples.states[i];
    if (!time.empty() && state.time_s <= time.back()) continue;  // a reversal is sampled twice
    const double turn = state.q[spindle];
    const Eigen::Matrix3d back = Eigen::AngleAxisd(-turn, line.direction_w).toRotationMatrix();
    Pose T = T_wt[i];
    T.linear() = back * T_wt[i].linear();
    T.translation() = line.point_w + back * (T_wt[i].translation() - line.point_w);
    motion.T_slow.push_back(T);
    angle.push_back(turn);
    time.push_back(state.time_s);
    motion.line.push_back(samples.line[i]);
  }
  motion.spindle = Eigen::Map<Eigen::VectorXd>(angle.data(), Eigen::Index(angle.size()));
  motion.time_s = Eigen::Map<Eigen::VectorXd>(time.data(), Eigen::Index(time.size()));
  return motion;
}

/// What does the cutting: the chain whose part turns, and the tool in it.
struct Cutting {
  const kinematics::Chain& chain;
  const std::variant<cutting::Cutter, cutting::Nose>& tool;
};

cutting::Surface machined(const Job& job, const std::vector<Pose>& T_wt, const program::Samples& samples,
                          const Cutting& with, const Progress& progress) {
  cutting::SurfaceOptions options;
  options.band = job.scene.band;
  if (progress) options.progress = [&](double fraction) { progress("surface", fraction); };
  if (const auto* cutter = std::get_if<cutting::Cutter>(&with.tool))
    return cutting::milled_surface(job.design_w, *cutter, cutter_motion(T_wt, samples), options);
  const int spindle = *job.machine.workpiece_spindle;
  return cutting::turned_surface(job.design_w, std::get<cutting::Nose>(with.tool),
                                 nose_motion(T_wt, samples, with.chain, spindle), options);
}

struct PoseErrors {
  Spread tip;
  Spread direction;
};

PoseErrors pose_errors(const std::vector<Pose>& T_wt, const std::vector<Pose>& T_wt_nominal) {
  PoseErrors errors;
  for (std::size_t i = 0; i < T_wt.size(); ++i) {
    const double tip = (T_wt[i].translation() - T_wt_nominal[i].translation()).norm();
    const Eigen::Vector3d u = T_wt[i].linear().col(2), v = T_wt_nominal[i].linear().col(2);
    const double direction = std::atan2(u.cross(v).norm(), u.dot(v));
    errors.tip.rms += tip * tip;
    errors.tip.max = std::max(errors.tip.max, tip);
    errors.direction.rms += direction * direction;
    errors.direction.max = std::max(errors.direction.max, direction);
  }
  const double n = std::max<double>(1.0, double(T_wt.size()));
  errors.tip.rms = std::sqrt(errors.tip.rms / n);
  errors.direction.rms = std::sqrt(errors.direction.rms / n);
  return errors;
}

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

compensation::CorrectOptions correct_options(const Job& job, const CaseDescription& compensator) {
  compensation::CorrectOptions options;
  options.strategy = static_cast<compensation::Strategy>(compensator.strategy);
  options.rotary_bound = job.scene.compensation.rotary_bound;
  options.functional_height = functional_height(job.scene.tool);
  options.idle_joint = job.machine.workpiece_spindle;
  return options;
}

/// The one door between truth and compensation: the perfect belief.
compensation::Belief perfect_belief(const Truth& truth) {
  return [known = without_random(truth)](const AxisState& state) {
    return tool_in_workpiece(known, state);
  };
}

struct Corrected {
  std::vector<AxisState> states;
  double direction_left = 0.0;
  std::size_t not_converged = 0;
};

Corrected corrected(const Job& job, const CaseDescription& compensator,
                    const std::vector<AxisState>& commanded, const std::vector<Pose>& T_wt_nominal) {
  const compensation::Belief belief = perfect_belief(job.truth);
  const compensation::CorrectOptions options = correct_options(job, compensator);
  Corrected result{commanded, 0.0, 0};
  std::vector<compensation::Correction> corrections(commanded.size());
  tbb::parallel_for(std::size_t(0), commanded.size(), [&](std::size_t i) {
    corrections[i] =
        compensation::correct(job.machine.control, belief, T_wt_nominal[i], commanded[i], options);
  });
  for (std::size_t i = 0; i < commanded.size(); ++i) {
    result.states[i].q = corrections[i].q;
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
    q = kinematics::slides_for_tip(job.machine.nominal, q, {q[x], q[y], q[z]}).value_or(q);
  }
  return job.machine.nominal.tool_in_workpiece(q);
}

/// A place in the original program.
struct Place {
  int block = 0;
  double u = 0.0;
};

/// The samples at which a rewritten program gets points: those of a path sampled so coarsely that its
/// chords stay within a word; of a block sampled twice (a reversal) the later.
std::vector<std::size_t> rewrite_points(const program::Path& path, const program::Samples& samples) {
  std::vector<std::size_t> points;
  for (std::size_t i = 0; i < samples.states.size(); ++i) {
    if (path.blocks[std::size_t(samples.block[i])].interpolation == program::Interpolation::Dwell) continue;
    const bool again = !points.empty() && samples.block[points.back()] == samples.block[i] &&
                       samples.states[points.back()].time_s == samples.states[i].time_s;
    if (again)
      points.back() = i;
    else
      points.push_back(i);
  }
  return points;
}

/// How far from the tip the tool shapes the part: a flat end mill may work with its whole flank, a
/// rounded one works with its rounding.
double shaping_height(const Scene& scene) {
  const auto* cutter = std::get_if<cutting::Cutter>(&scene.tool.nominal);
  if (cutter == nullptr) return 0.0;
  const bool flank = cutter->corner_radius == 0.0 || std::holds_alternative<program::Flank>(scene.program.source);
  return flank ? cutter->flank_length : cutter->radius;
}

program::SampleOptions sample_options(const Scene& scene, const Machine& machine) {
  program::SampleOptions options;
  options.chord_tolerance = scene.chord_tolerance;
  options.max_step = scene.max_step;
  options.max_axis_step = scene.max_step;
  options.workpiece_spindle = machine.workpiece_spindle;
  options.reach = shaping_height(scene);
  return options;
}

/// Programmed coordinates of a corrected command, in those of its block.
AxisVector programmed(const Job& job, const program::Block& block, const AxisVector& q) {
  if (block.coordinates == program::Coordinates::Axis) return q;
  const Eigen::Vector3d tip_w = job.machine.control.tool_in_workpiece(q).translation();
  AxisVector words = q;
  const auto axes = tip_words(job.machine.control);
  for (std::size_t k = 0; k < 3; ++k) words[axes[k]] = tip_w[Eigen::Index(k)];
  return words;
}

/// Where the tool should be at every sample of a rewritten program: its moves are, one by one, the
/// stretches of the original between the places that were corrected.
std::vector<Pose> wanted_of_rewritten(const Job& job, const program::Path& path,
                                      const program::Samples& samples, const std::vector<Place>& places) {
  std::vector<int> move_of(path.blocks.size());
  const std::size_t first = places.front().u == 0.0 ? 1 : 0;
  int moves = int(first);
  const auto rests = [&](std::size_t i) {
    return path.blocks[i].interpolation == program::Interpolation::Dwell;
  };
  for (std::size_t i = 0; i < path.blocks.size(); ++i) move_of[i] = rests(i) ? moves - 1 : moves++;
  if (moves != int(places.size()))
    throw std::logic_error(fmt::format("a rewritten program has {} moves for {} places", moves, places.size()));
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
    wanted[i] = nominal_at(job, job.path.blocks[std::size_t(to.block)], from + part * (to.u - from));
  });
  return wanted;
}

/// The correction written into a program of the same dialect, which the control then reads and runs.
Compensated through_program(const Job& job, const CaseDescription& compensator) {
  const CompensationDescription& words = job.scene.compensation;
  program::SampleOptions coarse = sample_options(job.scene, job.machine);
  coarse.chord_tolerance = std::max(coarse.chord_tolerance, words.word_resolution);
  const program::Samples samples = program::sample(job.path, job.machine.nominal, coarse);
  const std::vector<std::size_t> points = rewrite_points(job.path, samples);

  std::vector<AxisState> commanded;
  std::vector<Pose> wanted;
  std::vector<Place> places;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const std::size_t i = points[k];
    const program::Block& block = job.path.blocks[std::size_t(samples.block[i])];
    const double duration = block.end_s - block.start_s;
    const bool last = k + 1 == points.size() || samples.block[points[k + 1]] != samples.block[i];
    const double u = duration > 0.0 ? (samples.states[i].time_s - block.start_s) / duration : 1.0;
    if (u <= 0.0 && !last && samples.block[i] != 0) continue;  // the end of the block before stands there
    commanded.push_back(samples.states[i]);
    wanted.push_back(job.machine.nominal.tool_in_workpiece(samples.states[i].q));
    places.push_back({samples.block[i], last ? 1.0 : u});
  }
  const Corrected ideal = corrected(job, compensator, commanded, wanted);
  std::vector<std::vector<program::CorrectedPoint>> lists(job.path.blocks.size());
  for (std::size_t k = 0; k < places.size(); ++k) {
    const program::Block& block = job.path.blocks[std::size_t(places[k].block)];
    lists[std::size_t(places[k].block)].push_back(
        {places[k].u, programmed(job, block, ideal.states[k].q)});
  }

  const program::NcOptions control = nc_options(job.scene, job.machine);
  Compensated result;
  result.rewritten_program =
      program::rewritten(job.path, lists, control, {words.word_resolution, words.angle_resolution});
  const bool is_pvt = std::any_of(job.path.blocks.begin(), job.path.blocks.end(), [](const auto& block) {
    return block.interpolation == program::Interpolation::Cubic;
  });
  const program::Path path = is_pvt ? program::read_pvt(result.rewritten_program, "rewritten.csv", control)
                                    : program::read_nc(result.rewritten_program, "rewritten.ngc", control);
  result.samples = program::sample(path, job.machine.control, sample_options(job.scene, job.machine));
  result.T_wt_nominal = wanted_of_rewritten(job, path, result.samples, places);
  result.direction_left = ideal.direction_left;
  result.not_converged = ideal.not_converged;
  return result;
}

}  // namespace

double functional_height(const ToolDescription& tool) {
  const auto* cutter = std::get_if<cutting::Cutter>(&tool.nominal);
  return cutter != nullptr ? cutter->corner_radius : 0.0;
}

Job prepare(const Scene& scene, const PrepareOptions& options) {
  Stopwatch watch;
  Machine machine = compile(scene);
  Truth truth = truth_of(scene, machine);
  Part part = load_part(scene);
  const double part_s = watch.lap();
  if (options.progress) options.progress("program", 0.0);
  Program program = load_program(scene, machine, part, options.program_folder);
  const double program_s = watch.lap();
  program::Samples samples =
      program::sample(program.path, machine.nominal, sample_options(scene, machine));
  std::vector<Pose> T_wt_nominal = poses(samples.states, [&](const AxisState& state) {
    return machine.nominal.tool_in_workpiece(state.q);
  });
  Job job{scene,
          std::move(machine),
          std::move(truth),
          std::move(part.design_w),
          std::move(program.path),
          std::move(samples),
          std::move(T_wt_nominal),
          std::move(program.text),
          {}};
  check_travel(job, job.samples);
  job.timing_s = {{"part", part_s}, {"program", program_s}, {"sample", watch.lap()}};
  return job;
}

std::vector<AxisState> commands(const Job& job) {
  std::vector<AxisState> states = job.samples.states;
  const Eigen::Vector3d offset_w = datum_offset(job.scene.datum, job.machine, job.truth);
  const bool own_kinematics = !same(job.machine.control, job.machine.nominal);
  if (!own_kinematics && offset_w.isZero(0.0)) return states;
  const AxisVector slides = slides_of_offset(job.machine.control, offset_w);
  tbb::parallel_for(std::size_t(0), states.size(), [&](std::size_t i) {
    if (!is_tip(job.path, job.samples.block[i])) {
      states[i].q += slides;
      return;
    }
    const Eigen::Vector3d tip_w = job.T_wt_nominal[i].translation() + offset_w;
    if (const auto q = kinematics::slides_for_tip(job.machine.control, states[i].q, tip_w))
      states[i].q = *q;
  });
  return states;
}

Compensated compensate(const Job& job, const CaseDescription& compensator) {
  Compensated result;
  if (compensator.channel == CaseDescription::Channel::Ideal) {
    Corrected ideal = corrected(job, compensator, commands(job), job.T_wt_nominal);
    result.samples = job.samples;
    result.samples.states = std::move(ideal.states);
    result.direction_left = ideal.direction_left;
    result.not_converged = ideal.not_converged;
    return result;
  }
  return through_program(job, compensator);
}

Cut cut_error_free(const Job& job, const Progress& progress) {
  Stopwatch watch;
  Cut result;
  result.name = "error_free";
  result.surface = machined(job, job.T_wt_nominal, job.samples,
                            {job.machine.nominal, job.scene.tool.nominal}, progress);
  result.timing_s["surface"] = watch.lap();
  return result;
}

Cut cut(const Job& job, const std::optional<CaseDescription>& compensator, const Progress& progress) {
  Stopwatch watch;
  Cut result;
  result.name = compensator ? compensator->name : "uncompensated";
  Compensated told;
  if (compensator) {
    told = compensate(job, *compensator);
    result.direction_left = told.direction_left;
    result.rewritten_program = told.rewritten_program;
    if (told.not_converged > 0)
      result.warnings.push_back(fmt::format("{} of {} corrections did not converge", told.not_converged,
                                            told.samples.states.size()));
  } else {
    told.samples = job.samples;
    told.samples.states = commands(job);
  }
  check_travel(job, told.samples);
  result.timing_s["correction"] = watch.lap();

  std::vector<Pose> T_wt;
  try {
    T_wt = poses(told.samples.states,
                 [&](const AxisState& state) { return tool_in_workpiece(job.truth, state); });
  } catch (const std::out_of_range& left) {
    throw BadInput(job.scene.file.string(), 0, 0, "a program inside the tables of the errors", left.what());
  }
  const PoseErrors errors =
      pose_errors(T_wt, told.T_wt_nominal.empty() ? job.T_wt_nominal : told.T_wt_nominal);
  result.tip_error = errors.tip;
  result.direction_error = errors.direction;
  result.timing_s["poses"] = watch.lap();
  result.surface = machined(job, T_wt, told.samples, {job.machine.actual, job.scene.tool.actual}, progress);
  result.timing_s["surface"] = watch.lap();
  return result;
}

}  // namespace abbe::sim
