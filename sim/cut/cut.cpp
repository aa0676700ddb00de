#include "sim/cut/cut.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <Eigen/Geometry>

#include "cutting/map/areal_filter.h"
#include "cutting/map/refinement.h"
#include "cutting/stock/stock.h"
#include "kinematics/pose.h"
#include "kinematics/units.h"
#include "sim/cut/collisions.h"
#include "sim/cut/judged_surface.h"
#include "sim/cut/process.h"
#include "sim/cut/process_simulation.h"
#include "sim/cut/resources.h"
#include "sim/cut/sweep.h"
#include "sim/cut/tool_motion.h"
#include "sim/cut/tool_poses.h"

namespace abbe::sim {
namespace {

using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Pose;

// Errors of a pose over the samples of a program: tip in mm, direction in rad.
struct PoseErrors {
  Spread tip;
  Spread direction;
};

/// Returns by how much the actual tool may reach beyond the nominal one, mm.
double oversize(const ToolDescription& tool) {
  if (const auto* nominal = std::get_if<cutting::Cutter>(&tool.nominal)) {
    const auto& actual = std::get<cutting::Cutter>(tool.actual);
    if (nominal->outline && actual.outline)
      return cutting::max_separation(*nominal->outline, *actual.outline);
    return std::abs(actual.radius - nominal->radius) +
           std::abs(actual.corner_radius - nominal->corner_radius);
  }
  const auto& actual = std::get<cutting::Nose>(tool.actual);
  if (actual.profile)
    return cutting::max_separation(*actual.profile, *std::get<cutting::Nose>(tool.nominal).profile);
  double size = std::abs(actual.radius - std::get<cutting::Nose>(tool.nominal).radius);
  for (const cutting::NoseWave& wave : actual.waves) size += std::abs(wave.amplitude);
  return size;
}

/// Returns the distance of the edge from its centre, mm.
double outermost(const cutting::Nose& nose) {
  return nose.profile ? nose.profile->outer_radius : nose.radius;
}

/// Returns an upper bound, mm, of the gouge that the errors explain: displaced tip, tilt over the
/// length of the tool, larger tool.
double explained(const Job& job, const PoseErrors& off) {
  const auto* cutter = std::get_if<cutting::Cutter>(&job.scene.tool.actual);
  const double arm = cutter != nullptr ? cutter->flank_length + cutter->radius
                                       : outermost(std::get<cutting::Nose>(job.scene.tool.actual));
  return off.tip.max + off.direction.max * arm + oversize(job.scene.tool);
}

std::string gouge_text(const ProgramGouge& gouge, int with_flank) {
  return fmt::format(
      "the program takes the tool into the design, by more than {} mm and the errors together at "
      "{} "
      "vertices, {} of them with the flank: the deepest by {:.3f} mm (line {})",
      cutting::rubbing, gouge.vertices, with_flank, gouge.deepest, gouge.line);
}

/// A map, how well it resolves the surface, and its warnings.
struct CutMap {
  cutting::Surface surface;
  std::optional<cutting::InterpolationError> interpolation;
  std::vector<std::string> warnings;
};

/// Returns the resolution a map must have: that of the scene; without one the resolution the
/// vertices were chosen for, or the default fraction of the range of this map if that is more,
/// since errors may enlarge the range.
double target_resolution(const Job& job, const cutting::Surface& surface) {
  const double sampled = job.sampled->resolution;
  if (job.scene.part.sampling.resolution) return sampled;
  return std::max(sampled, cutting::default_resolution(trimmed_range(surface, job.design_w)));
}

/// Returns advice for a map too coarse for the texture: its form is still usable if enough of the
/// values within triangles carry it.
/// @param cutoff  wavelength that the filter passes by half, mm
std::string advice_on_form(const cutting::Design& design, double cutoff) {
  if (cutting::resolves_form(design, cutoff)) return "judge by form_um, or";
  const double values =
      cutting::filter_values(cutoff, double(design.triangles.rows()) / design.area.sum());
  return fmt::format(
      "form_um is no better, with {:.2g} values within its cut-off of {:.3g} mm ({:.3g} would do);",
      values, cutoff, cutting::min_filter_values);
}

/// Returns the keys of [part] by which its vertices come closer to each other.
std::string remedy(const PartDescription& part) {
  switch (part.sampling.kind) {
    case PartSampling::Kind::Adaptive:
      return "raise part.points, or part.resolution_um";
    case PartSampling::Kind::Spacing:
      return "lower part.spacing_mm";
    case PartSampling::Kind::Vertices:
      break;
  }
  const bool is_mesh = std::holds_alternative<MeshFile>(part.shape);
  return std::string(is_mesh ? "" : "raise part.vertices, or ") +
         "set part.sampling to \"adaptive\"";
}

std::string unresolved_text(const cutting::InterpolationError& error, double resolution,
                            const Job& job) {
  return fmt::format(
      "the map is too coarse for what the tool left: between its {} vertices, linear interpolation "
      "misses the surface by more than {:.3g} um at {:.3g} % of it, by {:.3g} um at most: {} {}",
      job.design_w.vertices.rows(), resolution / units::um, 100.0 * error.unresolved,
      error.worst / units::um, advice_on_form(job.design_w, job.scene.part.form_cutoff),
      remedy(job.scene.part));
}

/// Calls `use` for each sweep of a program in order.
using SweepVisitor = std::function<void(const std::function<void(const ToolSweep&)>& use)>;

/// Returns the number of gouge vertices cut by flanks. Each vertex counts for the first sweep in
/// whose time it was cut, since neighbouring sweeps may meet in a sample.
int total_flank_gouges(ProgramGouge gouge, const cutting::Surface& surface,
                       const cutting::Design& design_w, const SweepVisitor& visit_sweeps) {
  int count = 0;
  visit_sweeps([&](const ToolSweep& sweep) {
    const auto* cutter = std::get_if<cutting::Cutter>(&sweep.tool);
    const auto& states = sweep.samples.states;
    if (cutter == nullptr || states.empty()) return;
    const auto is_during = [&](Eigen::Index i) {
      const double time_s = surface.cut_time_s[i];
      return time_s >= states.front().time_s && time_s <= states.back().time_s;
    };
    ProgramGouge own = gouge;
    std::erase_if(own.at, [&](Eigen::Index i) { return !is_during(i); });
    std::erase_if(gouge.at, is_during);
    if (own.at.empty()) return;
    count += flank_gouge_count(own, surface, design_w, *cutter,
                               cutter_motion(sweep.T_wt, sweep.samples));
  });
  return count;
}

/// Inputs of a map: the sweep, the program, and the gouge in mm that the errors explain. That is a
/// function since windows know it only after the surface is cut.
struct CutInputs {
  Sweep sweep;
  SweepVisitor visit_sweeps;
  const program::Path& path;
  std::function<double()> explained;
  std::shared_ptr<const cutting::Surface> known = {};  ///< the surface, if it was already cut
};

SweepVisitor sweep_visitor(const std::vector<ToolSweep>& sweeps) {
  return [&](const auto& use) { std::ranges::for_each(sweeps, use); };
}

std::shared_ptr<const cutting::Surface> error_free_surface(const Job& job) {
  return job.sampled ? job.sampled->error_free : nullptr;
}

CutMap cut_map(const Job& job, const CutInputs& with) {
  const Sweep& sweep = with.sweep;
  CutMap made;
  // The error-free surface was cut when the vertices were chosen; cutting it again gives the same
  // bits.
  made.surface = with.known ? *with.known : sweep.surface(job.design_w);
  const ProgramGouge gouge = program_gouge(made.surface, with.explained());
  if (gouge.vertices > 0)
    made.warnings.push_back(gouge_text(
        gouge, total_flank_gouges(gouge, made.surface, job.design_w, with.visit_sweeps)));
  add_warnings(surface_warnings(made.surface, with.path, job.scene.band), made.warnings);
  if (job.sampled) {
    const double wanted = target_resolution(job, made.surface);
    const cutting::SurfaceInterpolator between = on_surface(job);
    made.surface = cutting::sample_within_triangles(std::move(made.surface), job.design_w,
                                                    job.sampled->within, between, sweep.surface);
    made.interpolation =
        cutting::interpolation_error(job.design_w, made.surface, between, sweep.surface,
                                     {.seed = job.scene.seed, .resolution = wanted});
    if (made.interpolation->places == 0)
      made.warnings.push_back(
          "no place between the vertices could be sampled: how well the map is resolved is not "
          "known");
    if (made.interpolation->unresolved > max_unresolved_fraction)
      made.warnings.push_back(unresolved_text(*made.interpolation, wanted, job));
  }
  return made;
}

/// Returns RMS and maximum of the errors of a pose.
/// @param first  first sample to be counted
PoseErrors pose_errors(const std::vector<Pose>& T_wt, const std::vector<Pose>& T_wt_nominal,
                       std::size_t first) {
  PoseErrors errors;
  for (std::size_t i = first; i < T_wt.size(); ++i) {
    const double tip = (T_wt[i].translation() - T_wt_nominal[i].translation()).norm();
    const Eigen::Vector3d u = T_wt[i].linear().col(2), v = T_wt_nominal[i].linear().col(2);
    const double direction = kinematics::angle_between(u, v);
    errors.tip.rms += tip * tip;
    errors.tip.max = std::max(errors.tip.max, tip);
    errors.direction.rms += direction * direction;
    errors.direction.max = std::max(errors.direction.max, direction);
  }
  const double n = std::max(1.0, double(T_wt.size()) - double(first));
  errors.tip.rms = std::sqrt(errors.tip.rms / n);
  errors.direction.rms = std::sqrt(errors.direction.rms / n);
  return errors;
}

/// Simulates stock and forces of a case with its actual poses.
Process simulated_process(const ActualRun& run, const Progress& progress) {
  const Job& job = run.job;
  if (!job.scene.cutting) return {};  // without [cutting] the design is not copied
  const auto pose = [&](std::size_t sample, const errors::Load& load) {
    return actual_pose(run, sample, load);
  };
  return simulate_process(job.scene, job.machine, *job.body_m,
                          {run.commands.samples, path_of(job, run.commands), run.T_wt_wanted, pose,
                           job.truth.actual, job.scene.tool.actual},
                          [&](double fraction) {
                            if (progress) progress("stock", fraction);
                          });
}

/// Returns the name of the geometric element with the largest value at a state. Angles count at a
/// lever of 1 m.
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

/// Throws BadInput if the tip is off by more than 1 m: no machine is that wrong, so a unit or
/// errors.scale is. The message names the largest element.
void check_tips(const ActualRun& run, const std::vector<Pose>& T_wt) {
  constexpr double max_mm = 1000.0;
  const program::Samples& samples = run.commands.samples;
  for (std::size_t i = 0; i < T_wt.size(); ++i) {
    const double off = (T_wt[i].translation() - run.T_wt_wanted[i].translation()).norm();
    if (off <= max_mm) continue;
    const program::Path& path = path_of(run.job, run.commands);
    throw BadInput(
        path.file, samples.line[i], 0,
        fmt::format("errors, with errors.scale, that move the tip by at most {} mm", max_mm),
        fmt::format("{:.3g} mm in this block, the largest of them {}", off,
                    largest_element(run.job, samples.states[i])));
  }
}

/// Returns the stroke of the piezo, mm (samples); empty without one.
std::span<const double> piezo_stroke(const Commands& commands) {
  if (!commands.piezo) return {};
  return {commands.piezo->stroke.data(), std::size_t(commands.piezo->stroke.size())};
}

/// Returns the first sample of a part that is not also the last of the part before.
std::size_t first_new_sample(const Job& part) { return part.sampling.goes_on ? 1 : 0; }

/// The motion of one part of a job on the machine with errors.
struct SegmentMotion {
  std::vector<Pose> T_wt;
  std::deque<WornSegment> worn;  ///< of a tool whose radius wears: the segments that are swept
                                 ///< instead of T_wt
  Process process;
  Signals signals;
  PoseErrors off;
  ChordError between;
  std::vector<std::string> warnings;
};

/// Computes the actual poses of a part, with its process, signals and warnings.
/// @param looks  largest number of intervals sampled for the chord error
SegmentMotion segment_motion(const Job& job, const Commands& commands, const Progress& progress,
                             std::map<std::string, double>& timing_s, std::size_t looks) {
  Stopwatch watch;
  SegmentMotion made;
  const ActualRun run = actual_run(job, commands);
  made.T_wt = check_table_range(job, [&] {
    made.process = simulated_process(run, progress);
    timing_s["stock"] += watch.lap();
    if (progress) progress("poses", 0.0);
    const std::vector<errors::Load> loads = sample_loads(run, made.process);
    made.signals = signals(job.scene, job.machine, job.truth,
                           {commands.samples, run.T_wt_wanted, made.process, loads,
                            commands.correction, piezo_stroke(commands)});
    return poses_of(run, loads, {});
  });
  check_table_range(job, [&] { check_tips(run, made.T_wt); });
  add_warnings(process_warnings(job.scene, made.process), made.warnings);
  made.between = check_table_range(job, [&] { return chord_error(job, commands, looks); });
  // The first sample of a window that continues another was counted there.
  made.off = pose_errors(made.T_wt, run.T_wt_wanted, first_new_sample(job));
  if (!run.wear.empty() && job.scene.tool.wear->radius > 0.0)
    made.worn = worn_segments(job.scene.tool, run.wear, commands.samples, made.T_wt);
  timing_s["poses"] += watch.lap();
  return made;
}

/// Adds the sweep of a part, or one for each segment of a tool whose radius wears. The sweeps refer
/// to the arguments.
void add_sweeps(const Job& part, const program::Samples& samples,
                const SegmentMotion& segment_motion, std::vector<ToolSweep>& sweeps) {
  const auto& chain = part.truth.actual;
  const std::optional<int> spindle = part.machine.workpiece_spindle;
  for (const WornSegment& piece : segment_motion.worn)
    sweeps.push_back({piece.tool, piece.samples, piece.T_wt, chain, spindle});
  if (segment_motion.worn.empty())
    sweeps.push_back({part.scene.tool.actual, samples, segment_motion.T_wt, chain, spindle});
}

/// Joins two spreads.
/// @param n_a, n_b  number of samples of each
Spread joined(const Spread& a, double n_a, const Spread& b, double n_b) {
  if (!(n_a > 0.0)) return b;
  const double n = n_a + n_b;
  return {std::sqrt((n_a * a.rms * a.rms + n_b * b.rms * b.rms) / n), std::max(a.max, b.max)};
}

/// Adds the figures of a part to the result. Stock and forces exist only for jobs with one tool, so
/// the process is moved, not joined.
void add(SegmentMotion& part, double n, double samples_before, Cut& result) {
  result.tip_error = joined(result.tip_error, samples_before, part.off.tip, n);
  result.direction_error = joined(result.direction_error, samples_before, part.off.direction, n);
  result.chord_error = joined(result.chord_error, part.between);
  result.process = std::move(part.process);
  result.signals = joined(std::move(result.signals), part.signals);
  add_warnings(std::move(part.warnings), result.warnings);
}

}  // namespace

Cut cut_error_free(const Job& job, const Progress& progress, Retention keep) {
  Stopwatch watch;
  Cut result;
  result.name = result.case_name = "error_free";
  if (progress) progress("surface", 0.0);  // sorting of the moves comes first and reports nothing
  const SweepVisitor visit_sweeps = [&](const std::function<void(const ToolSweep&)>& use) {
    each_part(job, [&](const Job& part) { use(segment_error_free_sweep(part)); });
  };
  CutMap made = cut_map(job, {error_free_sweep(job, options_of(job, progress)), visit_sweeps,
                              job.path, [] { return 0.0; }, error_free_surface(job)});
  result.surface = std::move(made.surface);
  result.interpolation = made.interpolation;
  result.process = job.nominal_process;
  if (keep == Retention::Track) {
    std::vector<TrackedPart> parts;
    for (const Job& part : parts_of(job))
      parts.push_back({part.samples, part.T_wt_nominal, part.T_wt_nominal});
    result.track = join_tracks(parts);
  }
  add_warnings(process_warnings(job.scene, result.process), result.warnings);
  add_warnings(std::move(made.warnings), result.warnings);
  result.timing_s["surface"] = watch.lap();
  return result;
}

void check_travel(const Job& job, const Commands& commands) {
  const auto parts = parts_of(job);
  for (std::size_t i = 0; i < parts.size(); ++i)
    check_travel(parts[i].machine, path_of(parts[i], of_part(commands, i)),
                 of_part(commands, i).samples);
}

Process cut_process(const Job& job, const Commands& commands, const Progress& progress) {
  return simulated_process(actual_run(job, commands), progress);
}

namespace {

std::string not_converged_text(std::size_t corrections, std::size_t of) {
  return fmt::format("{} of {} corrections did not converge", corrections, of);
}

/// Throws CollisionStop if the program cannot run. The message holds all collisions, since no
/// result file is written.
void stop_at_collision(const Collisions& found) {
  if (is_clear(found)) return;
  std::string text = "stopped, nothing was cut (collision.stop)";
  for (const std::string& warning : collision_warnings(found)) text += "; " + warning;
  throw CollisionStop(text + "; places and clearances: abbe check SCENE --collisions");
}

}  // namespace

Cut cut(const Job& job, const Commands& commands, const Progress& progress, Retention keep) {
  Cut result;
  result.name = result.case_name = "uncompensated";
  result.point_left = commands.point_left;
  result.direction_left = commands.direction_left;
  result.rewritten_program = commands.rewritten_program;
  result.warnings = commands.warnings;
  if (commands.not_converged > 0)
    result.warnings.push_back(
        not_converged_text(commands.not_converged, commands.samples.states.size()));
  // Travel is checked before the collisions, poses and surface, which take most of the time.
  check_travel(job, commands);
  if (job.scene.collision.on) {
    result.collisions = collisions(job, commands, result.name, progress);
    result.timing_s["collisions"] = result.collisions->seconds;
    if (job.scene.collision.stop) stop_at_collision(*result.collisions);
    add_warnings(collision_warnings(*result.collisions), result.warnings);
  }
  const auto parts = parts_of(job);
  std::vector<SegmentMotion> all;
  double samples = 0.0, off = 0.0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    all.push_back(segment_motion(parts[i], of_part(commands, i), progress, result.timing_s,
                                 default_interval_count));
    off = std::max(off, explained(parts[i], all.back().off));
    const auto n = double(all.back().T_wt.size());
    add(all.back(), n, samples, result);
    samples += n;
  }
  add_warnings(chord_error_warnings(result.chord_error, result.tip_error.rms), result.warnings);
  add_warnings(idle_warnings(job.scene), result.warnings);
  if (keep == Retention::Track) {
    std::vector<TrackedPart> tracked;
    for (std::size_t i = 0; i < parts.size(); ++i)
      tracked.push_back({of_part(commands, i).samples, target_poses(parts[i], of_part(commands, i)),
                         all[i].T_wt});
    result.track = join_tracks(tracked);
  }
  Stopwatch watch;
  if (progress) progress("surface", 0.0);  // sorting of the moves comes first and reports nothing
  std::vector<ToolSweep> sweeps;
  for (std::size_t i = 0; i < parts.size(); ++i)
    add_sweeps(parts[i], of_part(commands, i).samples, all[i], sweeps);
  result.wear = worn_tools(tool_runs(job));
  CutMap made = cut_map(job, {sweep_of(sweeps, options_of(job, progress)), sweep_visitor(sweeps),
                              path_of(job, commands), [off] { return off; }});
  result.surface = std::move(made.surface);
  result.interpolation = made.interpolation;
  add_warnings(std::move(made.warnings), result.warnings);
  result.timing_s["surface"] = watch.lap();
  return result;
}

namespace {

/// Runs the windows of a job on the machine with errors. The figures of each window are added to
/// the cut when it is first run.
class WindowedCut {
 public:
  WindowedCut(const Job& job, CommandSource command_source, Cut& result)
      : job_(job), command_source_(std::move(command_source)), result_(result) {}

  SweptWindow at(std::size_t number);
  void visit_sweeps(const std::function<void(const ToolSweep&)>& use);
  double explained() const {
    return sim::explained(job_, {result_.tip_error, result_.direction_error});
  }
  std::size_t not_converged() const { return not_converged_; }

 private:
  void report(const Job& part, const Commands& commands, SegmentMotion& made);

  const Job& job_;
  CommandSource command_source_;
  Cut& result_;
  std::size_t reported_ = 0;  // number of windows
  std::size_t not_converged_ = 0;
  double samples_ = 0.0;
};

/// Returns the number of intervals sampled in each window for the chord error; at least 10, since
/// the quotient is zero beyond 1000 windows.
std::size_t intervals_per_window(std::size_t windows) {
  constexpr std::size_t least = 10;
  return std::max(least, default_interval_count / windows);
}

SweptWindow WindowedCut::at(std::size_t number) {
  const Job part = window_of(job_, number);
  Commands commands = command_source_(part);
  check_travel(part.machine, path_of(part, commands), commands.samples);
  std::map<std::string, double> timing_s;
  // Windows are first swept in order; a repeated one is not reported again, and its chord error is
  // not needed.
  const bool is_first = number == reported_;
  const std::size_t looks = is_first ? intervals_per_window(job_.windows->all.size()) : 0;
  SegmentMotion made = segment_motion(part, commands, {}, timing_s, looks);
  if (is_first) report(part, commands, made);
  return {std::move(commands.samples), std::move(made.T_wt)};
}

void WindowedCut::visit_sweeps(const std::function<void(const ToolSweep&)>& use) {
  for (std::size_t i = 0; i < job_.windows->all.size(); ++i) {
    const SweptWindow one = at(i);
    use({job_.scene.tool.actual, one.samples, one.T_wt, job_.truth.actual, std::nullopt});
  }
}

void WindowedCut::report(const Job& part, const Commands& commands, SegmentMotion& made) {
  ++reported_;
  // The first sample of a window is the last of the one before and counts once.
  const double n = double(made.T_wt.size()) - double(first_new_sample(part));
  add(made, n, samples_, result_);
  samples_ += n;
  result_.point_left = std::max(result_.point_left, commands.point_left);
  result_.direction_left = std::max(result_.direction_left, commands.direction_left);
  not_converged_ += commands.not_converged;
  for (const std::string& warning : commands.warnings)
    if (std::ranges::find(result_.warnings, warning) == result_.warnings.end())
      result_.warnings.push_back(warning);
}

}  // namespace

Cut cut_in_windows(const Job& job, const CommandSource& command_source, const Progress& progress) {
  Stopwatch watch;
  Cut result;
  result.name = result.case_name = "uncompensated";
  WindowedCut run(job, command_source, result);
  if (progress) progress("surface", 0.0);
  const auto window = [&run](std::size_t number) { return run.at(number); };
  const Sweep sweep = sweep_in_windows(std::get<cutting::Cutter>(job.scene.tool.actual),
                                       job.windows->all.size(), window, options_of(job, progress));
  CutMap made = cut_map(job, {sweep, [&run](const auto& use) { run.visit_sweeps(use); }, job.path,
                              [&run] { return run.explained(); }});
  result.surface = std::move(made.surface);
  result.interpolation = made.interpolation;
  if (run.not_converged() > 0)
    result.warnings.push_back(not_converged_text(run.not_converged(), job.windows->samples));
  add_warnings(chord_error_warnings(result.chord_error, result.tip_error.rms), result.warnings);
  add_warnings(idle_warnings(job.scene), result.warnings);
  add_warnings(std::move(made.warnings), result.warnings);
  result.timing_s["surface"] = watch.lap();
  return result;
}

Cut cut(const Job& job, const Progress& progress, Retention keep) {
  if (job.windows)
    return cut_in_windows(
        job, [](const Job& part) { return uncompensated_commands(part); }, progress);
  Stopwatch watch;
  const Commands commands = uncompensated_commands(job);
  const double correction_s = watch.lap();
  Cut result = cut(job, commands, progress, keep);
  result.timing_s["correction"] = correction_s;
  return result;
}

std::vector<std::string> warnings_of(const Job& job, const Cut& cut) {
  std::vector<std::string> all = job.warnings;
  all.insert(all.end(), cut.warnings.begin(), cut.warnings.end());
  return all;
}

}  // namespace abbe::sim
