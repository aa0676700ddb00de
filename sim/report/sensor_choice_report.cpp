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

/// Return the names of measures, images and screenings as the scene has them.
const char* word_of(const identification::SensorChoiceOptions& choice) {
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

const char* word_of(identification::Image image) {
  using identification::Image;
  return image == Image::Initial    ? "initial"
         : image == Image::Mean     ? "mean"
         : image == Image::Interval ? "interval"
                                    : "none";
}

const char* word_of(identification::Screening screening) {
  return screening == identification::Screening::Degree ? "degree" : "regression";
}

/// Returns the settings of a method; those that its measure does not use are null.
Json method_json(const SensorChoiceGrade& graded) {
  const SensorChoiceDescription::Way& way = graded.way;
  const identification::SensorChoiceOptions& how = way.choice;
  if (!how.fixed.empty()) return {{"fixed", true}};
  const bool deng = how.similarity_measure == identification::SimilarityMeasure::Grey &&
                    how.grey.kind == identification::GreyKind::Deng;
  return {{"likeness", word_of(how)},
          {"image", deng ? Json(word_of(how.grey.image)) : Json(nullptr)},
          {"screening", word_of(how.screening)},
          {"temperatures", graded.since_start ? "since the start of the day" : "as read, C"},
          {"for", way.drifts.empty() ? Json("all displacements") : Json(way.drifts)}};
}

/// Returns the start of the degree's computation for each displacement; null for excluded ones.
Json start_times_json(const std::vector<DegreeStart>& begins) {
  Json json = Json::object();
  for (const DegreeStart& one : begins)
    json[one.channel] = one.at ? Json{{"row", one.at->row},
                                      {"h", one.at->since_start_s / 3600.0},
                                      {"drift_um", one.at->drift / units::um}}
                               : Json(nullptr);
  return json;
}

std::vector<std::string> names_of(const std::vector<int>& inputs,
                                  const std::vector<std::string>& names) {
  std::vector<std::string> result;
  for (const int i : inputs) result.push_back(names[std::size_t(i)]);
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

/// Returns the drift that the model leaves on days that were not used for training.
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

/// Returns a displacement or tilt. Channels without a model have only their name and range.
Json channel_json(const ChannelGrade& channel, bool with_model) {
  const double unit = channel.angle ? units::urad : units::um;
  Json json{{"name", channel.name}, {"unit", channel.angle ? "urad" : "um"}};
  if (with_model) json["training_range"] = channel.training_range / unit;
  if (!channel.fitted.model) return json;
  if (with_model) json["model"] = model_json(channel.fitted, unit);
  json["in_cycle"] = spread_json(channel.in_cycle, unit);
  json["cross_day"] = other_days_json(channel.other_days, unit);
  return json;
}

Json channels_json(const SensorChoiceGrade& way, bool with_models) {
  Json list = Json::array();
  for (const ChannelGrade& one : way.channels) list.push_back(channel_json(one, with_models));
  return list;
}

/// Returns the results of random choices, against which a choice is judged.
Json random_json(const identification::RandomChoices& random, double chosen) {
  return {{"subsets", random.rms_over_range.size()},
          {"p05", random.p05},
          {"p25", random.p25},
          {"p50", random.p50},
          {"p75", random.p75},
          {"p95", random.p95},
          {"chosen", chosen},
          {"beaten_by_the_choice", random.fraction_beaten}};
}

/// Returns the dependence of a choice on its start and on noise.
Json spread_json(const SensorChoiceGrade& way, const std::vector<std::string>& sensors) {
  if (!way.spread) return nullptr;
  const identification::ChoiceSpread& spread = *way.spread;
  Json chosen = Json::object(), ranks = Json::object();
  for (std::size_t i = 0; i < sensors.size(); ++i) {
    chosen[sensors[i]] = 100.0 * spread.chosen[Index(i)];
    ranks[sensors[i]] =
        spread.best_rank[i] > 0 ? Json{spread.best_rank[i], spread.worst_rank[i]} : Json(nullptr);
  }
  return {{"draws", spread.draws},
          {"start_rows", {0, spread.last_start}},
          {"same_sensors_percent", 100.0 * spread.same},
          {"chosen_percent", chosen},
          {"rank_from_to", ranks}};
}

/// Returns a method with its choice, and the figures of its channels without their models.
Json strategy_json(const SensorChoiceGrade& way, const std::vector<std::string>& sensors) {
  Json json{{"name", name_of(way.way)}, {"method", method_json(way)}};
  if (way.begins) json["method"]["begins"] = start_times_json(*way.begins);
  json["chosen"] = way.chosen;
  json["degree"] = choice_json(way.choice, sensors)["degree"];
  json["channels"] = channels_json(way, false);
  json["rms_over_range"] = way.rms_over_range ? Json(*way.rms_over_range) : Json(nullptr);
  json["spread"] = spread_json(way, sensors);
  json["random_choices_rms_over_range"] =
      way.random ? random_json(*way.random, *way.rms_over_range) : Json(nullptr);
  return json;
}

}  // namespace

Json to_json(const ThermalChoice& choice) {
  const SensorChoiceGrade& own = choice.ways.front();
  Json json{
      {"training_day", choice.training_day}, {"rows", choice.rows}, {"sensors", choice.sensors}};
  json.update(choice_json(own.choice, choice.sensors));
  json["standing_still"] = names_of(own.choice.still, choice.sensors);
  json["chosen"] = own.chosen;
  if (own.random)
    json["random_choices_rms_over_range"] = random_json(*own.random, *own.rms_over_range);
  json["channels"] = channels_json(own, true);
  json["warnings"] = choice.warnings;
  json["choices"] = Json::array();
  for (const SensorChoiceGrade& way : choice.ways)
    json["choices"].push_back(strategy_json(way, choice.sensors));
  return json;
}

Json choice_json(const identification::SensorChoice& choice,
                 const std::vector<std::string>& sensors) {
  Json degree = Json::object(), groups = Json::array();
  for (const int i : identification::ranking(choice.degree))
    degree[sensors[std::size_t(i)]] = choice.degree[i];
  for (const auto& group : choice.groups) groups.push_back(names_of(group, sensors));
  return {{"degree", degree}, {"threshold", choice.threshold}, {"groups", groups}};
}

std::string name_of(const SensorChoiceDescription::Way& way) {
  if (!way.name.empty()) return way.name;
  return fmt::format("{}, {} screening", word_of(way.choice), word_of(way.choice.screening));
}

namespace {

/// Returns the start of a displacement's degree: a drift within noise has none.
std::string start_time_text(const DegreeStart& begin) {
  if (!begin.at)
    return fmt::format("    {} takes no part: it drifts within its noise\n",
                       escaped(begin.channel));
  return fmt::format(
      "    degrees with {} begin at {:.3f} h, its first drift beyond noise, {:.2f} um\n",
      escaped(begin.channel), begin.at->since_start_s / 3600.0, begin.at->drift / units::um);
}

/// Returns the result for a displacement; empty for a tilt or if no model could be fitted.
std::string displacement_text(const ChannelGrade& channel) {
  if (!channel.fitted.model || channel.angle) return "";
  std::string text = fmt::format("    {}: {:.3f} um on the day that chose", escaped(channel.name),
                                 channel.in_cycle.rms / units::um);
  for (const DayGrade& day : channel.other_days)
    text += fmt::format(", {:.3f} of {:.1f} um on {}", day.left.rms / units::um,
                        day.drift_range / units::um, escaped(day.day));
  return text + "\n";
}

/// Returns "8 (100 %, rank 1 to 2), 12 (64 %, rank 2 to 5)" for sensors chosen in at least a tenth
/// of the draws.
std::string spread_text(const SensorChoiceGrade& way, const std::vector<std::string>& sensors) {
  constexpr double seldom = 0.1;
  if (!way.spread || way.spread->draws == 0) return "";
  const errors::identification::ChoiceSpread& spread = *way.spread;
  std::string text;
  for (const int i : errors::identification::ranking(spread.chosen)) {
    if (spread.chosen[i] < seldom) break;
    text += fmt::format("{}{} {:.0f} %", text.empty() ? "" : ", ", escaped(sensors[std::size_t(i)]),
                        100.0 * spread.chosen[i]);
    if (const int best = spread.best_rank[std::size_t(i)],
        worst = spread.worst_rank[std::size_t(i)];
        best > 0)
      text += best == worst ? fmt::format(" (degree {}.)", best)
                            : fmt::format(" (degree {}. to {}.)", best, worst);
  }
  return fmt::format(
      "    over start rows 0 to {} and noise, {} draws: {}; the same sensors in {:.0f} %\n",
      spread.last_start, spread.draws, text, 100.0 * spread.same);
}

/// Returns the results of one method.
std::string strategy_text(const SensorChoiceGrade& way, const std::vector<std::string>& sensors) {
  std::string chosen;
  for (const std::string& name : way.chosen) chosen += (chosen.empty() ? "" : ", ") + escaped(name);
  std::string text = fmt::format("  {}: {}\n", escaped(name_of(way.way)), chosen);
  if (way.begins)
    for (const DegreeStart& begin : *way.begins) text += start_time_text(begin);
  text += spread_text(way, sensors);
  for (const ChannelGrade& channel : way.channels) text += displacement_text(channel);
  if (way.rms_over_range)
    text += fmt::format("    together {:.1f} % of the range of days unseen\n",
                        100.0 * *way.rms_over_range);
  if (way.random)
    text += fmt::format(
        "    random choices of {}: {:.1f} % (median; 5 % of them below {:.1f}, 5 % above {:.1f}), "
        "{:.0f} % are worse than this choice\n",
        way.chosen.size(), 100.0 * way.random->p50, 100.0 * way.random->p05,
        100.0 * way.random->p95, 100.0 * way.random->fraction_beaten);
  return text;
}

}  // namespace

std::string sensor_choices_text(const ThermalChoice& choice) {
  std::string text = "\nsensors chosen, and RMS of the drift that their model leaves\n";
  for (const SensorChoiceGrade& way : choice.ways) text += strategy_text(way, choice.sensors);
  for (const std::string& warning : choice.warnings)
    text += "  warning: " + escaped(warning) + "\n";
  return text;
}

#if ABBE_RENDER
void write_thermal_picture(const ResultFile& file, const ThermalChoice& choice) {
  std::vector<render::Panel> panels;
  std::size_t days = 1;
  for (const DriftSeries& one : choice.series) {
    const double unit = one.angle ? units::urad : units::um;
    const bool training = one.day == choice.series.front().day;
    // One column per day: the channels repeat from the first one on.
    if (one.channel == choice.series.front().channel && !training) ++days;
    const double rms =
        std::sqrt((one.read - one.predicted).squaredNorm() / double(one.read.size())) / unit;
    panels.push_back(
        {fmt::format("{} on {} ({})", one.channel, one.day, training ? "trained" : "never seen"),
         "time / h",
         one.angle ? "drift / µrad" : "drift / µm",
         {{"read", one.hours, one.read / unit, {}, {}, render::Mark::Line, 1},
          {"predicted", one.hours, one.predicted / unit, {}, {}, render::Mark::Line, 0}},
         {fmt::format("RMS {:.2f} {}", rms, one.angle ? "µrad" : "µm")}});
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
void write_thermal_picture(const ResultFile&, const ThermalChoice&) {}
#endif

}  // namespace abbe::sim
