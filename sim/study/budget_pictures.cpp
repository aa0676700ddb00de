#include "sim/study/budget.h"

#if ABBE_RENDER

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "render/distribution.h"
#include "render/figures.h"
#include "render/heat_map.h"
#include "render/plot.h"
#include "sim/files/output.h"
#include "sim/study/budget.h"
#include "sim/study/study_text.h"

namespace abbe::sim::study {
namespace {

constexpr std::size_t max_bars = 25;  // of inputs; more are not readable on one picture
constexpr std::size_t max_panels = 12;
constexpr std::size_t max_configurations = 24;  // curves in one distribution

std::string axis_text(Response response) {
  return title_of(response) + " / " + shown_unit(response);
}

/// Writes the pictures of a folder under unique names, each through a temporary file.
class Album {
 public:
  explicit Album(ResultFolder folder) : folder_(std::move(folder)) {}

  template <typename Write>
  void add(const std::vector<std::string>& name, const Write& write) {
    write_file(folder_ / (names_.unused(name) + ".png"),
               [&](const std::filesystem::path& temporary) { write(temporary); });
  }

 private:
  ResultFolder folder_;
  PictureNames names_;
};

constexpr std::size_t max_letters = 44;        // characters of a name beside a bar or a cell
constexpr std::size_t max_title_letters = 34;  // characters above a small panel

std::string name_of_input(const Budget& budget, int i, std::size_t most = max_letters) {
  return short_line(budget.study.inputs[std::size_t(i)].name, most);
}
std::string configuration_name(const ConfigurationBudget& arm) {
  return short_line(arm.arm.name, max_letters);
}

std::string shown_percent(double share) {
  return share > 0.0 && share < 0.0005 ? "< 0.1 %" : render::fixed(100.0 * share, 1) + " %";
}

std::string name_of_bar(const Budget& budget, const Ranking& r, const ParetoBar& bar) {
  switch (bar.kind) {
    case ParetoBar::Kind::Input:
      return name_of_input(budget, bar.input);
    case ParetoBar::Kind::Others:
      return fmt::format("{} others", bar.many);
    case ParetoBar::Kind::Apart:
      return remainder_name(r.basis);
  }
  return "";
}

/// Writes the shares of the inputs with their running sum, which ends at 100 %: inputs beyond the
/// maximum are one bar, the share of no input alone is the last.
void write_pareto(Album& album, const Budget& budget, const ConfigurationBudget& arm) {
  Ranking r = map_ranking(arm, budget.study.inputs.size());
  std::string of = "map";
  if (r.basis == Ranking::Basis::None && !arm.responses.empty()) {
    r = ranking(arm.responses.front(), budget.study.inputs.size());
    of = title_of(arm.responses.front().response);
  }
  if (r.basis == Ranking::Basis::None || !(r.weights.sum() > 0.0)) return;
  std::vector<render::Bar> bars;
  for (const ParetoBar& one : pareto(r, max_bars)) {
    render::Bar bar{name_of_bar(budget, r, one), 100.0 * one.share};
    bar.text = shown_percent(one.share);
    if (r.basis == Ranking::Basis::Map && one.kind == ParetoBar::Kind::Input)
      bar.text += fmt::format("   RMS {} µm",
                              render::figure(arm.maps[std::size_t(one.input)].rms / units::um));
    bars.push_back(bar);
  }
  render::BarsOptions options;
  options.title = fmt::format("{}: what makes the {}", configuration_name(arm), of);
  options.x_label = fmt::format("share of {} / %", share_of(r.basis));
  options.running_sum = "running sum";
  if (arm.map_mean_rms && r.basis == Ranking::Basis::Map)
    options.caption.push_back(
        fmt::format("no input's: RMS {} µm of the map (cusps, centres){}",
                    render::figure(*arm.map_mean_rms / units::um),
                    arm.map_rms ? fmt::format(" of {} µm over random machines",
                                              render::figure(*arm.map_rms / units::um))
                                : ""));
  album.add({"pareto", arm.arm.name},
            [&](const auto& file) { render::write_bars(file, bars, options); });
}

/// Returns the text about the inputs left out of a tornado.
std::string left_out(const Ranking& r, Response response) {
  double squares = 0.0, sum = 0.0;
  for (std::size_t k = max_bars; k < r.order.size(); ++k) {
    squares += r.weights[r.order[k]];
    sum += std::sqrt(r.weights[r.order[k]]);
  }
  return fmt::format("{} inputs are left out: together {} {} root-sum-square, {} {} in sum",
                     r.order.size() - max_bars,
                     render::figure(in_unit(response, std::sqrt(squares))), shown_unit(response),
                     render::figure(in_unit(response, sum)), shown_unit(response));
}

std::string totals(const ResponseBudget& r) {
  std::string text;
  const auto add = [&](const char* name, const std::optional<double>& value) {
    if (value)
      text += fmt::format("{}{} {} {}", text.empty() ? "" : "  ·  ", name,
                          render::figure(in_unit(r.response, *value)), shown_unit(r.response));
  };
  add("base", r.base);
  add("root-sum-square", r.root_sum_square);
  add("sum", r.sum);
  add("worst found", r.worst);
  return text;
}

/// Writes the changes due to each input to either side of the base machine.
void write_tornado(Album& album, const Budget& budget, const ConfigurationBudget& arm,
                   const ResponseBudget& r) {
  const Ranking order = change_ranking(r, budget.study.inputs.size());
  if (order.basis == Ranking::Basis::None) return;
  std::vector<const Contribution*> contributions_by_input(budget.study.inputs.size(), nullptr);
  for (const Contribution& c : r.contributions) contributions_by_input[std::size_t(c.input)] = &c;
  std::vector<render::Bar> bars;
  for (std::size_t k = 0; k < std::min(order.order.size(), max_bars); ++k) {
    const Contribution* c = contributions_by_input[std::size_t(order.order[k])];
    if (c == nullptr) continue;
    const auto shown = [&](const std::optional<double>& v) {
      return v ? in_unit(r.response, *v) : std::nan("");
    };
    render::Bar bar{name_of_input(budget, c->input), shown(c->low)};
    bar.other = shown(c->high);
    bars.push_back(bar);
  }
  const double step = budget.study.one_at_a_time ? budget.study.one_at_a_time->step : 1.0;
  render::BarsOptions options;
  options.title =
      fmt::format("{}: {}, one input at a time", configuration_name(arm), title_of(r.response));
  options.x_label = fmt::format("change of {} against the base / {}", title_of(r.response),
                                shown_unit(r.response));
  options.legend = {fmt::format("centre − {:g} std. dev.", step),
                    fmt::format("centre + {:g} std. dev.", step)};
  options.caption.push_back(totals(r));
  if (order.order.size() > max_bars) options.caption.push_back(left_out(order, r.response));
  album.add({"tornado", arm.arm.name, name_of(r.response)},
            [&](const auto& file) { render::write_bars(file, bars, options); });
}

/// Returns one index of one input over the number of base points.
render::Series index_series(const IndexConvergence& c, std::size_t input,
                            IntervalEstimate SobolIndex::*which, const char* name) {
  const auto n = Eigen::Index(c.base_points.size());
  render::Series s;
  s.name = name;
  s.x = Eigen::VectorXd::LinSpaced(n, 0.0, double(n - 1));
  s.y.resize(n);
  s.lower.resize(n);
  s.upper.resize(n);
  for (Eigen::Index m = 0; m < n; ++m) {
    const IntervalEstimate& b = c.indices[std::size_t(m)][input].*which;
    s.y[m] = b.value;
    // Estimates from the first few points have intervals far outside 0 .. 1, which would hide the
    // rest.
    s.lower[m] = std::max(b.low, -0.5);
    s.upper[m] = std::min(b.high, 1.5);
  }
  s.mark = render::Mark::LineAndPoints;
  return s;
}

void write_indices(Album& album, const Budget& budget, const ConfigurationBudget& arm,
                   const ResponseBudget& r) {
  if (!r.convergence || r.convergence->base_points.empty()) return;
  const IndexConvergence& c = *r.convergence;
  const Ranking order = ranking(r, budget.study.inputs.size());
  if (order.order.empty()) return;  // the response varies by less than the numerical floor
  std::vector<render::Panel> panels;
  for (std::size_t k = 0; k < std::min(order.order.size(), max_panels); ++k) {
    const auto i = std::size_t(order.order[k]);
    render::Panel panel{name_of_input(budget, int(i), max_title_letters), "", "", {}, {}, {}};
    panel.series = {index_series(c, i, &SobolIndex::total, "total, 95 % band"),
                    index_series(c, i, &SobolIndex::first, "alone, 95 % band")};
    const SobolIndex& last = c.indices.back()[i];
    panel.note = {render::fixed(last.total.value, 2)};
    for (const Eigen::Index points : c.base_points) panel.x_names.push_back(std::to_string(points));
    panels.push_back(panel);
  }
  render::GridOptions options;
  options.title = fmt::format("{}: Sobol indices of {} over the base points",
                              configuration_name(arm), title_of(r.response));
  options.common_y = true;
  options.caption = {
      "share of the variance that an input makes alone, and with all its "
      "interactions; beside the name: total index of all base points"};
  if (order.order.size() > max_panels)
    options.caption.push_back(fmt::format("the {} inputs of the largest total index of {}",
                                          max_panels, order.order.size()));
  album.add({"indices", arm.arm.name, name_of(r.response)},
            [&](const auto& file) { render::write_grid(file, panels, options); });
}

std::string banded(Response response, const IntervalEstimate& b) {
  const auto shown = [&](double v) { return render::figure(in_unit(response, v)); };
  return fmt::format("{} [{}, {}]", shown(b.value), shown(b.low), shown(b.high));
}

render::DistributionSeries distribution_of(const ConfigurationBudget& arm,
                                           const ResponseBudget& r) {
  render::DistributionSeries s;
  s.name = configuration_name(arm);
  s.values = r.values.unaryExpr([&](double v) { return in_unit(r.response, v); });
  s.figures.assign(5, "");
  if (r.answers) {
    s.mean = in_unit(r.response, r.answers->mean.value);
    s.p95 = in_unit(r.response, r.answers->p95.value);
    s.figures[0] = banded(r.response, r.answers->mean);
    s.figures[1] = render::figure(in_unit(r.response, r.answers->standard_deviation.value));
    s.figures[2] = banded(r.response, r.answers->p95);
  }
  if (r.fraction_within)
    s.figures[3] = fmt::format("{} [{}, {}]", render::fixed(100.0 * r.fraction_within->value, 1),
                               render::fixed(100.0 * r.fraction_within->low, 1),
                               render::fixed(100.0 * r.fraction_within->high, 1));
  if (r.capability) s.figures[4] = render::fixed(*r.capability, 2);
  return s;
}

/// Writes the distributions of all configurations in one chart.
void write_distribution(Album& album, const Budget& budget, Response response) {
  std::vector<render::DistributionSeries> series;
  render::DistributionOptions options;
  std::size_t arms = 0;
  for (const ConfigurationBudget& arm : budget.arms)
    for (const ResponseBudget& r : arm.responses) {
      if (r.response != response || r.values.size() == 0 || ++arms > max_configurations) continue;
      series.push_back(distribution_of(arm, r));
      if (r.limit) options.limit = in_unit(response, *r.limit);
    }
  if (series.empty()) return;
  const std::string unit = shown_unit(response);
  options.title =
      fmt::format("{}: {} of random machines", one_line(budget.study.title), title_of(response));
  options.x_label = axis_text(response);
  options.unit = unit;
  options.heads = {"mean / " + unit, "std. dev.", "P95 / " + unit, "within / %", "Cpk"};
  if (options.limit)
    options.limit_label = fmt::format("limit {} {}", render::figure(*options.limit), unit);
  options.caption = {"brackets hold the truth with 95 % confidence"};
  if (arms > max_configurations)
    options.caption.push_back(fmt::format("{} more arms are left out", arms - max_configurations));
  album.add({"distribution", name_of(response)},
            [&](const auto& file) { render::write_distribution(file, series, options); });
}

/// Returns the correlations with a response, linear and of ranks; NaN where chance may give as
/// much. (inputs x 2)
Eigen::MatrixXd significant_correlations(const ResponseBudget& r, std::size_t inputs) {
  Eigen::MatrixXd all = Eigen::MatrixXd::Constant(Eigen::Index(inputs), 2, std::nan(""));
  const auto shown = [least = chance_correlation(r)](const std::optional<double>& value) {
    return value && std::abs(*value) > least ? *value : std::nan("");
  };
  for (const Contribution& c : r.contributions)
    all.row(c.input) << shown(c.correlation), shown(c.rank_correlation);
  return all;
}

void write_correlation(Album& album, const Budget& budget, const ConfigurationBudget& arm) {
  const std::size_t inputs = budget.study.inputs.size();
  Eigen::MatrixXd all(Eigen::Index(inputs), 0);
  render::HeatMap map;
  double least = 0.0;
  for (const ResponseBudget& r : arm.responses) {
    if (std::none_of(r.contributions.begin(), r.contributions.end(),
                     [](const Contribution& c) { return c.correlation || c.rank_correlation; }))
      continue;
    all.conservativeResize(Eigen::NoChange, all.cols() + 2);
    all.rightCols(2) = significant_correlations(r, inputs);
    for (const char* kind : {"linear", "rank"})
      map.columns.push_back(title_of(r.response) + ", " + kind);
    least = std::max(least, chance_correlation(r));
  }
  std::vector<int> order;
  Eigen::VectorXd strongest = Eigen::VectorXd::Zero(all.rows());
  for (int i = 0; i < int(inputs); ++i) {
    for (const double value : all.row(i))
      if (std::abs(value) > strongest[i]) strongest[i] = std::abs(value);
    if (strongest[i] > 0.0) order.push_back(i);
  }
  if (order.empty()) return;
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return strongest[a] > strongest[b]; });
  const std::size_t beyond = order.size();
  order.resize(std::min(beyond, max_bars));
  for (const int i : order) map.rows.push_back(name_of_input(budget, i));
  map.values = all(order, Eigen::all);
  render::HeatMapOptions options;
  options.title = short_line(arm.arm.name, max_title_letters) + ": correlations";
  options.value_label = "correlation";
  options.range = 1.0;
  options.decimals = 2;
  options.caption = {
      "of the inputs with the answers of random machines",
      fmt::format("–  no larger than {}, four standard errors: chance may give as much",
                  render::fixed(least, 3)),
      fmt::format("{} of {} inputs {} a larger one", beyond, inputs, beyond == 1 ? "has" : "have")};
  if (beyond > order.size())
    options.caption.back() += fmt::format(", the {} strongest are shown", order.size());
  album.add({"correlation", arm.arm.name},
            [&](const auto& file) { render::write_heat_map(file, map, options); });
}

/// Returns the label of an input with its unit: "EXX, factor", "thermal.link.3 / W_per_K".
std::string axis_text(const Input& input) {
  const std::string name = short_line(input.name, max_letters);
  return name + (input.element.empty() ? "" : ", factor") + " / " + shown_unit(unit_of(input));
}

void write_sweep(Album& album, const Budget& budget, const SweepResult& sweeping) {
  const Study& study = budget.study;
  const Sweep& sweep = study.sweeps[std::size_t(sweeping.sweep)];
  const Input& input = study.inputs[std::size_t(sweep.input)];
  std::vector<render::Panel> panels;
  for (std::size_t r = 0; r < study.responses.size(); ++r) {
    render::Panel panel{
        title_of(study.responses[r]), axis_text(input), axis_text(study.responses[r]), {}, {}, {}};
    for (std::size_t a = 0; a < sweeping.answers.size(); ++a) {
      render::Series s;
      s.name = short_line(study.arms[a].name, max_letters);
      s.x = sweep.values;
      s.y = sweeping.answers[a][r].unaryExpr(
          [&](double v) { return in_unit(study.responses[r], v); });
      s.mark = render::Mark::LineAndPoints;
      panel.series.push_back(s);
    }
    panels.push_back(panel);
  }
  if (panels.empty() || panels.front().series.empty()) return;
  render::CurvesOptions options;
  options.title = fmt::format("{}: sweep of {}", one_line(study.title), one_line(input.name));
  album.add({"sweep", input.name},
            [&](const auto& file) { render::write_curves(file, panels, options); });
}

}  // namespace

void write_pictures(const ResultFolder& folder, const Budget& budget, const Progress& progress) {
  Album album(folder);
  double done = 0.0;
  for (const ConfigurationBudget& arm : budget.arms) {
    if (progress) progress("budget", done++ / double(budget.arms.size() + 1));
    write_pareto(album, budget, arm);
    for (const ResponseBudget& r : arm.responses) {
      write_tornado(album, budget, arm, r);
      write_indices(album, budget, arm, r);
    }
    write_correlation(album, budget, arm);
  }
  for (const Response response : budget.study.responses)
    write_distribution(album, budget, response);
  for (const SweepResult& sweep : budget.sweeps) write_sweep(album, budget, sweep);
}

}  // namespace abbe::sim::study

#else

namespace abbe::sim::study {

void write_pictures(const ResultFolder&, const Budget&, const Progress&) {}

}  // namespace abbe::sim::study

#endif
