#include "sim/cut/cut.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <Eigen/Geometry>

#include "cutting/stock.h"
#include "kinematics/turn_between.h"
#include "kinematics/units.h"
#include "sim/cut/accelerations.h"
#include "sim/cut/follow.h"
#include "sim/cut/revolution_swing.h"
#include "sim/cut/stopwatch.h"
#include "sim/cut/surface_warnings.h"
#include "sim/cut/tool_motion.h"
#include "sim/cut/travel.h"

namespace abbe::sim {
namespace {

using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Pose;

/// What does the cutting: the chain whose part turns, the tool in it, and the program it follows.
struct Cutting {
  const kinematics::Chain& chain;
  const std::variant<cutting::Cutter, cutting::Nose>& tool;
  const program::Path& path;
  const program::Samples& samples;
  double explained = 0.0;  ///< mm, of a gouge by the errors
};

struct PoseErrors {
  Spread tip;
  Spread direction;
};

/// By how much more than it is commanded to a tool may reach, mm.
double oversize(const ToolDescription& tool) {
  if (const auto* nominal = std::get_if<cutting::Cutter>(&tool.nominal)) {
    const auto& actual = std::get<cutting::Cutter>(tool.actual);
    return std::abs(actual.radius - nominal->radius) +
           std::abs(actual.corner_radius - nominal->corner_radius);
  }
  const auto& actual = std::get<cutting::Nose>(tool.actual);
  double size = std::abs(actual.radius - std::get<cutting::Nose>(tool.nominal).radius);
  for (const cutting::NoseWave& wave : actual.waves) size += std::abs(wave.amplitude);
  return size;
}

/// What the errors explain of a gouge, mm: the tool off its place, leaning, larger.
double explained(const Job& job, const PoseErrors& off) {
  const auto* cutter = std::get_if<cutting::Cutter>(&job.scene.tool.actual);
  const double arm = cutter != nullptr ? cutter->flank_length + cutter->radius
                                       : std::get<cutting::Nose>(job.scene.tool.actual).radius;
  return off.tip.max + off.direction.max * arm + oversize(job.scene.tool);
}

std::string gouge_text(const ProgramGouge& gouge, int with_flank) {
  return fmt::format(
      "the program takes the tool into the design, by more than {} mm and the errors together at "
      "{} "
      "vertices, {} of them with the flank: the deepest by {:.3f} mm (line {})",
      cutting::rubbing, gouge.vertices, with_flank, gouge.deepest, gouge.line);
}

/// A map, and what is to be said of it.
struct Machined {
  cutting::Surface surface;
  std::vector<std::string> warnings;
};

Machined machined(const Job& job, const std::vector<Pose>& T_wt, const Cutting& with,
                  const Progress& progress) {
  cutting::SurfaceOptions options;
  options.band = job.scene.band;
  if (progress) options.progress = [&](double fraction) { progress("surface", fraction); };
  Machined made;
  if (const auto* cutter = std::get_if<cutting::Cutter>(&with.tool)) {
    const cutting::CutterMotion motion = cutter_motion(T_wt, with.samples);
    made.surface = cutting::milled_surface(job.design_w, *cutter, motion, options);
    const ProgramGouge gouge = program_gouge(made.surface, with.explained);
    if (gouge.vertices > 0)
      made.warnings.push_back(
          gouge_text(gouge, by_flank(gouge, made.surface, job.design_w, *cutter, motion)));
  } else {
    const int spindle = *job.machine.workpiece_spindle;
    made.surface = cutting::turned_surface(
        job.design_w, std::get<cutting::Nose>(with.tool),
        nose_motion(T_wt, with.samples, spindle_line(with.chain, spindle), spindle), options);
    const ProgramGouge gouge = program_gouge(made.surface, with.explained);
    if (gouge.vertices > 0) made.warnings.push_back(gouge_text(gouge, 0));
  }
  for (std::string& one : surface_warnings(made.surface, with.path, options.band))
    made.warnings.push_back(std::move(one));
  return made;
}

PoseErrors pose_errors(const std::vector<Pose>& T_wt, const std::vector<Pose>& T_wt_nominal) {
  PoseErrors errors;
  for (std::size_t i = 0; i < T_wt.size(); ++i) {
    const double tip = (T_wt[i].translation() - T_wt_nominal[i].translation()).norm();
    const Eigen::Vector3d u = T_wt[i].linear().col(2), v = T_wt_nominal[i].linear().col(2);
    const double direction = kinematics::angle_between(u, v);
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

/// What a scene describes and nothing in it uses, in words.
std::vector<std::string> idle(const Scene& scene) {
  std::vector<std::string> warnings;
  const auto warn = [&](bool is, const char* what) {
    if (is) warnings.push_back(what);
  };
  const bool cuts = scene.cutting && scene.cutting->material;
  if (scene.compliance) {
    const errors::ComplianceErrors& soft = *scene.compliance;
    const bool weighs = (soft.gravity_b || soft.inertia) && !soft.masses.empty();
    warn(!cuts && !weighs && soft.clamping_w.isZero(0.0),
         "nothing loads the compliance: it wants [cutting] with a material, masses with gravity or "
         "inertia, or clamping");
    warn((soft.gravity_b || soft.inertia) && soft.masses.empty(),
         "gravity and inertia act on [[compliance.mass]], and there is none");
    warn(!soft.gravity_b && !soft.inertia && !soft.masses.empty(),
         "the masses do nothing without gravity or inertia");
  }
  warn(scene.signals.dynamometer && !cuts, "the dynamometer reads nothing without cutting forces");
  warn(scene.signals.current && !cuts && !scene.thermal && !scene.compliance,
       "signals.csv is written where there is heat, stock or compliance");
  return warnings;
}

/// A program as the axes are commanded, on the wrong machine.
struct Run {
  const Job& job;
  const Commands& commands;
  const std::vector<Pose>& T_wt_wanted;
  std::vector<AxisVector> acceleration;  ///< (samples) empty without inertia
};

Pose actual_pose(const Run& run, std::size_t sample, errors::Load load) {
  if (!run.acceleration.empty()) load.acceleration = run.acceleration[sample];
  Pose T_wt = tool_in_workpiece(run.job.truth, run.commands.samples.states[sample], load);
  if (const auto& piezo = run.commands.piezo) {
    const Eigen::Vector3d& along_t = piezo->piezo.direction_t;
    const double force = along_t.dot(load.on_tool_t.head<3>());
    T_wt.translation() +=
        (piezo->stroke[Eigen::Index(sample)] + compensation::yielding(piezo->piezo, force)) *
        (T_wt.linear() * along_t);
  }
  return T_wt;
}

/// The cut of a case.
Process followed(const Run& run, const Progress& progress) {
  const Job& job = run.job;
  if (!job.scene.cutting) return {};  // nor a copy of the design for it
  const auto pose = [&](std::size_t sample, const errors::Load& load) {
    return actual_pose(run, sample, load);
  };
  return follow(job.scene, job.machine,
                cutting::transformed(job.design_w, job.scene.part.T_wm.inverse()),
                {run.commands.samples, run.commands.path ? *run.commands.path : job.path,
                 run.T_wt_wanted, pose, job.truth.actual, job.scene.tool.actual},
                [&](double fraction) {
                  if (progress) progress("stock", fraction);
                });
}

/// What acts at every sample. @return (samples), empty where nothing does
std::vector<errors::Load> loads_of(const Run& run, const Process& process) {
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

Run run_on(const Job& job, const Commands& commands) {
  Run run{
      job, commands, commands.T_wt_nominal.empty() ? job.T_wt_nominal : commands.T_wt_nominal, {}};
  if (!job.accelerations.empty()) run.acceleration = accelerations(commands.samples);
  return run;
}

/// @param loads  (samples), empty for none
/// @param at     numbers of samples; empty: all
std::vector<Pose> poses_of(const Run& run, const std::vector<errors::Load>& loads,
                           std::span<const std::size_t> at) {
  std::vector<Pose> T_wt(at.empty() ? run.commands.samples.states.size() : at.size());
  tbb::parallel_for(std::size_t(0), T_wt.size(), [&](std::size_t i) {
    const std::size_t sample = at.empty() ? i : at[i];
    T_wt[i] = actual_pose(run, sample, loads.empty() ? errors::Load{} : loads[sample]);
  });
  return T_wt;
}

/// What a table of the errors that is left says, as a fault of the scene.
template <typename Act>
auto inside_tables(const Job& job, const Act& act) {
  try {
    return act();
  } catch (const std::out_of_range& left) {
    throw BadInput(job.scene.file.string(), 0, 0, "a program inside the tables of the errors",
                   left.what());
  }
}

/// The element that is largest at a state, angles at a metre of lever.
std::string largest_element(const Job& job, const AxisState& state) {
  constexpr double lever = 1000.0;  // mm
  std::string name = "none of [errors], but heat, force, clamping or tool";
  double most = 0.0;
  const auto& joints = job.machine.nominal.joints();
  for (const errors::Element& element : job.scene.geometric.elements) {
    const auto joint = std::ranges::find_if(joints, [&](const kinematics::Joint& one) {
      return one.name == element.name.axis || (one.name == 's' && element.name.axis == 'S');
    });
    if (joint == joints.end()) continue;
    const auto j = std::size_t(joint - joints.begin());
    errors::CurveState at;
    at.command = state.q[Eigen::Index(j)];
    at.primed = joint->side == kinematics::Side::Workpiece;
    at.carriage = at.primed ? -at.command : at.command;
    at.direction = state.direction[j];
    at.stroke = state.stroke[j];
    double value = 0.0;
    for (const errors::Curve& curve : element.curves) value += errors::value(curve, at);
    value *= std::abs(job.scene.error_scale) * (element.name.is_angle() ? lever : 1.0);
    if (!(std::abs(value) > most)) continue;
    most = std::abs(value);
    name = "errors." + errors::to_string(element.name);
  }
  return name;
}

/// No machine is wrong by a metre: that is a wrong unit, refused with what makes it.
void check_tips(const Run& run, const std::vector<Pose>& T_wt) {
  constexpr double most_mm = 1000.0;
  const program::Samples& samples = run.commands.samples;
  for (std::size_t i = 0; i < T_wt.size(); ++i) {
    const double off = (T_wt[i].translation() - run.T_wt_wanted[i].translation()).norm();
    if (off <= most_mm) continue;
    const program::Path& path = run.commands.path ? *run.commands.path : run.job.path;
    throw BadInput(
        path.file, samples.line[i], 0,
        fmt::format("errors, with errors.scale, that move the tip by at most {} mm", most_mm),
        fmt::format("{:.3g} mm in this block, the largest of them {}", off,
                    largest_element(run.job, samples.states[i])));
  }
}

/// @return (samples), empty without a piezo
std::span<const double> stroke_of(const Commands& commands) {
  if (!commands.piezo) return {};
  return {commands.piezo->stroke.data(), std::size_t(commands.piezo->stroke.size())};
}

std::string swing_text(const RevolutionSwing& swing) {
  const std::string how =
      swing.leaps > 0
          ? fmt::format(
                "on line {} the tool leaps out of the work and back {} times in {} "
                "revolutions, under up to {:.4g} N, with a gain of force by depth of {:.2f}",
                swing.line, swing.leaps, swing.revolutions, swing.high, swing.gain)
          : fmt::format(
                "for {} revolutions from line {} on the force swings between {:.4g} and "
                "{:.4g} N from one to the next, a change returns {:.2f} times as large",
                swing.revolutions, swing.line, swing.low, swing.high, swing.gain);
  return "the cut does not settle: " + how +
         ": under the cutting force the tool goes too far into the work, and the surface is one of "
         "chatter";
}

/// What went wrong with the cut itself, in words.
std::vector<std::string> process_warnings(const Scene& scene, const Process& process) {
  std::vector<std::string> warnings;
  if (process.steps.empty()) return warnings;
  const ProcessTotals all = totals(process);
  if (all.open > 0)
    warnings.push_back(
        fmt::format("force and deflection did not agree to {:.3g} nm at {} of {} steps; they "
                    "differ by {:.3g} nm at most",
                    scene.cutting->tolerance / units::nm, all.open, process.steps.size(),
                    all.disagreement_max / units::nm));
  if (const auto swing = revolution_swing(process)) warnings.push_back(swing_text(*swing));
  if (!(all.removed > 0.0)) warnings.push_back("the tool met no material of the blank");
  if (!process.crash_lines.empty())
    warnings.push_back(fmt::format("a rapid or the shank met material on {} lines, first line {}",
                                   process.crash_lines.size(), process.crash_lines.front()));
  return warnings;
}

void add(std::vector<std::string> more, std::vector<std::string>& warnings) {
  std::move(more.begin(), more.end(), std::back_inserter(warnings));
}

}  // namespace

Cut cut_error_free(const Job& job, const Progress& progress) {
  Stopwatch watch;
  Cut result;
  result.name = result.case_name = "error_free";
  Machined made =
      machined(job, job.T_wt_nominal,
               {job.machine.nominal, job.scene.tool.nominal, job.path, job.samples, 0.0}, progress);
  result.surface = std::move(made.surface);
  result.process = job.nominal_process;
  add(process_warnings(job.scene, result.process), result.warnings);
  add(std::move(made.warnings), result.warnings);
  result.timing_s["surface"] = watch.lap();
  return result;
}

void check_travel(const Job& job, const Commands& commands) {
  check_travel(job.machine, commands.path ? *commands.path : job.path, commands.samples);
}

Process cut_process(const Job& job, const Commands& commands) {
  return followed(run_on(job, commands), {});
}

std::vector<Pose> tool_poses(const Job& job, const Commands& commands, const Process& process,
                             std::span<const std::size_t> at) {
  const Run run = run_on(job, commands);
  return inside_tables(job, [&] { return poses_of(run, loads_of(run, process), at); });
}

Cut cut(const Job& job, const Commands& commands, const Progress& progress) {
  Stopwatch watch;
  Cut result;
  result.name = result.case_name = "uncompensated";
  result.point_left = commands.point_left;
  result.direction_left = commands.direction_left;
  result.rewritten_program = commands.rewritten_program;
  result.warnings = commands.warnings;
  if (commands.not_converged > 0)
    result.warnings.push_back(fmt::format("{} of {} corrections did not converge",
                                          commands.not_converged, commands.samples.states.size()));
  check_travel(job, commands);

  const Run run = run_on(job, commands);
  const std::vector<Pose>& T_wt_wanted = run.T_wt_wanted;
  const std::vector<Pose> T_wt = inside_tables(job, [&] {
    result.process = followed(run, progress);
    result.timing_s["stock"] = watch.lap();
    const std::vector<errors::Load> loads = loads_of(run, result.process);
    result.signals = signals(job.scene, job.machine, job.truth,
                             {commands.samples, T_wt_wanted, result.process, loads,
                              commands.correction, stroke_of(commands)});
    return poses_of(run, loads, {});
  });
  inside_tables(job, [&] { check_tips(run, T_wt); });
  add(process_warnings(job.scene, result.process), result.warnings);
  for (const std::string& warning : idle(job.scene)) result.warnings.push_back(warning);
  const PoseErrors off = pose_errors(T_wt, T_wt_wanted);
  result.tip_error = off.tip;
  result.direction_error = off.direction;
  result.timing_s["poses"] = watch.lap();
  Machined made =
      machined(job, T_wt,
               {job.truth.actual, job.scene.tool.actual, commands.path ? *commands.path : job.path,
                commands.samples, explained(job, off)},
               progress);
  result.surface = std::move(made.surface);
  add(std::move(made.warnings), result.warnings);
  result.timing_s["surface"] = watch.lap();
  return result;
}

Cut cut(const Job& job, const Progress& progress) {
  Stopwatch watch;
  const Commands commands = as_programmed(job);
  const double correction_s = watch.lap();
  Cut result = cut(job, commands, progress);
  result.timing_s["correction"] = correction_s;
  return result;
}

std::vector<std::string> warnings_of(const Job& job, const Cut& cut) {
  std::vector<std::string> all = job.warnings;
  all.insert(all.end(), cut.warnings.begin(), cut.warnings.end());
  return all;
}

}  // namespace abbe::sim
