#include "sim/cut/job.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "cutting/part/design_points.h"
#include "errors/geometric.h"
#include "kinematics/units.h"
#include "sim/cut/commands.h"
#include "sim/cut/part.h"
#include "sim/cut/process.h"
#include "sim/cut/process_simulation.h"
#include "sim/cut/resources.h"
#include "sim/cut/scene_checks.h"
#include "sim/cut/tool_motion.h"
#include "sim/cut/tool_use.h"
#include "sim/machine/run_out.h"
#include "sim/machine/truth.h"
#include "sim/scene/scene.h"
#include "sim/scene/toml.h"
#include "sim/scene/value_warnings.h"

namespace abbe::sim {
namespace {

using kinematics::AxisState;
using kinematics::Pose;

// Returns the height above the tip up to which the tool shapes the part, mm.
double shaping_height(const Scene& scene) {
  const auto* cutter = std::get_if<cutting::Cutter>(&scene.tool.nominal);
  if (cutter == nullptr) return 0.0;
  const bool flank =
      cutter->corner_radius == 0.0 || std::holds_alternative<program::Flank>(scene.program.source);
  return flank ? cutter->flank_length : cutter->radius;
}

/// Returns the largest second derivative of the tip by the spindle angle, mm/rad^2, from harmonics
/// in that angle: error motion of a spindle that turns the workpiece, and vibration on any spindle.
double spindle_bend(const Scene& scene, const Machine& machine) {
  // Tilts count at a lever of 100 mm; an estimate is enough, as it only sets the density of
  // samples.
  constexpr double lever = 100.0;  // mm, for tilts
  const auto size = [](const errors::ElementName& name) { return name.is_angle() ? lever : 1.0; };
  double bend = 0.0;
  for (const errors::Element& element : scene.geometric.elements) {
    if (element.name.axis != 'S' || !machine.workpiece_spindle) continue;
    for (const errors::Curve& curve : element.curves)
      bend += size(element.name) * scene.error_scale * errors::max_bend(curve);
  }
  for (const errors::Vibration& vibration : scene.vibrations) {
    double speed = vibration.reference_speed;
    // the largest amplitude is at the resonance, if the spindle can reach that speed
    if (vibration.resonance) speed = std::max(speed, *vibration.resonance / vibration.order);
    bend += size(vibration.name) * vibration.order * vibration.order *
            std::abs(errors::amplitude(vibration, speed));
  }
  return bend;
}

/// Throws BadInput if a finite-element field does not lie on the part, which means another mesh,
/// unit or pose.
void check_field(const Scene& scene, const cutting::Design& design_w) {
  if (!scene.compliance || !scene.compliance->workpiece) return;
  const auto* field = std::get_if<errors::WorkpieceField>(&*scene.compliance->workpiece);
  if (field == nullptr) return;
  const auto size = [](const cutting::Points& points) {
    return (points.colwise().maxCoeff() - points.colwise().minCoeff()).norm();
  };
  const auto refuse = [&](const std::string& expected, const std::string& seen) {
    throw BadInput(scene.file.string(), 0, 0, "a compliance field on this part: " + expected, seen);
  };
  // The farthest point of a square grid is 0.71 spacings from a node; 1.5 leaves room for irregular
  // meshes.
  const double allowed = 1.5 * errors::node_spacing(*field);
  const double far = errors::coverage(*field, design_w.vertices);
  if (far > allowed)
    refuse(fmt::format("a node within {:.3g} mm of every vertex, 1.5 of its spacings", allowed),
           fmt::format("a vertex {:.4g} mm from the nearest node", far));
  // A field four times as large as the part is of another part or in another unit, even if each
  // vertex has a node nearby.
  if (size(field->points_w) > 4 * size(design_w.vertices))
    refuse(fmt::format("nodes over at most {:.4g} mm, four times the part",
                       4 * size(design_w.vertices)),
           fmt::format("nodes over {:.4g} mm", size(field->points_w)));
}

/// Returns warnings about error elements, true and believed, over the range in which the program
/// moves the axes.
std::vector<std::string> size_warnings(const Job& job) {
  kinematics::AxisVector least, most;
  if (job.windows) {
    least = job.windows->least;
    most = job.windows->most;
  } else if (!job.samples.states.empty()) {
    least = most = job.samples.states.front().q;
    for (const kinematics::AxisState& state : job.samples.states) {
      least = least.cwiseMin(state.q);
      most = most.cwiseMax(state.q);
    }
  } else {
    return {};
  }
  std::vector<std::string> warnings = errors::element_warnings(job.truth.geometric, least, most);
  if (job.scene.belief.identified)
    add_warnings(errors::element_warnings(
                     errors::scaled(errors::bind(*job.scene.belief.identified, job.machine.control),
                                    job.scene.belief.scale),
                     least, most, {.section = "belief.identified"}),
                 warnings);
  return warnings;
}

/// Returns true if samples made with `had` are as dense as those with `wanted` along turns of
/// spindles. Errors change the sampling in no other respect.
bool is_as_dense(const program::SampleOptions& had, const program::SampleOptions& wanted) {
  if (had.max_spindle_turn > wanted.max_spindle_turn) return false;
  return !wanted.max_nose_turn ||
         (had.max_nose_turn && *had.max_nose_turn <= *wanted.max_nose_turn);
}

}  // namespace

program::SampleOptions sample_options(const Scene& scene, const Machine& machine) {
  program::SampleOptions options;
  options.chord_tolerance = scene.chord_tolerance;
  options.max_step = scene.max_step;
  options.max_axis_step = scene.max_step;
  options.workpiece_spindle = machine.workpiece_spindle;
  options.reach = shaping_height(scene);
  const double bend = spindle_bend(scene, machine);
  if (bend > 0.0) {
    // the sagitta of a chord over an angle is bend angle^2 / 8
    const double turn = std::sqrt(8 * scene.chord_tolerance / bend);
    options.max_spindle_turn = std::min(options.max_spindle_turn, turn);
    if (!scene.vibrations.empty()) options.max_nose_turn = turn;
  }
  return options;
}

namespace {

/// Returns the input error for too many samples, at the key that causes them.
BadInput refusal_of(const Scene& scene, const program::TooManySamples& fault,
                    const std::string& expected, const std::string& windows_obstacle = {}) {
  return scene_limit_error(scene,
                           {"sampling.max_step_mm", "sampling.chord_tolerance_nm",
                            "program.step_over_mm", "program.step_mm", "program.feed_um_per_rev"},
                           expected,
                           fmt::format("more, from line {} of {} on{}", fault.line, fault.file,
                                       windows_obstacle_text(windows_obstacle)));
}

program::Samples sampled(const Scene& scene, const program::Path& path, const Machine& machine,
                         program::SampleOptions options, const std::string& windows_obstacle) {
  options.max_samples = max_program_samples();
  try {
    return program::sample(path, machine.nominal, options);
  } catch (const program::TooManySamples& fault) {
    throw refusal_of(scene, fault,
                     fmt::format("at most {} samples of the program, which the memory holds",
                                 options.max_samples),
                     windows_obstacle);
  }
}

std::vector<program::Window> windows_of(const Scene& scene, const program::Path& path,
                                        const Machine& machine,
                                        const program::SampleOptions& options,
                                        const Progress& progress) {
  try {
    // A window ends with the block that passes half of the limit, so that one block may be as long
    // as the other half.
    return program::windows(path, machine.nominal, options, options.max_samples / 2,
                            [&](double part) {
                              if (progress) progress("sample", part);
                            });
  } catch (const program::TooManySamples& fault) {
    throw refusal_of(scene, fault,
                     fmt::format("at most {:.0f} samples of the program, {} of them in a block",
                                 program::max_in_windows, options.max_samples / 2));
  }
}

/// A program, or a segment of it, as the error-free machine runs it with one tool.
struct JobSegment {
  Scene scene;
  Machine machine;
  program::Path path;
  program::SampleOptions sampling;
  program::Samples samples;
  std::vector<Pose> T_wt;
};

std::vector<Pose> nominal_poses(const Machine& machine, const program::Samples& samples) {
  std::vector<Pose> T_wt(samples.states.size());
  tbb::parallel_for(std::size_t(0), T_wt.size(), [&](std::size_t i) {
    T_wt[i] = machine.nominal.tool_in_workpiece(samples.states[i].q);
  });
  return T_wt;
}

JobSegment make_job_segment(Scene scene, Machine machine, program::Path path,
                            program::SampleOptions sampling, program::Samples samples) {
  std::vector<Pose> T_wt = nominal_poses(machine, samples);
  check_travel(machine, path, samples);
  return {std::move(scene), std::move(machine), std::move(path),
          sampling,         std::move(samples), std::move(T_wt)};
}

/// Samples the program and makes the segment.
/// @param before  axis state in which it begins, for directions of approach
JobSegment make_job_segment(Scene scene, program::Path path, const AxisState& before,
                            const std::string& windows_obstacle = {}) {
  Machine machine = compile(scene);
  program::SampleOptions sampling = sample_options(scene, machine);
  sampling.before = before;
  program::Samples samples = sampled(scene, path, machine, sampling, windows_obstacle);
  return make_job_segment(std::move(scene), std::move(machine), std::move(path), sampling,
                          std::move(samples));
}

/// Returns one job segment for each tool segment of a program with several tools.
std::vector<JobSegment> stretch_pieces(const Scene& described, const program::Path& path,
                                       const ToolUse& use) {
  const std::vector<ToolDescription> tools = all_tools(described);
  std::vector<JobSegment> pieces;
  AxisState before;
  for (const ToolSegment& stretch : use.stretches) {
    Scene scene = with_run_out(with_tool(described, *tools[stretch.tool].number));
    // The history runs before the first segment only.
    if (!pieces.empty()) scene.signals.history_interval = 0.0;
    pieces.push_back(make_job_segment(
        std::move(scene), program::stretch_of(path, stretch.first, stretch.last), before));
    if (!pieces.back().samples.states.empty()) before = pieces.back().samples.states.back();
  }
  return pieces;
}

/// Joins the segments of several tools into one program, under the first tool of the scene.
JobSegment joined(const Scene& scene, program::Path path, const std::vector<JobSegment>& pieces,
                  const ToolUse& use) {
  JobSegment whole{scene, compile(scene), std::move(path), pieces.front().sampling, {}, {}};
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const program::Samples& from = pieces[i].samples;
    program::Samples& to = whole.samples;
    to.states.insert(to.states.end(), from.states.begin(), from.states.end());
    to.line.insert(to.line.end(), from.line.begin(), from.line.end());
    for (const int block : from.block) to.block.push_back(block + int(use.stretches[i].first));
    whole.T_wt.insert(whole.T_wt.end(), pieces[i].T_wt.begin(), pieces[i].T_wt.end());
  }
  return whole;
}

/// Returns the job of a segment, without its warnings.
Job job_of(JobSegment piece, Truth truth, cutting::Design design_w,
           std::shared_ptr<const cutting::Design> body_m, Process process) {
  std::vector<kinematics::AxisVector> acceleration;
  if (piece.scene.compliance && piece.scene.compliance->inertia)
    acceleration = accelerations(piece.samples);
  return {std::move(piece.scene),
          std::move(piece.machine),
          std::move(truth),
          std::move(design_w),
          std::move(body_m),
          {},
          {},
          0.0,
          {},
          std::nullopt,
          std::move(piece.path),
          piece.sampling,
          std::move(piece.samples),
          std::move(piece.T_wt),
          std::move(process),
          std::move(acceleration),
          {},
          {},
          {},
          {},
          {}};
}

/// The segments of a program on the error-free machine, and their warnings.
struct JobSegments {
  JobSegment whole;                   // the first window of a program in windows, with all blocks
  std::vector<JobSegment> stretches;  // empty with one tool
  std::vector<std::string> warnings;
  std::shared_ptr<const Windows> windows = {};
  std::vector<std::string> shank_warnings = {};  // of a program in windows
};

/// Prepares a program of one tool in windows. Each is sampled once here for its size, extents and
/// shank contacts.
/// @param held  samples that may be in memory
JobSegments in_windows(const Scene& scene, const program::Path& path,
                       const cutting::Design& design_w, std::size_t held,
                       const Progress& progress) {
  const Machine machine = compile(scene);
  program::SampleOptions sampling = sample_options(scene, machine);
  // half: the first window stays in memory while another is cut
  sampling.max_samples = held / 2;
  Windows windows{windows_of(scene, path, machine, sampling, progress), 0, 0, {}, {}};
  std::optional<JobSegment> first;
  ShankContacts shank;
  for (const program::Window& window : windows.all) {
    program::Path blocks = path_of(path, window);
    if (progress) progress("sample", double(window.first) / double(path.blocks.size()));
    sampling.goes_on = window.goes_on;
    program::Samples samples = sample(blocks, machine.nominal, sampling);
    if (!first) windows.least = windows.most = samples.states.front().q;
    for (const AxisState& state : samples.states) {
      windows.least = windows.least.cwiseMin(state.q);
      windows.most = windows.most.cwiseMax(state.q);
    }
    // the first sample of a later window is the last of the one before
    windows.samples += samples.states.size() - (first ? 1 : 0);
    windows.max_at_once = std::max(windows.max_at_once, samples.states.size());
    JobSegment piece =
        make_job_segment(scene, machine, std::move(blocks), sampling, std::move(samples));
    const ShankContacts contacts = shank_contacts(scene, design_w, {piece.samples, piece.T_wt});
    shank = first ? joined(shank, contacts) : contacts;
    if (!first) first = std::move(piece);
  }
  first->path = path;
  return {*std::move(first),
          {},
          {},
          std::make_shared<const Windows>(std::move(windows)),
          shank_warnings(scene, shank)};
}

/// Prepares the program of one tool, in windows if its samples exceed the budget.
JobSegments one_piece(const Scene& scene, const program::Path& path,
                      const cutting::Design& design_w, const MemoryBudget& holding,
                      const Progress& progress) {
  const auto vertices = std::size_t(design_w.vertices.rows());
  const std::size_t most = holding.samples ? std::min(holding.samples(path.blocks.size(), vertices),
                                                      max_program_samples())
                                           : 0;
  if (most == 0) return {make_job_segment(scene, path, {}, holding.windows_obstacle), {}, {}};
  Machine machine = compile(scene);
  program::SampleOptions sampling = sample_options(scene, machine);
  sampling.max_samples = most;
  try {
    program::Samples samples = program::sample(path, machine.nominal, sampling);
    return {
        make_job_segment(scene, std::move(machine), path, sampling, std::move(samples)), {}, {}};
  } catch (const program::TooManySamples&) {
    return in_windows(scene, path, design_w, most, progress);
  }
}

JobSegments segments_by_tool(const Scene& described, const Scene& scene, const program::Path& path,
                             const ToolUse& use) {
  std::vector<JobSegment> stretches = stretch_pieces(described, path, use);
  JobSegment whole = joined(scene, path, stretches, use);
  return {std::move(whole), std::move(stretches), {}};
}

JobSegments pieces_of(const Scene& described, const Program& program,
                      const cutting::Design& design_w, const MemoryBudget& holding,
                      const Progress& progress) {
  const Scene scene = with_run_out(described);
  const std::vector<ToolDescription> tools = all_tools(scene);
  ToolUse use = tool_use(program.path, tools);
  JobSegments made = tools.size() > 1 ? segments_by_tool(described, scene, program.path, use)
                                      : one_piece(scene, program.path, design_w, holding, progress);
  made.warnings.insert(made.warnings.begin(), use.warnings.begin(), use.warnings.end());
  if (tools.size() == 1 && scene.program.tools)
    add_warnings(
        length_warnings(program.path, {0, 0, program.path.blocks.size()}, *scene.tool.number),
        made.warnings);
  add_warnings(program.warnings, made.warnings);
  add_warnings(program_warnings(scene, design_w, program.path, program.unreached), made.warnings);
  add_warnings(feed_warnings(scene, made.whole.machine, program.path), made.warnings);
  add_warnings(pole_warnings(scene, made.whole.machine, program.path), made.warnings);
  add_warnings(made.shank_warnings, made.warnings);
  if (made.windows) return made;
  for (const JobSegment& one :
       made.stretches.empty() ? std::span(&made.whole, 1) : std::span<JobSegment>(made.stretches))
    add_warnings(
        shank_warnings(one.scene, shank_contacts(one.scene, design_w, {one.samples, one.T_wt})),
        made.warnings);
  return made;
}

}  // namespace

std::span<const Job> parts_of(const Job& job) {
  if (job.windows) throw std::logic_error("the parts of a job in windows are not held");
  return job.stretches.empty() ? std::span(&job, 1) : std::span<const Job>(job.stretches);
}

void each_part(const Job& job, const std::function<void(const Job& part)>& use) {
  if (!job.windows) std::ranges::for_each(parts_of(job), use);
  for (std::size_t i = 0; job.windows && i < job.windows->all.size(); ++i) use(window_of(job, i));
}

Job window_of(const Job& job, std::size_t number) {
  stop_if_interrupted();
  const program::Window& window = job.windows->all[number];
  JobSegment piece{job.scene, job.machine, path_of(job.path, window), job.sampling, {}, {}};
  // The history runs before the first window only.
  if (number > 0) piece.scene.signals.history_interval = 0.0;
  piece.sampling.goes_on = window.goes_on;
  piece.samples = sample(piece.path, piece.machine.nominal, piece.sampling);
  piece.T_wt = nominal_poses(piece.machine, piece.samples);
  return job_of(std::move(piece), job.truth, {}, job.body_m, {});
}

const program::Path& path_of(const Job& part, const Commands& commands) {
  return commands.path ? *commands.path : part.path;
}

const std::vector<Pose>& target_poses(const Job& part, const Commands& commands) {
  return commands.T_wt_nominal.empty() ? part.T_wt_nominal : commands.T_wt_nominal;
}

ToolRun tool_run(const Job& part) {
  return {part.scene.tool, part.path, part.samples, part.T_wt_nominal, part.cut_before};
}

std::vector<ToolRun> tool_runs(const Job& job) {
  std::vector<ToolRun> parts;
  if (job.windows) return parts;  // a tool that wears is not run in windows
  for (const Job& part : parts_of(job)) parts.push_back(tool_run(part));
  return parts;
}

Job prepare(const Scene& described, const Progress& progress, const MemoryBudget& holding) {
  Stopwatch watch;
  const auto begins = [&](const char* stage) {
    if (progress) progress(stage, 0.0);
  };
  begins("part");
  const Scene scene = with_run_out(described);
  Part part = load_part(scene);
  // The work is limited before the program is read or generated, the first step that may take long.
  const double part_s = watch.lap();
  const Work all = estimate_work(scene, part);
  const bool in_windows = holding.samples && holding.samples(0, std::size_t(all.vertices)) > 0;
  const Work work = in_windows ? windowed_work(all) : all;
  check_work(scene, work);
  if (const std::string text = remark(work); progress && !text.empty()) progress(text, -1.0);
  begins("program");
  Program program = load_program(scene, compile(scene), part);
  const double program_s = watch.lap();
  begins("sample");
  JobSegments made = pieces_of(described, program, part.design_w, holding, progress);
  JobSegment& whole = made.whole;
  std::vector<std::string>& warnings = made.warnings;
  const double sample_s = watch.lap();
  check_field(scene, part.design_w);
  // The nominal process runs on a rigid machine: its poses do not depend on the load.
  const auto rigid = [&T_wt = whole.T_wt](std::size_t i, const errors::Load&) { return T_wt[i]; };
  Process process = simulate_process(
      scene, whole.machine, part.body_m,
      {whole.samples, whole.path, whole.T_wt, rigid, whole.machine.nominal, scene.tool.nominal},
      [&](double fraction) {
        if (progress) progress("stock", fraction);
      });
  const double stock_s = watch.lap();
  add_warnings(process.warnings, warnings);
  begins("heat");
  const auto body_m = std::make_shared<const cutting::Design>(std::move(part.body_m));
  // Heat needs the whole program, as every tool warms the same machine.
  const std::vector<errors::Activity> active =
      activity(scene, whole.machine, whole.samples, process);
  const auto job_from = [&](JobSegment piece, Process of_piece) {
    Truth truth = make_truth(piece.scene, piece.machine, active);
    return job_of(std::move(piece), std::move(truth), part.design_w, body_m, std::move(of_piece));
  };
  Job job = job_from(std::move(whole), std::move(process));
  for (JobSegment& piece : made.stretches) job.stretches.push_back(job_from(std::move(piece), {}));
  const std::vector<FeedUse> before = previous_uses(tool_runs(job));
  for (std::size_t i = 0; i < job.stretches.size(); ++i) job.stretches[i].cut_before = before[i];
  job.windows = std::move(made.windows);
  job.body_w = std::make_shared<const cutting::Thickness>(part.design_w);
  if (progress && job.windows)
    progress(fmt::format("{} samples are not held at once: run in {} windows", job.windows->samples,
                         job.windows->all.size()),
             -1.0);
  add_warnings(std::move(part.warnings), warnings);
  add_warnings(value_warnings(scene), warnings);
  add_warnings(heat_warnings(scene.datum, job.truth), warnings);
  add_warnings(size_warnings(job), warnings);
  job.recognised = std::move(part.recognised);
  job.recognised_fraction = part.recognised_fraction;
  job.facet_uncertainty = std::move(part.facet_uncertainty);
  job.face_groups = std::move(part.face_groups);
  job.program_text = std::move(program.text);
  job.unreached = program.unreached;
  add_warnings(wear_warnings(worn_tools(tool_runs(job))), warnings);
  job.warnings = std::move(warnings);
  job.timing_s = {{"part", part_s},
                  {"program", program_s},
                  {"sample", sample_s},
                  {"stock", stock_s},
                  {"heat", watch.lap()}};
  return job;
}

namespace {

/// Returns the job of one tool with other errors.
/// @param active  heat sources of the whole program
Job changed(Job job, Scene scene, const std::vector<errors::Activity>& active) {
  Machine machine = compile(scene);
  const auto refuse = [&](bool differs, const char* what) {
    if (differs)
      throw BadInput(scene.file.string(), 0, 0, fmt::format("the {} of every other case", what),
                     "another one");
  };
  refuse(!same(machine.nominal, job.machine.nominal), "nominal machine");
  refuse(!is_as_dense(job.sampling, sample_options(scene, machine)), "density of samples");
  Truth truth = make_truth(scene, machine, active);
  job.scene = std::move(scene);
  job.machine = std::move(machine);
  job.truth = std::move(truth);
  return job;
}

}  // namespace

Job replace_errors(Job job, const Scene& described) {
  const Scene scene = with_run_out(described);
  const std::vector<errors::Activity> active =
      activity(scene, compile(scene), job.samples, job.nominal_process);
  for (Job& stretch : job.stretches) {
    Scene of_tool = with_run_out(with_tool(described, *stretch.scene.tool.number));
    stretch = changed(std::move(stretch), std::move(of_tool), active);
  }
  return changed(std::move(job), scene, active);
}

Eigen::Vector3d control_datum_offset(const Job& job, const Corrector& corrector) {
  const auto really_at = [&](const kinematics::AxisState& state) {
    return tool_in_workpiece(job.truth, state);
  };
  try {
    return datum_offset(job.scene.datum, job.machine, really_at, corrector);
  } catch (const std::out_of_range& left) {  // a table of the errors without extrapolation
    const Node* datum = job.scene.tree ? job.scene.tree->find("datum") : nullptr;
    const Place place = datum ? datum->place : Place{};
    throw BadInput(place.file ? *place.file : job.scene.file.string(), place.line, place.column,
                   "errors that reach to where the datum is found", left.what());
  }
}

Commands uncompensated_commands(const Job& job) {
  std::vector<Commands> parts;
  for (const Job& part : parts_of(job))
    parts.push_back(
        uncompensated_commands(part.machine, part.path, part.samples, control_datum_offset(part)));
  return joined(std::move(parts));
}

}  // namespace abbe::sim
