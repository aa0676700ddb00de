#include "sim/loop.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <Eigen/Dense>

#include "kinematics/units.h"
#include "sim/part.h"

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
      if (joint.motion == kinematics::Motion::Spindle || job.machine.workpiece_spindle == k)
        continue;
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

cutting::CutterMotion cutter_motion(const std::vector<Pose>& T_wt,
                                    const program::Samples& samples) {
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

/// The tool turned back by the spindle, so that only slow motion is left to interpolate; the
/// turning itself is then exact.
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

cutting::Surface machined(const Job& job, const std::vector<Pose>& T_wt,
                          const program::Samples& samples, const Cutting& with,
                          const Progress& progress) {
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

double shaping_height(const Scene& scene) {
  const auto* cutter = std::get_if<cutting::Cutter>(&scene.tool.nominal);
  if (cutter == nullptr) return 0.0;
  const bool flank =
      cutter->corner_radius == 0.0 || std::holds_alternative<program::Flank>(scene.program.source);
  return flank ? cutter->flank_length : cutter->radius;
}

}  // namespace

program::SampleOptions sample_options(const Scene& scene, const Machine& machine) {
  program::SampleOptions options;
  options.chord_tolerance = scene.chord_tolerance;
  options.max_step = scene.max_step;
  options.max_axis_step = scene.max_step;
  options.workpiece_spindle = machine.workpiece_spindle;
  options.reach = shaping_height(scene);
  return options;
}

Job prepare(const Scene& scene, const Progress& progress) {
  Stopwatch watch;
  Machine machine = compile(scene);
  Truth truth = truth_of(scene, machine);
  Part part = load_part(scene);
  const double part_s = watch.lap();
  if (progress) progress("program", 0.0);
  Program program = load_program(scene, machine, part);
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

Cut cut_error_free(const Job& job, const Progress& progress) {
  Stopwatch watch;
  Cut result;
  result.name = result.case_name = "error_free";
  result.surface = machined(job, job.T_wt_nominal, job.samples,
                            {job.machine.nominal, job.scene.tool.nominal}, progress);
  result.timing_s["surface"] = watch.lap();
  return result;
}

Cut cut(const Job& job, const std::optional<CaseDescription>& compensator,
        const Progress& progress) {
  Stopwatch watch;
  Cut result;
  result.name = result.case_name = compensator ? compensator->name : "uncompensated";
  Compensated told;
  if (compensator) {
    told = compensate(job, *compensator);
    result.point_left = told.point_left;
    result.direction_left = told.direction_left;
    result.rewritten_program = told.rewritten_program;
    if (told.not_converged > 0)
      result.warnings.push_back(fmt::format("{} of {} corrections did not converge",
                                            told.not_converged, told.samples.states.size()));
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
    throw BadInput(job.scene.file.string(), 0, 0, "a program inside the tables of the errors",
                   left.what());
  }
  const PoseErrors errors =
      pose_errors(T_wt, told.T_wt_nominal.empty() ? job.T_wt_nominal : told.T_wt_nominal);
  result.tip_error = errors.tip;
  result.direction_error = errors.direction;
  result.timing_s["poses"] = watch.lap();
  result.surface =
      machined(job, T_wt, told.samples, {job.machine.actual, job.scene.tool.actual}, progress);
  result.timing_s["surface"] = watch.lap();
  return result;
}

}  // namespace abbe::sim
