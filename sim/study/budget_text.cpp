#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/scene/scene.h"
#include "sim/study/budget.h"
#include "sim/study/study_text.h"

namespace abbe::sim::study {
namespace {

constexpr std::size_t max_rows = 15;  // inputs in a table; the others are summed up below it

/// The size of one unit of an input in a unit that describes the machine.
struct UnitSize {
  double size = 1.0;
  std::string unit;
};

/// The style of a report, and the study whose names it shows.
struct ReportText {
  const Study& study;
  TextStyle style;
  std::vector<UnitSize> units = {};  ///< (inputs)

  std::string name(const std::string& text) const { return user_text(style, text); }
  std::string name(int input) const { return name(study.inputs[std::size_t(input)].name); }
  std::string bold(const std::string& text) const { return bold_text(style, text); }
  std::string table_text(const TextTable& rows) const { return table(style, rows); }
};

/// Returns a value with three significant digits, with an exponent only above 1e6 and below 1e-4.
std::string figure(double value) {
  if (!std::isfinite(value)) return "–";
  if (value == 0.0) return "0";
  const double size = std::abs(value);
  if (size >= 1e6 || size < 1e-4) return fmt::format("{:.2e}", value);
  const int decimals = std::clamp(2 - int(std::floor(std::log10(size))), 0, 6);
  return fmt::format("{:.{}f}", value, decimals);
}

/// Returns a value with two decimals, without sign if it rounds to zero.
std::string two_decimals(double value) {
  if (!std::isfinite(value)) return "–";
  return fmt::format("{:.2f}", std::abs(value) < 0.005 ? 0.0 : value);
}

std::string percent_text(double fraction) {
  const double percent = 100.0 * fraction;
  return fmt::format("{:.{}f} %", percent, percent != 0.0 && std::abs(percent) < 10.0 ? 1 : 0);
}

/// Returns a fraction of machines in percent, with a second decimal near 100 %.
std::string machines_text(double fraction) {
  const double percent = 100.0 * fraction;
  return fmt::format("{:.{}f}", percent, percent > 99.0 && percent < 100.0 ? 2 : 1);
}

std::string machines_text(const IntervalEstimate& estimate) {
  return fmt::format("{} % [{}, {}]", machines_text(estimate.value), machines_text(estimate.low),
                     machines_text(estimate.high));
}

/// Returns the unit in which the spread of an input is stated. For the factor of a location error
/// it is the error itself, factor times value; for that of an error motion, which is a curve, it is
/// the factor.
UnitSize unit_size(const Input& input, const Scene& scene) {
  const UnitSize input_unit{1.0, display_unit(input.unit)};
  if (input.element.empty()) return input_unit;
  for (const errors::Element& element : scene.geometric.elements) {
    if (errors::to_string(element.name) != input.element || !element.name.location) continue;
    double value = 0.0;
    for (const errors::Curve& curve : element.curves) {
      if (!std::holds_alternative<errors::Constant>(curve.shape))
        return {1.0, "× " + input.element};
      value += errors::value(curve, {});
    }
    const bool is_angle = element.name.is_angle();
    return {std::abs(scene.error_scale * value) / (is_angle ? units::urad : units::um),
            display_unit(is_angle ? "urad" : "um")};
  }
  return {1.0, "× " + input.element};
}

std::vector<UnitSize> unit_sizes(const Budget& budget) {
  const Study& study = budget.study;
  const bool has_scene = study.scene_tree != nullptr && !study.configurations.empty();
  const Scene scene = has_scene ? base_scene(study, study.configurations.front()) : Scene{};
  std::vector<UnitSize> sizes;
  for (const Input& input : study.inputs) sizes.push_back(unit_size(input, scene));
  return sizes;
}

std::string unit_text(const ReportText& report, int input) {
  return report.name(report.units[std::size_t(input)].unit);
}

double in_input_unit(const ReportText& report, int input, double value) {
  return value * report.units[std::size_t(input)].size;
}

std::string with_unit(Response response, double value) {
  return figure(in_unit(response, value)) + " " + display_unit(response);
}

std::string band_text(Response response, const IntervalEstimate& estimate) {
  return fmt::format("{} [{}, {}]", figure(in_unit(response, estimate.value)),
                     figure(in_unit(response, estimate.low)),
                     figure(in_unit(response, estimate.high)));
}

std::string totals_table(const ReportText& report, const ConfigurationBudget& arm) {
  TextTable table{{"response", "base", "RSS", "sum", "worst found", "at most", "mean", "std. dev.",
                   "P95", "P99", "limit", "within the limit", "Cpk"}};
  for (const ResponseBudget& response : arm.responses) {
    const auto value_text = [&](const std::optional<double>& value) {
      return value ? figure(in_unit(response.response, *value)) : std::string();
    };
    const auto statistic_text = [&](const IntervalEstimate ResponseStatistics::*what) {
      return response.answers ? band_text(response.response, (*response.answers).*what)
                              : std::string();
    };
    table.rows.push_back(
        {response_title(response.response) + ", " + display_unit(response.response),
         value_text(response.base), value_text(response.root_sum_square), value_text(response.sum),
         value_text(response.worst), value_text(response.worst_bound),
         statistic_text(&ResponseStatistics::mean),
         statistic_text(&ResponseStatistics::standard_deviation),
         statistic_text(&ResponseStatistics::p95), statistic_text(&ResponseStatistics::p99),
         value_text(response.limit),
         response.fraction_within ? machines_text(*response.fraction_within) : "",
         response.capability ? two_decimals(*response.capability) : ""});
  }
  return report.table_text(table);
}

/// Returns the meanings of those abbreviations of `totals_table` that the configuration needs.
std::string legend(const Budget& budget, const ConfigurationBudget& arm) {
  std::string text = "Base: every input at its centre. ";
  const auto has_any = [&](const auto& predicate) {
    return std::any_of(arm.responses.begin(), arm.responses.end(), predicate);
  };
  if (has_any([](const ResponseBudget& response) { return response.root_sum_square.has_value(); }))
    text += fmt::format(
        "RSS and sum: over the larger change caused by each input at its centre ± {:g} std. dev. ",
        budget.study.one_at_a_time ? budget.study.one_at_a_time->step : 1.0);
  if (has_any([](const ResponseBudget& response) { return response.worst.has_value(); }))
    text += fmt::format(
        "Worst found: worst of the corners tried, with inputs at the ends of their distributions "
        "or at ± {:g} std. dev.; no corner exceeds \"at most\". ",
        budget.study.worst_case ? budget.study.worst_case->coverage : 3.0);
  if (has_any([](const ResponseBudget& response) { return response.answers.has_value(); }))
    text += "Mean to Cpk: over random machines; brackets are 95 % confidence intervals. ";
  return text + "\n\n";
}

/// Returns a text of inputs with their shares, such as "EXX 41 %, EYX 20 %".
std::string input_shares(const ReportText& report, const Ranking& ranking,
                         const std::vector<int>& inputs) {
  std::string text;
  for (const int i : inputs)
    text += (text.empty() ? "" : ", ") + report.bold(report.name(i)) + " " +
            percent_text(ranking.shares[i]);
  return text;
}

/// Returns the inputs with the largest shares above zero, even if they do not dominate.
std::vector<int> largest_inputs(const Ranking& ranking, std::size_t max_inputs) {
  std::vector<int> inputs;
  for (std::size_t k = 0; k < std::min(max_inputs, ranking.order.size()); ++k)
    if (ranking.shares[ranking.order[k]] > 0.0) inputs.push_back(ranking.order[k]);
  return inputs;
}

std::string remainder_text(const Ranking& ranking) {
  // A smaller one would be printed as 0 %.
  if (!(ranking.apart >= 0.005)) return "";
  return fmt::format(", {} {}", remainder_name(ranking.basis), percent_text(ranking.apart));
}

/// Returns a text such as "mostly EXX 41 %, EYX 20 %, interactions of inputs 12 %", or that no
/// input dominates; empty without a basis.
std::string dominance_text(const ReportText& report, const Ranking& ranking) {
  if (ranking.basis == Ranking::Basis::None) return "";
  const std::vector<int> dominant = dominant_inputs(ranking);
  if (!dominant.empty())
    return "mostly " + input_shares(report, ranking, dominant) + remainder_text(ranking);
  const std::vector<int> largest = largest_inputs(ranking, 3);
  if (!largest.empty())
    return "no input dominates: the largest are " + input_shares(report, ranking, largest) +
           remainder_text(ranking);
  if (ranking.basis == Ranking::Basis::MainEffect)
    return "no input dominates: no single contribution is statistically significant";
  return ranking.weights.sum() > 0.0 ? "no input dominates" + remainder_text(ranking)
                                     : "no input has an effect";
}

/// Returns the number of inputs that together have a fraction of the shares of all inputs.
std::size_t input_count_for(const Ranking& ranking, double fraction) {
  double sum = 0.0;
  for (std::size_t k = 0; k < ranking.order.size(); ++k)
    if ((sum += ranking.shares[ranking.order[k]]) >= fraction * ranking.shares.sum()) return k + 1;
  return ranking.order.size();
}

std::string dominance_line(const ReportText& report, const std::string& subject,
                           const Ranking& ranking) {
  const std::string text = dominance_text(report, ranking);
  if (text.empty()) return "";
  std::string line = fmt::format("- {}: {}", subject, text);
  if (!largest_inputs(ranking, 1).empty())
    line += fmt::format(" (of {}); {} of {} inputs cause 90 % of the sum of single contributions",
                        share_of(ranking.basis), input_count_for(ranking, 0.9),
                        report.study.inputs.size());
  return line + ".\n";
}

/// Returns a line with the dominant inputs for every response and for the map.
std::string dominant_inputs_text(const ReportText& report, const ConfigurationBudget& arm) {
  std::string text;
  for (const ResponseBudget& response : arm.responses)
    text += dominance_line(report, response_title(response.response),
                           ranking(response, report.study.inputs.size()));
  text += dominance_line(report, "map", map_ranking(arm, report.study.inputs.size()));
  return text.empty() ? text : "Dominant inputs:\n\n" + text + "\n";
}

const Contribution* find_contribution(const ResponseBudget& response, int input) {
  for (const Contribution& contribution : response.contributions)
    if (contribution.input == input) return &contribution;
  return nullptr;
}

std::string change_text(Response response, const Contribution* contribution) {
  if (contribution == nullptr || (!contribution->low && !contribution->high)) return "";
  const auto value_text = [&](const std::optional<double>& change) -> std::string {
    if (!change) return "–";
    const double value = in_unit(response, *change);
    if (std::abs(value) < 1e-4) return "0";
    return (value > 0.0 ? "+" : "") + figure(value);
  };
  return value_text(contribution->low) + " / " + value_text(contribution->high);
}

std::string index_text(const IntervalEstimate& estimate) {
  return fmt::format("{} [{}, {}]", two_decimals(estimate.value), two_decimals(estimate.low),
                     two_decimals(estimate.high));
}

constexpr std::size_t max_changes = 3;  // number of responses whose changes fit into a table

TextTable input_table(const ConfigurationBudget& arm, const Ranking& order) {
  TextTable table;
  table.heads = {"input", "centre", "std. dev.", "unit"};
  table.text_columns = 1;
  for (std::size_t r = 0; r < std::min(arm.responses.size(), max_changes); ++r) {
    const Response response = arm.responses[r].response;
    table.heads.push_back(
        fmt::format("{} − / +, {}", response_title(response), display_unit(response)));
  }
  const std::string first_response =
      arm.responses.empty() ? "" : response_title(arm.responses.front().response) + ": ";
  table.heads.insert(
      table.heads.end(),
      {order.basis == Ranking::Basis::Map ? "fraction" : first_response + "fraction",
       first_response + "Sobol first", first_response + "total", first_response + "alone",
       first_response + "rank corr.", "map RMS, µm", "of the map"});
  return table;
}

std::vector<std::string> input_row(const ReportText& report, const ConfigurationBudget& arm,
                                   const Ranking& order, int input) {
  std::vector<std::string> row{
      report.name(input), figure(in_input_unit(report, input, centre(report.study)[input])),
      figure(in_input_unit(report, input, spreads(report.study)[input])), unit_text(report, input)};
  for (std::size_t r = 0; r < std::min(arm.responses.size(), max_changes); ++r)
    row.push_back(
        change_text(arm.responses[r].response, find_contribution(arm.responses[r], input)));
  const Contribution* contribution =
      arm.responses.empty() ? nullptr : find_contribution(arm.responses.front(), input);
  const bool has_map = std::size_t(input) < arm.maps.size();
  const bool has_share = order.basis != Ranking::Basis::Map && order.basis != Ranking::Basis::None;
  row.insert(
      row.end(),
      {has_share ? percent_text(order.shares[input]) : "",
       contribution && contribution->sobol ? index_text(contribution->sobol->first) : "",
       contribution && contribution->sobol ? index_text(contribution->sobol->total) : "",
       contribution && contribution->main_effect ? percent_text(*contribution->main_effect) : "",
       contribution && contribution->rank_correlation
           ? two_decimals(*contribution->rank_correlation)
           : "",
       has_map ? figure(arm.maps[std::size_t(input)].rms / units::um) : "",
       has_map ? percent_text(arm.maps[std::size_t(input)].share) : ""});
  return row;
}

std::string inputs_text(const ReportText& report, const ConfigurationBudget& arm) {
  Ranking order;
  if (!arm.responses.empty()) order = ranking(arm.responses.front(), report.study.inputs.size());
  if (order.basis == Ranking::Basis::None || !(order.weights.sum() > 0.0)) {
    const Ranking map = map_ranking(arm, report.study.inputs.size());
    if (map.basis != Ranking::Basis::None) order = map;
  }
  if (order.basis == Ranking::Basis::None) return "";
  TextTable table = input_table(arm, order);
  double remaining_share = 0.0;
  for (std::size_t k = 0; k < order.order.size(); ++k) {
    const int i = order.order[k];
    if (k < max_rows)
      table.rows.push_back(input_row(report, arm, order, i));
    else
      remaining_share += order.shares[i];
  }
  std::string text = report.table_text(table);
  if (order.order.size() > max_rows)
    text += fmt::format("and {} others, {} in total.\n", order.order.size() - max_rows,
                        percent_text(remaining_share));
  text += fmt::format("Fractions: of {}{}. ", share_of(order.basis), remainder_text(order));
  if (order.basis == Ranking::Basis::MainEffect && !report.study.copula.groups().empty())
    text += "Inputs are correlated: the joint contribution of two inputs counts for both. ";
  return text + "\n\n";
}

/// Returns the text about the map over random machines, the part of it that is due to no input, and
/// the flagged area.
std::string map_text(const ConfigurationBudget& arm) {
  std::string text;
  if (arm.map_rms)
    text += fmt::format("Map over random machines: RMS {} µm", figure(*arm.map_rms / units::um));
  if (arm.map_mean_rms)
    text += fmt::format("{}{} µm not caused by inputs (cusps, centres)",
                        text.empty() ? "Map: " : ", ", figure(*arm.map_mean_rms / units::um));
  if (!text.empty()) text += ". ";
  if (arm.flagged_percent)
    text += fmt::format("{} % of the judged area is flagged: influence maps are invalid there. ",
                        figure(*arm.flagged_percent));
  return text.empty() ? text : text + "\n\n";
}

/// Returns the root-sum-square of a linear response after halving the spreads of the first `count`
/// inputs, which leaves a quarter of their squares.
double rss_after_halving(const Ranking& squares, std::size_t count) {
  double sum = squares.weights.sum();
  for (std::size_t k = 0; k < std::min(count, squares.order.size()); ++k)
    sum -= 0.75 * squares.weights[squares.order[k]];
  return std::sqrt(std::max(sum, 0.0));
}

/// Returns the effect of halving spreads; empty if there are no changes one at a time.
std::string halving_text(const ReportText& report, const ConfigurationBudget& arm) {
  if (arm.responses.empty()) return "";
  const ResponseBudget& response = arm.responses.front();
  const Ranking squares = change_ranking(response, report.study.inputs.size());
  if (squares.basis == Ranking::Basis::None || !(squares.weights.sum() > 0.0)) return "";
  std::string text =
      fmt::format("Halving the spread of {} would reduce the RSS of {} from {} to {}",
                  report.name(squares.order.front()), response_title(response.response),
                  with_unit(response.response, rss_after_halving(squares, 0)),
                  with_unit(response.response, rss_after_halving(squares, 1)));
  if (report.study.inputs.size() > 3)
    text += fmt::format(", halving the first three to {}",
                        with_unit(response.response, rss_after_halving(squares, 3)));
  return text + fmt::format(", assuming linearity. Without any spread, {} is {}.\n\n",
                            response_title(response.response),
                            with_unit(response.response, response.base));
}

std::vector<int> tightened_inputs(const Eigen::VectorXd& factors) {
  std::vector<int> order;
  for (Eigen::Index i = 0; i < factors.size(); ++i)
    // A larger factor would be printed as 1.00.
    if (factors[i] < 0.995) order.push_back(int(i));
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return factors[a] < factors[b]; });
  return order;
}

std::string tightening_text(const ReportText& report, const Eigen::VectorXd& factors) {
  const Eigen::VectorXd present_spreads = spreads(report.study);
  const std::vector<int> order = tightened_inputs(factors);
  TextTable table{
      {"tighten", "std. dev. now", "to", "unit", "by the factor", "cost now", "then", "more"}};
  double remaining_cost = 0.0;
  for (std::size_t k = 0; k < order.size(); ++k) {
    const int i = order[k];
    const Input& input = report.study.inputs[std::size_t(i)];
    const double new_cost = input.cost / factors[i];
    if (k >= max_rows) {
      remaining_cost += new_cost - input.cost;
      continue;
    }
    table.rows.push_back({report.name(i), figure(in_input_unit(report, i, present_spreads[i])),
                          figure(in_input_unit(report, i, present_spreads[i] * factors[i])),
                          unit_text(report, i), fmt::format("{:.2f}", factors[i]),
                          figure(input.cost), figure(new_cost), figure(new_cost - input.cost)});
  }
  if (order.empty()) return "No spread needs to be reduced.\n\n";
  std::string text = report.table_text(table);
  if (order.size() > max_rows)
    text += fmt::format("and {} others at an additional cost of {}. ", order.size() - max_rows,
                        figure(remaining_cost));
  const std::size_t unchanged = std::size_t(factors.size()) - order.size();
  if (unchanged > 0)
    text += fmt::format("{} can stay unchanged.",
                        unchanged == 1 ? "1 input" : fmt::format("{} inputs", unchanged));
  return text + "\n\n";
}

std::string allocation_text(const ReportText& report, const Allocation& allocation) {
  const std::string response = response_title(allocation.asked.response);
  std::string text =
      fmt::format("{}, for {} ≤ {} in {} of the machines. ", report.bold("Where to spend"),
                  response, with_unit(allocation.asked.response, allocation.asked.limit),
                  percent_text(allocation.asked.confidence));
  text += fmt::format("Without any spread, with every input at its centre, {} is {}.\n\n", response,
                      with_unit(allocation.asked.response, allocation.floor));
  if (!allocation.attainable)
    return text + report.bold("Not attainable") + ", even without any spread.\n\n";
  double present_cost = 0.0;
  for (const Input& input : report.study.inputs) present_cost += input.cost;
  text += fmt::format("- cheapest: cost {} (now {}), within the limit {}\n",
                      figure(allocation.cheapest_cost), figure(present_cost),
                      machines_text(allocation.cheapest_fraction));
  if (allocation.equal.size() > 0)
    text +=
        fmt::format("- every spread × {:.2f}: cost {}, within the limit {}\n", allocation.equal[0],
                    figure(allocation.equal_cost), machines_text(allocation.equal_fraction));
  return text + "\n" +
         (allocation.cheapest.size() > 0 ? tightening_text(report, allocation.cheapest) : "");
}

std::string configuration_text(const ReportText& report, const Budget& budget,
                               const ConfigurationBudget& arm) {
  return heading(report.style, 2, report.name(arm.arm.name)) + totals_table(report, arm) +
         dominant_inputs_text(report, arm) +
         (arm.allocation ? allocation_text(report, *arm.allocation) : halving_text(report, arm)) +
         inputs_text(report, arm) + map_text(arm) + legend(budget, arm);
}

/// Returns a sentence about a configuration: its figures, the dominant inputs, and the first input
/// to tighten.
std::string summary_sentence(const ReportText& report, const ConfigurationBudget& arm) {
  if (arm.responses.empty()) return "";
  const ResponseBudget& response = arm.responses.front();
  std::string text = fmt::format("- {}: {}", report.bold(report.name(arm.arm.name)),
                                 response_title(response.response));
  text += response.answers ? " ≤ " + with_unit(response.response, response.answers->p95.value) +
                                 " in 95 % of the machines"
                           : " " + with_unit(response.response, response.base) + " at the centres";
  if (response.limit)
    text += fmt::format(", limit {}", with_unit(response.response, *response.limit));
  if (response.fraction_within)
    text += fmt::format(" met by {}", percent_text(response.fraction_within->value));
  const Ranking response_ranking = ranking(response, report.study.inputs.size());
  const std::string dominance = dominance_text(report, response_ranking);
  if (!dominance.empty()) text += "; " + dominance;
  const Ranking map_shares = map_ranking(arm, report.study.inputs.size());
  if (dominant_inputs(response_ranking).empty() && !dominant_inputs(map_shares).empty())
    text += "; the map is " + dominance_text(report, map_shares);
  if (arm.allocation && !arm.allocation->attainable) {
    text += "; the limit cannot be met at any cost";
  } else if (arm.allocation) {
    const std::vector<int> order = tightened_inputs(arm.allocation->cheapest);
    if (!order.empty())
      text += fmt::format("; tighten first {} to {:.2f} of its spread",
                          report.bold(report.name(order.front())),
                          arm.allocation->cheapest[order.front()]);
  }
  return text + ".\n";
}

std::string heading_text(const ReportText& report, const Budget& budget) {
  const Study& study = budget.study;
  std::string text = heading(report.style, 1, report.name(study.title));
  text += fmt::format("{} inputs, {} cases", study.inputs.size(), budget.cases);
  if (budget.failed > 0)
    text += ", " + report.bold(fmt::format("{} without a result", budget.failed));
  text += fmt::format(", seed {}. ", study.seed);
  if (study.subtracts_error_free_map) text += "Figures refer to the map minus the error-free map. ";
  return text + "\n\n";
}

std::string proofs_text(const ReportText& report, const Budget& budget) {
  if (budget.proofs.empty()) return "";
  TextTable table{{"influence against full cuts", "response", "cases", "max difference, %"}};
  table.text_columns = 2;
  for (const Proof& proof : budget.proofs)
    table.rows.push_back({report.name(proof.arm), response_title(proof.response),
                          fmt::format("{}", proof.compared),
                          proof.percent ? figure(*proof.percent) : "–"});
  return heading(report.style, 2, "Proof") + report.table_text(table);
}

std::string without_trailing_spaces(const std::string& text) {
  std::string result;
  for (const char character : text) {
    while (character == '\n' && !result.empty() && result.back() == ' ') result.pop_back();
    result += character;
  }
  return result;
}

std::string make_report(const Budget& budget, TextStyle style) {
  const ReportText report{budget.study, style, unit_sizes(budget)};
  std::string text = heading_text(report, budget);
  for (const std::string& warning : budget.warnings)
    text += warning_paragraph(style, report.name(warning));
  for (const ConfigurationBudget& arm : budget.configurations)
    text += summary_sentence(report, arm);
  if (!budget.configurations.empty()) text += "\n";
  for (const ConfigurationBudget& arm : budget.configurations)
    text += configuration_text(report, budget, arm);
  return without_trailing_spaces(text + proofs_text(report, budget));
}

}  // namespace

std::string to_markdown(const Budget& budget) { return make_report(budget, TextStyle::Markdown); }

std::string to_text(const Budget& budget) { return make_report(budget, TextStyle::Terminal); }

}  // namespace abbe::sim::study
