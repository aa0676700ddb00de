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

double squared(double value) { return value * value; }

constexpr double numerical_floor = 1e-6;  // mm: below the numerical floor of the surface a change
                                          // has no cause

/// Returns the finite values, negative ones as 0: estimates of indices may be slightly below it.
Eigen::VectorXd known(const Eigen::VectorXd& values) {
  return values.array().isFinite().select(values.cwiseMax(0.0), 0.0);
}

/// Ranks inputs by weight. Shares that add up to more than 1, as estimates may, are scaled down.
Ranking ranked(Ranking::Basis basis, const Eigen::VectorXd& weights,
               const Eigen::VectorXd& shares) {
  Ranking r;
  r.basis = basis;
  r.weights = known(weights);
  r.shares = known(shares);
  r.shares /= std::max(1.0, r.shares.sum());
  r.apart = r.weights.sum() > 0.0 ? std::max(0.0, 1.0 - r.shares.sum()) : 0.0;
  r.order.resize(std::size_t(weights.size()));
  std::iota(r.order.begin(), r.order.end(), 0);
  std::stable_sort(r.order.begin(), r.order.end(),
                   [&](int a, int b) { return r.weights[a] > r.weights[b]; });
  return r;
}

/// Ranks inputs by weight; shares are fractions of the sum of all weights.
Ranking ranked(Ranking::Basis basis, const Eigen::VectorXd& weights) {
  const Eigen::VectorXd all = known(weights);
  const double sum = all.sum();
  Ranking r = ranked(basis, all, sum > 0.0 ? Eigen::VectorXd(all / sum) : all);
  r.apart = 0.0;
  return r;
}

/// Returns one figure of every contribution; empty if no contribution has it.
template <typename Figure>
std::optional<Eigen::VectorXd> figures(const ResponseBudget& response, std::size_t inputs,
                                       const Figure& figure) {
  Eigen::VectorXd all = Eigen::VectorXd::Zero(Eigen::Index(inputs));
  bool any = false;
  for (const Contribution& c : response.contributions) {
    const std::optional<double> value = figure(c);
    if (!value) continue;
    any = true;
    all[c.input] = *value;
  }
  return any ? std::optional(all) : std::nullopt;
}

std::optional<Ranking> sobol_ranking(const ResponseBudget& response, std::size_t inputs) {
  const auto of = [&](const IntervalEstimate SobolIndex::*which) {
    return figures(response, inputs, [&](const Contribution& c) {
      return c.sobol ? std::optional(((*c.sobol).*which).value) : std::nullopt;
    });
  };
  const auto total = of(&SobolIndex::total), first = of(&SobolIndex::first);
  if (!total) return {};
  return ranked(Ranking::Basis::Sobol, *total, *first);
}

std::optional<Ranking> main_effect_ranking(const ResponseBudget& response, std::size_t inputs) {
  // An effect that chance alone may give counts as none.
  const double chance =
      chance_effect(response.answers ? response.answers->cases : 0, Eigen::Index(inputs));
  const auto effects = figures(response, inputs, [&](const Contribution& c) {
    return c.main_effect ? std::optional(*c.main_effect > chance ? *c.main_effect : 0.0)
                         : std::nullopt;
  });
  if (!effects) return {};
  Ranking r = ranked(Ranking::Basis::MainEffect, *effects, *effects);
  r.apart = std::max(0.0, 1.0 - r.shares.sum());
  return r;
}

}  // namespace

std::optional<double> larger_change(const Contribution& c) {
  if (!c.low && !c.high) return {};
  return std::max(std::abs(c.low.value_or(0.0)), std::abs(c.high.value_or(0.0)));
}

Ranking change_ranking(const ResponseBudget& response, std::size_t inputs) {
  // The fraction in tolerance is in percent, so the floor in mm does not apply.
  const double floor = response.response == Response::InTolerance ? 0.0 : numerical_floor;
  const auto squares = figures(response, inputs, [&](const Contribution& c) {
    const std::optional<double> change = larger_change(c);
    return change ? std::optional(*change >= floor ? squared(*change) : 0.0) : std::nullopt;
  });
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(Eigen::Index(inputs));
  return squares ? ranked(Ranking::Basis::Change, *squares) : ranked(Ranking::Basis::None, none);
}

double chance_correlation(const ResponseBudget& response) {
  // The correlation of independent values has a standard error of 1 / sqrt(n); four of them are
  // exceeded by chance once in 16 000 pairs.
  return response.answers ? 4.0 / std::sqrt(double(response.answers->cases)) : 0.0;
}

Ranking ranking(const ResponseBudget& response, std::size_t inputs) {
  if (response.response != Response::InTolerance && response.answers &&
      response.answers->standard_deviation.value < numerical_floor)
    return {};
  if (const auto sobol = sobol_ranking(response, inputs)) return *sobol;
  Ranking change = change_ranking(response, inputs);
  if (change.basis != Ranking::Basis::None) return change;
  return main_effect_ranking(response, inputs).value_or(Ranking{});
}

Ranking map_ranking(const ConfigurationBudget& arm, std::size_t inputs) {
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(Eigen::Index(inputs));
  for (std::size_t i = 0; i < std::min(arm.maps.size(), inputs); ++i)
    weights[Eigen::Index(i)] = arm.maps[i].share;
  Ranking result = ranked(arm.maps.empty() ? Ranking::Basis::None : Ranking::Basis::Map, weights);
  // Shares of a map may be negative and are not scaled; `ranked` would clip them.
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
      return "of no input alone";
    default:
      return "";
  }
}

std::vector<int> dominant_inputs(const Ranking& ranking) {
  constexpr std::size_t most = 3;
  std::vector<int> inputs;
  double sum = 0.0;
  for (std::size_t k = 0; k < std::min(most, ranking.order.size()); ++k) {
    const int i = ranking.order[k];
    if (!(ranking.shares[i] > 0.0)) continue;
    inputs.push_back(i);
    sum += ranking.shares[i];
  }
  return sum >= 0.5 ? inputs : std::vector<int>{};
}

std::vector<ParetoBar> pareto(const Ranking& ranking, std::size_t most) {
  std::vector<int> order = ranking.order;
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return std::abs(ranking.shares[a]) > std::abs(ranking.shares[b]);
  });
  std::vector<ParetoBar> bars;
  ParetoBar others{ParetoBar::Kind::Others, 0, 0, 0.0};
  for (const int i : order) {
    if (bars.size() < most) {
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

namespace {

using nlohmann::ordered_json;

/// JSON has no infinities and no NaN: both become null.
ordered_json number(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json();
}
ordered_json number(const std::optional<double>& value) {
  return value ? number(*value) : ordered_json();
}
ordered_json numbers(const Eigen::VectorXd& values) {
  ordered_json list = ordered_json::array();
  for (const double value : values) list.push_back(number(value));
  return list;
}

/// Writes values of a response in its unit.
struct InUnit {
  Response response;

  ordered_json operator()(double value) const { return number(in_unit(response, value)); }
  ordered_json operator()(const std::optional<double>& value) const {
    return value ? (*this)(*value) : ordered_json();
  }
  ordered_json operator()(const IntervalEstimate& b) const {
    return {{"value", (*this)(b.value)}, {"low", (*this)(b.low)}, {"high", (*this)(b.high)}};
  }
};

ordered_json banded(const IntervalEstimate& b, double factor = 1.0) {
  return {{"value", number(factor * b.value)},
          {"low", number(factor * b.low)},
          {"high", number(factor * b.high)}};
}

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

const char* name_of(Engine engine) {
  switch (engine) {
    case Engine::Influence:
      return "influence";
    case Engine::Full:
      return "full";
    case Engine::Both:
      return "both";
  }
  return "";
}

ordered_json inputs(const Study& study) {
  const Eigen::VectorXd centres = centre(study), deviations = spreads(study);
  ordered_json list = ordered_json::array();
  for (std::size_t i = 0; i < study.inputs.size(); ++i) {
    const Input& input = study.inputs[i];
    const Distribution& d = input.distribution;
    ordered_json settings = ordered_json::array();
    for (const Setting& s : input.settings)
      settings.push_back({{"path", s.path}, {"factor", number(s.factor)}});
    list.push_back({{"name", input.name},
                    {"unit", unit_of(input)},
                    {"centre", number(centres[Eigen::Index(i)])},
                    {"standard_deviation", number(deviations[Eigen::Index(i)])},
                    {"cost", number(input.cost)},
                    {"distribution",
                     {{"kind", name_of(d.kind)},
                      {"centre", number(d.centre)},
                      {"spread", number(d.spread)},
                      {"low", number(d.low)},
                      {"high", number(d.high)}}},
                    {"element", input.element},
                    {"number", input.number},
                    {"settings", settings}});
  }
  return list;
}

/// Returns the pairs of inputs that are correlated.
ordered_json correlation_rows(const Study& study) {
  ordered_json pairs = ordered_json::array();
  for (const Copula::Group& group : study.copula.groups()) {
    const Eigen::MatrixXd rho = group.factor * group.factor.transpose();
    for (Eigen::Index i = 0; i < rho.rows(); ++i)
      for (Eigen::Index j = 0; j < i; ++j)
        if (rho(i, j) != 0.0)
          pairs.push_back({{"a", study.inputs[std::size_t(group.of[std::size_t(j)])].name},
                           {"b", study.inputs[std::size_t(group.of[std::size_t(i)])].name},
                           {"rho", number(rho(i, j))}});
  }
  return pairs;
}

ordered_json contribution(const Study& study, const Contribution& c, const InUnit& figure) {
  return {{"input", study.inputs[std::size_t(c.input)].name},
          {"low", figure(c.low)},
          {"high", figure(c.high)},
          {"sobol_first", c.sobol ? banded(c.sobol->first) : ordered_json()},
          {"sobol_total", c.sobol ? banded(c.sobol->total) : ordered_json()},
          {"correlation", number(c.correlation)},
          {"rank_correlation", number(c.rank_correlation)},
          {"main_effect_percent", c.main_effect ? number(100.0 * *c.main_effect) : ordered_json()}};
}

ordered_json monte_carlo(const Answers& a, const InUnit& figure) {
  return {{"cases", a.cases},
          {"mean", figure(a.mean)},
          {"standard_deviation", figure(a.standard_deviation)},
          {"min", figure(a.min)},
          {"max", figure(a.max)},
          {"median", figure(a.median)},
          {"p95", figure(a.p95)},
          {"p99", figure(a.p99)}};
}

ordered_json convergence_of(const IndexConvergence& c) {
  ordered_json steps = ordered_json::array();
  for (std::size_t m = 0; m < c.base_points.size(); ++m) {
    ordered_json first = ordered_json::array(), total = ordered_json::array();
    for (const SobolIndex& index : c.indices[m]) {
      first.push_back(banded(index.first));
      total.push_back(banded(index.total));
    }
    steps.push_back(
        {{"base_points", c.base_points[m]}, {"sobol_first", first}, {"sobol_total", total}});
  }
  return steps;
}

/// Returns the inputs with the largest shares of a response, and the share of no input alone.
ordered_json whose(const Study& study, const ResponseBudget& r) {
  constexpr std::size_t most = 10;
  const Ranking ranked = ranking(r, study.inputs.size());
  if (ranked.basis == Ranking::Basis::None) return {};
  ordered_json list = ordered_json::array();
  for (const ParetoBar& bar : pareto(ranked, most))
    if (bar.kind == ParetoBar::Kind::Input && bar.share > 0.0)
      list.push_back({{"input", study.inputs[std::size_t(bar.input)].name},
                      {"share_percent", number(100.0 * bar.share)}});
  return {{"of", share_of(ranked.basis)},
          {"dominated", !dominant_inputs(ranked).empty()},
          {"largest", list},
          {"of_no_input_alone_percent", number(100.0 * ranked.apart)}};
}

ordered_json response(const Study& study, const ResponseBudget& r) {
  const InUnit figure{r.response};
  ordered_json contributions = ordered_json::array();
  for (const Contribution& c : r.contributions)
    contributions.push_back(contribution(study, c, figure));
  return {{"response", name_of(r.response)},
          {"unit", unit_of(r.response)},
          {"base", figure(r.base)},
          {"root_sum_square", figure(r.root_sum_square)},
          {"sum", figure(r.sum)},
          {"worst", figure(r.worst)},
          {"worst_bound", figure(r.worst_bound)},
          {"monte_carlo", r.answers ? monte_carlo(*r.answers, figure) : ordered_json()},
          {"limit", figure(r.limit)},
          {"within_limit_percent",
           r.fraction_within ? banded(*r.fraction_within, 100.0) : ordered_json()},
          {"cpk", number(r.capability)},
          {"whose", whose(study, r)},
          {"contributions", contributions},
          {"convergence", r.convergence ? convergence_of(*r.convergence) : ordered_json()}};
}

ordered_json map_of(const Study& study, const ConfigurationBudget& arm) {
  if (arm.maps.empty() && !arm.map_rms && !arm.uncut_percent) return {};
  ordered_json list = ordered_json::array();
  for (std::size_t i = 0; i < arm.maps.size(); ++i)
    list.push_back({{"input", study.inputs[i].name},
                    {"rms_um", number(arm.maps[i].rms / units::um)},
                    {"pv_um", number(arm.maps[i].pv / units::um)},
                    {"share_percent", number(100.0 * arm.maps[i].share)}});
  const auto um = [](const std::optional<double>& v) {
    return v ? number(*v / units::um) : ordered_json();
  };
  return {{"rms_um", um(arm.map_rms)},
          {"mean_rms_um", um(arm.map_mean_rms)},
          {"flagged_percent", number(arm.flagged_percent)},
          {"uncut_percent", number(arm.uncut_percent)},
          {"gouged_percent", number(arm.gouged_percent)},
          {"contributions", list}};
}

ordered_json allocation_of(const Allocation& a) {
  const InUnit figure{a.asked.response};
  const auto way = [&](const Eigen::VectorXd& factors, double cost, const IntervalEstimate& share) {
    return ordered_json{{"factors", numbers(factors)},
                        {"cost", number(cost)},
                        {"within_limit_percent", banded(share, 100.0)}};
  };
  return {{"response", name_of(a.asked.response)},
          {"unit", unit_of(a.asked.response)},
          {"limit", figure(a.asked.limit)},
          {"confidence_percent", number(100.0 * a.asked.confidence)},
          {"floor", figure(a.floor)},
          {"attainable", a.attainable},
          {"equal", way(a.equal, a.equal_cost, a.equal_share)},
          {"cheapest", way(a.cheapest, a.cheapest_cost, a.cheapest_share)}};
}

ordered_json unidentified_of(const ConfigurationBudget& arm) {
  ordered_json list = ordered_json::array();
  for (const UnidentifiedEffect& one : arm.unidentified)
    list.push_back({{"number", one.number.number},
                    {"unit", one.number.unit},
                    {"spread", number(one.number.spread)},
                    {"drawn", one.number.is_drawn},
                    {"rms_um", number(one.rms / units::um)},
                    {"pv_um", number(one.pv / units::um)}});
  return list;
}

ordered_json arm(const Study& study, const ConfigurationBudget& a) {
  ordered_json responses = ordered_json::array();
  for (const ResponseBudget& r : a.responses) responses.push_back(response(study, r));
  return {{"name", a.arm.name},
          {"variant", a.arm.variant},
          {"case", a.arm.case_name},
          {"responses", responses},
          {"map", map_of(study, a)},
          {"unidentified", unidentified_of(a)},
          {"allocation", a.allocation ? allocation_of(*a.allocation) : ordered_json()}};
}

ordered_json sweep_of(const Study& study, const SweepResult& s) {
  const Sweep& sweep = study.sweeps[std::size_t(s.sweep)];
  ordered_json arms = ordered_json::array(), units = ordered_json::object();
  for (const Response one : study.responses) units[name_of(one)] = unit_of(one);
  for (std::size_t a = 0; a < s.answers.size(); ++a) {
    ordered_json one{{"name", study.arms[a].name}};
    for (std::size_t r = 0; r < s.answers[a].size(); ++r) {
      ordered_json values = ordered_json::array();
      for (const double value : s.answers[a][r])
        values.push_back(InUnit{study.responses[r]}(value));
      one[name_of(study.responses[r])] = values;
    }
    arms.push_back(one);
  }
  return {{"input", study.inputs[std::size_t(sweep.input)].name},
          {"unit", unit_of(study.inputs[std::size_t(sweep.input)])},
          {"values", numbers(sweep.values)},
          {"units", units},
          {"arms", arms}};
}

}  // namespace

ordered_json to_json(const Budget& budget) {
  const Study& study = budget.study;
  ordered_json arms = ordered_json::array(), proofs = ordered_json::array(),
               sweeps = ordered_json::array();
  for (const ConfigurationBudget& a : budget.arms) arms.push_back(arm(study, a));
  for (const Proof& p : budget.proofs)
    proofs.push_back({{"arm", p.arm},
                      {"response", name_of(p.response)},
                      {"compared", p.compared},
                      {"one_sided", p.one_sided},
                      {"percent", number(p.percent)}});
  for (const SweepResult& s : budget.sweeps) sweeps.push_back(sweep_of(study, s));
  return {{"study", study.title},
          {"engine", name_of(study.engine)},
          {"seed", study.seed},
          {"cases", budget.cases},
          {"failed_cases", budget.failed},
          {"machine_part", study.machine_part},
          {"step_standard_deviations",
           study.one_at_a_time ? number(study.one_at_a_time->step) : ordered_json()},
          {"inputs", inputs(study)},
          {"correlations", correlation_rows(study)},
          {"arms", arms},
          {"proofs", proofs},
          {"sweeps", sweeps},
          {"warnings", budget.warnings}};
}

namespace {

using Cells = std::vector<std::string>;

/// Returns the cells of a response's value: it stands in the column of micrometres or in that of
/// percent.
Cells fields(Response response, const std::optional<double>& value) {
  const std::string text = value ? csv_field(in_unit(response, *value)) : "";
  return response == Response::InTolerance ? Cells{"", text} : Cells{text, ""};
}

Cells fields(const IntervalEstimate& b) {
  return {csv_field(b.value), csv_field(b.low), csv_field(b.high)};
}

Cells fields(const std::optional<SobolIndex>& index) {
  Cells all = index ? fields(index->first) : Cells(3);
  const Cells total = index ? fields(index->total) : Cells(3);
  all.insert(all.end(), total.begin(), total.end());
  return all;
}

constexpr const char* csv_head =
    "arm,response,input,input_unit,centre,standard_deviation,cost,"
    "low_um,low_percent,high_um,high_percent,share_of_squares_percent,"
    "sobol_first,sobol_first_low,sobol_first_high,sobol_total,sobol_total_low,sobol_total_high,"
    "correlation,rank_correlation,main_effect_percent,map_rms_um,map_pv_um,map_share_percent,"
    "equal_factor,cheapest_factor\n";

/// Returns the field of an input; empty if the values were not computed.
std::string field_of(const Eigen::VectorXd& values, Eigen::Index i) {
  return i < values.size() ? csv_field(values[i]) : "";
}

}  // namespace

std::string to_csv(const Budget& budget) {
  const Study& study = budget.study;
  const Eigen::VectorXd centres = centre(study), deviations = spreads(study);
  std::string text = csv_head;
  for (const ConfigurationBudget& arm : budget.arms) {
    const Eigen::VectorXd none;
    const Eigen::VectorXd& equal = arm.allocation ? arm.allocation->equal : none;
    const Eigen::VectorXd& cheapest = arm.allocation ? arm.allocation->cheapest : none;
    for (const ResponseBudget& r : arm.responses) {
      const Ranking squares = change_ranking(r, study.inputs.size());
      for (const Contribution& c : r.contributions) {
        const auto i = std::size_t(c.input);
        const Input& input = study.inputs[i];
        const std::optional<MapContribution> map =
            i < arm.maps.size() ? std::optional(arm.maps[i]) : std::nullopt;
        Cells row{csv_field(arm.arm.name),     name_of(r.response),
                  csv_field(input.name),       csv_field(unit_of(input)),
                  csv_field(centres[c.input]), csv_field(deviations[c.input]),
                  csv_field(input.cost)};
        const auto add = [&](const Cells& more) {
          row.insert(row.end(), more.begin(), more.end());
        };
        add(fields(r.response, c.low));
        add(fields(r.response, c.high));
        add({larger_change(c) ? csv_field(100.0 * squares.shares[c.input]) : ""});
        add(fields(c.sobol));
        add({csv_field(c.correlation), csv_field(c.rank_correlation),
             c.main_effect ? csv_field(100.0 * *c.main_effect) : ""});
        add(map ? Cells{csv_field(map->rms / units::um), csv_field(map->pv / units::um),
                        csv_field(100.0 * map->share)}
                : Cells(3));
        add({field_of(equal, c.input), field_of(cheapest, c.input)});
        text += fmt::format("{}\n", fmt::join(row, ","));
      }
    }
  }
  return text;
}

}  // namespace abbe::sim::study
