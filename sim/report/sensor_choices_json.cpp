#include "sim/report/sensor_choices_json.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/units.h"

namespace abbe::sim {
namespace {

namespace identification = errors::identification;
using Eigen::Index;
using Json = nlohmann::ordered_json;

// ---- ways to choose

const char* word_of(const identification::SensorChoiceOptions& choice) {
  using identification::GreyKind;
  if (choice.likeness == identification::Likeness::Correlation) return "correlation";
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

Json method_json(const GradedWay& graded) {
  const SensorChoiceDescription::Way& way = graded.way;
  const identification::SensorChoiceOptions& how = way.choice;
  if (!how.fixed.empty()) return {{"fixed", true}};
  const bool deng = how.likeness == identification::Likeness::Grey &&
                    how.grey.kind == identification::GreyKind::Deng;
  return {{"likeness", word_of(how)},
          {"image", deng ? Json(word_of(how.grey.image)) : Json(nullptr)},
          {"screening", word_of(how.screening)},
          {"temperatures", graded.since_start ? "since the start of the day" : "as read, C"},
          {"for", way.drifts.empty() ? Json("all displacements") : Json(way.drifts)}};
}

/// Where the degree of each displacement began; those that it left out by null.
Json begins_json(const std::vector<DegreeStart>& begins) {
  Json json = Json::object();
  for (const DegreeStart& one : begins)
    json[one.channel] = one.at ? Json{{"row", one.at->row},
                                      {"h", one.at->since_start_s / 3600.0},
                                      {"drift_um", one.at->drift / units::um}}
                               : Json(nullptr);
  return json;
}

// ---- what they chose, and what that is worth

std::vector<std::string> names_of(const std::vector<int>& inputs,
                                  const std::vector<std::string>& names) {
  std::vector<std::string> result;
  for (const int i : inputs) result.push_back(names[std::size_t(i)]);
  return result;
}

Json spread_json(const identification::Spread& spread, double unit) {
  return {{"rms", spread.rms / unit}, {"max", spread.max / unit}};
}

/// Null of a model that is no regression.
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

Json channels_json(const GradedWay& way, bool with_models) {
  Json list = Json::array();
  for (const ChannelGrade& one : way.channels) list.push_back(channel_json(one, with_models));
  return list;
}

Json random_json(const identification::RandomChoices& random, double chosen) {
  return {{"subsets", random.rms_over_range.size()},
          {"p05", random.p05},
          {"p25", random.p25},
          {"p50", random.p50},
          {"p75", random.p75},
          {"p95", random.p95},
          {"chosen", chosen},
          {"beaten_by_the_choice", random.beaten}};
}

/// How far a choice depends on where it begins and on noise.
Json spread_json(const GradedWay& way, const std::vector<std::string>& sensors) {
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

/// A way with what it chose, and the figures of its channels without their models.
Json way_json(const GradedWay& way, const std::vector<std::string>& sensors) {
  Json json{{"name", name_of(way.way)}, {"method", method_json(way)}};
  if (way.begins) json["method"]["begins"] = begins_json(*way.begins);
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
  const GradedWay& own = choice.ways.front();
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
  for (const GradedWay& way : choice.ways) json["choices"].push_back(way_json(way, choice.sensors));
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

}  // namespace abbe::sim
