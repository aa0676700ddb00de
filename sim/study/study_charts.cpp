#include "sim/study/study_charts.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <stdexcept>

#include <fmt/format.h>

#include "sim/report/figures_page.h"
#include "sim/study/budget.h"
#include "sim/study/study_text.h"

namespace abbe::sim::study {

namespace {

using nlohmann::ordered_json;

// One panel per input; more panels would be too small to read.
constexpr std::size_t max_convergence_panels = 12;

std::string text_at(const ordered_json& json, const char* key) {
  return json.at(key).get<std::string>();
}

PageText response_label(const ordered_json& response) {
  return label_text("response_" + text_at(response, "response"));
}
std::string response_unit(const ordered_json& response) {
  return display_unit(text_at(response, "unit"));
}

std::string input_name(const ordered_json& input) { return one_line(text_at(input, "name")); }

/// Returns the unique id of a block.
/// @param configuration  its index
std::string block_id(const char* name, std::size_t configuration,
                     const std::string& response = {}) {
  return std::string(name) + "-" + std::to_string(configuration) +
         (response.empty() ? "" : "-" + response);
}

/// Returns true if any of the rows has a figure under the key.
bool has_figure(const ordered_json& rows, const char* key) {
  return std::any_of(rows.begin(), rows.end(),
                     [&](const ordered_json& row) { return !row.at(key).is_null(); });
}

/// Returns a number or the value of an estimate; 0 for null.
double number_or_zero(const ordered_json& json) {
  const ordered_json& value = json.is_object() ? json.at("value") : json;
  return value.is_null() ? 0.0 : value.get<double>();
}

/// Returns the rows sorted by weight, largest first.
std::vector<ordered_json> sorted_rows(const ordered_json& rows,
                                      const std::function<double(const ordered_json&)>& weight) {
  std::vector<ordered_json> sorted(rows.begin(), rows.end());
  std::stable_sort(sorted.begin(), sorted.end(), [&](const ordered_json& a, const ordered_json& b) {
    return weight(a) > weight(b);
  });
  return sorted;
}

double total_index(const ordered_json& contribution) {
  return number_or_zero(contribution.at("sobol_total"));
}

/// Returns a block of bars without rows.
ordered_json bars_block(const std::string& id, const PageText& title, const std::string& group,
                        const std::vector<PageText>& series, const PageText& x,
                        const std::string& unit) {
  ordered_json block = page_block("bars", id, title, group);
  block["x"] = x;
  block["unit"] = unit;
  block["series"] = ordered_json::array();
  for (const PageText& name : series) block["series"].push_back({{"name", name}});
  block["rows"] = ordered_json::array();
  return block;
}

/// Adds a row of bars, one for each series.
void add_bar(ordered_json& block, const PageText& name, const std::vector<ordered_json>& values,
             const PageText& note = nullptr) {
  ordered_json row;
  row["name"] = name;
  row["values"] = ordered_json::array();
  for (const ordered_json& value : values) row["values"].push_back(require_figure(value));
  if (!note.is_null()) row["note"] = note;
  block["rows"].push_back(row);
}

/// Returns the table of the figures of all responses.
ordered_json figures_block(const ordered_json& budget) {
  const char* response_keys[] = {"base", "root_sum_square", "sum", "worst", "worst_bound"};
  const char* statistics_keys[] = {"mean", "standard_deviation", "median", "p95", "p99", "min",
                                   "max"};
  std::vector<PageColumn> columns{
      {label_text("arm"), ""}, {label_text("response"), ""}, {label_text("unit"), ""}};
  for (const char* key : response_keys) columns.push_back({label_text(key), ""});
  for (const char* key : statistics_keys)
    columns.push_back({label_text("machines_" + std::string(key)), ""});
  columns.push_back({label_text("limit"), ""});
  columns.push_back({label_text("within"), "%"});
  columns.push_back({label_text("cpk"), ""});
  ordered_json rows = ordered_json::array();
  for (const ordered_json& configuration : budget.at("arms"))
    for (const ordered_json& response : configuration.at("responses")) {
      ordered_json row = ordered_json::array();
      row.push_back(text_at(configuration, "name"));
      row.push_back(response_label(response));
      row.push_back(response_unit(response));
      for (const char* key : response_keys) row.push_back(require_figure(response.at(key)));
      const ordered_json& machines = response.at("monte_carlo");
      for (const char* key : statistics_keys)
        row.push_back(machines.is_null() ? ordered_json() : require_figure(machines.at(key)));
      for (const char* key : {"limit", "within_limit_percent", "cpk"})
        row.push_back(require_figure(response.at(key)));
      rows.push_back(row);
    }
  ordered_json block = table_block("figures", label_text("study_figures"), columns, rows);
  block["note"] = label_text("study_figures_note");
  return block;
}

/// Returns the histogram of a response over random machines, with a series for each configuration;
/// null if there are none.
ordered_json distribution_block(const ordered_json& budget, const ordered_json& response,
                                const MachineResponses& responses) {
  const std::string name = text_at(response, "response");
  ordered_json block =
      page_block("histogram", "distribution-" + name,
                 phrase({label_text("distribution"), ": ", response_label(response)}));
  block["x"] = response_label(response);
  block["y"] = label_text("share_of_machines");
  block["unit"] = response_unit(response);
  block["series"] = ordered_json::array();
  for (const ordered_json& configuration : budget.at("arms"))
    for (const ordered_json& candidate : configuration.at("responses")) {
      if (text_at(candidate, "response") != name || candidate.at("monte_carlo").is_null()) continue;
      const auto values = responses.find(response_column_head(budget, configuration, candidate));
      if (values == responses.end() || values->second.empty()) continue;
      ordered_json series{{"name", text_at(configuration, "name")}, {"values", values->second}};
      series["marks"] = ordered_json::array();
      for (const char* key : {"mean", "p95"})
        series["marks"].push_back({{"name", label_text("machines_" + std::string(key))},
                                   {"value", candidate.at("monte_carlo").at(key).at("value")}});
      block["series"].push_back(series);
      if (!candidate.at("limit").is_null()) block["limit"] = candidate.at("limit");
    }
  return block["series"].empty() ? ordered_json() : block;
}

/// Returns the charts of a sweep, one for each response.
ordered_json sweep_block(const ordered_json& sweep, std::size_t number) {
  const std::string input = one_line(text_at(sweep, "input"));
  const std::string unit = text_at(sweep, "unit");
  ordered_json block = page_block("panels", "sweep-" + std::to_string(number),
                                  phrase({label_text("sweep"), ": ", input}));
  block["panels"] = ordered_json::array();
  for (const auto& [response, unit_name] : sweep.at("units").items()) {
    ordered_json panel;
    panel["title"] = label_text("response_" + response);
    panel["x"] = input + (unit == "1" ? "" : " / " + display_unit(unit));
    panel["y"] = phrase(
        {label_text("response_" + response), " / " + display_unit(unit_name.get<std::string>())});
    panel["series"] = ordered_json::array();
    for (const ordered_json& configuration : sweep.at("arms"))
      panel["series"].push_back(chart_series(configuration.at("name"), sweep.at("values"),
                                             configuration.at(response), "both"));
    block["panels"].push_back(panel);
  }
  return block;
}

/// Returns the table that compares influence maps with fully cut machines; null if there are none.
ordered_json proofs_block(const ordered_json& budget) {
  ordered_json rows = ordered_json::array();
  for (const ordered_json& proof : budget.at("proofs")) {
    ordered_json row = ordered_json::array();
    row.push_back(text_at(proof, "arm"));
    row.push_back(response_label(proof));
    for (const char* key : {"compared", "one_sided", "percent"})
      row.push_back(require_figure(proof.at(key)));
    rows.push_back(row);
  }
  if (rows.empty()) return {};
  return table_block("proofs", label_text("proofs"),
                     {{label_text("arm"), ""},
                      {label_text("response"), ""},
                      {label_text("proof_compared"), ""},
                      {label_text("proof_one_sided"), ""},
                      {label_text("proof_differs"), "%"}},
                     rows);
}

/// Returns the table of the days on which a thermal belief was learnt and evaluated.
ordered_json histories_block(const ordered_json& budget) {
  ordered_json rows = ordered_json::array();
  const auto day = [](const ordered_json& result, const char* key) -> PageText {
    const std::string name = text_at(result, key);
    return name.empty() ? label_text("scene_day") : PageText(name);
  };
  for (const ordered_json& result : budget.at("histories")) {
    ordered_json row = ordered_json::array();
    row.push_back(day(result, "train"));
    row.push_back(result.at("own_day").get<bool>()
                      ? phrase({day(result, "test"), " (", label_text("same_day"), ")"})
                      : day(result, "test"));
    for (const char* key : {"uncompensated_rms_um", "compensated_rms_um", "reduction_percent"})
      row.push_back(require_figure(result.at(key)));
    std::string sensors;
    for (const ordered_json& sensor : result.at("sensors"))
      sensors += (sensors.empty() ? "" : ", ") + sensor.get<std::string>();
    row.push_back(sensors);
    rows.push_back(row);
  }
  return table_block("histories", label_text("histories"),
                     {{label_text("learnt_on"), ""},
                      {label_text("judged_on"), ""},
                      {label_text("uncompensated_rms"), "µm"},
                      {label_text("compensated_rms"), "µm"},
                      {label_text("reduction"), "%"},
                      {label_text("sensors"), ""}},
                     rows);
}

std::string shown_um(const ordered_json& value) {
  return fmt::format("{:.3g} µm", value.get<double>());
}

/// Returns the bars of the inputs' contributions to the map.
ordered_json map_block(const ordered_json& configuration, std::size_t number) {
  const ordered_json& map = configuration.at("map");
  if (map.is_null() || map.at("contributions").empty()) return {};
  ordered_json block =
      bars_block(block_id("map", number), label_text("pareto_map"), text_at(configuration, "name"),
                 {label_text("share")}, label_text("share_of_map"), "%");
  block["running"] = true;
  if (!map.at("rms_um").is_null() && !map.at("mean_rms_um").is_null())
    block["note"] = phrase({label_text("map_rms"), " ", shown_um(map.at("rms_um")), ", ",
                            label_text("map_mean_rms"), " ", shown_um(map.at("mean_rms_um"))});
  for (const ordered_json& contribution :
       sorted_rows(map.at("contributions"),
                   [](const ordered_json& c) { return number_or_zero(c.at("share_percent")); }))
    add_bar(block, one_line(text_at(contribution, "input")), {contribution.at("share_percent")},
            contribution.at("rms_um").is_null()
                ? PageText()
                : PageText("RMS " + shown_um(contribution.at("rms_um"))));
  return block;
}

/// Returns the label of the basis of a ranking.
const char* basis_label(const std::string& of) {
  using Basis = Ranking::Basis;
  if (of == share_of(Basis::Sobol)) return "share_of_sobol";
  if (of == share_of(Basis::Change)) return "share_of_change";
  return "share_of_main_effect";
}

/// Returns the bars of the largest contributions to a response, of the sum of the other inputs, and
/// of interactions, which belong to no single input.
ordered_json ranking_block(const ordered_json& configuration, const ordered_json& response,
                           std::size_t number) {
  const ordered_json& ranking = response.at("whose");
  if (ranking.is_null()) return {};
  ordered_json block =
      bars_block(block_id("whose", number, text_at(response, "response")),
                 phrase({label_text("pareto_response"), ": ", response_label(response)}),
                 text_at(configuration, "name"), {label_text("share")},
                 label_text(basis_label(text_at(ranking, "of"))), "%");
  double remainder = 100.0;
  for (const ordered_json& contribution : ranking.at("largest")) {
    add_bar(block, one_line(text_at(contribution, "input")), {contribution.at("share_percent")});
    remainder -= number_or_zero(contribution.at("share_percent"));
  }
  const double interactions = number_or_zero(ranking.at("of_no_input_alone_percent"));
  // The numbers of the file are rounded, so a tiny remainder is not a contribution.
  if (remainder - interactions > 1e-9)
    add_bar(block, label_text("other_inputs"), {remainder - interactions});
  if (interactions != 0.0) add_bar(block, label_text("no_input_alone"), {interactions});
  return block;
}

/// Returns the bars of the changes by a step of each input to either side, sorted by the larger of
/// the two.
ordered_json tornado_block(const ordered_json& budget, const ordered_json& configuration,
                           const ordered_json& response, std::size_t number) {
  const ordered_json& contributions = response.at("contributions");
  if (!has_figure(contributions, "low") && !has_figure(contributions, "high")) return {};
  const ordered_json& step = budget.at("step_standard_deviations");
  const std::string step_text = step.is_null() ? "" : fmt::format(" {:g} ", step.get<double>());
  ordered_json block =
      bars_block(block_id("tornado", number, text_at(response, "response")),
                 phrase({label_text("tornado"), ": ", response_label(response)}),
                 text_at(configuration, "name"),
                 {phrase({label_text("centre"), " −" + step_text, label_text("deviations")}),
                  phrase({label_text("centre"), " +" + step_text, label_text("deviations")})},
                 label_text("change_of_response"), response_unit(response));
  const auto change_magnitude = [](const ordered_json& c) {
    return std::max(std::abs(number_or_zero(c.at("low"))), std::abs(number_or_zero(c.at("high"))));
  };
  for (const ordered_json& contribution : sorted_rows(contributions, change_magnitude))
    add_bar(block, one_line(text_at(contribution, "input")),
            {contribution.at("low"), contribution.at("high")});
  return block;
}

/// Returns the dots of the Sobol indices of each input; null if there are none.
ordered_json indices_block(const ordered_json& configuration, const ordered_json& response,
                           std::size_t number) {
  const ordered_json& contributions = response.at("contributions");
  if (!has_figure(contributions, "sobol_total")) return {};
  ordered_json block = bars_block(
      block_id("indices", number, text_at(response, "response")),
      phrase({label_text("sobol"), ": ", response_label(response)}), text_at(configuration, "name"),
      {label_text("sobol_total"), label_text("sobol_first")}, label_text("share_of_variance"), "");
  block["mark"] = "dot";
  block["note"] = label_text("sobol_note");
  for (const ordered_json& contribution : sorted_rows(contributions, total_index))
    add_bar(block, one_line(text_at(contribution, "input")),
            {contribution.at("sobol_total"), contribution.at("sobol_first")});
  return block;
}

/// Returns the series of one index of an input over the number of base points, with its interval.
ordered_json convergence_series(const ordered_json& steps, std::size_t input, const char* key) {
  std::vector<std::size_t> x(steps.size());
  std::iota(x.begin(), x.end(), std::size_t(0));
  ordered_json series = chart_series(label_text(key), x, ordered_json::array(), "both");
  series["low"] = series["high"] = ordered_json::array();
  for (const ordered_json& step : steps) {
    const ordered_json& index = step.at(key).at(input);
    series["y"].push_back(index.at("value"));
    // The intervals of estimates from few points extend far beyond 0 .. 1; unclipped they would
    // determine the scale of the chart.
    const auto clipped_end = [](const ordered_json& end) -> ordered_json {
      if (end.is_null()) return nullptr;
      return std::clamp(end.get<double>(), -0.5, 1.5);
    };
    series["low"].push_back(clipped_end(index.at("low")));
    series["high"].push_back(clipped_end(index.at("high")));
  }
  return series;
}

/// Returns the charts of the Sobol indices over the number of base points, for the inputs with the
/// largest total indices; null if there are none.
ordered_json convergence_block(const ordered_json& configuration, const ordered_json& response,
                               std::size_t number) {
  const ordered_json& steps = response.at("convergence");
  if (steps.is_null() || steps.empty()) return {};
  ordered_json block =
      page_block("panels", block_id("convergence", number, text_at(response, "response")),
                 phrase({label_text("convergence"), ": ", response_label(response)}),
                 text_at(configuration, "name"));
  block["common_y"] = true;
  block["note"] = label_text("convergence_note");
  block["panels"] = ordered_json::array();
  const ordered_json& contributions = response.at("contributions");
  std::vector<std::size_t> order(contributions.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return total_index(contributions[a]) > total_index(contributions[b]);
  });
  order.resize(std::min(order.size(), max_convergence_panels));
  for (const std::size_t i : order) {
    ordered_json panel;
    panel["title"] = one_line(text_at(contributions[i], "input"));
    panel["x"] = label_text("base_points");
    panel["y"] = label_text("index");
    panel["names"] = ordered_json::array();
    for (const ordered_json& step : steps) panel["names"].push_back(step.at("base_points").dump());
    panel["series"] = ordered_json::array();
    panel["series"].push_back(convergence_series(steps, i, "sobol_total"));
    panel["series"].push_back(convergence_series(steps, i, "sobol_first"));
    block["panels"].push_back(panel);
  }
  return block;
}

/// Returns the table of all inputs with their figures.
ordered_json inputs_block(const ordered_json& budget, const ordered_json& configuration,
                          const ordered_json& response, std::size_t number) {
  const ordered_json& contributions = response.at("contributions");
  const std::string unit = response_unit(response);
  std::vector<PageColumn> columns{{label_text("input"), ""},
                                  {label_text("unit"), ""},
                                  {label_text("centre"), ""},
                                  {label_text("deviation"), ""}};
  std::vector<std::string> keys;
  const auto add = [&](const char* key, const char* column_unit) {
    if (!has_figure(contributions, key)) return;
    columns.push_back({label_text("input_" + std::string(key)), column_unit});
    keys.push_back(key);
  };
  for (const char* key : {"low", "high"}) add(key, unit.c_str());
  for (const char* key : {"sobol_first", "sobol_total", "correlation", "rank_correlation"})
    add(key, "");
  add("main_effect_percent", "%");
  ordered_json rows = ordered_json::array();
  for (std::size_t i = 0; i < contributions.size(); ++i) {
    const ordered_json& input = budget.at("inputs").at(i);
    if (text_at(input, "name") != text_at(contributions[i], "input"))
      throw std::invalid_argument("inputs and contributions are in different order");
    ordered_json row = ordered_json::array();
    row.push_back(input_name(input));
    row.push_back(text_at(input, "unit") == "1" ? "" : display_unit(text_at(input, "unit")));
    row.push_back(require_figure(input.at("centre")));
    row.push_back(require_figure(input.at("standard_deviation")));
    for (const std::string& key : keys) row.push_back(require_figure(contributions[i].at(key)));
    rows.push_back(row);
  }
  ordered_json block =
      table_block(block_id("inputs", number, text_at(response, "response")),
                  phrase({label_text("every_input"), ": ", response_label(response)}), columns,
                  rows, text_at(configuration, "name"));
  // The table is sorted by the total indices; four columns precede those of the keys.
  const auto sort_key = std::ranges::find(keys, "sobol_total");
  if (sort_key != keys.end()) block["by"] = 4 + (sort_key - keys.begin());
  return block;
}

/// Returns the table of the spreads that the inputs must keep, tightest first.
ordered_json allocation_block(const ordered_json& budget, const ordered_json& configuration,
                              std::size_t number) {
  const ordered_json& allocation = configuration.at("allocation");
  if (allocation.is_null()) return {};
  const ordered_json &equal = allocation.at("equal"), &cheapest = allocation.at("cheapest");
  ordered_json rows = ordered_json::array();
  for (std::size_t i = 0; i < budget.at("inputs").size(); ++i) {
    const ordered_json& input = budget.at("inputs")[i];
    const double spread = input.at("standard_deviation").get<double>();
    ordered_json row = ordered_json::array();
    row.push_back(input_name(input));
    row.push_back(text_at(input, "unit") == "1" ? "" : display_unit(text_at(input, "unit")));
    row.push_back(spread);
    for (const ordered_json* method : {&equal, &cheapest}) {
      const ordered_json& factor = require_figure(method->at("factors").at(i));
      row.push_back(factor);
      row.push_back(factor.is_null() ? ordered_json()
                                     : ordered_json(factor.get<double>() * spread));
    }
    rows.push_back(row);
  }
  const auto tightness = [](const ordered_json& row) { return -number_or_zero(row.at(5)); };
  ordered_json block =
      table_block(block_id("allocation", number),
                  phrase({label_text("allocation"), ": ", response_label(allocation),
                          fmt::format(" ≤ {:g} {}, {:g} %", allocation.at("limit").get<double>(),
                                      response_unit(allocation),
                                      allocation.at("confidence_percent").get<double>())}),
                  {{label_text("input"), ""},
                   {label_text("unit"), ""},
                   {label_text("deviation"), ""},
                   {label_text("factor_equal"), ""},
                   {label_text("deviation_equal"), ""},
                   {label_text("factor_cheapest"), ""},
                   {label_text("deviation_cheapest"), ""}},
                  sorted_rows(rows, tightness), text_at(configuration, "name"));
  block["note"] =
      label_text(allocation.at("attainable").get<bool>() ? "allocation_note" : "not_attainable");
  return block;
}

/// Returns the table of cost and yield of the allocations; null if none was requested.
ordered_json allocation_totals_block(const ordered_json& configuration, std::size_t number) {
  const ordered_json& allocation = configuration.at("allocation");
  if (allocation.is_null()) return {};
  ordered_json rows = ordered_json::array();
  for (const char* key : {"equal", "cheapest"}) {
    ordered_json row = ordered_json::array();
    row.push_back(label_text("allocation_" + std::string(key)));
    row.push_back(require_figure(allocation.at(key).at("cost")));
    row.push_back(require_figure(allocation.at(key).at("within_limit_percent")));
    row.push_back(require_figure(allocation.at("floor")));
    rows.push_back(row);
  }
  return table_block(block_id("allocation-totals", number), label_text("allocation_totals"),
                     {{label_text("allocation_way"), ""},
                      {label_text("cost"), ""},
                      {label_text("within"), "%"},
                      {label_text("floor"), response_unit(allocation)}},
                     rows, text_at(configuration, "name"));
}

/// Returns the table of the figures of the influence and uncertainty maps.
ordered_json map_figures_block(const ordered_json& configuration, std::size_t number) {
  ordered_json rows = ordered_json::array();
  for (const char* part : {"map", "influence", "uncertainty"}) {
    if (!configuration.contains(part) || configuration.at(part).is_null()) continue;
    for (const auto& [key, value] : configuration.at(part).items()) {
      if (!value.is_number()) continue;
      ordered_json row = ordered_json::array();
      row.push_back(label_text("maps_" + std::string(part)));
      row.push_back(label_text("maps_" + key));
      row.push_back(value);
      rows.push_back(row);
    }
  }
  if (rows.empty()) return {};
  return table_block(
      block_id("map-figures", number), label_text("map_figures"),
      {{label_text("maps"), ""}, {label_text("figure"), ""}, {label_text("value"), ""}}, rows,
      text_at(configuration, "name"));
}

}  // namespace

std::string response_column_head(const ordered_json& budget, const ordered_json& configuration,
                                 const ordered_json& response) {
  const std::string unit = text_at(response, "unit");
  const std::string figure = text_at(response, "response") + "_" + (unit == "%" ? "percent" : unit);
  return budget.at("arms").size() == 1 ? figure : text_at(configuration, "name") + " " + figure;
}

ordered_json study_blocks(const ordered_json& budget, const MachineResponses& responses) {
  ordered_json blocks = ordered_json::array();
  const auto add = [&](const ordered_json& block) {
    if (!block.is_null()) blocks.push_back(block);
  };
  if (budget.contains("arms")) {
    const ordered_json& configurations = budget.at("arms");
    add(figures_block(budget));
    for (std::size_t i = 0; i < configurations.size(); ++i) {
      add(map_block(configurations[i], i));
      for (const ordered_json& response : configurations[i].at("responses")) {
        add(ranking_block(configurations[i], response, i));
        add(tornado_block(budget, configurations[i], response, i));
        add(indices_block(configurations[i], response, i));
      }
    }
    if (!configurations.empty())
      for (const ordered_json& response : configurations[0].at("responses"))
        add(distribution_block(budget, response, responses));
    for (std::size_t i = 0; i < configurations.size(); ++i) {
      add(allocation_totals_block(configurations[i], i));
      add(allocation_block(budget, configurations[i], i));
      for (const ordered_json& response : configurations[i].at("responses")) {
        add(inputs_block(budget, configurations[i], response, i));
        add(convergence_block(configurations[i], response, i));
      }
      add(map_figures_block(configurations[i], i));
    }
    for (std::size_t k = 0; k < budget.at("sweeps").size(); ++k)
      add(sweep_block(budget.at("sweeps")[k], k));
    add(proofs_block(budget));
  }
  if (budget.contains("histories")) add(histories_block(budget));
  return blocks;
}

}  // namespace abbe::sim::study
