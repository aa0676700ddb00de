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
#include "sim/cut/scene_checks.h"
#include "sim/cut/tool_motion.h"
#include "sim/cut/tool_use.h"
#include "sim/files/progress.h"
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
  const bool uses_flank =
      cutter->corner_radius == 0.0 || std::holds_alternative<program::Flank>(scene.program.source);
  return uses_flank ? cutter->flank_length : cutter->radius;
}

/// Returns an estimate of the largest second derivative of the tip by the spindle angle, mm/rad^2.
/// It sums the harmonics in that angle: the error motions of a spindle that turns the workpiece,
/// and the vibrations on any spindle.
double spindle_curvature(const Scene& scene, const Machine& machine) {
  constexpr double lever = 100.0;  // mm, for tilts: an estimate is enough for the sample density
  const auto lever_length = [](const errors::ElementName& name) {
    return name.is_angle() ? lever : 1.0;
  };
  double curvature = 0.0;
  for (const errors::Element& element : scene.geometric.elements) {
    if (element.name.axis != 'S' || !machine.workpiece_spindle) continue;
    for (const errors::Curve& curve : element.curves)
      curvature +=
          lever_length(element.name) * scene.error_scale * errors::second_derivative_bound(curve);
  }
  for (const errors::Vibration& vibration : scene.vibrations) {
    double speed = vibration.reference_speed;
    // The amplitude is largest at the resonance.
    if (vibration.resonance) speed = std::max(speed, *vibration.resonance / vibration.order);
    curvature += lever_length(vibration.name) * vibration.order * vibration.order *
                 std::abs(errors::amplitude(vibration, speed));
  }
  return curvature;
}

/// Throws BadInput if a finite-element field does not lie on the part, i.e. has another mesh, unit
/// or pose.
void check_field(const Scene& scene, const cutting::Design& design_w) {
  if (!scene.compliance || !scene.compliance->workpiece) return;
  const auto* field = std::get_if<errors::WorkpieceField>(&*scene.compliance->workpiece);
  if (field == nullptr) return;
  const auto diagonal = [](const cutting::Points& points) {
    return (points.colwise().maxCoeff() - points.colwise().minCoeff()).norm();
  };
  const auto throw_field_error = [&](const std::string& expected, const std::string& seen) {
    throw BadInput(scene.file.string(), 0, 0,
                   "a compliance field that matches this part: " + expected, seen);
  };
  // In a square grid no point is farther than 0.71 spacings from a node; 1.5 allows for irregular
  // meshes.
  const double max_distance = 1.5 * errors::node_spacing(*field);
  const double distance = errors::max_node_distance(*field, design_w.vertices);
  if (distance > max_distance)
    throw_field_error(
        fmt::format("a node within {:.3g} mm (1.5 node spacings) of every vertex", max_distance),
        fmt::format("a vertex {:.4g} mm from the nearest node", distance));
  // A much larger field belongs to another part or has another unit, even if each vertex has a node
  // nearby.
  if (diagonal(field->points_w) > 4 * diagonal(design_w.vertices))
    throw_field_error(fmt::format("nodes over at most {:.4g} mm (four times the part size)",
                                  4 * diagonal(design_w.vertices)),
                      fmt::format("nodes over {:.4g} mm", diagonal(field->points_w)));
}

/// Returns warnings about the error elements of the truth and of the belief over the range in which
/// the program moves the axes.
std::vector<std::string> error_size_warnings(const Job& job) {
  kinematics::AxisVector lower, upper;
  if (job.windows) {
    lower = job.windows->lower;
    upper = job.windows->upper;
  } else if (!job.samples.states.empty()) {
    lower = upper = job.samples.states.front().q;
    for (const kinematics::AxisState& state : job.samples.states) {
      lower = lower.cwiseMin(state.q);
      upper = upper.cwiseMax(state.q);
    }
  } else {
    return {};
  }
  std::vector<std::string> warnings = errors::element_warnings(job.truth.geometric, lower, upper);
  if (job.scene.belief.identified)
    add_warnings(errors::element_warnings(
                     errors::scaled(errors::bind(*job.scene.belief.identified, job.machine.control),
                                    job.scene.belief.scale),
                     lower, upper, {.section = "belief.identified"}),
                 warnings);
  return warnings;
}

/// Returns true if existing samples are as dense along spindle turns as the required ones. Errors
/// change the sampling in no other respect.
bool is_as_dense(const program::SampleOptions& existing, const program::SampleOptions& required) {
  if (existing.max_spindle_turn > required.max_spindle_turn) return false;
  return !required.max_tool_spindle_turn ||
         (existing.max_tool_spindle_turn &&
          *existing.max_tool_spindle_turn <= *required.max_tool_spindle_turn);
}

}  // namespace

program::SampleOptions sample_options(const Scene& scene, const Machine& machine) {
  program::SampleOptions options;
  options.chord_tolerance = scene.chord_tolerance;
  options.max_step = scene.max_step;
  options.max_axis_step = scene.max_step;
  options.workpiece_spindle = machine.workpiece_spindle;
  options.reach = shaping_height(scene);
  const double curvature = spindle_curvature(scene, machine);
  if (curvature > 0.0) {
    // The sagitta of a chord over an angle is curvature angle^2 / 8.
    const double turn = std::sqrt(8 * scene.chord_tolerance / curvature);
    options.max_spindle_turn = std::min(options.max_spindle_turn, turn);
    if (!scene.vibrations.empty()) options.max_tool_spindle_turn = turn;
  }
  return options;
}

namespace {

/// Returns the input error for too many samples, at the key that sets their number.
BadInput too_many_samples_error(const Scene& scene, const program::TooManySamples& excess,
                                const std::string& expected,
                                const std::string& windows_obstacle = {}) {
  return scene_limit_error(scene,
                           {"sampling.max_step_mm", "sampling.chord_tolerance_nm",
                            "program.step_over_mm", "program.step_mm", "program.feed_um_per_rev"},
                           expected,
                           fmt::format("more, from line {} of {} on{}", excess.line, excess.file,
                                       windows_obstacle_text(windows_obstacle)));
}

program::Samples sample_program(const Scene& scene, const program::Path& path,
                                const Machine& machine, program::SampleOptions options,
                                const std::string& windows_obstacle) {
  options.max_samples = max_program_samples();
  try {
    return program::sample(path, machine.nominal, options);
  } catch (const program::TooManySamples& excess) {
    throw too_many_samples_error(
        scene, excess,
        fmt::format("at most {} samples of the program, limited by memory", options.max_samples),
        windows_obstacle);
  }
}

std::vector<program::SampleWindow> divide_into_windows(const Scene& scene,
                                                       const program::Path& path,
                                                       const Machine& machine,
                                                       const program::SampleOptions& options,
                                                       const Progress& progress) {
  try {
    // A window ends with the block that exceeds half of the limit, which leaves the other half for
    // that block.
    return program::windows(path, machine.nominal, options, options.max_samples / 2,
                            [&](double fraction) {
                              if (progress) progress("sample", fraction);
                            });
  } catch (const program::TooManySamples& excess) {
    throw too_many_samples_error(
        scene, excess,
        fmt::format("at most {:.0f} samples of the program, {} per block",
                    program::max_samples_in_windows, options.max_samples / 2));
  }
}

std::vector<Pose> nominal_poses(const Machine& machine, const program::Samples& samples) {
  std::vector<Pose> T_wt(samples.states.size());
  tbb::parallel_for(std::size_t(0), T_wt.size(), [&](std::size_t i) {
    T_wt[i] = machine.nominal.tool_in_workpiece(samples.states[i].q);
  });
  return T_wt;
}

/// Returns a segment on the error-free machine, without its process.
Segment nominal_segment(Scene scene, Machine machine, program::Path path,
                        program::SampleOptions sampling, program::Samples samples) {
  std::vector<Pose> T_wt = nominal_poses(machine, samples);
  Truth truth{machine.nominal, {}, {}, {}, {}, {}};
  return {.scene = std::move(scene),
          .machine = std::move(machine),
          .truth = std::move(truth),
          .body_m = {},
          .path = std::move(path),
          .sampling = sampling,
          .samples = std::move(samples),
          .T_wt_nominal = std::move(T_wt),
          .nominal_process = {},
          .accelerations = {}};
}

/// Returns the same for samples whose axes must stay within their travel.
Segment make_segment(Scene scene, Machine machine, program::Path path,
                     program::SampleOptions sampling, program::Samples samples) {
  check_travel(machine, path, samples);
  return nominal_segment(std::move(scene), std::move(machine), std::move(path), sampling,
                         std::move(samples));
}

/// Samples a program and makes its segment.
/// @param before  axis state before the program, for directions of approach
Segment make_segment(Scene scene, program::Path path, const AxisState& last_state,
                     const std::string& windows_obstacle = {}) {
  Machine machine = make_machine(scene);
  program::SampleOptions sampling = sample_options(scene, machine);
  sampling.before = last_state;
  program::Samples samples = sample_program(scene, path, machine, sampling, windows_obstacle);
  return make_segment(std::move(scene), std::move(machine), std::move(path), sampling,
                      std::move(samples));
}

/// Returns the segments of a program with several tools.
std::vector<Segment> make_tool_segments(const Scene& described, const program::Path& path,
                                        const ToolUse& use) {
  const std::vector<ToolDescription> tools = all_tools(described);
  std::vector<Segment> segments;
  AxisState last_state;
  for (const ToolSegment& tool_segment : use.segments) {
    Scene scene = with_run_out(select_tool(described, *tools[tool_segment.tool].number));
    // The thermal history precedes the first segment only.
    if (!segments.empty()) scene.signals.history_interval = 0.0;
    segments.push_back(make_segment(
        std::move(scene), program::path_segment(path, tool_segment.first, tool_segment.last),
        last_state));
    if (!segments.back().samples.states.empty()) last_state = segments.back().samples.states.back();
  }
  return segments;
}

/// Joins the segments of several tools into one program, under the first tool of the scene.
Segment joined(const Scene& scene, program::Path path, const std::vector<Segment>& segments,
               const ToolUse& use) {
  Segment whole =
      nominal_segment(scene, make_machine(scene), std::move(path), segments.front().sampling, {});
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const program::Samples& part_samples = segments[i].samples;
    program::Samples& all_samples = whole.samples;
    all_samples.states.insert(all_samples.states.end(), part_samples.states.begin(),
                              part_samples.states.end());
    all_samples.line.insert(all_samples.line.end(), part_samples.line.begin(),
                            part_samples.line.end());
    for (const int block : part_samples.block)
      all_samples.block.push_back(block + int(use.segments[i].first));
    whole.T_wt_nominal.insert(whole.T_wt_nominal.end(), segments[i].T_wt_nominal.begin(),
                              segments[i].T_wt_nominal.end());
  }
  return whole;
}

/// Completes a segment of the error-free machine.
Segment with_truth(Segment segment, Truth truth, std::shared_ptr<const cutting::Design> body_m,
                   Process process) {
  if (segment.scene.compliance && segment.scene.compliance->inertia)
    segment.accelerations = accelerations(segment.samples);
  segment.truth = std::move(truth);
  segment.body_m = std::move(body_m);
  segment.nominal_process = std::move(process);
  return segment;
}

/// The segments of a program on the error-free machine, and their warnings.
struct JobSegments {
  Segment whole;  // of a program in windows: all blocks, but only the samples of the first window
  std::vector<Segment> by_tool;  // empty with one tool
  std::vector<std::string> warnings;
  std::shared_ptr<const Windows> windows = {};
  std::vector<std::string> shank_warnings = {};  // of a program in windows

  std::span<const Segment> parts() const {
    return by_tool.empty() ? std::span(&whole, 1) : std::span(by_tool);
  }
};

/// Prepares a program of one tool in windows. Each window is sampled once here for its number of
/// samples, axis ranges and shank contacts.
/// @param held  number of samples that may be in memory
JobSegments prepare_windows(const Scene& scene, const program::Path& path,
                            const cutting::Design& design_w, std::size_t held,
                            const Progress& progress) {
  const Machine machine = make_machine(scene);
  program::SampleOptions sampling = sample_options(scene, machine);
  // The first window stays in memory while another is cut.
  sampling.max_samples = held / 2;
  Windows windows{divide_into_windows(scene, path, machine, sampling, progress), 0, 0, {}, {}};
  std::optional<Segment> first;
  ShankContacts all_contacts;
  for (const program::SampleWindow& window : windows.all) {
    program::Path blocks = path_of(path, window);
    if (progress) progress("sample", double(window.first) / double(path.blocks.size()));
    sampling.continued_from = window.continued_from;
    program::Samples samples = sample(blocks, machine.nominal, sampling);
    if (!first) windows.lower = windows.upper = samples.states.front().q;
    for (const AxisState& state : samples.states) {
      windows.lower = windows.lower.cwiseMin(state.q);
      windows.upper = windows.upper.cwiseMax(state.q);
    }
    // A later window begins with the last sample of the one before.
    windows.samples += samples.states.size() - (first ? 1 : 0);
    windows.max_window_samples = std::max(windows.max_window_samples, samples.states.size());
    Segment segment = make_segment(scene, machine, std::move(blocks), sampling, std::move(samples));
    const ShankContacts contacts =
        shank_contacts(scene, design_w, {segment.samples, segment.T_wt_nominal});
    all_contacts = first ? joined(all_contacts, contacts) : contacts;
    if (!first) first = std::move(segment);
  }
  first->path = path;
  return {*std::move(first),
          {},
          {},
          std::make_shared<const Windows>(std::move(windows)),
          shank_warnings(scene, all_contacts)};
}

/// Prepares the program of one tool, in windows if its samples exceed the budget.
JobSegments prepare_single_tool(const Scene& scene, const program::Path& path,
                                const cutting::Design& design_w, const MemoryBudget& memory_budget,
                                const Progress& progress) {
  const auto vertices = std::size_t(design_w.vertices.rows());
  const std::size_t max_samples =
      memory_budget.samples
          ? std::min(memory_budget.samples(path.blocks.size(), vertices), max_program_samples())
          : 0;
  if (max_samples == 0)
    return {make_segment(scene, path, {}, memory_budget.windows_obstacle), {}, {}};
  Machine machine = make_machine(scene);
  program::SampleOptions sampling = sample_options(scene, machine);
  sampling.max_samples = max_samples;
  try {
    program::Samples samples = program::sample(path, machine.nominal, sampling);
    return {make_segment(scene, std::move(machine), path, sampling, std::move(samples)), {}, {}};
  } catch (const program::TooManySamples&) {
    return prepare_windows(scene, path, design_w, max_samples, progress);
  }
}

JobSegments prepare_tool_segments(const Scene& described, const Scene& scene,
                                  const program::Path& path, const ToolUse& use) {
  std::vector<Segment> segments = make_tool_segments(described, path, use);
  Segment whole = joined(scene, path, segments, use);
  return {std::move(whole), std::move(segments), {}};
}

JobSegments prepare_segments(const Scene& described, const Program& program,
                             const cutting::Design& design_w, const MemoryBudget& memory_budget,
                             const Progress& progress) {
  const Scene scene = with_run_out(described);
  const std::vector<ToolDescription> tools = all_tools(scene);
  ToolUse use = tool_use(program.path, tools);
  JobSegments segments =
      tools.size() > 1
          ? prepare_tool_segments(described, scene, program.path, use)
          : prepare_single_tool(scene, program.path, design_w, memory_budget, progress);
  segments.warnings.insert(segments.warnings.begin(), use.warnings.begin(), use.warnings.end());
  if (tools.size() == 1 && scene.program.tools)
    add_warnings(
        length_warnings(program.path, {0, 0, program.path.blocks.size()}, *scene.tool.number),
        segments.warnings);
  add_warnings(program.warnings, segments.warnings);
  add_warnings(program_warnings(scene, design_w, program.path, program.unreached),
               segments.warnings);
  for (const Segment& segment : segments.parts())
    for (const std::string& text : feed_warnings(segment.scene, segment.machine, segment.path))
      add_warnings(
          {segments.by_tool.empty() ? text
                                    : fmt::format("T{}: {}", *segment.scene.tool.number, text)},
          segments.warnings);
  add_warnings(pole_warnings(scene, segments.whole.machine, program.path), segments.warnings);
  add_warnings(segments.shank_warnings, segments.warnings);
  if (segments.windows) return segments;
  for (const Segment& segment : segments.parts())
    add_warnings(
        shank_warnings(segment.scene, shank_contacts(segment.scene, design_w,
                                                     {segment.samples, segment.T_wt_nominal})),
        segments.warnings);
  return segments;
}

}  // namespace

std::span<const Segment> tool_segments(const Job& job) {
  if (!job.segments.empty()) return job.segments;
  return {static_cast<const Segment*>(&job), 1};
}

std::span<const Segment> job_segments(const Job& job) {
  if (job.windows) throw std::logic_error("the segments of a job in windows are not stored");
  return tool_segments(job);
}

void visit_segments(const Job& job, const std::function<void(const Segment& segment)>& visit) {
  if (!job.windows) {
    std::ranges::for_each(job_segments(job), visit);
    return;
  }
  for (std::size_t i = 0; i < job.windows->all.size(); ++i) visit(make_window(job, i));
}

Segment make_window(const Job& job, std::size_t number) {
  stop_if_interrupted();
  const program::SampleWindow& window = job.windows->all[number];
  program::Path path = path_of(job.path, window);
  program::SampleOptions sampling = job.sampling;
  sampling.continued_from = window.continued_from;
  program::Samples samples = sample(path, job.machine.nominal, sampling);
  Scene scene = job.scene;
  // The thermal history precedes the first window only.
  if (number > 0) scene.signals.history_interval = 0.0;
  return with_truth(
      nominal_segment(std::move(scene), job.machine, std::move(path), sampling, std::move(samples)),
      job.truth, job.body_m, {});
}

const program::Path& path_of(const Segment& segment, const Commands& commands) {
  return commands.path ? *commands.path : segment.path;
}

const std::vector<Pose>& target_poses(const Segment& segment, const Commands& commands) {
  return commands.T_wt_nominal.empty() ? segment.T_wt_nominal : commands.T_wt_nominal;
}

ToolRun tool_run(const Segment& segment) {
  return {segment.scene.tool, segment.path, segment.samples, segment.T_wt_nominal,
          segment.previous_use};
}

std::vector<ToolRun> tool_runs(const Job& job) {
  std::vector<ToolRun> runs;
  if (job.windows) return runs;  // a scene with wear is never prepared in windows
  for (const Segment& segment : job_segments(job)) runs.push_back(tool_run(segment));
  return runs;
}

namespace {

/// Throws BadInput if a scene needs too many points or too much memory, and reports its work.
void check_expected_work(const Scene& scene, const Part& part, const MemoryBudget& memory_budget,
                         const Progress& progress) {
  const WorkEstimate estimate = estimate_work(scene, part);
  const bool uses_windows =
      memory_budget.samples && memory_budget.samples(0, std::size_t(estimate.vertices)) > 0;
  const WorkEstimate work = uses_windows ? windowed_work(estimate) : estimate;
  check_work(scene, work);
  if (const std::string text = work_remark(work); progress && !text.empty()) progress(text, -1.0);
}

/// Simulates the cut of the segments of a program, one after another, on the rigid, error-free
/// machine.
Process nominal_process(const cutting::Design& body_m, std::span<const Segment> segments,
                        const Progress& progress) {
  Process process;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const Segment& segment = segments[i];
    const auto pose = [&](std::size_t k, const errors::Load&) { return segment.T_wt_nominal[k]; };
    append_part(simulate_process(
                    segment.scene, segment.machine, body_m,
                    {segment.samples, segment.path, segment.T_wt_nominal, pose,
                     segment.machine.nominal, segment.scene.tool.nominal},
                    [&](double fraction) {
                      if (progress)
                        progress("stock", (double(i) + fraction) / double(segments.size()));
                    },
                    take_stock(process)),
                process);
  }
  return process;
}

}  // namespace

Job prepare(const Scene& described, const Progress& progress, const MemoryBudget& memory_budget) {
  Stopwatch watch;
  const auto report_begin = [&](const char* stage) {
    if (progress) progress(stage, 0.0);
  };
  report_begin("part");
  const Scene scene = with_run_out(described);
  Part part = load_part(scene);
  // The work is checked before the program is read or generated, the first step that may take long.
  const double part_s = watch.lap();
  check_expected_work(scene, part, memory_budget, progress);
  report_begin("program");
  Program program = load_program(scene, make_machine(scene), part);
  const double program_s = watch.lap();
  report_begin("sample");
  JobSegments segments =
      prepare_segments(described, program, part.design_w, memory_budget, progress);
  Segment& whole = segments.whole;
  std::vector<std::string>& warnings = segments.warnings;
  const double sample_s = watch.lap();
  check_field(scene, part.design_w);
  Process process = nominal_process(part.body_m, segments.parts(), progress);
  const double stock_s = watch.lap();
  add_warnings(process.warnings, warnings);
  report_begin("heat");
  const auto body_m = std::make_shared<const cutting::Design>(std::move(part.body_m));
  // Heat needs the activity of the whole program, since every tool warms the same machine.
  const std::vector<errors::Activity> activities =
      activity(scene, whole.machine, whole.samples, process);
  const auto complete = [&](Segment segment, Process segment_process) {
    Truth truth = make_truth(segment.scene, segment.machine, activities);
    return with_truth(std::move(segment), std::move(truth), body_m, std::move(segment_process));
  };
  Job job{complete(std::move(whole), std::move(process)), part.design_w};
  for (Segment& segment : segments.by_tool)
    job.segments.push_back(
        complete(std::move(segment), part_process(job.nominal_process, job.segments.size())));
  const std::vector<FeedUse> uses = previous_uses(tool_runs(job));
  for (std::size_t i = 0; i < job.segments.size(); ++i) job.segments[i].previous_use = uses[i];
  job.windows = std::move(segments.windows);
  job.body_w = std::make_shared<const cutting::WallThickness>(part.design_w);
  if (progress && job.windows)
    progress(fmt::format("{} samples do not fit in memory at once: run in {} windows",
                         job.windows->samples, job.windows->all.size()),
             -1.0);
  add_warnings(std::move(part.warnings), warnings);
  add_warnings(value_warnings(scene), warnings);
  add_warnings(heat_warnings(scene.datum, job.truth), warnings);
  add_warnings(error_size_warnings(job), warnings);
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

/// Gives a segment the errors of another scene.
/// @param activities  heat sources of the whole program
void set_errors(Segment& segment, Scene scene, const std::vector<errors::Activity>& activities) {
  Machine machine = make_machine(scene);
  const auto require = [&](bool is_equal, const char* what) {
    if (!is_equal)
      throw BadInput(scene.file.string(), 0, 0, fmt::format("the same {} in all cases", what),
                     "a different one");
  };
  require(have_same_poses(machine.nominal, segment.machine.nominal), "nominal machine");
  require(is_as_dense(segment.sampling, sample_options(scene, machine)), "sampling density");
  segment.truth = make_truth(scene, machine, activities);
  segment.scene = std::move(scene);
  segment.machine = std::move(machine);
}

}  // namespace

Job replace_errors(Job job, const Scene& described) {
  const Scene scene = with_run_out(described);
  const std::vector<errors::Activity> activities =
      activity(scene, make_machine(scene), job.samples, job.nominal_process);
  for (Segment& segment : job.segments)
    set_errors(segment, with_run_out(select_tool(described, *segment.scene.tool.number)),
               activities);
  set_errors(job, scene, activities);
  return job;
}

Eigen::Vector3d control_datum_offset(const Segment& segment, const Corrector& corrector) {
  const auto actual_pose = [&](const kinematics::AxisState& state) {
    return tool_in_workpiece(segment.truth, state);
  };
  try {
    return datum_offset(segment.scene.datum, segment.machine, actual_pose, corrector);
  } catch (const std::out_of_range& range_error) {  // of an error table without extrapolation
    const Node* datum = segment.scene.tree ? segment.scene.tree->find("datum") : nullptr;
    const SourcePosition place = datum ? datum->place : SourcePosition{};
    throw BadInput(place.file ? *place.file : segment.scene.file.string(), place.line, place.column,
                   "errors that are defined at the datum", range_error.what());
  }
}

Commands segment_commands(const Segment& segment) {
  return uncompensated_commands(segment.machine, segment.path, segment.samples,
                                control_datum_offset(segment));
}

Commands uncompensated_commands(const Job& job) {
  std::vector<Commands> commands;
  for (const Segment& segment : job_segments(job)) commands.push_back(segment_commands(segment));
  return joined(std::move(commands));
}

}  // namespace abbe::sim
