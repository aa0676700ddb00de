#include "sim/study/histories.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "cutting/map/residual.h"
#include "kinematics/units.h"
#include "sim/calibration/calibration.h"
#include "sim/files/progress.h"
#include "sim/measure/measure.h"
#include "sim/readings/readings_file.h"
#include "sim/scene/read_scene.h"
#include "sim/study/study_text.h"

namespace abbe::sim::study {
namespace {

using errors::metrology::Readings;

constexpr double min_drift = 1e-6;  // mm, the numerical floor of a cut surface

std::string day_text(const std::string& day) {
  return day.empty() ? "the scene's own day" : "the day \"" + day + "\"";
}

[[noreturn]] void throw_scene_error(const Scene& scene, const std::string& expected,
                                    const std::string& seen) {
  throw BadInput(scene.file.string(), 0, 0, expected, seen);
}

Scene scene_of_day(const Study& study, const std::string& day) {
  Scene scene = base_scene(study, {day, day, "uncompensated"});
  if (!scene.thermal)
    throw_scene_error(scene, "heat ([thermal]) on every day of [histories]",
                      "none on " + day_text(day));
  return scene;
}

bool is_same_phase(const ThermalPhase& a, const ThermalPhase& b) {
  return a.duration == b.duration && a.spindle_speed == b.spindle_speed &&
         a.axis_speed == b.axis_speed && a.powered == b.powered && a.coolant == b.coolant;
}

bool same(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  return a.size() == b.size() && a == b;
}

/// Returns true if two days have the same thermal history, whatever their names.
bool is_same_day(const ThermalDescription& a, const ThermalDescription& b) {
  return std::ranges::equal(a.history, b.history, is_same_phase) &&
         same(a.room_time_s, b.room_time_s) && same(a.room_T_C, b.room_T_C) &&
         a.coolant_T_C == b.coolant_T_C;
}

/// The thermal belief learned on one day.
struct LearnedBelief {
  std::string day;
  ThermalDescription heat;  ///< of that day, which may have another name too
  compensation::ThermalBelief belief;
  std::vector<std::string> sensors;
  std::vector<std::string> warnings;
};

/// Returns the readings of a day as the files of its instruments contain them. They are converted
/// to text and back, so that the belief comes from the printed digits, as with `abbe identify`.
std::vector<Readings> day_readings(const Scene& scene, const std::string& day) {
  if (scene.instruments.empty())
    throw_scene_error(
        scene,
        "[[instrument]] tables that read the machine at several times of a train day (start_h "
        "with a list), such as drift, r_test and tracker; a variant brings its own by "
        "`instrument` in its set",
        "none on " + day_text(day));
  std::vector<Readings> result;
  for (const InstrumentDescription& instrument : scene.instruments) {
    stop_if_interrupted();
    result.push_back(read_readings(sim::to_text(measure_machine(scene, instrument)),
                                   instrument.instrument.name + ".csv"));
  }
  return result;
}

LearnedBelief learn_belief(const Study& study, const std::string& day) {
  const Scene scene = scene_of_day(study, day);
  const std::vector<Readings> readings = day_readings(scene, day);
  const std::string expected = "readings from which heat can be learnt on " + day_text(day) +
                               ", every instrument from the same three or more start_h";
  try {
    ThermalIdentificationResult result = identify_thermal(readings, thermal_identification({}));
    return {day, *scene.thermal, std::move(result.belief), std::move(result.day.sensors),
            std::move(result.warnings)};
  } catch (const std::invalid_argument& error) {
    throw_scene_error(scene, expected, error.what());
  } catch (const std::out_of_range& error) {
    throw_scene_error(scene, expected, error.what());
  }
}

/// Returns true if a variant changes what days could share: part, program, nominal machine.
bool is_reshaping(const std::vector<Override>& overrides) {
  constexpr std::array ignored_keys{"compare", "instrument", "sensor_choice", "title"};
  Input input;
  for (const Override& override_value : overrides) {
    const std::string key = override_value.path.substr(0, override_value.path.find('.'));
    if (std::ranges::find(ignored_keys, key) == ignored_keys.end())
      input.settings.push_back({override_value.path, 1.0});
  }
  return study::is_reshaping(input);
}

/// Prepares the jobs of days. Days that cut the same part with the same program share one.
class JobCache {
 public:
  explicit JobCache(const Study& study)
      : variants_(read_scene(study.scene, study.overrides).variants) {}

  Job prepare_day(const Scene& scene, const std::string& day) {
    const auto variant = std::ranges::find(variants_, day, &Variant::name);
    if (variant != variants_.end() && is_reshaping(variant->set)) return prepare(scene);
    if (!shared_) {
      shared_ = prepare(scene);
      return *shared_;
    }
    try {
      return replace_errors(*shared_, scene);
    } catch (const BadInput&) {
      return prepare(scene);  // the day has another machine, or errors that need denser samples
    }
  }

 private:
  std::vector<Variant> variants_;
  std::optional<Job> shared_;
};

double drift_rms(const cutting::Surface& drift, const Job& job) {
  const auto rms = cutting::statistics(drift, job.design_w).rms;
  if (!rms)
    throw_scene_error(job.scene, "a part of which something is cut with heat and without", "none");
  return *rms;
}

/// A test day with its map without heat and the drift by heat.
struct TestDay {
  std::string name;
  Job job;
  cutting::Surface cold_surface;
  double uncompensated_rms = 0.0;
};

TestDay test_day(JobCache& jobs, const Study& study, const std::string& day) {
  const Scene scene = scene_of_day(study, day);
  TestDay result{day, jobs.prepare_day(scene, day), {}, 0.0};
  Scene cold_scene = scene;
  cold_scene.thermal->scale = 0.0;
  result.cold_surface = cut(replace_errors(result.job, cold_scene)).surface;
  stop_if_interrupted();
  const cutting::Surface warm_surface = cut(result.job).surface;
  result.uncompensated_rms =
      drift_rms(cutting::minus(warm_surface, result.cold_surface), result.job);
  return result;
}

HistoryResult judge(TestDay& day, const LearnedBelief& belief, const CaseDescription& compensator) {
  stop_if_interrupted();
  day.job.scene.belief.thermal = belief.belief;
  const Cut compensated = cut(day.job, compensator);
  HistoryResult result;
  result.train = belief.day;
  result.test = day.name;
  result.is_own_day = belief.day == day.name || is_same_day(belief.heat, *day.job.scene.thermal);
  result.uncompensated_rms = day.uncompensated_rms;
  result.compensated_rms =
      drift_rms(cutting::minus(compensated.surface, day.cold_surface), day.job);
  if (result.uncompensated_rms >= min_drift)
    result.reduction_percent = 100.0 * (1.0 - result.compensated_rms / result.uncompensated_rms);
  result.sensors = belief.sensors;
  result.warnings = belief.warnings;
  result.warnings.insert(result.warnings.end(), compensated.warnings.begin(),
                         compensated.warnings.end());
  return result;
}

/// Reports the days learned and the parts cut as one stage.
class DayProgress {
 public:
  DayProgress(const Progress& progress, std::size_t steps) : progress_(progress), steps_(steps) {}
  void step() {
    ++finished_steps_;
    if (progress_) progress_("thermal histories", double(finished_steps_) / double(steps_));
  }

 private:
  const Progress& progress_;
  std::size_t steps_;
  std::size_t finished_steps_ = 0;
};

}  // namespace

CaseDescription histories_compensator(const Study& study) {
  // A belief of geometry or force would remove more than the drift and seem better than it is.
  constexpr const char* expected =
      "a case that believes in temperatures alone, such as thermal-iterated-ideal, for "
      "histories.case";
  const std::string& name = study.histories->case_name;
  try {
    CaseDescription compensator = parse_case(name);
    if (compensator.plug_in.empty() && compensator.belief == CaseDescription::Belief::Thermal)
      return compensator;
  } catch (const std::invalid_argument& error) {
    throw BadInput(study.file.string(), 0, 0, expected, error.what());
  }
  throw BadInput(study.file.string(), 0, 0, expected, "\"" + name + "\"");
}

std::vector<HistoryResult> histories(const Study& study, const Progress& progress) {
  if (!study.histories)
    throw BadInput(study.file.string(), 0, 0, "[histories] with train and test days", "none");
  const auto& [train, test, case_name] = *study.histories;
  const CaseDescription compensator = histories_compensator(study);
  // `scene_of_day` reports input errors before anything is cut.
  for (const std::string& day : test) scene_of_day(study, day);
  DayProgress stage(progress, train.size() + test.size() * (train.size() + 1));
  std::vector<LearnedBelief> beliefs;
  for (const std::string& day : train) {
    beliefs.push_back(learn_belief(study, day));
    stage.step();
  }
  JobCache jobs(study);
  std::vector<HistoryResult> results(train.size() * test.size());
  for (std::size_t j = 0; j < test.size(); ++j) {
    TestDay day = test_day(jobs, study, test[j]);
    stage.step();
    for (std::size_t i = 0; i < beliefs.size(); ++i) {
      results[i * test.size() + j] = judge(day, beliefs[i], compensator);
      stage.step();
    }
  }
  return results;
}

nlohmann::ordered_json to_json(const std::vector<HistoryResult>& results) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const HistoryResult& result : results) {
    nlohmann::ordered_json reduction;
    if (result.reduction_percent) reduction = *result.reduction_percent;
    list.push_back({{"train", result.train},
                    {"test", result.test},
                    {"own_day", result.is_own_day},
                    {"uncompensated_rms_um", result.uncompensated_rms / units::um},
                    {"compensated_rms_um", result.compensated_rms / units::um},
                    {"reduction_percent", reduction},
                    {"sensors", result.sensors},
                    {"warnings", result.warnings}});
  }
  return list;
}

std::string to_csv(const std::vector<HistoryResult>& results) {
  std::string text =
      "train,test,own_day,uncompensated_rms_um,compensated_rms_um,reduction_percent,sensors\n";
  for (const HistoryResult& result : results)
    text += fmt::format("{},{},{},{},{},{},{}\n", csv_field(result.train), csv_field(result.test),
                        result.is_own_day, csv_field(result.uncompensated_rms / units::um),
                        csv_field(result.compensated_rms / units::um),
                        csv_field(result.reduction_percent),
                        csv_field(fmt::format("{}", fmt::join(result.sensors, "; "))));
  return text;
}

std::string to_text(const std::vector<HistoryResult>& results) {
  TextTable text_table{{"learnt on", "judged on", "uncompensated, RMS µm", "compensated, RMS µm",
                        "reduction, %", "sensors"}};
  text_table.text_columns = 2;
  const auto day_name = [](const std::string& name) { return name.empty() ? "its own day" : name; };
  for (const HistoryResult& result : results)
    text_table.rows.push_back(
        {day_name(result.train), day_name(result.test) + (result.is_own_day ? " (the same)" : ""),
         fmt::format("{:.3f}", result.uncompensated_rms / units::um),
         fmt::format("{:.3f}", result.compensated_rms / units::um),
         result.reduction_percent ? fmt::format("{:.1f}", *result.reduction_percent) : "–",
         fmt::format("{}", fmt::join(result.sensors, ", "))});
  return "\n" + table(TextStyle::Terminal, text_table);
}

}  // namespace abbe::sim::study
