#include "sim/study/budget.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/study/response_statistics.h"
#include "sim/study/study_text.h"

namespace abbe::sim::study {

namespace {

double square(double value) { return value * value; }

constexpr double numerical_floor = 1e-6;  // mm, of the surface; a smaller change has no cause

/// Returns the values with 0 for those that are negative, as estimates of indices may be, or not
/// finite.
Eigen::VectorXd finite_non_negative(const Eigen::VectorXd& values) {
  return values.array().isFinite().select(values.cwiseMax(0.0), 0.0);
}

/// Ranks inputs by weight. Estimated shares may add up to more than 1, and are then scaled down.
Ranking make_ranking(Ranking::Basis basis, const Eigen::VectorXd& weights,
                     const Eigen::VectorXd& shares) {
  Ranking ranking;
  ranking.basis = basis;
  ranking.weights = finite_non_negative(weights);
  ranking.shares = finite_non_negative(shares);
  ranking.shares /= std::max(1.0, ranking.shares.sum());
  ranking.apart = ranking.weights.sum() > 0.0 ? std::max(0.0, 1.0 - ranking.shares.sum()) : 0.0;
  ranking.order.resize(std::size_t(weights.size()));
  std::iota(ranking.order.begin(), ranking.order.end(), 0);
  std::stable_sort(ranking.order.begin(), ranking.order.end(),
                   [&](int a, int b) { return ranking.weights[a] > ranking.weights[b]; });
  return ranking;
}

/// Ranks inputs by weight; shares are fractions of the sum of all weights.
Ranking make_ranking(Ranking::Basis basis, const Eigen::VectorXd& weights) {
  const Eigen::VectorXd clean_weights = finite_non_negative(weights);
  const double sum = clean_weights.sum();
  Ranking ranking = make_ranking(basis, clean_weights,
                                 sum > 0.0 ? Eigen::VectorXd(clean_weights / sum) : clean_weights);
  ranking.apart = 0.0;
  return ranking;
}

/// Returns (inputs) one figure of every contribution, 0 where it is missing; none if no
/// contribution has it.
template <typename Figure>
std::optional<Eigen::VectorXd> collect_figures(const ResponseBudget& response,
                                               std::size_t input_count, const Figure& figure) {
  Eigen::VectorXd result = Eigen::VectorXd::Zero(Eigen::Index(input_count));
  bool has_any = false;
  for (const Contribution& contribution : response.contributions) {
    const std::optional<double> value = figure(contribution);
    if (!value) continue;
    has_any = true;
    result[contribution.input] = *value;
  }
  return has_any ? std::optional(result) : std::nullopt;
}

std::optional<Ranking> sobol_ranking(const ResponseBudget& response, std::size_t input_count) {
  const auto indices = [&](const IntervalEstimate SobolIndex::*which) {
    return collect_figures(response, input_count, [&](const Contribution& contribution) {
      return contribution.sobol ? std::optional(((*contribution.sobol).*which).value)
                                : std::nullopt;
    });
  };
  const auto total = indices(&SobolIndex::total), first = indices(&SobolIndex::first);
  if (!total) return {};
  return make_ranking(Ranking::Basis::Sobol, *total, *first);
}

std::optional<Ranking> main_effect_ranking(const ResponseBudget& response,
                                           std::size_t input_count) {
  // Effects that chance alone may give count as zero.
  const double chance = main_effect_chance_limit(response.answers ? response.answers->cases : 0,
                                                 Eigen::Index(input_count));
  const auto effects =
      collect_figures(response, input_count, [&](const Contribution& contribution) {
        return contribution.main_effect
                   ? std::optional(*contribution.main_effect > chance ? *contribution.main_effect
                                                                      : 0.0)
                   : std::nullopt;
      });
  if (!effects) return {};
  Ranking ranking = make_ranking(Ranking::Basis::MainEffect, *effects, *effects);
  ranking.apart = std::max(0.0, 1.0 - ranking.shares.sum());
  return ranking;
}

}  // namespace

std::optional<double> larger_change(const Contribution& contribution) {
  if (!contribution.low && !contribution.high) return {};
  return std::max(std::abs(contribution.low.value_or(0.0)),
                  std::abs(contribution.high.value_or(0.0)));
}

Ranking change_ranking(const ResponseBudget& response, std::size_t input_count) {
  // The floor is in mm and does not apply to the area in tolerance, which is in percent.
  const double floor = response.response == Response::InTolerance ? 0.0 : numerical_floor;
  const auto squares =
      collect_figures(response, input_count, [&](const Contribution& contribution) {
        const std::optional<double> change = larger_change(contribution);
        return change ? std::optional(*change >= floor ? square(*change) : 0.0) : std::nullopt;
      });
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(Eigen::Index(input_count));
  return squares ? make_ranking(Ranking::Basis::Change, *squares)
                 : make_ranking(Ranking::Basis::None, zero);
}

double chance_correlation(const ResponseBudget& response) {
  // The correlation of independent values has the standard error 1 / sqrt(n). Chance exceeds four
  // of them once in 16 000 pairs.
  return response.answers ? 4.0 / std::sqrt(double(response.answers->cases)) : 0.0;
}

Ranking ranking(const ResponseBudget& response, std::size_t input_count) {
  if (response.response != Response::InTolerance && response.answers &&
      response.answers->standard_deviation.value < numerical_floor)
    return {};
  if (const auto sobol = sobol_ranking(response, input_count)) return *sobol;
  Ranking change = change_ranking(response, input_count);
  if (change.basis != Ranking::Basis::None) return change;
  return main_effect_ranking(response, input_count).value_or(Ranking{});
}

Ranking map_ranking(const ConfigurationBudget& arm, std::size_t input_count) {
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(Eigen::Index(input_count));
  for (std::size_t i = 0; i < std::min(arm.maps.size(), input_count); ++i)
    weights[Eigen::Index(i)] = arm.maps[i].share;
  Ranking result =
      make_ranking(arm.maps.empty() ? Ranking::Basis::None : Ranking::Basis::Map, weights);
  // Shares of a map may be negative, which `make_ranking` would clip.
  result.shares = weights;
  return result;
}

const char* share_of(Ranking::Basis basis) {
  switch (basis) {
    case Ranking::Basis::None:
      return "";
    case Ranking::Basis::Sobol:
      return "the variance, first-order Sobol indices";
    case Ranking::Basis::Change:
      return "the sum of squares, one at a time";
    case Ranking::Basis::MainEffect:
      return "the variance, by line and parabola of each input";
    case Ranking::Basis::Map:
      return "the mean square of the map that inputs make";
  }
  return "";
}

const char* remainder_name(Ranking::Basis basis) {
  switch (basis) {
    case Ranking::Basis::Sobol:
      return "interactions of inputs";
    case Ranking::Basis::MainEffect:
      return "not due to a single input";
    default:
      return "";
  }
}

std::vector<int> dominant_inputs(const Ranking& ranking) {
  constexpr std::size_t max_inputs = 3;
  std::vector<int> inputs;
  double sum = 0.0;
  for (std::size_t k = 0; k < std::min(max_inputs, ranking.order.size()); ++k) {
    const int i = ranking.order[k];
    if (!(ranking.shares[i] > 0.0)) continue;
    inputs.push_back(i);
    sum += ranking.shares[i];
  }
  return sum >= 0.5 ? inputs : std::vector<int>{};
}

std::vector<ParetoBar> pareto(const Ranking& ranking, std::size_t max_inputs) {
  std::vector<int> order = ranking.order;
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return std::abs(ranking.shares[a]) > std::abs(ranking.shares[b]);
  });
  std::vector<ParetoBar> bars;
  ParetoBar others{ParetoBar::Kind::Others, 0, 0, 0.0};
  for (const int i : order) {
    if (bars.size() < max_inputs) {
      bars.push_back({ParetoBar::Kind::Input, i, 1, ranking.shares[i]});
    } else {
      ++others.many;
      others.share += ranking.shares[i];
    }
  }
  if (others.many > 0) bars.push_back(others);
  if (*remainder_name(ranking.basis) != '\0')
    bars.push_back({ParetoBar::Kind::Apart, 0, 1, ranking.apart});
  return bars;
}

using nlohmann::ordered_json;

ordered_json json_figure(const std::optional<double>& value) {
  return value && std::isfinite(*value) ? ordered_json(*value) : ordered_json();
}

ordered_json json_figure(const IntervalEstimate& estimate, double factor) {
  return {{"value", json_figure(factor * estimate.value)},
          {"low", json_figure(factor * estimate.low)},
          {"high", json_figure(factor * estimate.high)}};
}

ordered_json json_figure(Response response, const std::optional<double>& value) {
  return value ? json_figure(in_unit(response, *value)) : ordered_json();
}

ordered_json json_figure(Response response, const IntervalEstimate& estimate) {
  return json_figure(IntervalEstimate{in_unit(response, estimate.value),
                                      in_unit(response, estimate.low),
                                      in_unit(response, estimate.high)});
}

ordered_json json_figures(const Eigen::VectorXd& values) {
  ordered_json list = ordered_json::array();
  for (const double value : values) list.push_back(json_figure(value));
  return list;
}

ordered_json map_figures(const ConfigurationBudget& arm) {
  if (arm.maps.empty() && !arm.map_rms && !arm.uncut_percent) return {};
  const auto figure_um = [](const std::optional<double>& value) {
    return value ? json_figure(*value / units::um) : ordered_json();
  };
  return {{"rms_um", figure_um(arm.map_rms)},
          {"mean_rms_um", figure_um(arm.map_mean_rms)},
          {"flagged_percent", json_figure(arm.flagged_percent)},
          {"uncut_percent", json_figure(arm.uncut_percent)},
          {"gouged_percent", json_figure(arm.gouged_percent)}};
}

namespace {

const char* name_of(Distribution::Kind kind) {
  switch (kind) {
    case Distribution::Kind::Normal:
      return "normal";
    case Distribution::Kind::Uniform:
      return "uniform";
    case Distribution::Kind::Triangular:
      return "triangular";
    case Distribution::Kind::LogNormal:
      return "log_normal";
  }
  return "";
}

ordered_json inputs_json(const Study& study) {
  const Eigen::VectorXd centres = centre(study), deviations = spreads(study);
  ordered_json list = ordered_json::array();
  for (std::size_t i = 0; i < study.inputs.size(); ++i) {
    const Input& input = study.inputs[i];
    const Distribution& d = input.distribution;
    ordered_json settings = ordered_json::array();
    for (const Setting& setting : input.settings)
      settings.push_back({{"path", setting.path}, {"factor", json_figure(setting.factor)}});
    list.push_back({{"name", input.name},
                    {"unit", unit_of(input)},
                    {"centre", json_figure(centres[Eigen::Index(i)])},
                    {"standard_deviation", json_figure(deviations[Eigen::Index(i)])},
                    {"cost", json_figure(input.cost)},
                    {"distribution",
                     {{"kind", name_of(d.kind)},
                      {"centre", json_figure(d.centre)},
                      {"spread", json_figure(d.spread)},
                      {"low", json_figure(d.low)},
                      {"high", json_figure(d.high)}}},
                    {"element", input.element},
                    {"number", input.number},
                    {"settings", settings}});
  }
  return list;
}

/// Returns the correlated pairs of inputs.
ordered_json correlations_json(const Study& study) {
  ordered_json pairs = ordered_json::array();
  for (const Copula::Group& group : study.copula.groups()) {
    const Eigen::MatrixXd rho = group.factor * group.factor.transpose();
    for (Eigen::Index i = 0; i < rho.rows(); ++i)
      for (Eigen::Index j = 0; j < i; ++j)
        if (rho(i, j) != 0.0)
          pairs.push_back({{"a", study.inputs[std::size_t(group.of[std::size_t(j)])].name},
                           {"b", study.inputs[std::size_t(group.of[std::size_t(i)])].name},
                           {"rho", json_figure(rho(i, j))}});
  }
  return pairs;
}

ordered_json contribution_json(const Study& study, const Contribution& contribution,
                               Response response) {
  return {
      {"input", study.inputs[std::size_t(contribution.input)].name},
      {"low", json_figure(response, contribution.low)},
      {"high", json_figure(response, contribution.high)},
      {"sobol_first", contribution.sobol ? json_figure(contribution.sobol->first) : ordered_json()},
      {"sobol_total", contribution.sobol ? json_figure(contribution.sobol->total) : ordered_json()},
      {"correlation", json_figure(contribution.correlation)},
      {"rank_correlation", json_figure(contribution.rank_correlation)},
      {"main_effect_percent",
       contribution.main_effect ? json_figure(100.0 * *contribution.main_effect) : ordered_json()}};
}

ordered_json statistics_json(const ResponseStatistics& statistics, Response response) {
  return {{"cases", statistics.cases},
          {"mean", json_figure(response, statistics.mean)},
          {"standard_deviation", json_figure(response, statistics.standard_deviation)},
          {"min", json_figure(response, statistics.min)},
          {"max", json_figure(response, statistics.max)},
          {"median", json_figure(response, statistics.median)},
          {"p95", json_figure(response, statistics.p95)},
          {"p99", json_figure(response, statistics.p99)}};
}

ordered_json convergence_json(const IndexConvergence& index_convergence) {
  ordered_json steps = ordered_json::array();
  for (std::size_t m = 0; m < index_convergence.base_points.size(); ++m) {
    ordered_json first = ordered_json::array(), total = ordered_json::array();
    for (const SobolIndex& index : index_convergence.indices[m]) {
      first.push_back(json_figure(index.first));
      total.push_back(json_figure(index.total));
    }
    steps.push_back({{"base_points", index_convergence.base_points[m]},
                     {"sobol_first", first},
                     {"sobol_total", total}});
  }
  return steps;
}

/// Returns the inputs with the largest shares of a response, and the share due to no input alone.
ordered_json dominance_json(const Study& study, const ResponseBudget& response) {
  const Ranking order = ranking(response, study.inputs.size());
  if (order.basis == Ranking::Basis::None) return {};
  ordered_json list = ordered_json::array();
  for (const ParetoBar& bar : pareto(order, max_ranked_inputs))
    if (bar.kind == ParetoBar::Kind::Input && bar.share > 0.0)
      list.push_back({{"input", study.inputs[std::size_t(bar.input)].name},
                      {"share_percent", json_figure(100.0 * bar.share)}});
  return {{"of", share_of(order.basis)},
          {"dominated", !dominant_inputs(order).empty()},
          {"largest", list},
          {"of_no_input_alone_percent", json_figure(100.0 * order.apart)}};
}

ordered_json response_json(const Study& study, const ResponseBudget& budget) {
  const Response response = budget.response;
  ordered_json contributions = ordered_json::array();
  for (const Contribution& contribution : budget.contributions)
    contributions.push_back(contribution_json(study, contribution, response));
  return {
      {"response", name_of(budget.response)},
      {"unit", unit_of(budget.response)},
      {"base", json_figure(response, budget.base)},
      {"root_sum_square", json_figure(response, budget.root_sum_square)},
      {"sum", json_figure(response, budget.sum)},
      {"worst", json_figure(response, budget.worst)},
      {"worst_bound", json_figure(response, budget.worst_bound)},
      {"monte_carlo", budget.answers ? statistics_json(*budget.answers, response) : ordered_json()},
      {"limit", json_figure(response, budget.limit)},
      {"within_limit_percent",
       budget.fraction_within ? json_figure(*budget.fraction_within, 100.0) : ordered_json()},
      {"cpk", json_figure(budget.capability)},
      {"whose", dominance_json(study, budget)},
      {"contributions", contributions},
      {"convergence",
       budget.index_convergence ? convergence_json(*budget.index_convergence) : ordered_json()}};
}

ordered_json map_json(const Study& study, const ConfigurationBudget& arm) {
  ordered_json json = map_figures(arm);
  if (json.is_null()) return json;
  ordered_json list = ordered_json::array();
  for (std::size_t i = 0; i < arm.maps.size(); ++i)
    list.push_back({{"input", study.inputs[i].name},
                    {"rms_um", json_figure(arm.maps[i].rms / units::um)},
                    {"pv_um", json_figure(arm.maps[i].pv / units::um)},
                    {"share_percent", json_figure(100.0 * arm.maps[i].share)}});
  json["contributions"] = list;
  return json;
}

ordered_json allocation_json(const Allocation& allocation) {
  const Response response = allocation.asked.response;
  const auto choice_json = [&](const Eigen::VectorXd& factors, double cost,
                               const IntervalEstimate& within_limit) {
    return ordered_json{{"factors", json_figures(factors)},
                        {"cost", json_figure(cost)},
                        {"within_limit_percent", json_figure(within_limit, 100.0)}};
  };
  return {
      {"response", name_of(response)},
      {"unit", unit_of(response)},
      {"limit", json_figure(response, allocation.asked.limit)},
      {"confidence_percent", json_figure(100.0 * allocation.asked.confidence)},
      {"floor", json_figure(response, allocation.floor)},
      {"attainable", allocation.attainable},
      {"equal", choice_json(allocation.equal, allocation.equal_cost, allocation.equal_fraction)},
      {"cheapest",
       choice_json(allocation.cheapest, allocation.cheapest_cost, allocation.cheapest_fraction)}};
}

ordered_json unidentified_json(const ConfigurationBudget& arm) {
  ordered_json list = ordered_json::array();
  for (const UnidentifiedEffect& effect : arm.unidentified)
    list.push_back({{"number", effect.number.number},
                    {"unit", effect.number.unit},
                    {"spread", json_figure(effect.number.spread)},
                    {"drawn", effect.number.is_drawn},
                    {"rms_um", json_figure(effect.rms / units::um)},
                    {"pv_um", json_figure(effect.pv / units::um)}});
  return list;
}

ordered_json configuration_json(const Study& study, const ConfigurationBudget& budget) {
  ordered_json responses = ordered_json::array();
  for (const ResponseBudget& response : budget.responses)
    responses.push_back(response_json(study, response));
  return {{"name", budget.arm.name},
          {"variant", budget.arm.variant},
          {"case", budget.arm.case_name},
          {"responses", responses},
          {"map", map_json(study, budget)},
          {"unidentified", unidentified_json(budget)},
          {"allocation", budget.allocation ? allocation_json(*budget.allocation) : ordered_json()}};
}

ordered_json sweep_json(const Study& study, const SweepResult& result) {
  const Sweep& sweep = study.sweeps[std::size_t(result.sweep)];
  ordered_json configurations = ordered_json::array(), units = ordered_json::object();
  for (const Response response : study.responses) units[name_of(response)] = unit_of(response);
  for (std::size_t a = 0; a < result.answers.size(); ++a) {
    ordered_json configuration_entry{{"name", study.configurations[a].name}};
    for (std::size_t r = 0; r < result.answers[a].size(); ++r) {
      ordered_json values = ordered_json::array();
      for (const double value : result.answers[a][r])
        values.push_back(json_figure(study.responses[r], value));
      configuration_entry[name_of(study.responses[r])] = values;
    }
    configurations.push_back(configuration_entry);
  }
  return {{"input", study.inputs[std::size_t(sweep.input)].name},
          {"unit", unit_of(study.inputs[std::size_t(sweep.input)])},
          {"values", json_figures(sweep.values)},
          {"units", units},
          {"arms", configurations}};
}

}  // namespace

ordered_json to_json(const Budget& budget) {
  const Study& study = budget.study;
  ordered_json configurations = ordered_json::array(), proofs = ordered_json::array(),
               sweeps = ordered_json::array();
  for (const ConfigurationBudget& arm_budget : budget.configurations)
    configurations.push_back(configuration_json(study, arm_budget));
  for (const Proof& proof : budget.proofs)
    proofs.push_back({{"arm", proof.arm},
                      {"response", name_of(proof.response)},
                      {"compared", proof.compared},
                      {"one_sided", proof.one_sided},
                      {"percent", json_figure(proof.percent)}});
  for (const SweepResult& sweep : budget.sweeps) sweeps.push_back(sweep_json(study, sweep));
  return {{"study", study.title},
          {"engine", name_of(study.engine)},
          {"seed", study.seed},
          {"cases", budget.cases},
          {"failed_cases", budget.failed},
          {"machine_part", study.subtracts_error_free_map},
          {"step_standard_deviations",
           study.one_at_a_time ? json_figure(study.one_at_a_time->step) : ordered_json()},
          {"inputs", inputs_json(study)},
          {"correlations", correlations_json(study)},
          {"arms", configurations},
          {"proofs", proofs},
          {"sweeps", sweeps},
          {"warnings", budget.warnings}};
}

namespace {

using Cells = std::vector<std::string>;

/// Returns the cells of a value in the two columns for micrometres and percent, one of them empty.
Cells value_cells(Response response, const std::optional<double>& value) {
  const std::string text = value ? csv_field(in_unit(response, *value)) : "";
  return response == Response::InTolerance ? Cells{"", text} : Cells{text, ""};
}

Cells value_cells(const IntervalEstimate& estimate) {
  return {csv_field(estimate.value), csv_field(estimate.low), csv_field(estimate.high)};
}

Cells value_cells(const std::optional<SobolIndex>& index) {
  Cells cells = index ? value_cells(index->first) : Cells(3);
  const Cells total = index ? value_cells(index->total) : Cells(3);
  cells.insert(cells.end(), total.begin(), total.end());
  return cells;
}

constexpr const char* csv_head =
    "arm,response,input,input_unit,centre,standard_deviation,cost,"
    "low_um,low_percent,high_um,high_percent,share_of_squares_percent,"
    "sobol_first,sobol_first_low,sobol_first_high,sobol_total,sobol_total_low,sobol_total_high,"
    "correlation,rank_correlation,main_effect_percent,map_rms_um,map_pv_um,map_share_percent,"
    "equal_factor,cheapest_factor\n";

/// Returns the cell of an input; empty if the values were not computed.
std::string input_cell(const Eigen::VectorXd& values, Eigen::Index i) {
  return i < values.size() ? csv_field(values[i]) : "";
}

}  // namespace

std::string to_csv(const Budget& budget) {
  const Study& study = budget.study;
  const Eigen::VectorXd centres = centre(study), deviations = spreads(study);
  std::string text = csv_head;
  for (const ConfigurationBudget& arm : budget.configurations) {
    const Eigen::VectorXd empty;
    const Eigen::VectorXd& equal = arm.allocation ? arm.allocation->equal : empty;
    const Eigen::VectorXd& cheapest = arm.allocation ? arm.allocation->cheapest : empty;
    for (const ResponseBudget& response_budget : arm.responses) {
      const Ranking squares = change_ranking(response_budget, study.inputs.size());
      for (const Contribution& contribution : response_budget.contributions) {
        const auto i = std::size_t(contribution.input);
        const Input& input = study.inputs[i];
        const std::optional<MapContribution> map =
            i < arm.maps.size() ? std::optional(arm.maps[i]) : std::nullopt;
        Cells row{csv_field(arm.arm.name),
                  name_of(response_budget.response),
                  csv_field(input.name),
                  csv_field(unit_of(input)),
                  csv_field(centres[contribution.input]),
                  csv_field(deviations[contribution.input]),
                  csv_field(input.cost)};
        const auto add = [&](const Cells& cells) {
          row.insert(row.end(), cells.begin(), cells.end());
        };
        add(value_cells(response_budget.response, contribution.low));
        add(value_cells(response_budget.response, contribution.high));
        add({larger_change(contribution) ? csv_field(100.0 * squares.shares[contribution.input])
                                         : ""});
        add(value_cells(contribution.sobol));
        add({csv_field(contribution.correlation), csv_field(contribution.rank_correlation),
             contribution.main_effect ? csv_field(100.0 * *contribution.main_effect) : ""});
        add(map ? Cells{csv_field(map->rms / units::um), csv_field(map->pv / units::um),
                        csv_field(100.0 * map->share)}
                : Cells(3));
        add({input_cell(equal, contribution.input), input_cell(cheapest, contribution.input)});
        text += fmt::format("{}\n", fmt::join(row, ","));
      }
    }
  }
  return text;
}

}  // namespace abbe::sim::study
