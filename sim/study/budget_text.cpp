#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/scene/scene.h"
#include "sim/study/budget.h"
#include "sim/study/study_text.h"

namespace abbe::sim::study {
namespace {

constexpr std::size_t most_rows = 15;  // of inputs in a table; the others are summed up below it

/// Size of one unit of an input, in a unit that describes the machine.
struct UnitSize {
  double size = 1.0;
  std::string unit;
};

/// A study with the style of its report.
struct Words {
  const Study& study;
  TextStyle style;
  std::vector<UnitSize> units = {};  ///< (inputs)

  std::string name(const std::string& text) const { return plain(style, text); }
  std::string name(int input) const { return name(study.inputs[std::size_t(input)].name); }
  std::string bold(const std::string& text) const { return strong(style, text); }
  std::string lines_of(const TextTable& rows) const { return table(style, rows); }
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

/// Returns a value with two decimals; a value that rounds to zero has no sign.
std::string hundredths(double value) {
  if (!std::isfinite(value)) return "–";
  return fmt::format("{:.2f}", std::abs(value) < 0.005 ? 0.0 : value);
}

std::string percent(double share) {
  const double p = 100.0 * share;
  return fmt::format("{:.{}f} %", p, p != 0.0 && std::abs(p) < 10.0 ? 1 : 0);
}

/// Returns a fraction of machines in percent; it needs a second decimal near 100 %.
std::string machines(double share) {
  const double p = 100.0 * share;
  return fmt::format("{:.{}f}", p, p > 99.0 && p < 100.0 ? 2 : 1);
}

std::string machines(const IntervalEstimate& b) {
  return fmt::format("{} % [{}, {}]", machines(b.value), machines(b.low), machines(b.high));
}

/// Returns the unit in which the spread of an input is stated. The factor of a location error is
/// stated as the error itself, factor times its value; an error motion is a curve, for which only
/// the factor has a meaning.
UnitSize unit_size(const Input& input, const Scene& scene) {
  const UnitSize own{1.0, shown_unit(input.unit)};
  if (input.element.empty()) return own;
  for (const errors::Element& element : scene.geometric.elements) {
    if (errors::to_string(element.name) != input.element || !element.name.location) continue;
    double value = 0.0;
    for (const errors::Curve& curve : element.curves) {
      if (!std::holds_alternative<errors::Constant>(curve.shape))
        return {1.0, "× " + input.element};
      value += errors::value(curve, {});
    }
    const bool angle = element.name.is_angle();
    return {std::abs(scene.error_scale * value) / (angle ? units::urad : units::um),
            shown_unit(angle ? "urad" : "um")};
  }
  return {1.0, "× " + input.element};
}

std::vector<UnitSize> unit_sizes(const Budget& budget) {
  const Study& study = budget.study;
  const bool has_scene = study.scene_tree != nullptr && !study.arms.empty();
  const Scene scene = has_scene ? scene_of(study, study.arms.front()) : Scene{};
  std::vector<UnitSize> sizes;
  for (const Input& input : study.inputs) sizes.push_back(unit_size(input, scene));
  return sizes;
}

std::string unit_text(const Words& w, int input) {
  return w.name(w.units[std::size_t(input)].unit);
}

double in_input_unit(const Words& w, int input, double value) {
  return value * w.units[std::size_t(input)].size;
}

std::string with_unit(Response response, double value) {
  return figure(in_unit(response, value)) + " " + shown_unit(response);
}

std::string band_text(Response response, const IntervalEstimate& b) {
  return fmt::format("{} [{}, {}]", figure(in_unit(response, b.value)),
                     figure(in_unit(response, b.low)), figure(in_unit(response, b.high)));
}

std::string totals(const Words& w, const ConfigurationBudget& arm) {
  TextTable t{{"response", "base", "RSS", "sum", "worst found", "at most", "mean", "std. dev.",
               "P95", "P99", "limit", "within the limit", "Cpk"}};
  for (const ResponseBudget& r : arm.responses) {
    const auto shown = [&](const std::optional<double>& v) {
      return v ? figure(in_unit(r.response, *v)) : std::string();
    };
    const auto band = [&](const IntervalEstimate Answers::*what) {
      return r.answers ? band_text(r.response, (*r.answers).*what) : std::string();
    };
    t.rows.push_back({title_of(r.response) + ", " + shown_unit(r.response), shown(r.base),
                      shown(r.root_sum_square), shown(r.sum), shown(r.worst), shown(r.worst_bound),
                      band(&Answers::mean), band(&Answers::standard_deviation), band(&Answers::p95),
                      band(&Answers::p99), shown(r.limit),
                      r.fraction_within ? machines(*r.fraction_within) : "",
                      r.capability ? hundredths(*r.capability) : ""});
  }
  return w.lines_of(t);
}

/// Returns the meaning of the abbreviations in `totals`, for those that occur.
std::string legend(const Budget& budget, const ConfigurationBudget& arm) {
  std::string text = "Base: every input at its centre. ";
  const auto any = [&](const auto& has) {
    return std::any_of(arm.responses.begin(), arm.responses.end(), has);
  };
  if (any([](const ResponseBudget& r) { return r.root_sum_square.has_value(); }))
    text += fmt::format(
        "RSS and sum: of the larger change by each input at its centre ± {:g} std. dev. ",
        budget.study.one_at_a_time ? budget.study.one_at_a_time->step : 1.0);
  if (any([](const ResponseBudget& r) { return r.worst.has_value(); }))
    text += fmt::format(
        "Worst found: of the corners that were tried, inputs at the ends of their distributions or "
        "at ± {:g} std. dev.; no corner exceeds \"at most\". ",
        budget.study.worst_case ? budget.study.worst_case->coverage : 3.0);
  if (any([](const ResponseBudget& r) { return r.answers.has_value(); }))
    text += "Mean to Cpk: of random machines; brackets hold the truth with 95 % confidence. ";
  return text + "\n\n";
}

/// Returns inputs with their shares: "EXX 41 %, EYX 20 %".
std::string leaders(const Words& w, const Ranking& r, const std::vector<int>& inputs) {
  std::string text;
  for (const int i : inputs)
    text += (text.empty() ? "" : ", ") + w.bold(w.name(i)) + " " + percent(r.shares[i]);
  return text;
}

/// Returns the inputs with the largest shares above zero, whether they dominate or not.
std::vector<int> largest(const Ranking& r, std::size_t most) {
  std::vector<int> inputs;
  for (std::size_t k = 0; k < std::min(most, r.order.size()); ++k)
    if (r.shares[r.order[k]] > 0.0) inputs.push_back(r.order[k]);
  return inputs;
}

std::string remainder_text(const Ranking& r) {
  // Below half a percent it would be printed as 0 %.
  if (!(r.apart >= 0.005)) return "";
  return fmt::format(", {} {}", remainder_name(r.basis), percent(r.apart));
}

/// Returns "mostly EXX 41 %, EYX 20 %, interactions of inputs 12 %", or that no input dominates;
/// empty without a basis.
std::string whose(const Words& w, const Ranking& r) {
  if (r.basis == Ranking::Basis::None) return "";
  const std::vector<int> first = dominant_inputs(r);
  if (!first.empty()) return "mostly " + leaders(w, r, first) + remainder_text(r);
  const std::vector<int> some = largest(r, 3);
  if (!some.empty())
    return "no input dominates: the largest are " + leaders(w, r, some) + remainder_text(r);
  if (r.basis == Ranking::Basis::MainEffect)
    return "no input dominates: none makes more of it alone than chance";
  return r.weights.sum() > 0.0 ? "no input dominates" + remainder_text(r) : "no input changes it";
}

/// Returns the number of inputs that together make a fraction of the contributions of all inputs.
std::size_t needed(const Ranking& r, double share) {
  double sum = 0.0;
  for (std::size_t k = 0; k < r.order.size(); ++k)
    if ((sum += r.shares[r.order[k]]) >= share * r.shares.sum()) return k + 1;
  return r.order.size();
}

std::string dominance(const Words& w, const std::string& what, const Ranking& r) {
  const std::string text = whose(w, r);
  if (text.empty()) return "";
  std::string line = fmt::format("- {}: {}", what, text);
  if (!largest(r, 1).empty())
    line += fmt::format(" (of {}); {} of {} inputs make 90 % of what inputs make alone",
                        share_of(r.basis), needed(r, 0.9), w.study.inputs.size());
  return line + ".\n";
}

/// Returns one line for every response, and one for the map, with their dominant inputs.
std::string dominant_inputs_text(const Words& w, const ConfigurationBudget& arm) {
  std::string text;
  for (const ResponseBudget& r : arm.responses)
    text += dominance(w, title_of(r.response), ranking(r, w.study.inputs.size()));
  text += dominance(w, "map", map_ranking(arm, w.study.inputs.size()));
  return text.empty() ? text : "What dominates:\n\n" + text + "\n";
}

const Contribution* contribution_of(const ResponseBudget& response, int input) {
  for (const Contribution& c : response.contributions)
    if (c.input == input) return &c;
  return nullptr;
}

std::string change_text(Response response, const Contribution* c) {
  if (c == nullptr || (!c->low && !c->high)) return "";
  const auto shown = [&](const std::optional<double>& v) -> std::string {
    if (!v) return "–";
    const double value = in_unit(response, *v);
    if (std::abs(value) < 1e-4) return "0";
    return (value > 0.0 ? "+" : "") + figure(value);
  };
  return shown(c->low) + " / " + shown(c->high);
}

std::string index_text(const IntervalEstimate& b) {
  return fmt::format("{} [{}, {}]", hundredths(b.value), hundredths(b.low), hundredths(b.high));
}

constexpr std::size_t max_changes = 3;  // responses whose changes fit into one table

TextTable input_table(const ConfigurationBudget& arm, const Ranking& order) {
  TextTable t;
  t.heads = {"input", "centre", "std. dev.", "unit"};
  t.text_columns = 1;
  for (std::size_t r = 0; r < std::min(arm.responses.size(), max_changes); ++r) {
    const Response response = arm.responses[r].response;
    t.heads.push_back(fmt::format("{} − / +, {}", title_of(response), shown_unit(response)));
  }
  const std::string first =
      arm.responses.empty() ? "" : title_of(arm.responses.front().response) + ": ";
  t.heads.insert(t.heads.end(), {order.basis == Ranking::Basis::Map ? "share" : first + "share",
                                 first + "Sobol first", first + "total", first + "alone",
                                 first + "rank corr.", "map RMS, µm", "of the map"});
  return t;
}

std::vector<std::string> input_row(const Words& w, const ConfigurationBudget& arm,
                                   const Ranking& order, int i) {
  std::vector<std::string> row{w.name(i), figure(in_input_unit(w, i, centre(w.study)[i])),
                               figure(in_input_unit(w, i, spreads(w.study)[i])), unit_text(w, i)};
  for (std::size_t r = 0; r < std::min(arm.responses.size(), max_changes); ++r)
    row.push_back(change_text(arm.responses[r].response, contribution_of(arm.responses[r], i)));
  const Contribution* c =
      arm.responses.empty() ? nullptr : contribution_of(arm.responses.front(), i);
  const bool mapped = std::size_t(i) < arm.maps.size();
  const bool own = order.basis != Ranking::Basis::Map && order.basis != Ranking::Basis::None;
  row.insert(row.end(),
             {own ? percent(order.shares[i]) : "", c && c->sobol ? index_text(c->sobol->first) : "",
              c && c->sobol ? index_text(c->sobol->total) : "",
              c && c->main_effect ? percent(*c->main_effect) : "",
              c && c->rank_correlation ? hundredths(*c->rank_correlation) : "",
              mapped ? figure(arm.maps[std::size_t(i)].rms / units::um) : "",
              mapped ? percent(arm.maps[std::size_t(i)].share) : ""});
  return row;
}

std::string inputs(const Words& w, const ConfigurationBudget& arm) {
  Ranking order;
  if (!arm.responses.empty()) order = ranking(arm.responses.front(), w.study.inputs.size());
  if (order.basis == Ranking::Basis::None || !(order.weights.sum() > 0.0)) {
    const Ranking map = map_ranking(arm, w.study.inputs.size());
    if (map.basis != Ranking::Basis::None) order = map;
  }
  if (order.basis == Ranking::Basis::None) return "";
  TextTable t = input_table(arm, order);
  double rest = 0.0;
  for (std::size_t k = 0; k < order.order.size(); ++k) {
    const int i = order.order[k];
    if (k < most_rows)
      t.rows.push_back(input_row(w, arm, order, i));
    else
      rest += order.shares[i];
  }
  std::string text = w.lines_of(t);
  if (order.order.size() > most_rows)
    text +=
        fmt::format("and {} others, together {}.\n", order.order.size() - most_rows, percent(rest));
  text += fmt::format("Shares: of {}{}. ", share_of(order.basis), remainder_text(order));
  if (order.basis == Ranking::Basis::MainEffect && !w.study.copula.groups().empty())
    text += "Inputs are correlated: what two of them make together counts for both. ";
  return text + "\n\n";
}

/// Returns the text about the part of the map that is due to no input.
std::string map_text(const ConfigurationBudget& arm) {
  std::string text;
  if (arm.map_rms)
    text += fmt::format("Map over random machines: RMS {} µm", figure(*arm.map_rms / units::um));
  if (arm.map_mean_rms)
    text += fmt::format("{}{} µm of it no input's (cusps, centres)", text.empty() ? "Map: " : ", ",
                        figure(*arm.map_mean_rms / units::um));
  if (!text.empty()) text += ". ";
  if (arm.flagged_percent)
    text += fmt::format("{} % of the judged area is flagged: there influence maps fail. ",
                        figure(*arm.flagged_percent));
  return text.empty() ? text : text + "\n\n";
}

/// Returns the root-sum-square after halving the spread of the first `count` inputs, for a linear
/// response: half a spread has a quarter of its square.
double halved(const Ranking& squares, std::size_t count) {
  double sum = squares.weights.sum();
  for (std::size_t k = 0; k < std::min(count, squares.order.size()); ++k)
    sum -= 0.75 * squares.weights[squares.order[k]];
  return std::sqrt(std::max(sum, 0.0));
}

/// Returns the effect of halving spreads; empty if there are no changes one at a time.
std::string halving(const Words& w, const ConfigurationBudget& arm) {
  if (arm.responses.empty()) return "";
  const ResponseBudget& r = arm.responses.front();
  const Ranking squares = change_ranking(r, w.study.inputs.size());
  if (squares.basis == Ranking::Basis::None || !(squares.weights.sum() > 0.0)) return "";
  std::string text = fmt::format("Halving the spread of {} would take the RSS of {} from {} to {}",
                                 w.name(squares.order.front()), title_of(r.response),
                                 with_unit(r.response, halved(squares, 0)),
                                 with_unit(r.response, halved(squares, 1)));
  if (w.study.inputs.size() > 3)
    text += fmt::format(", of the first three to {}", with_unit(r.response, halved(squares, 3)));
  return text + fmt::format(", if it is linear. Without any spread {} is {}.\n\n",
                            title_of(r.response), with_unit(r.response, r.base));
}

std::vector<int> tightest_first(const Eigen::VectorXd& factors) {
  std::vector<int> order;
  for (Eigen::Index i = 0; i < factors.size(); ++i)
    // A factor that is printed as 1.00 tightens nothing.
    if (factors[i] < 0.995) order.push_back(int(i));
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return factors[a] < factors[b]; });
  return order;
}

std::string tightening(const Words& w, const Eigen::VectorXd& factors) {
  const Eigen::VectorXd now = spreads(w.study);
  const std::vector<int> order = tightest_first(factors);
  TextTable t{
      {"tighten", "std. dev. now", "to", "unit", "by the factor", "cost now", "then", "more"}};
  double rest = 0.0;
  for (std::size_t k = 0; k < order.size(); ++k) {
    const int i = order[k];
    const Input& input = w.study.inputs[std::size_t(i)];
    const double then = input.cost / factors[i];
    if (k >= most_rows) {
      rest += then - input.cost;
      continue;
    }
    t.rows.push_back({w.name(i), figure(in_input_unit(w, i, now[i])),
                      figure(in_input_unit(w, i, now[i] * factors[i])), unit_text(w, i),
                      fmt::format("{:.2f}", factors[i]), figure(input.cost), figure(then),
                      figure(then - input.cost)});
  }
  if (order.empty()) return "All spreads may stay as they are.\n\n";
  std::string text = w.lines_of(t);
  if (order.size() > most_rows)
    text += fmt::format("and {} others for {} more. ", order.size() - most_rows, figure(rest));
  const std::size_t kept = std::size_t(factors.size()) - order.size();
  if (kept > 0)
    text += fmt::format("{} may stay as they are.",
                        kept == 1 ? "1 input" : fmt::format("{} inputs", kept));
  return text + "\n\n";
}

std::string allocation(const Words& w, const Allocation& a) {
  const std::string what = title_of(a.asked.response);
  std::string text =
      fmt::format("{}, for {} ≤ {} in {} of the machines. ", w.bold("What to spend on"), what,
                  with_unit(a.asked.response, a.asked.limit), percent(a.asked.confidence));
  text += fmt::format("Without any spread {} is {}, every input at its centre.\n\n", what,
                      with_unit(a.asked.response, a.floor));
  if (!a.attainable) return text + w.bold("Not attainable") + ": not even without any spread.\n\n";
  double now = 0.0;
  for (const Input& input : w.study.inputs) now += input.cost;
  text += fmt::format("- cheapest: cost {} (now {}), within the limit {}\n",
                      figure(a.cheapest_cost), figure(now), machines(a.cheapest_share));
  if (a.equal.size() > 0)
    text += fmt::format("- every spread × {:.2f}: cost {}, within the limit {}\n", a.equal[0],
                        figure(a.equal_cost), machines(a.equal_share));
  return text + "\n" + (a.cheapest.size() > 0 ? tightening(w, a.cheapest) : "");
}

std::string configuration_text(const Words& w, const Budget& budget,
                               const ConfigurationBudget& arm) {
  return heading(w.style, 2, w.name(arm.arm.name)) + totals(w, arm) + dominant_inputs_text(w, arm) +
         (arm.allocation ? allocation(w, *arm.allocation) : halving(w, arm)) + inputs(w, arm) +
         map_text(arm) + legend(budget, arm);
}

/// Returns one sentence about a configuration: its figures, the dominant inputs, the first thing to
/// do.
std::string summary_sentence(const Words& w, const ConfigurationBudget& arm) {
  if (arm.responses.empty()) return "";
  const ResponseBudget& r = arm.responses.front();
  std::string text = fmt::format("- {}: {}", w.bold(w.name(arm.arm.name)), title_of(r.response));
  text += r.answers
              ? " ≤ " + with_unit(r.response, r.answers->p95.value) + " in 95 % of the machines"
              : " " + with_unit(r.response, r.base) + " at the centres";
  if (r.limit) text += fmt::format(", limit {}", with_unit(r.response, *r.limit));
  if (r.fraction_within) text += fmt::format(" kept by {}", percent(r.fraction_within->value));
  const Ranking own = ranking(r, w.study.inputs.size());
  const std::string theirs = whose(w, own);
  if (!theirs.empty()) text += "; " + theirs;
  const Ranking map = map_ranking(arm, w.study.inputs.size());
  if (dominant_inputs(own).empty() && !dominant_inputs(map).empty())
    text += "; the map is " + whose(w, map);
  if (arm.allocation && !arm.allocation->attainable) {
    text += "; no spending reaches the limit";
  } else if (arm.allocation) {
    const std::vector<int> order = tightest_first(arm.allocation->cheapest);
    if (!order.empty())
      text += fmt::format("; tighten first {} to {:.2f} of its spread",
                          w.bold(w.name(order.front())), arm.allocation->cheapest[order.front()]);
  }
  return text + ".\n";
}

std::string head(const Words& w, const Budget& budget) {
  const Study& study = budget.study;
  std::string text = heading(w.style, 1, w.name(study.title));
  text += fmt::format("{} inputs, {} cases", study.inputs.size(), budget.cases);
  if (budget.failed > 0) text += ", " + w.bold(fmt::format("{} without an answer", budget.failed));
  text += fmt::format(", seed {}. ", study.seed);
  if (study.machine_part) text += "Figures are of the map minus the error-free one. ";
  return text + "\n\n";
}

std::string proofs(const Words& w, const Budget& budget) {
  if (budget.proofs.empty()) return "";
  TextTable t{{"influence against full cuts", "response", "cases", "differs at most by, %"}};
  t.text_columns = 2;
  for (const Proof& p : budget.proofs)
    t.rows.push_back({w.name(p.arm), title_of(p.response), fmt::format("{}", p.compared),
                      p.percent ? figure(*p.percent) : "–"});
  return heading(w.style, 2, "Proof") + w.lines_of(t);
}

std::string without_trailing_spaces(const std::string& text) {
  std::string result;
  for (const char c : text) {
    while (c == '\n' && !result.empty() && result.back() == ' ') result.pop_back();
    result += c;
  }
  return result;
}

std::string written(const Budget& budget, TextStyle style) {
  const Words w{budget.study, style, unit_sizes(budget)};
  std::string text = head(w, budget);
  for (const std::string& warning : budget.warnings) text += notice(style, w.name(warning));
  for (const ConfigurationBudget& arm : budget.arms) text += summary_sentence(w, arm);
  if (!budget.arms.empty()) text += "\n";
  for (const ConfigurationBudget& arm : budget.arms) text += configuration_text(w, budget, arm);
  return without_trailing_spaces(text + proofs(w, budget));
}

}  // namespace

std::string to_markdown(const Budget& budget) { return written(budget, TextStyle::Markdown); }

std::string to_text(const Budget& budget) { return written(budget, TextStyle::Terminal); }

}  // namespace abbe::sim::study
