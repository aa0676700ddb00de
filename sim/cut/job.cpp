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

/// The blocks that one tool runs, with the scene of that tool.
struct ToolProgram {
  Scene scene;
  std::shared_ptr<const program::Path> path;  // of a single tool that of the program
};

/// Returns the programs of the tools, one after the other.
std::vector<ToolProgram> tool_programs(const Scene& described, const program::Path& path,
                                       const ToolUse& use) {
  const std::vector<ToolDescription> tools = all_tools(described);
  if (tools.size() == 1)
    return {{with_run_out(described),
             std::shared_ptr<const program::Path>(std::shared_ptr<void>(), &path)}};
  std::vector<ToolProgram> programs;
  for (const ToolSegment& tool_segment : use.segments) {
    Scene scene = with_run_out(select_tool(described, *tools[tool_segment.tool].number));
    // The thermal history precedes the first segment only.
    if (!programs.empty()) scene.signals.history_interval = 0.0;
    programs.push_back(
        {std::move(scene), std::make_shared<const program::Path>(program::path_segment(
                               path, tool_segment.first, tool_segment.last))});
  }
  return programs;
}

/// Samples the programs of the tools.
/// @param max_samples  of all together
/// @throws program::TooManySamples
std::vector<Segment> sample_tools(const std::vector<ToolProgram>& programs,
                                  std::size_t max_samples) {
  std::vector<Segment> segments;
  AxisState last_state;  // for directions of approach
  for (const ToolProgram& tool : programs) {
    Machine machine = make_machine(tool.scene);
    program::SampleOptions sampling = sample_options(tool.scene, machine);
    sampling.before = last_state;
    sampling.max_samples = max_samples;
    program::Samples samples = program::sample(*tool.path, machine.nominal, sampling);
    max_samples -= std::min(max_samples, samples.states.size());
    if (!samples.states.empty()) last_state = samples.states.back();
    segments.push_back(
        make_segment(tool.scene, std::move(machine), *tool.path, sampling, std::move(samples)));
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

/// Gives a segment its truth, and the accelerations of its axes if masses have inertia.
/// @param activities  heat sources of the whole program
void complete(Segment& segment, const std::vector<errors::Activity>& activities) {
  segment.truth = make_truth(segment.scene, segment.machine, activities);
  if (segment.scene.compliance && segment.scene.compliance->inertia)
    segment.accelerations = accelerations(segment.samples);
}

/// The segments of a program on the error-free machine, and their warnings.
struct JobSegments {
  std::optional<Segment> whole;  // of a program in windows: with the samples of the first window
  std::vector<Segment> by_tool;  // empty with one tool
  std::vector<std::string> warnings;
  std::shared_ptr<const Windows> windows = {};
  std::vector<std::string> shank_warnings = {};  // of a program in windows

  std::span<const Segment> parts() const {
    return by_tool.empty() ? std::span(&*whole, 1) : std::span(by_tool);
  }
};

/// Prepares a program in windows. Each window is sampled once here for its number of samples, axis
/// ranges and shank contacts.
/// @param held  number of samples that may be in memory
class WindowPreparation {
 public:
  WindowPreparation(const cutting::Design& design_w, std::size_t held, const Progress& progress)
      : design_w_(design_w), held_(held), progress_(progress) {}

  void add(const ToolProgram& tool);
  std::vector<Segment> segments;
  Windows windows;
  std::vector<std::string> shank_warnings;

 private:
  void add_window(const ToolProgram& tool, const program::SampleWindow& blocks);

  const cutting::Design& design_w_;
  std::size_t held_;
  const Progress& progress_;
  AxisState last_state_;                   // of the tools so far, for directions of approach
  std::optional<ShankContacts> contacts_;  // of the tool so far
};

void WindowPreparation::add(const ToolProgram& tool) {
  Machine machine = make_machine(tool.scene);
  program::SampleOptions sampling = sample_options(tool.scene, machine);
  // The first window stays in memory while another is cut.
  sampling.max_samples = held_ / 2;
  sampling.before = last_state_;
  const std::vector<program::SampleWindow> tool_windows =
      divide_into_windows(tool.scene, *tool.path, machine, sampling, progress_);
  segments.push_back(nominal_segment(tool.scene, std::move(machine), *tool.path, sampling, {}));
  contacts_.reset();
  for (const program::SampleWindow& blocks : tool_windows) {
    if (progress_) progress_("sample", double(blocks.first) / double(tool.path->blocks.size()));
    add_window(tool, blocks);
  }
  if (contacts_) add_warnings(sim::shank_warnings(tool.scene, *contacts_), shank_warnings);
}

void WindowPreparation::add_window(const ToolProgram& tool, const program::SampleWindow& blocks) {
  Segment& segment = segments.back();
  program::Path path = path_of(*tool.path, blocks);
  program::SampleOptions sampling = segment.sampling;
  sampling.continued_from = blocks.continued_from;
  program::Samples samples = sample(path, segment.machine.nominal, sampling);
  check_travel(segment.machine, path, samples);
  if (samples.states.empty()) return;
  const bool is_first = windows.all.empty();
  if (is_first) windows.lower = windows.upper = samples.states.front().q;
  for (const AxisState& state : samples.states) {
    windows.lower = windows.lower.cwiseMin(state.q);
    windows.upper = windows.upper.cwiseMax(state.q);
  }
  last_state_ = samples.states.back();
  // A window that continues another begins with its last sample.
  windows.samples += samples.states.size() - (blocks.continued_from ? 1 : 0);
  windows.max_window_samples = std::max(windows.max_window_samples, samples.states.size());
  windows.all.push_back(
      {segments.size() - 1, blocks, samples.states.front().time_s, last_state_.time_s});
  std::vector<Pose> T_wt = nominal_poses(segment.machine, samples);
  const ShankContacts contacts = shank_contacts(tool.scene, design_w_, {samples, T_wt});
  contacts_ = contacts_ ? joined(*contacts_, contacts) : contacts;
  if (!is_first) return;
  segment.samples = std::move(samples);
  segment.T_wt_nominal = std::move(T_wt);
}

/// Samples the programs of the tools, in windows if the samples exceed the budget.
JobSegments sample_segments(const Scene& scene, const program::Path& path,
                            const std::vector<ToolProgram>& programs, const ToolUse& use,
                            const cutting::Design& design_w, const MemoryBudget& memory_budget,
                            const Progress& progress) {
  const std::size_t held =
      memory_budget.samples ? std::min(memory_budget.samples(path.blocks.size(),
                                                             std::size_t(design_w.vertices.rows())),
                                       max_program_samples())
                            : 0;
  JobSegments result;
  std::vector<Segment> segments;
  try {
    segments = sample_tools(programs, held > 0 ? held : max_program_samples());
  } catch (const program::TooManySamples& excess) {
    if (held == 0)
      throw too_many_samples_error(
          scene, excess,
          fmt::format("at most {} samples of the program, limited by memory",
                      max_program_samples()),
          memory_budget.windows_obstacle);
    WindowPreparation preparation(design_w, held, progress);
    for (const ToolProgram& tool : programs) preparation.add(tool);
    segments = std::move(preparation.segments);
    result.windows = std::make_shared<const Windows>(std::move(preparation.windows));
    result.shank_warnings = std::move(preparation.shank_warnings);
  }
  if (all_tools(scene).size() == 1) {
    result.whole = std::move(segments.front());
  } else {
    result.whole = joined(scene, path, segments, use);
    result.by_tool = std::move(segments);
  }
  return result;
}

JobSegments prepare_segments(const Scene& described, const Program& program,
                             const cutting::Design& design_w, const MemoryBudget& memory_budget,
                             const Progress& progress) {
  const Scene scene = with_run_out(described);
  const std::vector<ToolDescription> tools = all_tools(scene);
  ToolUse use = tool_use(program.path, tools);
  JobSegments segments =
      sample_segments(scene, program.path, tool_programs(described, program.path, use), use,
                      design_w, memory_budget, progress);
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
  add_warnings(pole_warnings(scene, segments.whole->machine, program.path), segments.warnings);
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
  const Window& window = job.windows->all[number];
  const Segment& tool = tool_segments(job)[window.segment];
  program::Path path = path_of(tool.path, window.blocks);
  program::SampleOptions sampling = tool.sampling;
  sampling.continued_from = window.blocks.continued_from;
  program::Samples samples = sample(path, tool.machine.nominal, sampling);
  Segment result =
      nominal_segment(tool.scene, tool.machine, std::move(path), sampling, std::move(samples));
  result.truth = tool.truth;
  result.body_m = tool.body_m;
  return result;
}

std::vector<WindowRange> window_ranges(const Job& job) {
  const std::vector<Window>& windows = job.windows->all;
  std::vector<WindowRange> ranges(tool_segments(job).size());
  for (std::size_t i = 0; i < windows.size(); ++i) {
    WindowRange& range = ranges[windows[i].segment];
    if (range.last == 0) range.first = i;
    range.last = i + 1;
  }
  return ranges;
}

Process windowed_process(const Job& job, std::size_t segment, const CommandSource& command_source,
                         const WindowedProcess::PoseAt& pose, const kinematics::Chain& chain,
                         const std::variant<cutting::Cutter, cutting::Nose>& tool, Process before,
                         const Progress& progress) {
  WindowedProcess process(std::move(before));
  const WindowRange range = window_ranges(job)[segment];
  for (std::size_t i = range.first; i < range.last; ++i) {
    const Segment window = make_window(job, i);
    const Commands commands = command_source(window, i);
    process.add(window.scene, window.machine, *window.body_m,
                {.samples = commands.samples,
                 .path = path_of(window, commands),
                 .T_wt = target_poses(window, commands),
                 .pose = {},
                 .chain = chain,
                 .tool = tool,
                 .is_continued = window.sampling.continued_from.has_value(),
                 .continues = i + 1 < range.last},
                pose, [&](double fraction) {
                  stop_if_interrupted();
                  if (progress)
                    progress("stock", (double(i) + fraction) / double(job.windows->all.size()));
                });
  }
  return process.take();
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

/// Simulates the cut of the segments of a job, one after another, on the rigid, error-free machine.
Process nominal_process(const Job& job, const Progress& progress) {
  Process process;
  if (!job.scene.cutting) return process;
  const auto segments = tool_segments(job);
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const Segment& segment = segments[i];
    const kinematics::Chain& chain = segment.machine.nominal;
    if (job.windows) {
      append_part(windowed_process(
                      job, i,
                      [](const Segment& window, std::size_t) {
                        Commands commands;
                        commands.samples = window.samples;
                        return commands;
                      },
                      [](const AxisState&, const Pose& T_wt, const errors::Load&) { return T_wt; },
                      chain, segment.scene.tool.nominal, take_stock(process), progress),
                  process);
      continue;
    }
    const auto pose = [&](std::size_t k, const errors::Load&) { return segment.T_wt_nominal[k]; };
    append_part(simulate_process(
                    segment.scene, segment.machine, *job.body_m,
                    {segment.samples, segment.path, segment.T_wt_nominal, pose, chain,
                     segment.scene.tool.nominal},
                    [&](double fraction) {
                      if (progress)
                        progress("stock", (double(i) + fraction) / double(segments.size()));
                    },
                    take_stock(process)),
                process);
  }
  return process;
}

/// Returns the activity of the machine of a scene along the program of a job. Heat needs that of
/// the whole program, since every tool warms the same machine.
std::vector<errors::Activity> job_activity(const Job& job, const Scene& scene) {
  const auto visit = [&](const auto& use) {
    if (!job.windows) return use(job.samples, 0);
    visit_segments(job, [&](const Segment& window) {
      use(window.samples, window.sampling.continued_from ? 1 : 0);
    });
  };
  return activity(scene, make_machine(scene), visit, job.nominal_process);
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
  std::vector<std::string>& warnings = segments.warnings;
  const double sample_s = watch.lap();
  check_field(scene, part.design_w);
  Job job{*std::move(segments.whole), part.design_w};
  job.segments = std::move(segments.by_tool);
  job.windows = std::move(segments.windows);
  job.body_m = std::make_shared<const cutting::Design>(std::move(part.body_m));
  for (Segment& segment : job.segments) segment.body_m = job.body_m;
  job.nominal_process = nominal_process(job, progress);
  for (std::size_t i = 0; i < job.segments.size(); ++i)
    job.segments[i].nominal_process = part_process(job.nominal_process, i);
  const double stock_s = watch.lap();
  add_warnings(job.nominal_process.warnings, warnings);
  report_begin("heat");
  const std::vector<errors::Activity> activities = job_activity(job, scene);
  complete(job, activities);
  for (Segment& segment : job.segments) complete(segment, activities);
  const std::vector<FeedUse> uses = previous_uses(tool_runs(job));
  for (std::size_t i = 0; i < std::min(uses.size(), job.segments.size()); ++i)
    job.segments[i].previous_use = uses[i];
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
  const std::vector<errors::Activity> activities = job_activity(job, scene);
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
    const SourcePosition position = datum ? datum->position : SourcePosition{};
    throw BadInput(position.file ? *position.file : segment.scene.file.string(), position.line,
                   position.column, "errors that are defined at the datum", range_error.what());
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
