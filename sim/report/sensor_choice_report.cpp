#include "sim/report/sensor_choice_report.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/files/output.h"

#if ABBE_RENDER
#include "render/plot.h"
#endif

namespace abbe::sim {

namespace {

namespace identification = errors::identification;
using Eigen::Index;
using Json = nlohmann::ordered_json;

/// Return the names of measures, images and screenings in a scene file.
const char* enum_value(const identification::SensorChoiceOptions& choice) {
  using identification::GreyKind;
  if (choice.similarity_measure == identification::SimilarityMeasure::Correlation)
    return "correlation";
  switch (choice.grey.kind) {
    case GreyKind::Deng:
      return "deng";
    case GreyKind::Absolute:
      return "absolute";
    case GreyKind::Relative:
      return "relative";
    case GreyKind::Comprehensive:
      return "comprehensive";
  }
  return "";
}

const char* enum_value(identification::Image image) {
  using identification::Image;
  return image == Image::Initial    ? "initial"
         : image == Image::Mean     ? "mean"
         : image == Image::Interval ? "interval"
                                    : "none";
}

const char* enum_value(identification::Screening screening) {
  return screening == identification::Screening::Degree ? "degree" : "regression";
}

/// Returns the settings of a method. Settings that its measure does not use are null.
Json method_json(const SensorChoiceGrade& grade) {
  const SensorChoiceDescription::SelectionMethod& method = grade.way;
  const identification::SensorChoiceOptions& options = method.choice;
  if (!options.fixed.empty()) return {{"fixed", true}};
  const bool is_deng = options.similarity_measure == identification::SimilarityMeasure::Grey &&
                       options.grey.kind == identification::GreyKind::Deng;
  return {{"likeness", enum_value(options)},
          {"image", is_deng ? Json(enum_value(options.grey.image)) : Json(nullptr)},
          {"screening", enum_value(options.screening)},
          {"temperatures", grade.since_start ? "since the start of the day" : "readings, C"},
          {"for", method.drifts.empty() ? Json("all displacements") : Json(method.drifts)}};
}

/// Returns the start of each displacement's degree; null for excluded displacements.
Json start_times_json(const std::vector<DegreeStart>& starts) {
  Json json = Json::object();
  for (const DegreeStart& start : starts)
    json[start.channel] = start.at ? Json{{"row", start.at->row},
                                          {"h", start.at->since_start_s / 3600.0},
                                          {"drift_um", start.at->drift / units::um}}
                                   : Json(nullptr);
  return json;
}

std::vector<std::string> selected_names(const std::vector<int>& indices,
                                        const std::vector<std::string>& names) {
  std::vector<std::string> result;
  for (const int i : indices) result.push_back(names[std::size_t(i)]);
  return result;
}

Json spread_json(const identification::Spread& spread, double unit) {
  return {{"rms", spread.rms / unit}, {"max", spread.max / unit}};
}

/// Returns the coefficients of a model; null if it is not a regression.
Json model_json(const identification::ThermalFit& fitted, double unit) {
  if (!fitted.regression) return nullptr;
  const identification::Regression& regression = *fitted.regression;
  Json json{{"constant", regression.constant / unit}};
  for (std::size_t k = 0; k < fitted.model->names.size(); ++k)
    json[fitted.model->names[k]] = {
        {"per_K", regression.beta[Index(k)] / unit},
        {"standard_error", regression.standard_error[Index(k) + 1] / unit},
        {"vif", regression.vif[Index(k)]}};
  json["r_squared"] = regression.r_squared;
  return json;
}

/// Returns the residual drift on days that were not used for training.
Json other_days_json(const std::vector<DayGrade>& days, double unit) {
  Json list = Json::array();
  for (const DayGrade& day : days) {
    Json figures = spread_json(day.left, unit);
    figures["drift_range"] = day.drift_range / unit;
    figures["rms_over_range"] =
        day.drift_range > 0.0 ? Json(day.left.rms / day.drift_range) : Json(nullptr);
    figures["rows"] = day.rows;
    figures["rows_outside_trained_range"] = day.outside;
    list.push_back({{"day", day.day}, {"figures", figures}});
  }
  return list;
}

/// Returns the results of a displacement or tilt. A channel without a model has only name and
/// range.
Json channel_json(const ChannelGrade& channel, bool with_model) {
  const double unit = channel.angle ? units::urad : units::um;
  Json json{{"name", channel.name}, {"unit", channel.angle ? "urad" : "um"}};
  if (with_model) json["training_range"] = channel.training_range / unit;
  if (!channel.fitted.model) return json;
  if (with_model) json["model"] = model_json(channel.fitted, unit);
  json["in_cycle"] = spread_json(channel.training_residual, unit);
  json["cross_day"] = other_days_json(channel.other_days, unit);
  return json;
}

/// Returns all displacements and tilts.
/// @param with_models  true: with the coefficients of their models
Json channels_json(const SensorChoiceGrade& grade, bool with_models) {
  Json list = Json::array();
  for (const ChannelGrade& channel : grade.channels)
    list.push_back(channel_json(channel, with_models));
  return list;
}

/// Returns the results of random choices, with which a choice is compared.
Json random_json(const identification::RandomChoices& random, double choice_result) {
  return {{"subsets", random.rms_over_range.size()},
          {"p05", random.p05},
          {"p25", random.p25},
          {"p50", random.p50},
          {"p75", random.p75},
          {"p95", random.p95},
          {"chosen", choice_result},
          {"beaten_by_the_choice", random.fraction_beaten}};
}

/// Returns the dependence of a choice on its start row and on noise.
Json choice_spread_json(const SensorChoiceGrade& grade, const std::vector<std::string>& sensors) {
  if (!grade.spread) return nullptr;
  const identification::ChoiceSpread& spread = *grade.spread;
  Json chosen = Json::object(), ranks = Json::object();
  for (std::size_t i = 0; i < sensors.size(); ++i) {
    chosen[sensors[i]] = 100.0 * spread.chosen[Index(i)];
    ranks[sensors[i]] =
        spread.best_rank[i] > 0 ? Json{spread.best_rank[i], spread.worst_rank[i]} : Json(nullptr);
  }
  return {{"draws", spread.draws},
          {"start_rows", {0, spread.last_start}},
          {"same_sensors_percent", 100.0 * spread.same_fraction},
          {"chosen_percent", chosen},
          {"rank_from_to", ranks}};
}

/// Returns a method with its choice and the figures of its channels, without their models.
Json strategy_json(const SensorChoiceGrade& grade, const std::vector<std::string>& sensors) {
  Json json{{"name", name_of(grade.way)}, {"method", method_json(grade)}};
  if (grade.begins) json["method"]["begins"] = start_times_json(*grade.begins);
  json["chosen"] = grade.chosen;
  json["degree"] = choice_json(grade.choice, sensors)["degree"];
  json["channels"] = channels_json(grade, false);
  json["rms_over_range"] = grade.rms_over_range ? Json(*grade.rms_over_range) : Json(nullptr);
  json["spread"] = choice_spread_json(grade, sensors);
  json["random_choices_rms_over_range"] =
      grade.random ? random_json(*grade.random, *grade.rms_over_range) : Json(nullptr);
  return json;
}

}  // namespace

Json to_json(const ThermalSensorChoice& choice) {
  const SensorChoiceGrade& first_grade = choice.ways.front();
  Json json{
      {"training_day", choice.training_day}, {"rows", choice.rows}, {"sensors", choice.sensors}};
  json.update(choice_json(first_grade.choice, choice.sensors));
  json["standing_still"] = selected_names(first_grade.choice.constant_inputs, choice.sensors);
  json["chosen"] = first_grade.chosen;
  if (first_grade.random)
    json["random_choices_rms_over_range"] =
        random_json(*first_grade.random, *first_grade.rms_over_range);
  json["channels"] = channels_json(first_grade, true);
  json["warnings"] = choice.warnings;
  json["choices"] = Json::array();
  for (const SensorChoiceGrade& grade : choice.ways)
    json["choices"].push_back(strategy_json(grade, choice.sensors));
  return json;
}

Json choice_json(const identification::SensorChoice& choice,
                 const std::vector<std::string>& sensors) {
  Json degree = Json::object(), groups = Json::array();
  for (const int i : identification::ranking(choice.degree))
    degree[sensors[std::size_t(i)]] = choice.degree[i];
  for (const auto& group : choice.groups) groups.push_back(selected_names(group, sensors));
  return {{"degree", degree}, {"threshold", choice.threshold}, {"groups", groups}};
}

std::string name_of(const SensorChoiceDescription::SelectionMethod& method) {
  if (!method.name.empty()) return method.name;
  return fmt::format("{}, {} screening", enum_value(method.choice),
                     enum_value(method.choice.screening));
}

namespace {

/// Returns the start of a displacement's degree. A displacement that drifts within its noise is
/// excluded.
std::string start_time_text(const DegreeStart& start) {
  if (!start.at)
    return fmt::format("    {} is not used: its drift is within its noise\n",
                       escaped(start.channel));
  return fmt::format(
      "    degrees with {} start at {:.3f} h, its first drift above noise, {:.2f} um\n",
      escaped(start.channel), start.at->since_start_s / 3600.0, start.at->drift / units::um);
}

/// Returns the result for a displacement; empty for a tilt, or if no model could be fitted.
std::string displacement_text(const ChannelGrade& channel) {
  if (!channel.fitted.model || channel.angle) return "";
  std::string text = fmt::format("    {}: {:.3f} um on the training day", escaped(channel.name),
                                 channel.training_residual.rms / units::um);
  for (const DayGrade& day : channel.other_days)
    text += fmt::format(", {:.3f} of {:.1f} um on {}", day.left.rms / units::um,
                        day.drift_range / units::um, escaped(day.day));
  return text + "\n";
}

/// Returns how often the sensors were chosen, and their ranks by degree, for all sensors chosen in
/// at least a tenth of the draws.
std::string spread_text(const SensorChoiceGrade& grade, const std::vector<std::string>& sensors) {
  constexpr double min_fraction = 0.1;
  if (!grade.spread || grade.spread->draws == 0) return "";
  const errors::identification::ChoiceSpread& spread = *grade.spread;
  std::string text;
  for (const int i : errors::identification::ranking(spread.chosen)) {
    if (spread.chosen[i] < min_fraction) break;
    text += fmt::format("{}{} {:.0f} %", text.empty() ? "" : ", ", escaped(sensors[std::size_t(i)]),
                        100.0 * spread.chosen[i]);
    if (const int best = spread.best_rank[std::size_t(i)],
        worst = spread.worst_rank[std::size_t(i)];
        best > 0)
      text += best == worst ? fmt::format(" (rank by degree {})", best)
                            : fmt::format(" (rank by degree {} to {})", best, worst);
  }
  return fmt::format(
      "    over start rows 0 to {} and noise, {} draws: {}; identical choice in {:.0f} %\n",
      spread.last_start, spread.draws, text, 100.0 * spread.same_fraction);
}

/// Returns the results of one method.
std::string strategy_text(const SensorChoiceGrade& grade, const std::vector<std::string>& sensors) {
  std::string chosen;
  for (const std::string& name : grade.chosen)
    chosen += (chosen.empty() ? "" : ", ") + escaped(name);
  std::string text = fmt::format("  {}: {}\n", escaped(name_of(grade.way)), chosen);
  if (grade.begins)
    for (const DegreeStart& begin : *grade.begins) text += start_time_text(begin);
  text += spread_text(grade, sensors);
  for (const ChannelGrade& channel : grade.channels) text += displacement_text(channel);
  if (grade.rms_over_range)
    text += fmt::format("    in total {:.1f} % of the range of the other days\n",
                        100.0 * *grade.rms_over_range);
  if (grade.random)
    text += fmt::format(
        "    random choices of {}: {:.1f} % (median; 5 % of them below {:.1f}, 5 % above {:.1f}), "
        "{:.0f} % are worse than this choice\n",
        grade.chosen.size(), 100.0 * grade.random->p50, 100.0 * grade.random->p05,
        100.0 * grade.random->p95, 100.0 * grade.random->fraction_beaten);
  return text;
}

}  // namespace

std::string sensor_choices_text(const ThermalSensorChoice& choice) {
  std::string text = "\nchosen sensors, and RMS of the remaining drift\n";
  for (const SensorChoiceGrade& grade : choice.ways) text += strategy_text(grade, choice.sensors);
  for (const std::string& warning : choice.warnings)
    text += "  warning: " + escaped(warning) + "\n";
  return text;
}

#if ABBE_RENDER
void write_thermal_picture(const ResultFile& file, const ThermalSensorChoice& choice) {
  std::vector<render::Panel> panels;
  std::size_t days = 1;
  for (const DriftSeries& drift : choice.series) {
    const double unit = drift.angle ? units::urad : units::um;
    const bool is_training = drift.day == choice.series.front().day;
    // Each day has a column of panels; it begins with the first channel.
    if (drift.channel == choice.series.front().channel && !is_training) ++days;
    const double rms =
        std::sqrt((drift.read - drift.predicted).squaredNorm() / double(drift.read.size())) / unit;
    panels.push_back(
        {fmt::format("{} on {} ({})", drift.channel, drift.day,
                     is_training ? "trained" : "not used in training"),
         "time / h",
         drift.angle ? "drift / µrad" : "drift / µm",
         {{"read", drift.hours, drift.read / unit, {}, {}, render::CurveStyle::Line, 1},
          {"predicted", drift.hours, drift.predicted / unit, {}, {}, render::CurveStyle::Line, 0}},
         {fmt::format("RMS {:.2f} {}", rms, drift.angle ? "µrad" : "µm")}});
  }
  if (panels.empty()) return;
  std::string chosen;
  for (const std::string& name : choice.ways.front().chosen)
    chosen += (chosen.empty() ? "" : ", ") + name;
  render::CurvesOptions options;
  options.title = "drift predicted from " + chosen;
  options.columns = int(days);
  options.width = days > 1 ? 2400 : 1600;
  write_file(file, [&](const std::filesystem::path& temporary) {
    render::write_curves(temporary, panels, options);
  });
}
#else
void write_thermal_picture(const ResultFile&, const ThermalSensorChoice&) {}
#endif

}  // namespace abbe::sim
