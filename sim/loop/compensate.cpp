#include "sim/loop/compensate.h"

#include <algorithm>
#include <deque>

#include <fmt/format.h>

#include "sim/cut/part.h"
#include "sim/cut/process_simulation.h"
#include "sim/cut/tool_motion.h"
#include "sim/files/progress.h"
#include "sim/loop/correctors.h"
#include "sim/measure/measure.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/trust.h"

namespace abbe::sim {

namespace {

using kinematics::AxisState;

/// Returns cutting load and accelerations at a time of the predicted run.
errors::Load predicted_load(const program::Samples& samples, const PredictedRun& run,
                            double time_s) {
  errors::Load load = load_at(run.process, time_s);
  if (run.accelerations.empty()) return load;
  load.acceleration = run.accelerations[sample_at(samples, time_s)];
  return load;
}

/// Returns a process with its steps only. The stock is large and not needed here.
Process without_stock(const Process& process) { return {process.steps, {}, {}, {}}; }

}  // namespace

compensation::Belief perfect_belief(const Segment& segment, PredictedRun run) {
  return [expected_truth = without_random_errors(segment.truth), &segment,
          run = std::move(run)](const AxisState& state) {
    return tool_in_workpiece(expected_truth, state,
                             predicted_load(segment.samples, run, state.time_s));
  };
}

// A perfect belief knows the effect of its own corrections. The first iteration has the inertial
// forces of the nominal program and the cutting forces of the rigid machine. In the next ones both
// follow the corrected commands. Each iteration changes them by some hundredths of the previous
// change.
Corrector perfect_corrector(const Segment& segment, const ControlView& view,
                            const CaseDescription& compensator, const Process& before) {
  constexpr int max_iterations = 3;
  PredictedRun run{without_stock(segment.nominal_process), segment.accelerations};
  Corrector corrector = belief_corrector(view, compensator, perfect_belief(segment, run));
  const bool has_bending = segment.truth.compliance && !segment.nominal_process.steps.empty();
  const bool has_inertia = !segment.accelerations.empty();
  if (!has_bending && !has_inertia) return corrector;
  Commands commands = segment_commands(segment);
  const std::vector<AxisState> uncorrected = commands.samples.states;
  for (int iteration = has_inertia ? 0 : max_iterations - 1; iteration < max_iterations;
       ++iteration) {
    commands.samples.states = corrector(uncorrected, segment.T_wt_nominal).states;
    if (has_inertia) run.accelerations = accelerations(commands.samples);
    // The simulated cut takes most of the time, so it is repeated only once, with nearly final
    // commands.
    if (has_bending && iteration + 1 == max_iterations)
      run.process = without_stock(segment_process(segment, commands, before));
    corrector = belief_corrector(view, compensator, perfect_belief(segment, run));
  }
  return corrector;
}

namespace {

using Eigen::Index;
using Eigen::VectorXd;

// One row per minute of the thermal history suffices, since temperatures change in minutes.
constexpr double history_interval_s = 60.0;

/// Returns true if a control can read a column of the signals. It cannot read true deviations and
/// temperatures of nodes.
bool is_readable(const Scene& scene, const std::string& column) {
  if (column == "spindle_rpm" || column == "current_A") return true;
  if (column.ends_with("_encoder_mm") || column.ends_with("_encoder_deg") ||
      column.ends_with("_dynamometer_N"))
    return true;
  if (!scene.thermal) return false;
  const auto& sensors = scene.thermal->sensors;
  return std::any_of(sensors.begin(), sensors.end(),
                     [&](const auto& sensor) { return column == sensor.name + "_C"; });
}

/// Returns the description of the instrument of that name, which must measure the part.
PartInstrumentDescription part_instrument(const Scene& scene, const std::string& name) {
  if (auto instrument = find_part_instrument(scene, name)) return *std::move(instrument);
  throw BadInput(scene.file.string(), 0, 0, "an [[instrument]] that measures the part",
                 "\"" + name + "\"");
}

/// Cuts the part and measures it with the instrument of the belief `part`.
MeasuredPart cut_and_measure(const Job& job, const Commands& commands, int pass) {
  PartInstrumentDescription instrument =
      part_instrument(job.scene, job.scene.belief.part->instrument);
  // The name seeds the noise. With the index of the pass in it, each pass has noise of its own.
  instrument.name += fmt::format(" {}", pass + 1);
  return {measure_cut_part(job, cut(job, commands), instrument).readings, instrument.spacing};
}

/// Cuts and measures the training part of a force belief.
TrainingRun training_run(const BeliefDescription::Force& force,
                         const std::vector<std::filesystem::path>& trusted) {
  Scene scene = read_scene(force.training);
  scene.trusted = trusted;
  const PartInstrumentDescription instrument = part_instrument(scene, force.instrument);
  const Job job = prepare(scene);
  const Cut training_cut = cut(job);
  // The times are those of the error-free cut, since a control knows only the nominal program.
  const VectorXd cut_time_s = cut_error_free(job).surface.cut_time_s;
  const errors::metrology::PartReadings part =
      measure_cut_part(job, training_cut, instrument).readings;
  compensation::CurrentTraining training{VectorXd(part.deviation.size()), part.deviation};
  for (Index i = 0; i < part.deviation.size(); ++i)
    training.time_s[i] = cut_time_s[nearest_vertex(job.design_w.vertices, part.points_w.row(i))];
  return {control_log(job, uncompensated_commands(job), training_cut.process), std::move(training)};
}

/// Returns the load of the cut, simulated on a believed machine with the design and the nominal
/// tool.
compensation::LoadSeries simulate_load(const Job& job, const Segment& segment,
                                       const Commands& commands, const BelievedPose& pose) {
  const Scene& scene = segment.scene;
  const auto& T_wt = target_poses(segment, commands);
  const Process process = simulate_process(
      scene, segment.machine, cutting::transformed(job.design_w, scene.part.T_wm.inverse()),
      {commands.samples, path_of(segment, commands), T_wt, pose, segment.machine.control,
       scene.tool.nominal});
  compensation::LoadSeries series{VectorXd(Index(process.steps.size())), {}};
  for (std::size_t i = 0; i < process.steps.size(); ++i) {
    series.time_s[Index(i)] = process.steps[i].time_s;
    series.loads.push_back(process.steps[i].load);
  }
  return series;
}

/// Throws BadInput if a job with several tools uses a function that is limited to one tool.
/// @param is_used  true if the case uses the function
/// @param what     the function, for the message
void require_single_tool(const Job& job, const CaseDescription& compensator, bool is_used,
                         const char* what) {
  if (!job.segments.empty() && is_used)
    throw BadInput(job.scene.file.string(), 0, 0, fmt::format("a single tool for {}", what),
                   fmt::format("{} tools and the case {}", 1 + job.scene.additional_tools.size(),
                               compensator.name));
}

/// Checks the channel and the beliefs of a case that are limited to one tool.
void check_tool_count(const Job& job, const CaseDescription& compensator) {
  using Belief = CaseDescription::Belief;
  const auto is_used = [&](Belief kind) {
    return compensator.plug_in.empty() &&
           is_belief_enabled(job.scene.belief, compensator.belief, kind);
  };
  require_single_tool(job, compensator, is_used(Belief::Part),
                      "the belief part, which corrects the tool that cut the part");
  require_single_tool(job, compensator, is_used(Belief::Force),
                      "the belief force, which follows the cut of one tool");
}

/// Returns true if the correction of a later tool depends on the stock that a segment leaves:
/// forces bend the machine, or a plug-in reads the signals of the cut.
bool follows_stock(const Segment& segment, const CaseDescription& compensator) {
  if (!segment.scene.cutting) return false;
  return !compensator.plug_in.empty() || (compensator.belief == CaseDescription::Belief::Perfect &&
                                          segment.truth.compliance.has_value());
}

/// Returns the corrected commands from which a program is written. The written program follows them
/// within the path tolerance, which changes the stock by less than its dexels resolve.
Commands ideal_commands(const Segment& segment, const CorrectedProgram& corrected) {
  Commands commands;
  commands.samples = segment.samples;
  commands.samples.states = corrected.ideal.states;
  return commands;
}

}  // namespace

CaseDescription::Channel channel_of(const Scene& scene, const CaseDescription& compensator) {
  return compensator.plug_in.empty() ? compensator.channel : scene.compensation.plug_in.channel;
}

namespace {

/// Returns the view of a tool that runs a program, its own or that of all tools.
ControlView control_view(const Job& job, const Segment& tool, const Segment& program) {
  const Scene& scene = tool.scene;
  return {scene.file,
          tool.machine,
          {scene.tool.name, scene.tool.length, scene.tool.nominal},
          scene.datum,
          scene.belief,
          scene.compensation,
          scene.seed,
          scene.chord_tolerance,
          scene.cutting.has_value(),
          nc_options(scene, tool.machine),
          program.sampling,
          program.path,
          program.samples,
          program.T_wt_nominal,
          job.design_w};
}

/// Returns the first segment of the tool for which the tables of a control are made.
const Segment& table_segment(const Job& job) {
  const auto segments = tool_segments(job);
  const std::optional<int>& number = job.scene.compensation.table.tool;
  if (!number || job.segments.empty()) return segments.front();
  const auto match = std::ranges::find_if(
      segments, [&](const Segment& segment) { return segment.scene.tool.number == number; });
  if (match == segments.end())
    throw BadInput(job.scene.file.string(), 0, 0,
                   "compensation.table.tool, a tool that the program calls",
                   fmt::format("T{}", *number));
  return *match;
}

}  // namespace

ControlView make_control_view(const Job& job, const Segment& segment) {
  return control_view(job, segment, segment);
}

ControlView make_table_view(const Job& job) { return control_view(job, table_segment(job), job); }

std::string table_tool_text(const Job& job) {
  if (job.segments.empty()) return {};
  const ToolDescription& tool = table_segment(job).scene.tool;
  return fmt::format(
      "the tables correct the tip of T{}, {:g} mm long (compensation.table.tool); of another "
      "length they leave what errors of angle do over the difference",
      *tool.number, tool.length);
}

MachineAccess make_machine_access(const Job& job, const Segment& segment, const Process& before) {
  MachineAccess machine_access;
  machine_access.touch_off = [&segment](const Corrector& corrector) {
    return control_datum_offset(segment, corrector);
  };
  machine_access.run = [&](const Commands& commands, bool through_blank) {
    return control_log(segment, commands,
                       through_blank ? segment_process(segment, commands, before) : Process{});
  };
  machine_access.measure_cut_part = [&job](const Commands& commands, int pass) {
    return cut_and_measure(job, commands, pass);
  };
  machine_access.training = [&job] {
    return training_run(*job.scene.belief.force, job.scene.trusted);
  };
  machine_access.error_free = [&job] { return cut_error_free(job).surface; };
  machine_access.simulate_load = [&](const Commands& commands, const BelievedPose& pose) {
    return simulate_load(job, segment, commands, pose);
  };
  machine_access.perfect = [&](const ControlView& view, const CaseDescription& compensator) {
    return perfect_corrector(segment, view, compensator, before);
  };
  machine_access.check_trusted = [&job](const std::filesystem::path& program) {
    check_trusted(job.scene, program);
  };
  return machine_access;
}

compensation::ControlLog control_log(const Segment& segment, const Commands& commands,
                                     const Process& process) {
  Scene scene = segment.scene;
  // The control reads the same history for any interval that the scene reports.
  if (!(scene.signals.history_interval > 0.0 &&
        scene.signals.history_interval < history_interval_s))
    scene.signals.history_interval = history_interval_s;
  std::vector<errors::Load> loads;
  const auto& T_wt = target_poses(segment, commands);
  const Signals recorded =
      signals(scene, segment.machine, segment.truth, {commands.samples, T_wt, process, loads});
  compensation::ControlLog log;
  std::vector<Index> columns;
  for (std::size_t k = 0; k < recorded.columns.size(); ++k) {
    if (recorded.columns[k] == "time_s") log.time_s = recorded.rows.col(Index(k));
    if (!is_readable(segment.scene, recorded.columns[k])) continue;
    // If a sensor and a node have columns of the same name, the sensor's comes later. Only the
    // sensor can be read.
    if (const auto same_name = std::find(log.names.begin(), log.names.end(), recorded.columns[k]);
        same_name != log.names.end()) {
      columns[std::size_t(same_name - log.names.begin())] = Index(k);
      continue;
    }
    log.names.push_back(recorded.columns[k]);
    columns.push_back(Index(k));
  }
  log.values = recorded.rows(Eigen::all, columns);
  return log;
}

LearnedCorrection learn_correction(const Job& job, const CaseDescription& compensator,
                                   const Progress& progress) {
  const Segment& tool = table_segment(job);
  return learn_correction(make_control_view(job, tool), make_machine_access(job, tool, {}),
                          compensator, progress);
}

namespace {

/// Returns the commands of a job with several tools through one set of tables. A control applies
/// its tables whichever tool runs.
Commands compensate_by_tables(const Job& job, const CaseDescription& compensator,
                              const Progress& progress) {
  const auto segments = job_segments(job);
  LearnedCorrection correction = learn_correction(job, compensator, progress);
  correction.tables =
      control_tables(make_table_view(job), correction.corrector, correction.geometric);
  correction.warnings.push_back(table_tool_text(job));
  std::vector<Commands> commands;
  for (const Segment& segment : segments)
    commands.push_back(compensated_commands(make_control_view(job, segment),
                                            make_machine_access(job, segment, {}), compensator,
                                            correction));
  return joined(std::move(commands));
}

}  // namespace

Commands compensate(const Job& job, const CaseDescription& compensator, const Progress& progress) {
  check_tool_count(job, compensator);
  if (!job.segments.empty() &&
      channel_of(job.scene, compensator) == CaseDescription::Channel::Table)
    return compensate_by_tables(job, compensator, progress);
  const bool rewrites = channel_of(job.scene, compensator) == CaseDescription::Channel::Program;
  const auto segments = job_segments(job);
  std::vector<Commands> commands_by_segment;
  std::vector<ControlView> views;
  std::vector<CorrectedProgram> corrected;
  Process stock;  // that the tools so far have left
  for (const Segment& segment : segments) {
    views.push_back(make_control_view(job, segment));
    const MachineAccess machine_access = make_machine_access(job, segment, stock);
    if (rewrites)
      corrected.push_back(corrected_program(views.back(), machine_access, compensator, progress));
    else
      commands_by_segment.push_back(
          compensated_commands(views.back(), machine_access, compensator, progress));
    if (&segment != &segments.back() && follows_stock(segment, compensator)) {
      Process process = segment_process(
          segment,
          rewrites ? ideal_commands(segment, corrected.back()) : commands_by_segment.back(),
          take_stock(stock));
      stock = take_stock(process);
    }
  }
  if (!rewrites) return joined(std::move(commands_by_segment));
  return run_corrected_program(views, corrected, job.path, nc_options(job.scene, job.machine));
}

namespace {

/// Returns the belief `perfect` in windows. It predicts the forces as `perfect_corrector` does: the
/// corrections that assume those of the rigid machine give the cut whose forces it then knows.
Corrector perfect_in_windows(const Job& job, std::size_t number, const ControlView& view,
                             const CaseDescription& compensator, Process before) {
  const Segment& segment = tool_segments(job)[number];
  PredictedRun run{without_stock(segment.nominal_process), {}};
  const Corrector corrector = belief_corrector(view, compensator, perfect_belief(segment, run));
  if (!segment.truth.compliance || segment.nominal_process.steps.empty()) return corrector;
  const auto corrected = [&](const Segment& window, std::size_t /*number*/) {
    Commands commands = segment_commands(window);
    commands.samples.states = corrector(commands.samples.states, window.T_wt_nominal).states;
    return commands;
  };
  run.process = without_stock(segment_process(job, number, corrected, std::move(before)));
  return belief_corrector(view, compensator, perfect_belief(segment, std::move(run)));
}

/// The corrections of the tools of a job in windows, each learned once for all its windows.
class WindowedCorrections {
 public:
  WindowedCorrections(const Job& job, const CaseDescription& compensator, const Progress& progress);

  /// Returns the corrected commands of a window, before a channel.
  Commands ideal_commands(const Segment& window, std::size_t number) const;
  /// Returns the program of a tool with its correction.
  /// @param tool  index in `tool_segments`
  CorrectedProgram corrected_program(std::size_t tool) const;
  /// Returns the view of a tool, with its whole program.
  const ControlView& view(std::size_t tool) const { return views_[tool]; }

 private:
  MachineAccess machine_access(const Segment& segment, std::size_t tool,
                               const Process& before) const;

  const Job& job_;
  CaseDescription compensator_;
  std::deque<ControlView> views_;  // to which the corrections refer
  std::vector<LearnedCorrection> corrections_;
  Process no_stock_;
};

WindowedCorrections::WindowedCorrections(const Job& job, const CaseDescription& compensator,
                                         const Progress& progress)
    : job_(job), compensator_(compensator) {
  const auto segments = tool_segments(job);
  Process stock;  // that the tools so far have left
  for (std::size_t i = 0; i < segments.size(); ++i) {
    views_.push_back(make_control_view(job, segments[i]));
    corrections_.push_back(learn_correction(views_.back(), machine_access(segments[i], i, stock),
                                            compensator, progress));
    if (i + 1 == segments.size() || !follows_stock(segments[i], compensator)) continue;
    const auto commands = [this](const Segment& window, std::size_t number) {
      return ideal_commands(window, number);
    };
    Process process = segment_process(job, i, commands, take_stock(stock));
    stock = take_stock(process);
  }
}

MachineAccess WindowedCorrections::machine_access(const Segment& segment, std::size_t tool,
                                                  const Process& before) const {
  MachineAccess result = make_machine_access(job_, segment, before);
  result.perfect = [this, tool, &before](const ControlView& view,
                                         const CaseDescription& description) {
    return perfect_in_windows(job_, tool, view, description, before);
  };
  return result;
}

Commands WindowedCorrections::ideal_commands(const Segment& window, std::size_t number) const {
  CaseDescription ideal = compensator_;
  ideal.channel = CaseDescription::Channel::Ideal;
  const std::size_t tool = job_.windows->all[number].segment;
  return compensated_commands(make_control_view(job_, window),
                              machine_access(window, tool, no_stock_), ideal, corrections_[tool]);
}

CorrectedProgram WindowedCorrections::corrected_program(std::size_t tool) const {
  const WindowRange range = window_ranges(job_)[tool];
  const auto visit_ranges = [&](const std::function<void(const ControlView&)>& use) {
    for (std::size_t i = range.first; i < range.last; ++i) {
      const Segment window = make_window(job_, i);
      use(make_control_view(job_, window));
    }
  };
  return sim::corrected_program(visit_ranges, views_[tool],
                                machine_access(tool_segments(job_)[tool], tool, no_stock_),
                                compensator_, corrections_[tool]);
}

/// The program of a job in windows, corrected, rewritten and read by the control. Its windows have
/// the blocks that come from those of the windows of the original.
class RewrittenWindows {
 public:
  RewrittenWindows(const Job& job, const WindowedCorrections& corrections);

  Commands commands(std::size_t number) const;
  const RewrittenPath& rewritten() const { return rewritten_; }
  std::span<const Window> windows() const { return windows_; }

 private:
  /// The rewritten program of a tool.
  struct ToolProgram {
    CorrectedProgram corrected;  // without its points
    program::Path path = {};
    std::size_t first_original_block = 0;  // in the program of all tools
    program::SampleOptions sampling = {};
  };
  void divide(ToolProgram& tool, std::size_t first_block, const WindowRange& range);
  program::SampleOptions sampling(std::size_t number) const;

  const WindowedCorrections& corrections_;
  std::vector<WindowRange> ranges_;  // by tool
  RewrittenPath rewritten_;
  std::vector<ToolProgram> tools_;
  std::vector<Window> windows_;
  kinematics::AxisState last_state_;  // of the tools so far, for directions of approach
};

RewrittenWindows::RewrittenWindows(const Job& job, const WindowedCorrections& corrections)
    : corrections_(corrections), ranges_(window_ranges(job)), windows_(job.windows->all) {
  std::vector<CorrectedProgram> corrected;
  for (std::size_t i = 0; i < ranges_.size(); ++i)
    corrected.push_back(corrections.corrected_program(i));
  rewritten_ =
      rewrite(corrected, job.scene.compensation, job.path, nc_options(job.scene, job.machine));
  std::size_t original_block = 0, block = 0;
  for (std::size_t i = 0; i < ranges_.size(); ++i) {
    const std::size_t next_original_block = original_block + corrections.view(i).path.blocks.size();
    const std::size_t next_block = find_rewritten_block(rewritten_, next_original_block, block);
    tools_.push_back({std::move(corrected[i]),
                      program::path_segment(rewritten_.path, block, next_block), original_block,
                      rewritten_sampling(corrections.view(i), job.windows->max_window_samples)});
    tools_.back().corrected.points.clear();
    tools_.back().sampling.before = last_state_;
    divide(tools_.back(), block, ranges_[i]);
    original_block = next_original_block;
    block = next_block;
  }
}

/// Divides the program of a tool. It is sampled here only to find where each window begins.
/// @param first_block  its number in the whole rewritten program
void RewrittenWindows::divide(ToolProgram& tool, std::size_t first_block,
                              const WindowRange& range) {
  program::SampleWindow blocks;
  for (std::size_t i = range.first; i < range.last; ++i) {
    stop_if_interrupted();
    Window& window = windows_[i];
    blocks.last =
        i + 1 == range.last
            ? tool.path.blocks.size()
            : find_rewritten_block(rewritten_, tool.first_original_block + window.blocks.last,
                                   first_block + blocks.first) -
                  first_block;
    window.blocks = blocks;
    const program::Samples samples =
        program::sample(program::path_of(tool.path, blocks),
                        corrections_.view(window.segment).machine.control, sampling(i));
    if (samples.states.empty()) continue;
    last_state_ = samples.states.back();
    window.start_s = samples.states.front().time_s;
    window.end_s = last_state_.time_s;
    // The next window begins with the block of the last sample; blocks without samples follow it.
    const std::size_t skipped = blocks.continued_from ? 1 : 0;
    window.blocks.last = blocks.first - skipped + std::size_t(samples.block.back()) + 1;
    blocks = {window.blocks.last, 0, program::SamplingState{last_state_, samples.moved}};
  }
}

program::SampleOptions RewrittenWindows::sampling(std::size_t number) const {
  program::SampleOptions options = tools_[windows_[number].segment].sampling;
  options.continued_from = windows_[number].blocks.continued_from;
  return options;
}

Commands RewrittenWindows::commands(std::size_t number) const {
  const Window& window = windows_[number];
  const ToolProgram& tool = tools_[window.segment];
  Commands result = rewritten_commands(
      corrections_.view(window.segment), program::path_of(tool.path, window.blocks),
      sampling(number), tool.corrected, rewritten_.line_origins, tool.first_original_block);
  // Counted once for the tool, in its first window.
  if (number > ranges_[window.segment].first) result.not_converged = 0;
  return result;
}

Cut cut_in_windows(const Job& job, const CaseDescription& compensator, const Progress& progress) {
  const WindowedCorrections corrections(job, compensator, progress);
  Cut result;
  if (channel_of(job.scene, compensator) == CaseDescription::Channel::Program) {
    if (progress) progress("correct", 0.0);
    const RewrittenWindows program(job, corrections);
    result = cut_in_windows(
        job,
        {[&](const Segment&, std::size_t number) { return program.commands(number); },
         program.rewritten().path, program.windows()},
        progress);
    result.rewritten_program = program.rewritten().text;
  } else {
    result = cut_in_windows(job,
                            {[&](const Segment& window, std::size_t number) {
                               return corrections.ideal_commands(window, number);
                             },
                             job.path, job.windows->all},
                            progress);
  }
  result.name = result.case_name = compensator.name;
  return result;
}

}  // namespace

std::string find_windows_obstacle(const Scene& scene,
                                  const std::optional<CaseDescription>& compensator) {
  using Belief = CaseDescription::Belief;
  for (const ToolDescription& tool : all_tools(scene)) {
    if (!std::holds_alternative<cutting::Cutter>(tool.nominal)) return "a turned part";
    if (tool.wear) return "tool wear";  // depends on all earlier samples of the tool
  }
  // Accelerations depend on the samples on both sides.
  if (scene.compliance && scene.compliance->inertia) return "compliance.inertia";
  if (!compensator) return {};
  if (!compensator->plug_in.empty() || compensator->function) return "a user compensator";
  const auto* file = std::get_if<ProgramDescription::File>(&scene.program.source);
  if (compensator->channel == CaseDescription::Channel::Program && file && is_pvt(*file))
    return "the channel program of a PVT table";  // its rows are thinned together
  // The other channels depend on neighbouring samples.
  if (compensator->channel != CaseDescription::Channel::Ideal &&
      compensator->channel != CaseDescription::Channel::Program)
    return "a channel other than ideal and program";
  const bool is_static =
      compensator->belief == Belief::Perfect || compensator->belief == Belief::Identified;
  return is_static ? "" : "a belief that learns from the program";
}

Cut cut(const Job& job, const std::optional<CaseDescription>& compensator, const Progress& progress,
        Retention keep) {
  if (!compensator) return cut(job, progress, keep);
  if (job.windows) return cut_in_windows(job, *compensator, progress);
  Stopwatch watch;
  const Commands commands = compensate(job, *compensator, progress);
  const double correction_s = watch.lap();
  Cut result = cut(job, commands, progress, keep);
  result.name = result.case_name = compensator->name;
  if (!compensator->plug_in.empty()) result.case_name = compensator->plug_in.string();
  result.timing_s["correction"] = correction_s;
  return result;
}

}  // namespace abbe::sim
