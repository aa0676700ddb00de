#include "sim/loop/compensate.h"

#include <algorithm>

#include <fmt/format.h>

#include "sim/cut/follow.h"
#include "sim/cut/part.h"
#include "sim/cut/stopwatch.h"
#include "sim/loop/beliefs.h"
#include "sim/loop/perfect.h"
#include "sim/measure/measure.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/trust.h"

namespace abbe::sim {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double history_interval_s = 60.0;

/// Whether a control can read that column of the signals.
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

PartInstrumentDescription part_instrument(const Scene& scene, const std::string& name) {
  if (auto instrument = part_instrument_of(scene, name)) return *std::move(instrument);
  throw BadInput(scene.file.string(), 0, 0, "an [[instrument]] that measures the part",
                 "\"" + name + "\"");
}

MeasuredPart cut_and_measured(const Job& job, const Commands& commands, int pass) {
  PartInstrumentDescription instrument =
      part_instrument(job.scene, job.scene.belief.part->instrument);
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
  const VectorXd cut_time_s = cut_error_free(job).surface.cut_time_s;  // by the program
  const errors::metrology::PartReadings part = measured_part(job, made, instrument).readings;
  compensation::CurrentTraining training{VectorXd(part.deviation.size()), part.deviation};
  for (Index i = 0; i < part.deviation.size(); ++i)
    training.time_s[i] = cut_time_s[nearest_vertex(job.design_w.vertices, part.points_w.row(i))];
  return {control_log(job, as_programmed(job), made.process), std::move(training)};
}

compensation::LoadCourse computed_load(const Job& job, const Commands& commands,
                                       const BelievedPose& pose) {
  const Scene& scene = job.scene;
  const auto& T_wt = wanted_poses(job, commands);
  const Process process =
      follow(scene, job.machine, cutting::transformed(job.design_w, scene.part.T_wm.inverse()),
             {commands.samples, path_of(job, commands), T_wt, pose, job.machine.control,
              scene.tool.nominal});
  compensation::LoadCourse course{VectorXd(Index(process.steps.size())), {}};
  for (std::size_t i = 0; i < process.steps.size(); ++i) {
    course.time_s[Index(i)] = process.steps[i].time_s;
    course.loads.push_back(process.steps[i].load);
  }
  return course;
}

/// @param wants  whether the case wants what follows one tool only
void refuse_several(const Job& job, const CaseDescription& compensator, bool wants,
                    const char* what) {
  if (!job.stretches.empty() && wants)
    throw BadInput(
        job.scene.file.string(), 0, 0, fmt::format("one tool for {}", what),
        fmt::format("{} tools and the case {}", 1 + job.scene.more_tools.size(), compensator.name));
}

/// What of a case follows one tool only.
void check_several(const Job& job, const CaseDescription& compensator) {
  using Belief = CaseDescription::Belief;
  using Channel = CaseDescription::Channel;
  const BeliefDescription& given = job.scene.belief;
  const bool own = !compensator.plug_in.empty();
  const Channel channel = own ? job.scene.compensation.plug_in.channel : compensator.channel;
  const auto wants = [&](Belief kind) { return !own && believes(given, compensator.belief, kind); };
  refuse_several(job, compensator, channel == Channel::Program,
                 "the channel program, which writes the program of one");
  refuse_several(job, compensator, channel == Channel::Table,
                 "the channel table, whose tables hold for the tip of one");
  refuse_several(job, compensator, wants(Belief::Part),
                 "the belief part, which the tool that cut it is corrected by");
  refuse_several(job, compensator, wants(Belief::Force),
                 "the belief force, which follows the cut of one");
}

}  // namespace

Seen seen_of(const Job& job) {
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

Workshop workshop_of(const Job& job) {
  Workshop workshop;
  workshop.touch_off = [&job](const Corrector& corrector) { return found_datum(job, corrector); };
  workshop.run = [&job](const Commands& commands, bool through_blank) {
    return control_log(job, commands, through_blank ? cut_process(job, commands) : Process{});
  };
  workshop.measured_part = [&job](const Commands& commands, int pass) {
    return cut_and_measured(job, commands, pass);
  };
  workshop.training = [&job] { return training_run(*job.scene.belief.force, job.scene.trusted); };
  workshop.error_free = [&job] { return cut_error_free(job).surface; };
  workshop.computed_load = [&job](const Commands& commands, const BelievedPose& pose) {
    return computed_load(job, commands, pose);
  };
  workshop.perfect = [&job](const Seen& seen, const CaseDescription& compensator) {
    return perfect_corrector(job, seen, compensator);
  };
  workshop.check_trusted = [&job](const std::filesystem::path& program) {
    check_trusted(job.scene, program);
  };
  return workshop;
}

compensation::ControlLog control_log(const Job& job, const Commands& commands,
                                     const Process& process) {
  Scene scene = job.scene;
  // what a scene asks to be reported does not change what a control reads
  if (!(scene.signals.history_interval > 0.0 &&
        scene.signals.history_interval < history_interval_s))
    scene.signals.history_interval = history_interval_s;
  std::vector<errors::Load> loads;
  const auto& T_wt = wanted_poses(job, commands);
  const Signals all =
      signals(scene, job.machine, job.truth, {commands.samples, T_wt, process, loads});
  compensation::ControlLog log;
  std::vector<Index> columns;
  for (std::size_t k = 0; k < all.columns.size(); ++k) {
    if (all.columns[k] == "time_s") log.time_s = all.rows.col(Index(k));
    if (!readable(job.scene, all.columns[k])) continue;
    // a sensor called like a node's column stands after it
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

Learnt learnt(const Job& job, const CaseDescription& compensator, const Progress& progress) {
  refuse_several(job, compensator, true, "what tables hold, for the tip of one tool");
  return learnt(seen_of(job), workshop_of(job), compensator, progress);
}

Commands compensate(const Job& job, const CaseDescription& compensator, const Progress& progress) {
  check_several(job, compensator);
  std::vector<Commands> parts;
  for (const Job& part : parts_of(job))
    parts.push_back(compensated(seen_of(part), workshop_of(part), compensator, progress));
  return joined(std::move(parts));
}

namespace {

/// What is learnt once corrects every window.
Cut cut_in_windows(const Job& job, const CaseDescription& compensator, const Progress& progress) {
  const Seen seen = seen_of(job);
  const Learnt known = learnt(seen, workshop_of(job), compensator, progress);
  Cut result = cut_in_windows(
      job,
      [&](const Job& part) {
        return compensated(seen_of(part), workshop_of(part), compensator, known);
      },
      progress);
  result.name = result.case_name = compensator.name;
  return result;
}

}  // namespace

std::string what_needs_whole(const Scene& scene,
                             const std::optional<CaseDescription>& compensator) {
  using Belief = CaseDescription::Belief;
  if (!std::holds_alternative<cutting::Cutter>(scene.tool.nominal)) return "a turned part";
  if (!scene.more_tools.empty()) return "several tools";
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
        Keep keep) {
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
