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

std::string name_of_day(const std::string& day) {
  return day.empty() ? "the scene's own day" : "the day \"" + day + "\"";
}

[[noreturn]] void refuse(const Scene& scene, const std::string& expected, const std::string& seen) {
  throw BadInput(scene.file.string(), 0, 0, expected, seen);
}

Scene scene_of_day(const Study& study, const std::string& day) {
  Scene scene = scene_of(study, {day, day, "uncompensated"});
  if (!scene.thermal)
    refuse(scene, "heat ([thermal]) on every day of [histories]", "none on " + name_of_day(day));
  return scene;
}

bool same_phase(const ThermalPhase& a, const ThermalPhase& b) {
  return a.duration == b.duration && a.spindle_speed == b.spindle_speed &&
         a.axis_speed == b.axis_speed && a.powered == b.powered && a.coolant == b.coolant;
}

bool same(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  return a.size() == b.size() && a == b;
}

/// Returns true if both days have the same thermal history, whatever their names.
bool same_day(const ThermalDescription& a, const ThermalDescription& b) {
  return std::ranges::equal(a.history, b.history, same_phase) &&
         same(a.room_time_s, b.room_time_s) && same(a.room_T_C, b.room_T_C) &&
         a.coolant_T_C == b.coolant_T_C;
}

struct LearntBelief {
  std::string day;
  ThermalDescription heat;  ///< of that day, to recognise it under another name
  compensation::ThermalBelief belief;
  std::vector<std::string> sensors;
  std::vector<std::string> warnings;
};

/// Returns the readings of a day as they stand in the files of its instruments. They go through
/// text, so that the belief is learnt from the printed digits only, as by `abbe identify`.
std::vector<Readings> readings_of(const Scene& scene, const std::string& day) {
  if (scene.instruments.empty())
    refuse(scene,
           "[[instrument]] tables that read the machine at several times of a train day (start_h "
           "with a list), such as drift, r_test and tracker; a variant brings its own by "
           "`instrument` in its set",
           "none on " + name_of_day(day));
  std::vector<Readings> all;
  for (const InstrumentDescription& one : scene.instruments) {
    stop_if_interrupted();
    all.push_back(read_readings(sim::to_text(measured(scene, one)), one.instrument.name + ".csv"));
  }
  return all;
}

LearntBelief learn_belief(const Study& study, const std::string& day) {
  const Scene scene = scene_of_day(study, day);
  const std::vector<Readings> readings = readings_of(scene, day);
  const std::string expected = "readings from which heat can be learnt on " + name_of_day(day) +
                               ", every instrument from the same three or more start_h";
  try {
    ThermalIdentificationResult found = identify_thermal(readings, thermal_identification({}));
    return {day, *scene.thermal, std::move(found.belief), std::move(found.day.sensors),
            std::move(found.warnings)};
  } catch (const std::invalid_argument& fault) {
    refuse(scene, expected, fault.what());
  } catch (const std::out_of_range& fault) {
    refuse(scene, expected, fault.what());
  }
}

/// Returns true if a variant changes anything that days could share: part, program, nominal
/// machine.
bool is_reshaping(const std::vector<Override>& set) {
  constexpr std::array ignored_keys{"compare", "instrument", "sensor_choice", "title"};
  Input input;
  for (const Override& one : set) {
    const std::string key = one.path.substr(0, one.path.find('.'));
    if (std::ranges::find(ignored_keys, key) == ignored_keys.end())
      input.settings.push_back({one.path, 1.0});
  }
  return study::is_reshaping(input);
}

/// Prepares the jobs of days; days that cut the same part by the same program share one.
class Workshop {
 public:
  explicit Workshop(const Study& study)
      : variants_(read_scene(study.scene, study.overrides).variants) {}

  Job job_of(const Scene& scene, const std::string& day) {
    const auto variant = std::ranges::find(variants_, day, &Variant::name);
    if (variant != variants_.end() && is_reshaping(variant->set)) return prepare(scene);
    if (!shared_) {
      shared_ = prepare(scene);
      return *shared_;
    }
    try {
      return replace_errors(*shared_, scene);
    } catch (const BadInput&) {
      return prepare(scene);  // another machine, or errors that need denser samples
    }
  }

 private:
  std::vector<Variant> variants_;
  std::optional<Job> shared_;
};

double rms_of(const cutting::Surface& drift, const Job& job) {
  const auto rms = cutting::statistics(drift, job.design_w).rms;
  if (!rms) refuse(job.scene, "a part of which something is cut with heat and without", "none");
  return *rms;
}

/// A test day: its map without heat, and the drift that heat adds.
struct TestDay {
  std::string name;
  Job job;
  cutting::Surface cold_surface;
  double uncompensated_rms = 0.0;
};

TestDay test_day(Workshop& workshop, const Study& study, const std::string& day) {
  const Scene scene = scene_of_day(study, day);
  TestDay result{day, workshop.job_of(scene, day), {}, 0.0};
  Scene unmoved = scene;
  unmoved.thermal->scale = 0.0;
  result.cold_surface = cut(replace_errors(result.job, unmoved)).surface;
  stop_if_interrupted();
  const cutting::Surface warm_surface = cut(result.job).surface;
  result.uncompensated_rms = rms_of(cutting::minus(warm_surface, result.cold_surface), result.job);
  return result;
}

HistoryResult judged(TestDay& day, const LearntBelief& lesson, const CaseDescription& compensator) {
  stop_if_interrupted();
  day.job.scene.belief.thermal = lesson.belief;
  const Cut compensated = cut(day.job, compensator);
  HistoryResult result;
  result.train = lesson.day;
  result.test = day.name;
  result.is_own_day = lesson.day == day.name || same_day(lesson.heat, *day.job.scene.thermal);
  result.uncompensated_rms = day.uncompensated_rms;
  result.compensated_rms = rms_of(cutting::minus(compensated.surface, day.cold_surface), day.job);
  if (result.uncompensated_rms >= min_drift)
    result.reduction_percent = 100.0 * (1.0 - result.compensated_rms / result.uncompensated_rms);
  result.sensors = lesson.sensors;
  result.warnings = lesson.warnings;
  result.warnings.insert(result.warnings.end(), compensated.warnings.begin(),
                         compensated.warnings.end());
  return result;
}

/// Reports days learnt and parts cut as one stage.
class DayProgress {
 public:
  DayProgress(const Progress& progress, std::size_t steps) : progress_(progress), steps_(steps) {}
  void step() {
    ++done_;
    if (progress_) progress_("thermal histories", double(done_) / double(steps_));
  }

 private:
  const Progress& progress_;
  std::size_t steps_;
  std::size_t done_ = 0;
};

}  // namespace

CaseDescription case_of_histories(const Study& study) {
  // A belief in geometry or force would remove more than the drift, and appear better than it is.
  constexpr const char* expected =
      "a case that believes in temperatures alone, such as thermal-iterated-ideal, for "
      "histories.case";
  const std::string& name = study.histories->case_name;
  try {
    CaseDescription compensator = parse_case(name);
    if (compensator.plug_in.empty() && compensator.belief == CaseDescription::Belief::Thermal)
      return compensator;
  } catch (const std::invalid_argument& fault) {
    throw BadInput(study.file.string(), 0, 0, expected, fault.what());
  }
  throw BadInput(study.file.string(), 0, 0, expected, "\"" + name + "\"");
}

std::vector<HistoryResult> histories(const Study& study, const Progress& progress) {
  if (!study.histories)
    throw BadInput(study.file.string(), 0, 0, "[histories] with train and test days", "none");
  const auto& [train, test, case_name] = *study.histories;
  const CaseDescription compensator = case_of_histories(study);
  // Input errors are reported before anything is cut.
  for (const std::string& day : test) scene_of_day(study, day);
  DayProgress stage(progress, train.size() + test.size() * (train.size() + 1));
  std::vector<LearntBelief> lessons;
  for (const std::string& day : train) {
    lessons.push_back(learn_belief(study, day));
    stage.step();
  }
  Workshop workshop(study);
  std::vector<HistoryResult> results(train.size() * test.size());
  for (std::size_t j = 0; j < test.size(); ++j) {
    TestDay day = test_day(workshop, study, test[j]);
    stage.step();
    for (std::size_t i = 0; i < lessons.size(); ++i) {
      results[i * test.size() + j] = judged(day, lessons[i], compensator);
      stage.step();
    }
  }
  return results;
}

nlohmann::ordered_json to_json(const std::vector<HistoryResult>& results) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const HistoryResult& one : results) {
    nlohmann::ordered_json reduction;
    if (one.reduction_percent) reduction = *one.reduction_percent;
    list.push_back({{"train", one.train},
                    {"test", one.test},
                    {"own_day", one.is_own_day},
                    {"uncompensated_rms_um", one.uncompensated_rms / units::um},
                    {"compensated_rms_um", one.compensated_rms / units::um},
                    {"reduction_percent", reduction},
                    {"sensors", one.sensors},
                    {"warnings", one.warnings}});
  }
  return list;
}

std::string to_csv(const std::vector<HistoryResult>& results) {
  std::string text =
      "train,test,own_day,uncompensated_rms_um,compensated_rms_um,reduction_percent,sensors\n";
  for (const HistoryResult& one : results)
    text +=
        fmt::format("{},{},{},{},{},{},{}\n", csv_field(one.train), csv_field(one.test),
                    one.is_own_day, csv_field(one.uncompensated_rms / units::um),
                    csv_field(one.compensated_rms / units::um), csv_field(one.reduction_percent),
                    csv_field(fmt::format("{}", fmt::join(one.sensors, "; "))));
  return text;
}

std::string to_text(const std::vector<HistoryResult>& results) {
  TextTable rows{{"learnt on", "judged on", "uncompensated, RMS µm", "compensated, RMS µm",
                  "reduction, %", "sensors"}};
  rows.text_columns = 2;
  const auto day = [](const std::string& name) { return name.empty() ? "its own day" : name; };
  for (const HistoryResult& one : results)
    rows.rows.push_back(
        {day(one.train), day(one.test) + (one.is_own_day ? " (the same)" : ""),
         fmt::format("{:.3f}", one.uncompensated_rms / units::um),
         fmt::format("{:.3f}", one.compensated_rms / units::um),
         one.reduction_percent ? fmt::format("{:.1f}", *one.reduction_percent) : "–",
         fmt::format("{}", fmt::join(one.sensors, ", "))});
  return "\n" + table(TextStyle::Terminal, rows);
}

}  // namespace abbe::sim::study
