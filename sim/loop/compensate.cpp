#include "sim/loop/compensate.h"

#include <algorithm>

#include <fmt/format.h>

#include "sim/cut/part.h"
#include "sim/cut/process_simulation.h"
#include "sim/cut/resources.h"
#include "sim/cut/tool_motion.h"
#include "sim/loop/correctors.h"
#include "sim/measure/measure.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/trust.h"

namespace abbe::sim {

namespace {

using kinematics::AxisState;

errors::Load predicted_load(const program::Samples& samples, const PredictedRun& run,
                            double time_s) {
  errors::Load load = load_at(run.process, time_s);
  if (run.accelerations.empty()) return load;
  load.acceleration = run.accelerations[sample_at(samples, time_s)];
  return load;
}

/// Returns the steps of a process without its stock, which is large and not needed here.
Process steps_of(const Process& process) { return {process.steps, {}, {}, {}}; }

}  // namespace

compensation::Belief perfect_belief(const Job& job, PredictedRun run) {
  return [known = without_random(job.truth), &job, run = std::move(run)](const AxisState& state) {
    return tool_in_workpiece(known, state, predicted_load(job.samples, run, state.time_s));
  };
}

// A perfect belief knows the effect of its own corrections. In the first round the masses press as
// in the nominal program and the cut pushes as on the rigid machine; then both follow the corrected
// commands. Each round changes them by some hundredths of the round before.
Corrector perfect_corrector(const Job& job, const ControlView& view,
                            const CaseDescription& compensator) {
  constexpr int rounds = 3;
  PredictedRun run{steps_of(job.nominal_process), job.accelerations};
  Corrector corrector = belief_corrector(view, compensator, perfect_belief(job, run));
  const bool bends = job.truth.compliance && !job.nominal_process.steps.empty();
  const bool presses = !job.accelerations.empty();
  if (!bends && !presses) return corrector;
  Commands commands = uncompensated_commands(job);
  const std::vector<AxisState> uncorrected = commands.samples.states;
  for (int round = presses ? 0 : rounds - 1; round < rounds; ++round) {
    commands.samples.states = corrector(uncorrected, job.T_wt_nominal).states;
    if (presses) run.accelerations = accelerations(commands.samples);
    // The simulated cut takes most of the time, so it is repeated once, with nearly final commands.
    if (bends && round + 1 == rounds) run.process = steps_of(cut_process(job, commands));
    corrector = belief_corrector(view, compensator, perfect_belief(job, run));
  }
  return corrector;
}

namespace {

using Eigen::Index;
using Eigen::VectorXd;

// One row a minute of the history: heat changes in minutes.
constexpr double history_interval_s = 60.0;

/// Returns true if a control can read a column of the signals. True deviations and temperatures of
/// nodes are excluded.
bool readable(const Scene& scene, const std::string& column) {
  if (column == "spindle_rpm" || column == "current_A") return true;
  if (column.ends_with("_encoder_mm") || column.ends_with("_encoder_deg") ||
      column.ends_with("_dynamometer_N"))
    return true;
  if (!scene.thermal) return false;
  const auto& sensors = scene.thermal->sensors;
  return std::any_of(sensors.begin(), sensors.end(),
                     [&](const auto& sensor) { return column == sensor.name + "_C"; });
}

// Returns the description of an instrument that measures the part, by its name.
PartInstrumentDescription part_instrument(const Scene& scene, const std::string& name) {
  if (auto instrument = find_part_instrument(scene, name)) return *std::move(instrument);
  throw BadInput(scene.file.string(), 0, 0, "an [[instrument]] that measures the part",
                 "\"" + name + "\"");
}

MeasuredPart cut_and_measure(const Job& job, const Commands& commands, int pass) {
  PartInstrumentDescription instrument =
      part_instrument(job.scene, job.scene.belief.part->instrument);
  // the pass is part of the name, so that each pass has noise of its own
  instrument.name += fmt::format(" {}", pass + 1);
  return {measured_part(job, cut(job, commands), instrument).readings, instrument.spacing};
}

TrainingRun training_run(const BeliefDescription::Force& force,
                         const std::vector<std::filesystem::path>& trusted) {
  Scene scene = read_scene(force.training);
  scene.trusted = trusted;
  const PartInstrumentDescription instrument = part_instrument(scene, force.instrument);
  const Job job = prepare(scene);
  const Cut made = cut(job);
  // Times of the nominal program.
  const VectorXd cut_time_s = cut_error_free(job).surface.cut_time_s;
  const errors::metrology::PartReadings part = measured_part(job, made, instrument).readings;
  compensation::CurrentTraining training{VectorXd(part.deviation.size()), part.deviation};
  for (Index i = 0; i < part.deviation.size(); ++i)
    training.time_s[i] = cut_time_s[nearest_vertex(job.design_w.vertices, part.points_w.row(i))];
  return {control_log(job, uncompensated_commands(job), made.process), std::move(training)};
}

// Returns the load of the cut as simulated on the believed machine, from the design and the nominal
// tool.
compensation::LoadSeries computed_load(const Job& job, const Commands& commands,
                                       const BelievedPose& pose) {
  const Scene& scene = job.scene;
  const auto& T_wt = target_poses(job, commands);
  const Process process = simulate_process(
      scene, job.machine, cutting::transformed(job.design_w, scene.part.T_wm.inverse()),
      {commands.samples, path_of(job, commands), T_wt, pose, job.machine.control,
       scene.tool.nominal});
  compensation::LoadSeries course{VectorXd(Index(process.steps.size())), {}};
  for (std::size_t i = 0; i < process.steps.size(); ++i) {
    course.time_s[Index(i)] = process.steps[i].time_s;
    course.loads.push_back(process.steps[i].load);
  }
  return course;
}

/// Throws BadInput if a job with several tools uses something that follows one tool only.
/// @param wants  true if the case uses it
void check_single_tool(const Job& job, const CaseDescription& compensator, bool wants,
                       const char* what) {
  if (!job.stretches.empty() && wants)
    throw BadInput(job.scene.file.string(), 0, 0, fmt::format("one tool for {}", what),
                   fmt::format("{} tools and the case {}", 1 + job.scene.additional_tools.size(),
                               compensator.name));
}

/// Checks the channel and the beliefs of a case that follow one tool only.
void check_several(const Job& job, const CaseDescription& compensator) {
  using Belief = CaseDescription::Belief;
  using Channel = CaseDescription::Channel;
  const BeliefDescription& given = job.scene.belief;
  const bool own = !compensator.plug_in.empty();
  const Channel channel = own ? job.scene.compensation.plug_in.channel : compensator.channel;
  const auto wants = [&](Belief kind) {
    return !own && is_belief_enabled(given, compensator.belief, kind);
  };
  check_single_tool(job, compensator, channel == Channel::Program,
                    "the channel program, which writes the program of one");
  check_single_tool(job, compensator, channel == Channel::Table,
                    "the channel table, whose tables hold for the tip of one");
  check_single_tool(job, compensator, wants(Belief::Part),
                    "the belief part, which the tool that cut it is corrected by");
  check_single_tool(job, compensator, wants(Belief::Force),
                    "the belief force, which follows the cut of one");
}

}  // namespace

ControlView make_control_view(const Job& job) {
  const Scene& scene = job.scene;
  return {scene.file,
          job.machine,
          {scene.tool.name, scene.tool.length, scene.tool.nominal},
          scene.datum,
          scene.belief,
          scene.compensation,
          scene.seed,
          scene.chord_tolerance,
          scene.cutting.has_value(),
          nc_options(scene, job.machine),
          sample_options(scene, job.machine),
          job.path,
          job.samples,
          job.T_wt_nominal,
          job.design_w};
}

MachineAccess make_machine_access(const Job& job) {
  MachineAccess machine_access;
  machine_access.touch_off = [&job](const Corrector& corrector) {
    return control_datum_offset(job, corrector);
  };
  machine_access.run = [&job](const Commands& commands, bool through_blank) {
    return control_log(job, commands, through_blank ? cut_process(job, commands) : Process{});
  };
  machine_access.measured_part = [&job](const Commands& commands, int pass) {
    return cut_and_measure(job, commands, pass);
  };
  machine_access.training = [&job] {
    return training_run(*job.scene.belief.force, job.scene.trusted);
  };
  machine_access.error_free = [&job] { return cut_error_free(job).surface; };
  machine_access.computed_load = [&job](const Commands& commands, const BelievedPose& pose) {
    return computed_load(job, commands, pose);
  };
  machine_access.perfect = [&job](const ControlView& view, const CaseDescription& compensator) {
    return perfect_corrector(job, view, compensator);
  };
  machine_access.check_trusted = [&job](const std::filesystem::path& program) {
    check_trusted(job.scene, program);
  };
  return machine_access;
}

compensation::ControlLog control_log(const Job& job, const Commands& commands,
                                     const Process& process) {
  Scene scene = job.scene;
  // The control reads the same, whatever the scene reports.
  if (!(scene.signals.history_interval > 0.0 &&
        scene.signals.history_interval < history_interval_s))
    scene.signals.history_interval = history_interval_s;
  std::vector<errors::Load> loads;
  const auto& T_wt = target_poses(job, commands);
  const Signals all =
      signals(scene, job.machine, job.truth, {commands.samples, T_wt, process, loads});
  compensation::ControlLog log;
  std::vector<Index> columns;
  for (std::size_t k = 0; k < all.columns.size(); ++k) {
    if (all.columns[k] == "time_s") log.time_s = all.rows.col(Index(k));
    if (!readable(job.scene, all.columns[k])) continue;
    // a sensor with the name of a node's column comes after it, and only the sensor can be read
    if (const auto twin = std::find(log.names.begin(), log.names.end(), all.columns[k]);
        twin != log.names.end()) {
      columns[std::size_t(twin - log.names.begin())] = Index(k);
      continue;
    }
    log.names.push_back(all.columns[k]);
    columns.push_back(Index(k));
  }
  log.values = all.rows(Eigen::all, columns);
  return log;
}

LearnedCorrection learned_correction(const Job& job, const CaseDescription& compensator,
                                     const Progress& progress) {
  check_single_tool(job, compensator, true, "what tables hold, for the tip of one tool");
  return learned_correction(make_control_view(job), make_machine_access(job), compensator,
                            progress);
}

Commands compensate(const Job& job, const CaseDescription& compensator, const Progress& progress) {
  check_several(job, compensator);
  std::vector<Commands> parts;
  for (const Job& part : parts_of(job))
    parts.push_back(
        compensated(make_control_view(part), make_machine_access(part), compensator, progress));
  return joined(std::move(parts));
}

namespace {

/// Cuts a job in windows. The correction is learned once and applied to every window.
Cut cut_in_windows(const Job& job, const CaseDescription& compensator, const Progress& progress) {
  const ControlView view = make_control_view(job);
  const LearnedCorrection known =
      learned_correction(view, make_machine_access(job), compensator, progress);
  Cut result = cut_in_windows(
      job,
      [&](const Job& part) {
        return compensated(make_control_view(part), make_machine_access(part), compensator, known);
      },
      progress);
  result.name = result.case_name = compensator.name;
  return result;
}

}  // namespace

std::string find_windows_obstacle(const Scene& scene,
                                  const std::optional<CaseDescription>& compensator) {
  // Each of these needs the samples of the whole program at once: stock, heat and wear depend on
  // all that came before a sample, a channel on its neighbours.
  using Belief = CaseDescription::Belief;
  if (!std::holds_alternative<cutting::Cutter>(scene.tool.nominal)) return "a turned part";
  if (!scene.additional_tools.empty()) return "several tools";
  if (scene.cutting) return "[cutting]";
  if (scene.thermal) return "[thermal]";
  if (scene.collision.on) return "[collision]";
  if (scene.tool.wear) return "a tool that wears";
  if (scene.compliance) return "[compliance]";
  if (scene.sensor_choice) return "a choice of sensors";
  if (!compensator) return {};
  if (!compensator->plug_in.empty() || compensator->function) return "a compensator of your own";
  if (compensator->channel != CaseDescription::Channel::Ideal) return "a channel other than ideal";
  const bool still =
      compensator->belief == Belief::Perfect || compensator->belief == Belief::Identified;
  return still ? "" : "a belief that learns from the program";
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
