#include "sim/study/study_charts.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/study/study_text.h"

namespace abbe::sim::study {

namespace {

using nlohmann::ordered_json;

// One panel per input; more panels would be too small to read.
constexpr std::size_t max_convergence_panels = 12;
constexpr std::size_t max_shown_machines = 20000;  // of one response

PageText response_label(Response response) {
  return label_text(std::string("response_") + name_of(response));
}

std::string input_name(const Study& study, int input) {
  return one_line(study.inputs[std::size_t(input)].name);
}

/// Returns the unit of an input for display; empty if it is dimensionless.
std::string input_unit(const Input& input) {
  return unit_of(input) == "1" ? "" : display_unit(unit_of(input));
}

/// Returns the unique id of a block.
/// @param configuration  its index
std::string block_id(const char* name, std::size_t configuration,
                     const std::string& response = {}) {
  return std::string(name) + "-" + std::to_string(configuration) +
         (response.empty() ? "" : "-" + response);
}

/// Returns the indices 0 .. count - 1 sorted by weight, largest first. A weight that is not finite
/// counts as 0.
std::vector<std::size_t> sorted_indices(std::size_t count,
                                        const std::function<double(std::size_t)>& weight) {
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::ranges::stable_sort(order, std::greater(), [&](std::size_t i) {
    return std::isfinite(weight(i)) ? weight(i) : 0.0;
  });
  return order;
}

/// Returns the indices of the contributions to a response, the largest total Sobol index first.
std::vector<std::size_t> by_total_index(const ResponseBudget& response) {
  return sorted_indices(response.contributions.size(), [&](std::size_t i) {
    const std::optional<SobolIndex>& sobol = response.contributions[i].sobol;
    return sobol ? sobol->total.value : 0.0;
  });
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
void add_bar(ordered_json& block, const PageText& name, const std::vector<ordered_json>& values) {
  block["rows"].push_back({{"name", name}, {"values", values}});
}

/// Returns the table of the figures of all responses.
ordered_json figures_block(const Budget& budget) {
  std::vector<PageColumn> columns{
      {label_text("arm"), ""}, {label_text("response"), ""}, {label_text("unit"), ""}};
  for (const char* key : {"base", "root_sum_square", "sum", "worst", "worst_bound", "machines_mean",
                          "machines_standard_deviation", "machines_median", "machines_p95",
                          "machines_p99", "machines_min", "machines_max", "limit"})
    columns.push_back({label_text(key), ""});
  columns.push_back({label_text("within"), "%"});
  columns.push_back({label_text("cpk"), ""});
  ordered_json rows = ordered_json::array();
  for (const ConfigurationBudget& configuration : budget.configurations)
    for (const ResponseBudget& response : configuration.responses) {
      const auto figure = [&](const auto& value) { return json_figure(response.response, value); };
      // Returns a statistic of the random machines; null if there are none.
      const auto statistic = [&](const auto ResponseStatistics::*member) {
        return response.answers ? figure((*response.answers).*member) : ordered_json();
      };
      rows.push_back(ordered_json::array(
          {configuration.arm.name, response_label(response.response),
           display_unit(response.response), figure(response.base), figure(response.root_sum_square),
           figure(response.sum), figure(response.worst), figure(response.worst_bound),
           statistic(&ResponseStatistics::mean), statistic(&ResponseStatistics::standard_deviation),
           statistic(&ResponseStatistics::median), statistic(&ResponseStatistics::p95),
           statistic(&ResponseStatistics::p99), statistic(&ResponseStatistics::min),
           statistic(&ResponseStatistics::max), figure(response.limit),
           response.fraction_within ? json_figure(*response.fraction_within, 100.0)
                                    : ordered_json(),
           json_figure(response.capability)}));
    }
  ordered_json block = table_block("figures", label_text("study_figures"), columns, rows);
  block["note"] = label_text("study_figures_note");
  return block;
}

/// Returns the responses of random machines that the page shows, in the unit of the response: all
/// of them, or every n-th by rank, which preserves the distribution and its extremes.
std::vector<double> shown_values(const ResponseBudget& response) {
  std::vector<double> values;
  for (const double value : response.values) values.push_back(in_unit(response.response, value));
  if (values.size() <= max_shown_machines) return values;
  std::ranges::sort(values);
  std::vector<double> subset;
  for (std::size_t k = 0; k < max_shown_machines; ++k)
    subset.push_back(values[k * (values.size() - 1) / (max_shown_machines - 1)]);
  return subset;
}

/// Returns the histogram of a response over random machines, with a series for each configuration;
/// null if there are none.
/// @param number  of the response
ordered_json distribution_block(const Budget& budget, std::size_t number) {
  const Response response = budget.configurations.front().responses[number].response;
  ordered_json block =
      page_block("histogram", std::string("distribution-") + name_of(response),
                 phrase({label_text("distribution"), ": ", response_label(response)}));
  block["x"] = response_label(response);
  block["y"] = label_text("share_of_machines");
  block["unit"] = display_unit(response);
  block["series"] = ordered_json::array();
  for (const ConfigurationBudget& configuration : budget.configurations) {
    const ResponseBudget& candidate = configuration.responses[number];
    if (!candidate.answers) continue;
    const auto mark = [&](const char* key, const IntervalEstimate& estimate) {
      return ordered_json{{"name", label_text(key)},
                          {"value", json_figure(response, estimate.value)}};
    };
    block["series"].push_back(
        {{"name", configuration.arm.name},
         {"values", shown_values(candidate)},
         {"marks", ordered_json::array({mark("machines_mean", candidate.answers->mean),
                                        mark("machines_p95", candidate.answers->p95)})}});
    if (candidate.limit) block["limit"] = json_figure(response, candidate.limit);
  }
  return block["series"].empty() ? ordered_json() : block;
}

/// Returns the charts of a sweep, one for each response.
ordered_json sweep_block(const Study& study, const SweepResult& result, std::size_t number) {
  const Sweep& sweep = study.sweeps[std::size_t(result.sweep)];
  const std::string name = input_name(study, sweep.input);
  const std::string unit = input_unit(study.inputs[std::size_t(sweep.input)]);
  ordered_json block = page_block("panels", "sweep-" + std::to_string(number),
                                  phrase({label_text("sweep"), ": ", name}));
  block["panels"] = ordered_json::array();
  for (std::size_t r = 0; r < study.responses.size(); ++r) {
    const Response response = study.responses[r];
    ordered_json panel;
    panel["title"] = response_label(response);
    panel["x"] = name + (unit.empty() ? "" : " / " + unit);
    panel["y"] = phrase({response_label(response), " / " + display_unit(response)});
    panel["series"] = ordered_json::array();
    for (std::size_t a = 0; a < result.answers.size(); ++a) {
      ordered_json values = ordered_json::array();
      for (const double value : result.answers[a][r])
        values.push_back(json_figure(response, value));
      panel["series"].push_back(
          chart_series(study.configurations[a].name, json_figures(sweep.values), values, "both"));
    }
    block["panels"].push_back(panel);
  }
  return block;
}

/// Returns the table that compares influence maps with fully cut machines; null if there are none.
ordered_json proofs_block(const std::vector<Proof>& proofs) {
  ordered_json rows = ordered_json::array();
  for (const Proof& proof : proofs)
    rows.push_back(ordered_json::array({proof.arm, response_label(proof.response), proof.compared,
                                        proof.one_sided, json_figure(proof.percent)}));
  if (rows.empty()) return {};
  return table_block("proofs", label_text("proofs"),
                     {{label_text("arm"), ""},
                      {label_text("response"), ""},
                      {label_text("proof_compared"), ""},
                      {label_text("proof_one_sided"), ""},
                      {label_text("proof_differs"), "%"}},
                     rows);
}

/// Returns the table of the days on which a thermal belief was learnt and evaluated; null if there
/// are none.
ordered_json histories_block(const std::vector<HistoryResult>& histories) {
  ordered_json rows = ordered_json::array();
  const auto day = [](const std::string& name) {
    return name.empty() ? label_text("scene_day") : PageText(name);
  };
  for (const HistoryResult& result : histories)
    rows.push_back(ordered_json::array(
        {day(result.train),
         result.is_own_day ? phrase({day(result.test), " (", label_text("same_day"), ")"})
                           : day(result.test),
         json_figure(result.uncompensated_rms / units::um),
         json_figure(result.compensated_rms / units::um), json_figure(result.reduction_percent),
         fmt::format("{}", fmt::join(result.sensors, ", "))}));
  if (rows.empty()) return {};
  return table_block("histories", label_text("histories"),
                     {{label_text("learnt_on"), ""},
                      {label_text("judged_on"), ""},
                      {label_text("uncompensated_rms"), "µm"},
                      {label_text("compensated_rms"), "µm"},
                      {label_text("reduction"), "%"},
                      {label_text("sensors"), ""}},
                     rows);
}

std::string shown_um(double value) { return fmt::format("{:.3g} µm", value / units::um); }

/// Returns the bars of the inputs' contributions to the map; null if there are none.
ordered_json map_block(const Study& study, const ConfigurationBudget& configuration,
                       std::size_t number) {
  const std::vector<MapContribution>& contributions = configuration.maps;
  if (contributions.empty()) return {};
  ordered_json block =
      bars_block(block_id("map", number), label_text("pareto_map"), configuration.arm.name,
                 {label_text("share")}, label_text("share_of_map"), "%");
  block["running"] = true;
  if (configuration.map_rms && configuration.map_mean_rms)
    block["note"] =
        phrase({label_text("map_rms"), " ", shown_um(*configuration.map_rms), ", ",
                label_text("map_mean_rms"), " ", shown_um(*configuration.map_mean_rms)});
  for (const std::size_t i : sorted_indices(
           contributions.size(), [&](std::size_t k) { return contributions[k].share; })) {
    add_bar(block, input_name(study, int(i)), {json_figure(100.0 * contributions[i].share)});
    block["rows"].back()["note"] = "RMS " + shown_um(contributions[i].rms);
  }
  return block;
}

/// Returns the key of the label of the basis of a ranking.
const char* basis_label(Ranking::Basis basis) {
  if (basis == Ranking::Basis::Sobol) return "share_of_sobol";
  return basis == Ranking::Basis::Change ? "share_of_change" : "share_of_main_effect";
}

/// Returns the bars of the largest contributions to a response, of the sum of the other inputs, and
/// of interactions, which belong to no single input; null if nothing contributes.
ordered_json ranking_block(const Study& study, const ConfigurationBudget& configuration,
                           const ResponseBudget& response, std::size_t number) {
  const Ranking order = ranking(response, study.inputs.size());
  if (order.basis == Ranking::Basis::None) return {};
  ordered_json block = bars_block(
      block_id("whose", number, name_of(response.response)),
      phrase({label_text("pareto_response"), ": ", response_label(response.response)}),
      configuration.arm.name, {label_text("share")}, label_text(basis_label(order.basis)), "%");
  for (const ParetoBar& bar : pareto(order, max_ranked_inputs)) {
    const bool is_input = bar.kind == ParetoBar::Kind::Input;
    // The shares add up to 1 only within rounding, so a tiny remainder is not a contribution.
    if (is_input ? bar.share > 0.0 : bar.share > 1e-11)
      add_bar(block,
              is_input                              ? PageText(input_name(study, bar.input))
              : bar.kind == ParetoBar::Kind::Others ? label_text("other_inputs")
                                                    : label_text("no_input_alone"),
              {json_figure(100.0 * bar.share)});
  }
  return block;
}

/// Returns the bars of the changes by a step of each input to either side, sorted by the larger of
/// the two; null if there are none.
ordered_json tornado_block(const Study& study, const ConfigurationBudget& configuration,
                           const ResponseBudget& response, std::size_t number) {
  const std::vector<Contribution>& contributions = response.contributions;
  const auto has_change = [](const Contribution& c) { return larger_change(c).has_value(); };
  if (std::ranges::none_of(contributions, has_change)) return {};
  const std::string step =
      study.one_at_a_time ? fmt::format(" {:g} ", study.one_at_a_time->step) : "";
  ordered_json block =
      bars_block(block_id("tornado", number, name_of(response.response)),
                 phrase({label_text("tornado"), ": ", response_label(response.response)}),
                 configuration.arm.name,
                 {phrase({label_text("centre"), " −" + step, label_text("deviations")}),
                  phrase({label_text("centre"), " +" + step, label_text("deviations")})},
                 label_text("change_of_response"), display_unit(response.response));
  for (const std::size_t i : sorted_indices(contributions.size(), [&](std::size_t k) {
         return larger_change(contributions[k]).value_or(0.0);
       }))
    add_bar(block, input_name(study, contributions[i].input),
            {json_figure(response.response, contributions[i].low),
             json_figure(response.response, contributions[i].high)});
  return block;
}

/// Returns true if any contribution to a response has Sobol indices.
bool has_indices(const ResponseBudget& response) {
  return std::ranges::any_of(response.contributions,
                             [](const Contribution& c) { return c.sobol.has_value(); });
}

/// Returns the dots of the Sobol indices of each input; null if there are none.
ordered_json indices_block(const Study& study, const ConfigurationBudget& configuration,
                           const ResponseBudget& response, std::size_t number) {
  if (!has_indices(response)) return {};
  ordered_json block =
      bars_block(block_id("indices", number, name_of(response.response)),
                 phrase({label_text("sobol"), ": ", response_label(response.response)}),
                 configuration.arm.name, {label_text("sobol_total"), label_text("sobol_first")},
                 label_text("share_of_variance"), "");
  block["mark"] = "dot";
  block["note"] = label_text("sobol_note");
  for (const std::size_t i : by_total_index(response)) {
    const Contribution& contribution = response.contributions[i];
    if (contribution.sobol)
      add_bar(block, input_name(study, contribution.input),
              {json_figure(contribution.sobol->total), json_figure(contribution.sobol->first)});
  }
  return block;
}

/// Returns the series of one index of an input over the number of base points, with its interval.
ordered_json convergence_series(const IndexConvergence& convergence, std::size_t input,
                                const char* key, IntervalEstimate SobolIndex::*index) {
  std::vector<std::size_t> x(convergence.base_points.size());
  std::iota(x.begin(), x.end(), std::size_t(0));
  ordered_json series = chart_series(label_text(key), x, ordered_json::array(), "both");
  series["low"] = series["high"] = ordered_json::array();
  for (const std::vector<SobolIndex>& step : convergence.indices) {
    const IntervalEstimate& estimate = step[input].*index;
    series["y"].push_back(json_figure(estimate.value));
    // The intervals of estimates from few points extend far beyond 0 .. 1; unclipped they would
    // determine the scale of the chart.
    series["low"].push_back(json_figure(std::clamp(estimate.low, -0.5, 1.5)));
    series["high"].push_back(json_figure(std::clamp(estimate.high, -0.5, 1.5)));
  }
  return series;
}

/// Returns the charts of the Sobol indices over the number of base points, for the inputs with the
/// largest total indices; null if there are none.
ordered_json convergence_block(const Study& study, const ConfigurationBudget& configuration,
                               const ResponseBudget& response, std::size_t number) {
  if (!response.index_convergence || response.index_convergence->base_points.empty()) return {};
  const IndexConvergence& convergence = *response.index_convergence;
  ordered_json block =
      page_block("panels", block_id("convergence", number, name_of(response.response)),
                 phrase({label_text("convergence"), ": ", response_label(response.response)}),
                 configuration.arm.name);
  block["common_y"] = true;
  block["note"] = label_text("convergence_note");
  block["panels"] = ordered_json::array();
  std::vector<std::size_t> order = by_total_index(response);
  order.resize(std::min(order.size(), max_convergence_panels));
  for (const std::size_t i : order) {
    ordered_json panel;
    panel["title"] = input_name(study, response.contributions[i].input);
    panel["x"] = label_text("base_points");
    panel["y"] = label_text("index");
    panel["names"] = ordered_json::array();
    for (const Eigen::Index count : convergence.base_points)
      panel["names"].push_back(std::to_string(count));
    panel["series"] = ordered_json::array(
        {convergence_series(convergence, i, "sobol_total", &SobolIndex::total),
         convergence_series(convergence, i, "sobol_first", &SobolIndex::first)});
    block["panels"].push_back(panel);
  }
  return block;
}

/// Returns the table of all inputs with their figures.
ordered_json inputs_block(const Study& study, const ConfigurationBudget& configuration,
                          const ResponseBudget& response, std::size_t number) {
  const Eigen::VectorXd centres = centre(study), deviations = spreads(study);
  std::vector<PageColumn> columns{{label_text("input"), ""},
                                  {label_text("unit"), ""},
                                  {label_text("centre"), ""},
                                  {label_text("deviation"), ""}};
  ordered_json rows = ordered_json::array();
  for (const Contribution& contribution : response.contributions)
    rows.push_back(ordered_json::array({input_name(study, contribution.input),
                                        input_unit(study.inputs[std::size_t(contribution.input)]),
                                        json_figure(centres[contribution.input]),
                                        json_figure(deviations[contribution.input])}));
  // Adds a column, unless no contribution has its figure.
  const auto add = [&](const char* key, const std::string& unit, const auto& figure) {
    std::vector<ordered_json> cells;
    for (const Contribution& contribution : response.contributions)
      cells.push_back(figure(contribution));
    if (std::ranges::all_of(cells, [](const ordered_json& cell) { return cell.is_null(); })) return;
    columns.push_back({label_text(key), unit});
    for (std::size_t i = 0; i < cells.size(); ++i) rows[i].push_back(cells[i]);
  };
  const auto add_index = [&](const char* key, IntervalEstimate SobolIndex::*index) {
    add(key, "", [&](const Contribution& c) {
      return c.sobol ? json_figure((*c.sobol).*index) : ordered_json();
    });
  };
  const std::string unit = display_unit(response.response);
  const auto change = [&](std::optional<double> Contribution::*side) {
    return [&response, side](const Contribution& c) {
      return json_figure(response.response, c.*side);
    };
  };
  add("input_low", unit, change(&Contribution::low));
  add("input_high", unit, change(&Contribution::high));
  add_index("input_sobol_first", &SobolIndex::first);
  const std::size_t total_column = columns.size();
  add_index("input_sobol_total", &SobolIndex::total);
  add("input_correlation", "", [](const Contribution& c) { return json_figure(c.correlation); });
  add("input_rank_correlation", "",
      [](const Contribution& c) { return json_figure(c.rank_correlation); });
  add("input_main_effect_percent", "%", [](const Contribution& c) {
    return c.main_effect ? json_figure(100.0 * *c.main_effect) : ordered_json();
  });
  ordered_json block =
      table_block(block_id("inputs", number, name_of(response.response)),
                  phrase({label_text("every_input"), ": ", response_label(response.response)}),
                  columns, rows, configuration.arm.name);
  if (has_indices(response)) block["by"] = total_column;
  return block;
}

/// Returns the table of the spreads that the inputs must keep, tightest first.
ordered_json allocation_block(const Study& study, const Allocation& allocation,
                              const std::string& group, std::size_t number) {
  const Response response = allocation.asked.response;
  const Eigen::VectorXd deviations = spreads(study);
  ordered_json rows = ordered_json::array();
  for (const std::size_t i : sorted_indices(study.inputs.size(), [&](std::size_t k) {
         return -allocation.cheapest[Eigen::Index(k)];
       })) {
    const Eigen::Index k = Eigen::Index(i);
    ordered_json row = ordered_json::array(
        {input_name(study, int(i)), input_unit(study.inputs[i]), json_figure(deviations[k])});
    for (const double factor : {allocation.equal[k], allocation.cheapest[k]}) {
      row.push_back(json_figure(factor));
      row.push_back(json_figure(factor * deviations[k]));
    }
    rows.push_back(row);
  }
  ordered_json block = table_block(
      block_id("allocation", number),
      phrase({label_text("allocation"), ": ", response_label(response),
              fmt::format(" ≤ {:g} {}, {:g} %", in_unit(response, allocation.asked.limit),
                          display_unit(response), 100.0 * allocation.asked.confidence)}),
      {{label_text("input"), ""},
       {label_text("unit"), ""},
       {label_text("deviation"), ""},
       {label_text("factor_equal"), ""},
       {label_text("deviation_equal"), ""},
       {label_text("factor_cheapest"), ""},
       {label_text("deviation_cheapest"), ""}},
      rows, group);
  block["note"] = label_text(allocation.attainable ? "allocation_note" : "not_attainable");
  return block;
}

/// Returns the table of cost and yield of the allocations.
ordered_json allocation_totals_block(const Allocation& allocation, const std::string& group,
                                     std::size_t number) {
  const auto row = [&](const char* key, double cost, const IntervalEstimate& fraction) {
    return ordered_json::array({label_text(key), json_figure(cost), json_figure(fraction, 100.0),
                                json_figure(allocation.asked.response, allocation.floor)});
  };
  return table_block(
      block_id("allocation-totals", number), label_text("allocation_totals"),
      {{label_text("allocation_way"), ""},
       {label_text("cost"), ""},
       {label_text("within"), "%"},
       {label_text("floor"), display_unit(allocation.asked.response)}},
      ordered_json::array(
          {row("allocation_equal", allocation.equal_cost, allocation.equal_fraction),
           row("allocation_cheapest", allocation.cheapest_cost, allocation.cheapest_fraction)}),
      group);
}

/// Returns the table of the figures of the maps of a configuration; null if there are none.
/// @param influence  figures of its influence and uncertainty maps
ordered_json map_figures_block(const ConfigurationBudget& configuration,
                               const ordered_json& influence, std::size_t number) {
  ordered_json rows = ordered_json::array();
  const auto add = [&](const std::string& map, const ordered_json& figures) {
    for (const auto& [key, value] : figures.items())
      if (value.is_number())
        rows.push_back(
            ordered_json::array({label_text("maps_" + map), label_text("maps_" + key), value}));
  };
  add("map", map_figures(configuration));
  for (const auto& [map, figures] : influence.items()) add(map, figures);
  if (rows.empty()) return {};
  return table_block(
      block_id("map-figures", number), label_text("map_figures"),
      {{label_text("maps"), ""}, {label_text("figure"), ""}, {label_text("value"), ""}}, rows,
      configuration.arm.name);
}

/// Returns the blocks of the budget of all configurations.
ordered_json budget_blocks(const Budget& budget, const std::vector<ordered_json>& maps) {
  const Study& study = budget.study;
  const std::vector<ConfigurationBudget>& configurations = budget.configurations;
  ordered_json blocks = ordered_json::array({figures_block(budget)});
  for (std::size_t i = 0; i < configurations.size(); ++i) {
    blocks.push_back(map_block(study, configurations[i], i));
    for (const ResponseBudget& response : configurations[i].responses)
      for (const auto& block : {ranking_block, tornado_block, indices_block})
        blocks.push_back(block(study, configurations[i], response, i));
  }
  for (std::size_t r = 0; r < configurations.front().responses.size(); ++r)
    blocks.push_back(distribution_block(budget, r));
  for (std::size_t i = 0; i < configurations.size(); ++i) {
    if (const std::optional<Allocation>& allocation = configurations[i].allocation) {
      const std::string& group = configurations[i].arm.name;
      blocks.push_back(allocation_totals_block(*allocation, group, i));
      blocks.push_back(allocation_block(study, *allocation, group, i));
    }
    for (const ResponseBudget& response : configurations[i].responses)
      for (const auto& block : {inputs_block, convergence_block})
        blocks.push_back(block(study, configurations[i], response, i));
    blocks.push_back(
        map_figures_block(configurations[i], i < maps.size() ? maps[i] : ordered_json(), i));
  }
  for (std::size_t k = 0; k < budget.sweeps.size(); ++k)
    blocks.push_back(sweep_block(study, budget.sweeps[k], k));
  blocks.push_back(proofs_block(budget.proofs));
  return blocks;
}

/// Returns the command that repeats a study from the files of its page. It uses the saved scene
/// only without variants, because a saved scene has a single variant.
std::string study_command(const Study& study) {
  const bool has_variants = study.inputs.empty() ||
                            std::ranges::any_of(study.configurations, [](const Configuration& arm) {
                              return !arm.variant.empty();
                            });
  return std::string("abbe study study.toml") + (has_variants ? "" : " --set scene=scene.toml") +
         " --report";
}

}  // namespace

FiguresPage study_page(const Budget& budget, const std::vector<ordered_json>& maps,
                       const std::vector<HistoryResult>& histories) {
  const Study& study = budget.study;
  FiguresPage page;
  page.title = study.title;
  page.command = study_command(study);
  page.request = {{"study", study.title}};
  if (!budget.configurations.empty()) {
    page.blocks = budget_blocks(budget, maps);
    page.request.insert(page.request.end(),
                        {{"study_engine", name_of(study.engine)},
                         {"study_seed", std::to_string(study.seed)},
                         {"study_cases", std::to_string(budget.cases)},
                         {"study_failed_cases", std::to_string(budget.failed)},
                         {"study_inputs", std::to_string(study.inputs.size())}});
  }
  page.blocks.push_back(histories_block(histories));
  page.blocks.erase(std::remove(page.blocks.begin(), page.blocks.end(), nullptr),
                    page.blocks.end());
  page.warnings = budget.warnings;
  for (const HistoryResult& result : histories)
    page.warnings.insert(page.warnings.end(), result.warnings.begin(), result.warnings.end());
  const std::vector<std::string> omissions = page_omissions(budget);
  page.warnings.insert(page.warnings.end(), omissions.begin(), omissions.end());
  return page;
}

std::vector<std::string> page_omissions(const Budget& budget) {
  std::vector<std::string> warnings;
  for (const ConfigurationBudget& configuration : budget.configurations)
    for (const ResponseBudget& response : configuration.responses)
      if (const auto count = std::size_t(response.values.size()); count > max_shown_machines)
        warnings.push_back(fmt::format(
            "of {} random machines of {}, {}, the report shows {}, every {:.3g}th by rank", count,
            configuration.arm.name, response_title(response.response), max_shown_machines,
            double(count) / double(max_shown_machines)));
  return warnings;
}

}  // namespace abbe::sim::study
