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
  require_single_tool(job, compensator,
                      channel_of(job.scene, compensator) == CaseDescription::Channel::Table,
                      "the channel table, whose tables apply to the tip of one tool");
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

ControlView make_control_view(const Job& job, const Segment& segment) {
  const Scene& scene = segment.scene;
  return {scene.file,
          segment.machine,
          {scene.tool.name, scene.tool.length, scene.tool.nominal},
          scene.datum,
          scene.belief,
          scene.compensation,
          scene.seed,
          scene.chord_tolerance,
          scene.cutting.has_value(),
          nc_options(scene, segment.machine),
          sample_options(scene, segment.machine),
          segment.path,
          segment.samples,
          segment.T_wt_nominal,
          job.design_w};
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
  require_single_tool(job, compensator, true, "tables, which apply to the tip of one tool");
  return learn_correction(make_control_view(job, job), make_machine_access(job, job, {}),
                          compensator, progress);
}

Commands compensate(const Job& job, const CaseDescription& compensator, const Progress& progress) {
  check_tool_count(job, compensator);
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
  const auto corrected = [&](const Segment& window, std::size_t) {
    Commands commands = segment_commands(window);
    commands.samples.states = corrector(commands.samples.states, window.T_wt_nominal).states;
    return commands;
  };
  run.process = without_stock(segment_process(job, number, corrected, std::move(before)));
  return belief_corrector(view, compensator, perfect_belief(segment, std::move(run)));
}

/// Cuts a job in windows. The correction of each tool is learned once and is applied to all its
/// windows.
Cut cut_in_windows(const Job& job, const CaseDescription& compensator, const Progress& progress) {
  const auto segments = tool_segments(job);
  std::vector<LearnedCorrection> corrections;
  const auto access = [&](const Segment& segment, std::size_t number, const Process& before) {
    MachineAccess result = make_machine_access(job, segment, before);
    result.perfect = [&job, number, &before](const ControlView& view,
                                             const CaseDescription& description) {
      return perfect_in_windows(job, number, view, description, before);
    };
    return result;
  };
  const Process no_stock;
  const auto commands = [&](const Segment& window, std::size_t number) {
    return compensated_commands(make_control_view(job, window), access(window, number, no_stock),
                                compensator, corrections[number]);
  };
  Process stock;                  // that the tools so far have left
  std::deque<ControlView> views;  // to which the corrections refer
  for (std::size_t i = 0; i < segments.size(); ++i) {
    views.push_back(make_control_view(job, segments[i]));
    corrections.push_back(
        learn_correction(views.back(), access(segments[i], i, stock), compensator, progress));
    if (i + 1 < segments.size() && follows_stock(segments[i], compensator)) {
      Process process = segment_process(job, i, commands, take_stock(stock));
      stock = take_stock(process);
    }
  }
  Cut result = cut_in_windows(job, commands, progress);
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
  if (scene.collision.is_enabled) return "[collision]";
  // Accelerations depend on the samples on both sides.
  if (scene.compliance && scene.compliance->inertia) return "compliance.inertia";
  if (!compensator) return {};
  if (!compensator->plug_in.empty() || compensator->function) return "a user compensator";
  // A channel depends on neighbouring samples.
  if (compensator->channel != CaseDescription::Channel::Ideal) return "a channel other than ideal";
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
