#include "sim/study/configuration.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "cutting/map/areal_filter.h"
#include "cutting/map/form.h"
#include "cutting/map/residual.h"
#include "errors/coefficients.h"
#include "errors/identification/model.h"
#include "kinematics/units.h"
#include "sim/calibration/calibration.h"
#include "sim/cut/part_regions.h"
#include "sim/cut/placement.h"
#include "sim/files/progress.h"
#include "sim/machine/run_out.h"
#include "sim/machine/truth.h"
#include "sim/measure/measure.h"
#include "sim/readings/readings_file.h"
#include "sim/report/verdict.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/toml.h"
#include "sim/scene/value_warnings.h"
#include "sim/study/study_inputs.h"
#include "sim/study/study_text.h"

namespace abbe::sim::study {

namespace {

using errors::metrology::Readings;

constexpr double min_drift = 1e-6;  // mm, the numerical floor of a cut surface

std::string day_text(const std::string& day) {
  return day.empty() ? "the day of the scene" : "the day \"" + day + "\"";
}

[[noreturn]] void throw_scene_error(const Scene& scene, const std::string& expected,
                                    const std::string& seen) {
  throw BadInput(scene.file.string(), 0, 0, expected, seen);
}

Scene scene_of_day(const Study& study, const std::string& day) {
  Scene scene = base_scene(study, {day, day, "uncompensated"});
  if (!scene.thermal)
    throw_scene_error(scene, "[thermal] on every day of [histories]", "none on " + day_text(day));
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
    throw_scene_error(scene,
                      "[[instrument]] tables that measure the machine at several times of a "
                      "training day (a list for start_h), such as drift, r_test and tracker; a "
                      "variant can define its own with `instrument` in its set",
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
  const std::string expected = "readings that identify thermal errors on " + day_text(day) +
                               ", with at least three start_h, the same for every instrument";
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
bool has_reshaping_override(const std::vector<Override>& overrides) {
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
    if (variant != variants_.end() && has_reshaping_override(variant->set)) return prepare(scene);
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
  if (!rms) throw_scene_error(job.scene, "a part that is cut both with and without heat", "none");
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
      "a case whose belief uses only temperatures, such as thermal-iterated-ideal, for "
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
  TextTable text_table{{"learnt on", "evaluated on", "uncompensated, RMS µm", "compensated, RMS µm",
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

namespace {

// P99 of fewer cases is interpolated between the two largest responses, P95 among the largest six.
constexpr std::uint64_t min_cases_for_quantiles = 100;
// Limit for the spread of a factor: machines of one kind differ by a few times their typical error
// at most.
constexpr double max_plausible_factor = 5.0;
// One standard deviation is then a factor of 7; no property of a machine is so uncertain.
constexpr double max_plausible_logarithm = 2.0;
// No machine and no tool is known to 20 nm.
constexpr double min_plausible_mm = 2e-5;
constexpr double max_tool_difference_mm =
    1.0;  // as for the actual sizes of tools in value_warnings.cpp
constexpr double min_remaining_fraction = 0.2;  // of a standard deviation, between `low` and `high`
// Distances in spreads: a normal distribution has one case in 370 beyond 3 and one in 1e23 beyond
// 10.
constexpr double max_centre_distance = 3.0, max_sweep_distance = 10.0;

/// Returns the probable mistake in the spread of a coefficient of an element, which has the same
/// limits as the clamping.
std::string unit_mistake_text(const std::string& unit, double spread) {
  return probable_mistake("setup.EX_" + unit, spread);
}

/// Returns the probable mistake in the spread of the number at a key; empty if there is none.
/// @param centre  of that number
std::string spread_mistake_text(const std::string& key, double centre, double spread) {
  const std::string unit = unit_name(key);
  const bool is_of_machine = key.starts_with("errors.") || key.starts_with("setup.");
  if (is_of_machine && (unit == "um" || unit == "urad")) return unit_mistake_text(unit, spread);
  if (key.ends_with("_C")) return probable_mistake(key, spread);
  if (key.ends_with("scale") && spread > max_plausible_factor) return "percent";
  if (unit != "mm") return {};
  if (spread < min_plausible_mm) return "m";
  if (centre != 0.0 && spread >= std::abs(centre))
    return "um, because it is as large as its centre";
  return key.starts_with("tool.actual.") && spread > max_tool_difference_mm ? "um" : "";
}

/// Returns true if the belief, not the study, states the uncertainty of a number.
bool is_in_belief(const std::string& number, const Study& study, const Scene& scene) {
  const errors::GeometricErrors& belief = scene.geometric;
  const auto is_same_number = [&](const errors::Coefficient& coefficient) {
    return errors::name_of(coefficient, belief.elements) == number;
  };
  return std::ranges::any_of(belief.covariance.of, is_same_number) ||
         std::ranges::find(study.unidentified, number, &UnidentifiedCoefficient::number) !=
             study.unidentified.end();
}

std::string spread_mistake_text(const Input& input) {
  const Distribution& distribution = input.distribution;
  if (distribution.kind == Distribution::Kind::LogNormal)
    return distribution.spread > max_plausible_logarithm
               ? "the unit of the path or in percent, but it applies to the logarithm"
               : "";
  if (!input.element.empty()) return distribution.spread > max_plausible_factor ? "percent" : "";
  if (!input.number.empty()) return unit_mistake_text(input.unit, distribution.spread);
  for (const Setting& setting : input.settings)
    if (std::string mistake = spread_mistake_text(path_without_indices(setting.path),
                                                  setting.factor * distribution.centre,
                                                  std::abs(setting.factor) * distribution.spread);
        !mistake.empty())
      return mistake;
  return {};
}

std::string value_text(const Input& input, double value) {
  return fmt::format("{:.6g}{}{}", value, input.unit.empty() ? "" : " ", input.unit);
}

/// Returns the distance of two values in spreads of a distribution.
double distance_in_spreads(const Distribution& distribution, double from, double to) {
  if (distribution.kind != Distribution::Kind::LogNormal)
    return std::abs(to - from) / distribution.spread;
  return from > 0.0 && to > 0.0 ? std::abs(std::log(to / from)) / distribution.spread : infinity;
}

void add_spread_warnings(const Input& input, std::vector<std::string>& warnings) {
  const Distribution& distribution = input.distribution;
  if (const std::string mistake = spread_mistake_text(input); !mistake.empty())
    warnings.push_back(
        fmt::format("the spread of input \"{}\" is {}: check the unit, it may be in {}", input.name,
                    value_text(input, distribution.spread), mistake));
  Distribution untruncated = distribution;
  untruncated.low = -infinity;
  untruncated.high = infinity;
  const double stated_deviation = moments(untruncated).standard_deviation,
               remaining_deviation = moments(distribution).standard_deviation;
  if (remaining_deviation < min_remaining_fraction * stated_deviation)
    warnings.push_back(fmt::format(
        "low and high of input \"{}\" reduce its standard deviation to {}, while its spread gives "
        "{}: low and high are values in the unit of the centre, not multiples of the spread or "
        "differences",
        input.name, value_text(input, remaining_deviation), value_text(input, stated_deviation)));
}

/// Adds a warning about a centre that differs from the number of the scene. The base machine of a
/// study, with every input at its centre, should be the machine of the scene.
void add_centre_warning(const Input& input, const Scene& scene,
                        std::vector<std::string>& warnings) {
  const Distribution& distribution = input.distribution;
  for (const Setting& setting : input.settings) {
    const std::optional<double> number = scene_number(scene, setting.path);
    if (!number || setting.factor == 0.0) continue;
    const double scene_value = *number / setting.factor;
    const double distance = distance_in_spreads(distribution, distribution.centre, scene_value);
    if (distance <= max_centre_distance) continue;
    warnings.push_back(
        fmt::format("the centre of input \"{}\" is {}, {:.3g} spreads from the value {} in the "
                    "scene: the machine of the study differs from that of the scene",
                    input.name, value_text(input, distribution.centre), distance,
                    value_text(input, scene_value)));
    return;
  }
}

/// Returns the error element that an input changes, such as "EC0Y"; empty if it changes none.
std::string changed_element(const Input& input) {
  if (!input.element.empty()) return input.element;
  if (!input.number.empty()) return errors::identification::coefficient_element(input.number);
  if (input.settings.empty()) return {};
  const std::string path = path_without_indices(input.settings.front().path), root = "errors.";
  if (!path.starts_with(root)) return {};
  const std::string name = path.substr(root.size(), path.find('.', root.size()) - root.size());
  return std::string(key_without_unit(name));
}

/// Adds warnings about elements of which both the factor and a coefficient are inputs, so that
/// their error counts twice.
void add_shared_element_warnings(const Study& study, std::vector<std::string>& warnings) {
  std::map<std::string, std::string> factors;
  for (const Input& input : study.inputs)
    if (!input.element.empty()) factors.emplace(input.element, input.name);
  for (const Input& input : study.inputs) {
    if (!input.element.empty()) continue;
    const auto factor = factors.find(changed_element(input));
    if (factor != factors.end())
      warnings.push_back(
          fmt::format("inputs \"{}\" and \"{}\" both change {}: its error counts twice", input.name,
                      factor->second, factor->first));
  }
}

void add_sweep_warning(const Study& study, const Sweep& sweep, std::vector<std::string>& warnings) {
  const Input& input = study.inputs[std::size_t(sweep.input)];
  const Distribution& distribution = input.distribution;
  double farthest = distribution.centre;
  for (const double value : sweep.values)
    if (distance_in_spreads(distribution, distribution.centre, value) >
        distance_in_spreads(distribution, distribution.centre, farthest))
      farthest = value;
  if (distance_in_spreads(distribution, distribution.centre, farthest) > max_sweep_distance)
    warnings.push_back(
        fmt::format("the sweep of input \"{}\" goes to {}, {:.3g} spreads from its centre {}: "
                    "sweep values are values of the input, not differences",
                    input.name, value_text(input, farthest),
                    distance_in_spreads(distribution, distribution.centre, farthest),
                    value_text(input, distribution.centre)));
}

}  // namespace

std::vector<std::string> study_warnings(const Study& study, const Scene& scene) {
  std::vector<std::string> warnings;
  for (const Input& input : study.inputs) {
    if (!is_in_belief(input.number, study, scene)) add_spread_warnings(input, warnings);
    add_centre_warning(input, scene, warnings);
  }
  add_shared_element_warnings(study, warnings);
  for (const Sweep& sweep : study.sweeps) add_sweep_warning(study, sweep, warnings);
  // The text was written from the study that was read, so its lines are not those of the file.
  for (std::string& text : value_warnings(parse_toml(study.text, "")))
    warnings.push_back(std::move(text));
  if (study.monte_carlo && study.monte_carlo->cases < min_cases_for_quantiles)
    warnings.push_back(
        fmt::format("monte_carlo.cases is {}: with fewer than {} machines P95 and P99 depend on "
                    "only a few of them",
                    study.monte_carlo->cases, min_cases_for_quantiles));
  return warnings;
}

namespace {

/// Returns true if the commands of the control depend on the input.
bool changes_commands(const Input& input) {
  return std::any_of(input.settings.begin(), input.settings.end(), [](const Setting& setting) {
    for (const char* key : {"datum", "control", "belief", "compensation", "signals"})
      if (setting.path.starts_with(key)) return true;
    return false;
  });
}

bool commands_depend_on_inputs(const Study& study, const Configuration& arm, const Scene& scene) {
  if (scene.datum.kind != DatumDescription::Kind::None) return true;
  if (std::any_of(study.inputs.begin(), study.inputs.end(), changes_commands)) return true;
  if (arm.case_name == "uncompensated") return false;
  // Any belief other than an identified one is made from readings of the actual machine.
  const CaseDescription compensator = parse_case(arm.case_name);
  return !compensator.plug_in.empty() || compensator.belief != CaseDescription::Belief::Identified;
}

/// Returns true if larger values of the input need denser samples of the program.
bool needs_samples(const Input& input) {
  return input.settings.empty() ||
         std::any_of(input.settings.begin(), input.settings.end(), [](const Setting& setting) {
           return setting.path.starts_with("errors.") || setting.path.starts_with("vibration");
         });
}

/// Returns the values of the inputs that need the densest sampling. Inputs with `needs_samples` are
/// at the extreme of their sweeps or at 6 standard deviations, which 2 of 10^9 machines exceed; the
/// others are at their centres.
Eigen::VectorXd extreme_inputs(const Study& study) {
  constexpr double max_score = 6.0;
  Eigen::VectorXd x = centre(study);
  const auto extend = [&](Eigen::Index input, double value) {
    if (std::abs(value) > std::abs(x[input])) x[input] = value;
  };
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const Input& input = study.inputs[std::size_t(i)];
    if (!needs_samples(input)) continue;
    for (const double score : {-max_score, max_score})
      extend(i, value_at_score(input.distribution, score));
    for (const Sweep& sweep : study.sweeps)
      if (sweep.input == i)
        for (const double value : sweep.values) extend(i, value);
  }
  return x;
}

/// Returns the scene whose errors need the densest samples; none if that machine is not valid.
std::optional<Scene> extreme_scene(const Study& study, const Configuration& arm,
                                   const Scene& base) {
  try {
    return with_run_out(scene_at(study, arm, base, extreme_inputs(study)));
  } catch (const BadScene&) {
    return std::nullopt;
  } catch (const BadInput&) {
    return std::nullopt;
  }
}

/// Returns the job with all inputs at their centres, sampled densely enough for all their values.
/// All machines have the same sampling, so that their samples are comparable and none is compiled
/// anew.
Job prepare_job(const Study& study, const Configuration& arm, const Scene& base,
                const Progress& progress) {
  const Scene scene = with_run_out(scene_at(study, arm, base, centre(study)));
  const std::optional<Scene> extreme = extreme_scene(study, arm, base);
  if (!extreme) return prepare(scene, progress);
  const program::SampleOptions centre_sampling = sample_options(scene, make_machine(scene));
  const program::SampleOptions extreme_sampling = sample_options(*extreme, make_machine(*extreme));
  const bool is_denser =
      extreme_sampling.max_spindle_turn < centre_sampling.max_spindle_turn ||
      extreme_sampling.max_tool_spindle_turn != centre_sampling.max_tool_spindle_turn;
  return is_denser ? replace_errors(prepare(*extreme, progress), scene) : prepare(scene, progress);
}

/// The figures of a map.
struct MapFigures {
  cutting::Statistics residual;
  std::optional<FormTextureSplit> form_texture;  ///< only if a response needs the filter
};

double response_value(const MapFigures& figures, Response response) {
  const cutting::Statistics& residual = figures.residual;
  const auto form_value = [&](std::optional<double> cutting::Statistics::*figure) {
    return figures.form_texture ? (figures.form_texture->form_statistics.*figure).value_or(none)
                                : none;
  };
  const auto texture_value = [&](double errors::metrology::ArealParameters::*figure) {
    const bool has_texture = figures.form_texture && figures.form_texture->texture;
    return has_texture ? (*figures.form_texture->texture).*figure : none;
  };
  switch (response) {
    case Response::Pv:
      return residual.pv.value_or(none);
    case Response::Rms:
      return residual.rms.value_or(none);
    case Response::Mean:
      return residual.mean.value_or(none);
    case Response::Std:
      return residual.std_dev.value_or(none);
    case Response::MaxAbs:
      return residual.max ? std::max(std::abs(*residual.min), std::abs(*residual.max)) : none;
    case Response::P95Abs:
      return residual.p95_abs.value_or(none);
    case Response::InTolerance:
      return residual.conformance ? residual.conformance->in : none;
    case Response::FormPv:
      return form_value(&cutting::Statistics::pv);
    case Response::FormRms:
      return form_value(&cutting::Statistics::rms);
    case Response::TextureSa:
      return texture_value(&errors::metrology::ArealParameters::Sa);
    case Response::TextureSq:
      return texture_value(&errors::metrology::ArealParameters::Sq);
    case Response::TextureSz:
      return texture_value(&errors::metrology::ArealParameters::Sz);
  }
  return none;
}

}  // namespace

Commands commands(const Configuration& arm, const Job& job) {
  return arm.case_name == "uncompensated" ? uncompensated_commands(job)
                                          : compensate(job, parse_case(arm.case_name));
}

namespace {

bool needs_filter(const Study& study) {
  return std::any_of(study.responses.begin(), study.responses.end(), is_filtered);
}

/// Returns the warning about vertices that do not resolve form and texture with all inputs at their
/// centres; empty if they do.
std::string unresolved_texture_text(const PreparedConfiguration& ready) {
  // Fraction of Sq that interpolation may miss. Added in squares it changes Sq by 0.1 %.
  constexpr double max_unresolved_fraction = 0.05;
  Job sampled_job = ready.job;
  // With a sampled surface the cut compares the map with points between the vertices.
  sampled_job.sampled = SampledSurface{};
  sampled_job.sampled->given = sampled_job.design_w.vertices.rows();
  const Cut map_cut = cut(sampled_job, ready.commanded);
  const FormTextureSplit form_texture = split_form_texture(ready.job, map_cut.surface, {});
  if (!map_cut.interpolation || map_cut.interpolation->places == 0 || !form_texture.texture)
    return {};
  const double unresolved_rms = map_cut.interpolation->rms, Sq = form_texture.texture->Sq;
  if (unresolved_rms <= max_unresolved_fraction * Sq) return {};
  const auto vertex_count = double(ready.job.design_w.vertices.rows());
  const double area = ready.job.design_w.area.sum(), spacing = std::sqrt(area / vertex_count);
  // The unresolved part averages out over the vertices in the area of the filter, at least one, as
  // independent values do.
  const double form_error =
      unresolved_rms /
      std::sqrt(std::max(1.0, cutting::effective_value_count(ready.job.scene.part.form_cutoff,
                                                             vertex_count / area)));
  return fmt::format(
      "form and texture are evaluated at the {} vertices of the part, about {:.3g} mm apart: "
      "between them the surface of {} deviates by {:.3g} um RMS from linear interpolation ({:.3g} "
      "um at most), and texture has Sq {:.3g} um: texture figures are not resolved, and form "
      "figures have a random error of about {:.2g} um; increase part.vertices",
      ready.job.design_w.vertices.rows(), spacing, ready.arm.name, unresolved_rms / units::um,
      map_cut.interpolation->worst / units::um, Sq / units::um, form_error / units::um);
}

}  // namespace

PreparedConfiguration prepare_configuration(const Study& study, const Configuration& arm,
                                            const Progress& progress) {
  Scene scene = base_scene(study, arm);
  Job job = check_placement(prepare_job(study, arm, scene, progress));
  Commands commanded = commands(arm, job);
  const bool is_commanded_for_each = commands_depend_on_inputs(study, arm, scene);
  cutting::Surface error_free;
  if (study.subtracts_error_free_map) error_free = cut_error_free(job, progress).surface;
  PreparedConfiguration ready{arm,
                              std::move(scene),
                              std::move(job),
                              std::move(commanded),
                              is_commanded_for_each,
                              std::move(error_free)};
  if (needs_filter(study))
    if (const std::string text = unresolved_texture_text(ready); !text.empty())
      ready.job.warnings.push_back(text);
  for (std::string& text : study_warnings(study, ready.scene))
    ready.job.warnings.push_back(std::move(text));
  return ready;
}

CutCase cut_at(const Study& study, const PreparedConfiguration& ready, Job job,
               const Eigen::VectorXd& x) {
  const Scene scene = scene_at(study, ready.arm, ready.scene, x);
  // A change of part, program or nominal machine needs a job of its own.
  if (std::any_of(study.inputs.begin(), study.inputs.end(), is_reshaping)) {
    const Job case_job = prepare(scene);
    Cut case_cut = cut(case_job, commands(ready.arm, case_job));
    cutting::Surface error_free;
    if (study.subtracts_error_free_map) error_free = cut_error_free(case_job).surface;
    Eigen::VectorXd values = responses(study, case_job, case_cut.surface, error_free);
    return {std::move(job), std::move(case_cut.surface), std::move(values)};
  }
  job = replace_errors(std::move(job), scene);
  Cut case_cut = ready.needs_commands_per_case ? cut(job, commands(ready.arm, job))
                                               : cut(job, ready.commanded);
  Eigen::VectorXd values = responses(study, job, case_cut.surface, ready.error_free);
  return {std::move(job), std::move(case_cut.surface), std::move(values)};
}

Eigen::VectorXd responses(const Study& study, const Job& job, const cutting::Surface& surface,
                          const cutting::Surface& error_free) {
  const auto align = [&](const cutting::Surface& map) {
    return cutting::aligned(map, job.design_w, {job.scene.alignment}).surface;
  };
  cutting::Surface judged = align(surface);
  if (study.subtracts_error_free_map) judged = cutting::minus(judged, align(error_free));
  MapFigures figures{
      cutting::statistics(judged, job.design_w,
                          tolerance_bands(job.scene.part, job.face_groups, job.design_w)),
      {}};
  if (needs_filter(study)) figures.form_texture = split_form_texture(job, judged, {});
  Eigen::VectorXd values(Eigen::Index(study.responses.size()));
  for (std::size_t i = 0; i < study.responses.size(); ++i)
    values[Eigen::Index(i)] = response_value(figures, study.responses[i]);
  return values;
}

}  // namespace abbe::sim::study
