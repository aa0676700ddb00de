#include <cmath>

#include "kinematics/units.h"
#include "sim/study/budget.h"
#include "sim/study/ranking.h"
#include "sim/study/words.h"

namespace abbe::sim::study {
namespace {

using nlohmann::ordered_json;

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

/// Values of a response, in its unit.
struct InUnit {
  Response response;

  ordered_json operator()(double value) const { return number(in_unit(response, value)); }
  ordered_json operator()(const std::optional<double>& value) const {
    return value ? (*this)(*value) : ordered_json();
  }
  ordered_json operator()(const Banded& b) const {
    return {{"value", (*this)(b.value)}, {"low", (*this)(b.low)}, {"high", (*this)(b.high)}};
  }
};

ordered_json banded(const Banded& b, double factor = 1.0) {
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

/// Pairs of inputs that vary together.
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

/// Whose a response is: shares of the inputs that make the most of it, and what none makes alone.
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
          {"dominated", !dominating(ranked).empty()},
          {"largest", list},
          {"of_no_input_alone_percent", number(100.0 * ranked.apart)}};
}

ordered_json response(const Study& study, const ResponseBudget& r) {
  const InUnit figure{r.response};
  ordered_json contributions = ordered_json::array();
  for (const Contribution& c : r.contributions)
    contributions.push_back(contribution(study, c, figure));
  return {
      {"response", name_of(r.response)},
      {"unit", unit_of(r.response)},
      {"base", figure(r.base)},
      {"root_sum_square", figure(r.root_sum_square)},
      {"sum", figure(r.sum)},
      {"worst", figure(r.worst)},
      {"worst_bound", figure(r.worst_bound)},
      {"monte_carlo", r.answers ? monte_carlo(*r.answers, figure) : ordered_json()},
      {"limit", figure(r.limit)},
      {"within_limit_percent", r.share_within ? banded(*r.share_within, 100.0) : ordered_json()},
      {"cpk", number(r.capability)},
      {"whose", whose(study, r)},
      {"contributions", contributions},
      {"convergence", r.convergence ? convergence_of(*r.convergence) : ordered_json()}};
}

ordered_json map_of(const Study& study, const ArmBudget& arm) {
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
  const auto way = [&](const Eigen::VectorXd& factors, double cost, const Banded& share) {
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

ordered_json unidentified_of(const ArmBudget& arm) {
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

ordered_json arm(const Study& study, const ArmBudget& a) {
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

ordered_json sweep_of(const Study& study, const Sweeping& s) {
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
  for (const ArmBudget& a : budget.arms) arms.push_back(arm(study, a));
  for (const Proof& p : budget.proofs)
    proofs.push_back({{"arm", p.arm},
                      {"response", name_of(p.response)},
                      {"compared", p.compared},
                      {"one_sided", p.one_sided},
                      {"percent", number(p.percent)}});
  for (const Sweeping& s : budget.sweeps) sweeps.push_back(sweep_of(study, s));
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

}  // namespace abbe::sim::study
