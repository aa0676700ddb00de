#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/study/budget.h"
#include "sim/study/ranking.h"
#include "sim/study/words.h"

namespace abbe::sim::study {
namespace {

constexpr std::size_t most_rows = 15;

/// Text that stays text in a table: one line, no mark-up.
std::string plain(const std::string& text) {
  const std::string line = one_line(text);
  const auto is_word = [&](std::size_t i) {
    return i < line.size() && std::isalnum(static_cast<unsigned char>(line[i])) != 0;
  };
  std::string result;
  for (std::size_t i = 0; i < line.size(); ++i) {
    // an underscore within a word is none of Markdown's
    const bool emphasis = line[i] == '_' && !(i > 0 && is_word(i - 1) && is_word(i + 1));
    if (emphasis || std::string_view("\\`*<>[]|&~#$").find(line[i]) != std::string_view::npos)
      result += '\\';
    result += line[i];
  }
  return result;
}

/// Three significant digits, without an exponent where a reader can do without.
std::string figure(double value) {
  if (!std::isfinite(value)) return "–";
  if (value == 0.0) return "0";
  const double size = std::abs(value);
  if (size >= 1e6 || size < 1e-4) return fmt::format("{:.2e}", value);
  const int decimals = std::clamp(2 - int(std::floor(std::log10(size))), 0, 6);
  return fmt::format("{:.{}f}", value, decimals);
}

/// Two decimals; what rounds to zero has no sign.
std::string hundredths(double value) {
  if (!std::isfinite(value)) return "–";
  return fmt::format("{:.2f}", std::abs(value) < 0.005 ? 0.0 : value);
}

std::string percent(double share) {
  const double p = 100.0 * share;
  return fmt::format("{:.{}f} %", p, p != 0.0 && std::abs(p) < 10.0 ? 1 : 0);
}

/// Shares of machines need digits near 100 %.
std::string machines(double share) {
  const double p = 100.0 * share;
  return fmt::format("{:.{}f}", p, p > 99.0 && p < 100.0 ? 2 : 1);
}

std::string machines(const Banded& b) {
  return fmt::format("{} % [{}, {}]", machines(b.value), machines(b.low), machines(b.high));
}

std::string unit_text(const std::string& unit) { return plain(shown_unit(unit)); }

std::string with_unit(Response response, double value) {
  return figure(in_unit(response, value)) + " " + shown_unit(response);
}

/// A table whose empty columns are left out.
struct MarkdownTable {
  std::vector<std::string> heads;
  std::vector<std::vector<std::string>> rows{};
  std::size_t text_columns = 1;  ///< the first ones, aligned left
};

std::string lines_of(const MarkdownTable& table) {
  std::vector<std::size_t> kept;
  for (std::size_t j = 0; j < table.heads.size(); ++j)
    if (std::any_of(table.rows.begin(), table.rows.end(),
                    [&](const auto& row) { return !row[j].empty(); }))
      kept.push_back(j);
  const auto line = [&](const std::vector<std::string>& cells) {
    std::string text = "|";
    for (const std::size_t j : kept) text += " " + cells[j] + " |";
    return text + "\n";
  };
  std::string text = line(table.heads) + "|";
  for (const std::size_t j : kept) text += j < table.text_columns ? "---|" : "---:|";
  text += "\n";
  for (const auto& row : table.rows) text += line(row);
  return text + "\n";
}

std::string in_band(Response response, const Banded& b) {
  return fmt::format("{} [{}, {}]", figure(in_unit(response, b.value)),
                     figure(in_unit(response, b.low)), figure(in_unit(response, b.high)));
}

std::string totals(const ArmBudget& arm) {
  MarkdownTable t{{"response", "base", "RSS", "sum", "worst found", "at most", "mean", "std. dev.",
                   "P95", "P99", "limit", "within the limit", "Cpk"}};
  for (const ResponseBudget& r : arm.responses) {
    const auto shown = [&](const std::optional<double>& v) {
      return v ? figure(in_unit(r.response, *v)) : std::string();
    };
    const auto band = [&](const Banded Answers::*what) {
      return r.answers ? in_band(r.response, (*r.answers).*what) : std::string();
    };
    t.rows.push_back({title_of(r.response) + ", " + shown_unit(r.response), shown(r.base),
                      shown(r.root_sum_square), shown(r.sum), shown(r.worst), shown(r.worst_bound),
                      band(&Answers::mean), band(&Answers::standard_deviation), band(&Answers::p95),
                      band(&Answers::p99), shown(r.limit),
                      r.share_within ? machines(*r.share_within) : "",
                      r.capability ? hundredths(*r.capability) : ""});
  }
  return lines_of(t);
}

/// What the letters of `totals` mean, as far as they are there.
std::string legend(const Budget& budget, const ArmBudget& arm) {
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

/// "`EXX` 41 %, `EYX` 20 %"
std::string leaders(const Study& study, const Ranking& r, std::size_t most) {
  std::string text;
  for (std::size_t k = 0; k < std::min(most, r.order.size()); ++k) {
    const int i = r.order[k];
    if (!(r.weights[i] > 0.0)) break;
    text += fmt::format("{}**{}** {}", k == 0 ? "" : ", ", plain(study.inputs[std::size_t(i)].name),
                        percent(r.shares[i]));
  }
  return text;
}

/// How many inputs make so much of everything.
std::size_t needed(const Ranking& r, double share) {
  double sum = 0.0;
  for (std::size_t k = 0; k < r.order.size(); ++k)
    if ((sum += r.shares[r.order[k]]) >= share) return k + 1;
  return r.order.size();
}

std::string dominance(const Study& study, const std::string& what, const Ranking& r) {
  if (r.basis == Ranking::Basis::None) return "";
  const std::string text = leaders(study, r, 3);
  if (text.empty()) return fmt::format("- {}: no input changes it.\n", what);
  return fmt::format("- {}: {} of {}; {} of {} inputs make 90 %.\n", what, text, share_of(r.basis),
                     needed(r, 0.9), study.inputs.size());
}

/// What every response and the map owe to whom, in a line each.
std::string dominating(const Study& study, const ArmBudget& arm) {
  std::string text;
  for (const ResponseBudget& r : arm.responses)
    text += dominance(study, title_of(r.response), ranking(r, study.inputs.size()));
  text += dominance(study, "map", map_ranking(arm, study.inputs.size()));
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

std::string index_text(const Banded& b) {
  return fmt::format("{} [{}, {}]", hundredths(b.value), hundredths(b.low), hundredths(b.high));
}

constexpr std::size_t most_changes = 3;  // responses whose changes have room in one table

MarkdownTable input_table(const ArmBudget& arm, const Ranking& order) {
  MarkdownTable t;
  t.heads = {"input", "centre", "std. dev.", "unit"};
  t.text_columns = 1;
  for (std::size_t r = 0; r < std::min(arm.responses.size(), most_changes); ++r) {
    const Response response = arm.responses[r].response;
    t.heads.push_back(fmt::format("{} − / +, {}", title_of(response), shown_unit(response)));
  }
  const std::string first =
      arm.responses.empty() ? "" : title_of(arm.responses.front().response) + ": ";
  t.heads.insert(t.heads.end(), {order.basis == Ranking::Basis::Map ? "share" : first + "share",
                                 first + "Sobol first", first + "total", first + "rank corr.",
                                 "map RMS, µm", "of the map"});
  return t;
}

std::vector<std::string> input_row(const Study& study, const ArmBudget& arm, const Ranking& order,
                                   int i) {
  const Input& input = study.inputs[std::size_t(i)];
  std::vector<std::string> row{plain(input.name), figure(centre(study)[i]),
                               figure(spreads(study)[i]), unit_text(input.unit)};
  for (std::size_t r = 0; r < std::min(arm.responses.size(), most_changes); ++r)
    row.push_back(change_text(arm.responses[r].response, contribution_of(arm.responses[r], i)));
  const Contribution* c =
      arm.responses.empty() ? nullptr : contribution_of(arm.responses.front(), i);
  const bool mapped = std::size_t(i) < arm.maps.size();
  const bool own = order.basis != Ranking::Basis::Map && order.basis != Ranking::Basis::None;
  row.insert(row.end(),
             {own ? percent(order.shares[i]) : "", c && c->sobol ? index_text(c->sobol->first) : "",
              c && c->sobol ? index_text(c->sobol->total) : "",
              c && c->rank_correlation ? hundredths(*c->rank_correlation) : "",
              mapped ? figure(arm.maps[std::size_t(i)].rms / units::um) : "",
              mapped ? percent(arm.maps[std::size_t(i)].share) : ""});
  return row;
}

std::string inputs(const Study& study, const ArmBudget& arm) {
  Ranking order;
  if (!arm.responses.empty()) order = ranking(arm.responses.front(), study.inputs.size());
  if (order.basis == Ranking::Basis::None) order = map_ranking(arm, study.inputs.size());
  if (order.basis == Ranking::Basis::None) return "";
  MarkdownTable t = input_table(arm, order);
  double rest = 0.0;
  for (std::size_t k = 0; k < order.order.size(); ++k) {
    const int i = order.order[k];
    if (k < most_rows)
      t.rows.push_back(input_row(study, arm, order, i));
    else
      rest += order.shares[i];
  }
  std::string text = lines_of(t);
  if (order.order.size() > most_rows)
    text +=
        fmt::format("and {} others, together {}.\n", order.order.size() - most_rows, percent(rest));
  return text + fmt::format("Shares: of {}.\n\n", share_of(order.basis));
}

/// The part of the map that no input makes.
std::string map_text(const ArmBudget& arm) {
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

/// Root-sum-square with the first `count` inputs of half their spread, if the response is linear.
double halved(const Ranking& squares, std::size_t count) {
  double sum = squares.weights.sum();
  for (std::size_t k = 0; k < std::min(count, squares.order.size()); ++k)
    sum -= 0.75 * squares.weights[squares.order[k]];
  return std::sqrt(std::max(sum, 0.0));
}

/// What halving would bring; where no allocation was asked.
std::string halving(const Study& study, const ArmBudget& arm) {
  if (arm.responses.empty()) return "";
  const ResponseBudget& r = arm.responses.front();
  const Ranking squares = change_ranking(r, study.inputs.size());
  if (squares.basis == Ranking::Basis::None || !(squares.weights.sum() > 0.0)) return "";
  std::string text = fmt::format("Halving the spread of {} would take the RSS of {} from {} to {}",
                                 plain(study.inputs[std::size_t(squares.order.front())].name),
                                 title_of(r.response), with_unit(r.response, halved(squares, 0)),
                                 with_unit(r.response, halved(squares, 1)));
  if (study.inputs.size() > 3)
    text += fmt::format(", of the first three to {}", with_unit(r.response, halved(squares, 3)));
  return text + fmt::format(", if it is linear. Without any spread {} is {}.\n\n",
                            title_of(r.response), with_unit(r.response, r.base));
}

std::vector<int> tightest_first(const Eigen::VectorXd& factors) {
  std::vector<int> order;
  for (Eigen::Index i = 0; i < factors.size(); ++i)
    if (factors[i] < 0.995) order.push_back(int(i));
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return factors[a] < factors[b]; });
  return order;
}

std::string tightening(const Study& study, const Eigen::VectorXd& factors) {
  const Eigen::VectorXd now = spreads(study);
  const std::vector<int> order = tightest_first(factors);
  MarkdownTable t{
      {"tighten", "std. dev. now", "to", "unit", "by the factor", "cost now", "then", "more"}};
  double rest = 0.0;
  for (std::size_t k = 0; k < order.size(); ++k) {
    const int i = order[k];
    const Input& input = study.inputs[std::size_t(i)];
    const double then = input.cost / factors[i];
    if (k >= most_rows) {
      rest += then - input.cost;
      continue;
    }
    t.rows.push_back({plain(input.name), figure(now[i]), figure(now[i] * factors[i]),
                      unit_text(input.unit), fmt::format("{:.2f}", factors[i]), figure(input.cost),
                      figure(then), figure(then - input.cost)});
  }
  if (order.empty()) return "All spreads may stay as they are.\n\n";
  std::string text = lines_of(t);
  if (order.size() > most_rows)
    text += fmt::format("and {} others for {} more. ", order.size() - most_rows, figure(rest));
  const std::size_t kept = std::size_t(factors.size()) - order.size();
  if (kept > 0)
    text += fmt::format("{} may stay as they are.",
                        kept == 1 ? "1 input" : fmt::format("{} inputs", kept));
  return text + "\n\n";
}

std::string allocation(const Study& study, const Allocation& a) {
  const std::string what = title_of(a.asked.response);
  std::string text =
      fmt::format("**What to spend on**, for {} ≤ {} in {} of the machines. ", what,
                  with_unit(a.asked.response, a.asked.limit), percent(a.asked.confidence));
  text += fmt::format("Without any spread {} is {}, every input at its centre.\n\n", what,
                      with_unit(a.asked.response, a.floor));
  if (!a.attainable) return text + "**Not attainable**: not even without any spread.\n\n";
  double now = 0.0;
  for (const Input& input : study.inputs) now += input.cost;
  text += fmt::format("- cheapest: cost {} (now {}), within the limit {}\n",
                      figure(a.cheapest_cost), figure(now), machines(a.cheapest_share));
  if (a.equal.size() > 0)
    text += fmt::format("- every spread × {:.2f}: cost {}, within the limit {}\n", a.equal[0],
                        figure(a.equal_cost), machines(a.equal_share));
  return text + "\n" + (a.cheapest.size() > 0 ? tightening(study, a.cheapest) : "");
}

std::string arm_text(const Budget& budget, const ArmBudget& arm) {
  const Study& study = budget.study;
  return fmt::format("## {}\n\n", plain(arm.arm.name)) + totals(arm) + dominating(study, arm) +
         (arm.allocation ? allocation(study, *arm.allocation) : halving(study, arm)) +
         inputs(study, arm) + map_text(arm) + legend(budget, arm);
}

/// A line for an arm: what it gives, whose it is, what to do first.
std::string in_short(const Study& study, const ArmBudget& arm) {
  if (arm.responses.empty()) return "";
  const ResponseBudget& r = arm.responses.front();
  std::string text = fmt::format("- **{}**: {}", plain(arm.arm.name), title_of(r.response));
  text += r.answers
              ? " ≤ " + with_unit(r.response, r.answers->p95.value) + " in 95 % of the machines"
              : " " + with_unit(r.response, r.base) + " at the centres";
  if (r.limit) text += fmt::format(", limit {}", with_unit(r.response, *r.limit));
  if (r.share_within) text += fmt::format(" kept by {}", percent(r.share_within->value));
  const Ranking own = ranking(r, study.inputs.size());
  const bool mapped = own.basis == Ranking::Basis::None;
  const std::string whose = leaders(study, mapped ? map_ranking(arm, study.inputs.size()) : own, 3);
  if (!whose.empty()) text += (mapped ? "; the map is mostly " : "; mostly ") + whose;
  if (arm.allocation && !arm.allocation->attainable) {
    text += "; no spending reaches the limit";
  } else if (arm.allocation) {
    const std::vector<int> order = tightest_first(arm.allocation->cheapest);
    if (!order.empty())
      text += fmt::format("; tighten first **{}** to {:.2f} of its spread",
                          plain(study.inputs[std::size_t(order.front())].name),
                          arm.allocation->cheapest[order.front()]);
  }
  return text + ".\n";
}

std::string head(const Budget& budget) {
  const Study& study = budget.study;
  std::string text = fmt::format("# {}\n\n", plain(study.title));
  text += fmt::format("{} inputs, {} cases", study.inputs.size(), budget.cases);
  if (budget.failed > 0) text += fmt::format(", **{} without an answer**", budget.failed);
  text += fmt::format(", seed {}. ", study.seed);
  if (study.machine_part) text += "Figures are of the map minus the error-free one. ";
  return text + "\n\n";
}

std::string proofs(const Budget& budget) {
  if (budget.proofs.empty()) return "";
  MarkdownTable t{{"influence against full cuts", "response", "cases", "differs at most by, %"}};
  t.text_columns = 2;
  for (const Proof& p : budget.proofs)
    t.rows.push_back({plain(p.arm), title_of(p.response), fmt::format("{}", p.compared),
                      p.percent ? figure(*p.percent) : "–"});
  return "## Proof\n\n" + lines_of(t);
}

std::string without_trailing_spaces(const std::string& text) {
  std::string result;
  for (const char c : text) {
    while (c == '\n' && !result.empty() && result.back() == ' ') result.pop_back();
    result += c;
  }
  return result;
}

}  // namespace

std::string to_markdown(const Budget& budget) {
  std::string text = head(budget);
  for (const std::string& warning : budget.warnings) text += "> " + plain(warning) + "\n\n";
  for (const ArmBudget& arm : budget.arms) text += in_short(budget.study, arm);
  if (!budget.arms.empty()) text += "\n";
  for (const ArmBudget& arm : budget.arms) text += arm_text(budget, arm);
  return without_trailing_spaces(text + proofs(budget));
}

}  // namespace abbe::sim::study
