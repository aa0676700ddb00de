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

constexpr std::size_t max_bars = 25;  // readable in one picture
constexpr std::size_t max_panels = 12;
constexpr std::size_t max_configurations = 24;  // curves in one distribution

std::string axis_text(Response response) {
  return response_title(response) + " / " + display_unit(response);
}

/// Writes pictures to a folder under unique names, each through a temporary file.
class Album {
 public:
  explicit Album(ResultFolder folder) : folder_(std::move(folder)) {}

  template <typename Write>
  void add(const std::vector<std::string>& name, const Write& write) {
    write_file(folder_ / (names_.unique_name(name) + ".png"),
               [&](const std::filesystem::path& temporary) { write(temporary); });
  }

 private:
  ResultFolder folder_;
  PictureNames names_;
};

constexpr std::size_t max_letters = 44;        // characters of a name beside a bar or a cell
constexpr std::size_t max_title_letters = 34;  // characters above a small panel

std::string input_name(const Budget& budget, int input, std::size_t max_length = max_letters) {
  return shortened_line(budget.study.inputs[std::size_t(input)].name, max_length);
}
std::string configuration_name(const ConfigurationBudget& arm) {
  return shortened_line(arm.arm.name, max_letters);
}

std::string share_text(double share) {
  return share > 0.0 && share < 0.0005 ? "< 0.1 %" : render::fixed(100.0 * share, 1) + " %";
}

std::string bar_name(const Budget& budget, const Ranking& ranking, const ParetoBar& bar) {
  switch (bar.kind) {
    case ParetoBar::Kind::Input:
      return input_name(budget, bar.input);
    case ParetoBar::Kind::Others:
      return fmt::format("{} others", bar.many);
    case ParetoBar::Kind::Apart:
      return remainder_name(ranking.basis);
  }
  return "";
}

/// Writes the shares of the inputs with their running sum, which ends at 100 %. One bar stands for
/// all inputs beyond `max_bars`, the last bar for the share due to no input alone.
void write_pareto(Album& album, const Budget& budget, const ConfigurationBudget& arm) {
  Ranking order = map_ranking(arm, budget.study.inputs.size());
  std::string subject = "map";
  if (order.basis == Ranking::Basis::None && !arm.responses.empty()) {
    order = ranking(arm.responses.front(), budget.study.inputs.size());
    subject = response_title(arm.responses.front().response);
  }
  if (order.basis == Ranking::Basis::None || !(order.weights.sum() > 0.0)) return;
  std::vector<render::Bar> bars;
  for (const ParetoBar& entry : pareto(order, max_bars)) {
    render::Bar bar{bar_name(budget, order, entry), 100.0 * entry.share};
    bar.text = share_text(entry.share);
    if (order.basis == Ranking::Basis::Map && entry.kind == ParetoBar::Kind::Input)
      bar.text += fmt::format("   RMS {} µm",
                              render::figure(arm.maps[std::size_t(entry.input)].rms / units::um));
    bars.push_back(bar);
  }
  render::BarsOptions options;
  options.title = fmt::format("{}: contributions to the {}", configuration_name(arm), subject);
  options.x_label = fmt::format("fraction of {} / %", share_of(order.basis));
  options.running_sum = "running sum";
  if (arm.map_mean_rms && order.basis == Ranking::Basis::Map)
    options.caption.push_back(
        fmt::format("not caused by inputs: RMS {} µm of the map (cusps, centres){}",
                    render::figure(*arm.map_mean_rms / units::um),
                    arm.map_rms ? fmt::format(", of {} µm over random machines",
                                              render::figure(*arm.map_rms / units::um))
                                : ""));
  album.add({"pareto", arm.arm.name},
            [&](const auto& file) { render::write_bars(file, bars, options); });
}

/// Returns the caption about the inputs without a bar in a tornado chart.
std::string omitted_text(const Ranking& ranking, Response response) {
  double squared_sum = 0.0, sum = 0.0;
  for (std::size_t k = max_bars; k < ranking.order.size(); ++k) {
    squared_sum += ranking.weights[ranking.order[k]];
    sum += std::sqrt(ranking.weights[ranking.order[k]]);
  }
  return fmt::format(
      "{} inputs are omitted: root-sum-square {} {}, sum {} {}", ranking.order.size() - max_bars,
      render::figure(in_unit(response, std::sqrt(squared_sum))), display_unit(response),
      render::figure(in_unit(response, sum)), display_unit(response));
}

std::string totals_caption(const ResponseBudget& response) {
  std::string text;
  const auto add = [&](const char* name, const std::optional<double>& value) {
    if (value)
      text += fmt::format("{}{} {} {}", text.empty() ? "" : "  ·  ", name,
                          render::figure(in_unit(response.response, *value)),
                          display_unit(response.response));
  };
  add("base", response.base);
  add("root-sum-square", response.root_sum_square);
  add("sum", response.sum);
  add("worst found", response.worst);
  return text;
}

/// Writes the changes of a response by each input to either side of the base machine.
void write_tornado(Album& album, const Budget& budget, const ConfigurationBudget& arm,
                   const ResponseBudget& response) {
  const Ranking order = change_ranking(response, budget.study.inputs.size());
  if (order.basis == Ranking::Basis::None) return;
  std::vector<const Contribution*> contributions_by_input(budget.study.inputs.size(), nullptr);
  for (const Contribution& contribution : response.contributions)
    contributions_by_input[std::size_t(contribution.input)] = &contribution;
  std::vector<render::Bar> bars;
  for (std::size_t k = 0; k < std::min(order.order.size(), max_bars); ++k) {
    const Contribution* contribution = contributions_by_input[std::size_t(order.order[k])];
    if (contribution == nullptr) continue;
    const auto display_value = [&](const std::optional<double>& value) {
      return value ? in_unit(response.response, *value) : std::nan("");
    };
    render::Bar bar{input_name(budget, contribution->input), display_value(contribution->low)};
    bar.second_value = display_value(contribution->high);
    bars.push_back(bar);
  }
  const double step = budget.study.one_at_a_time ? budget.study.one_at_a_time->step : 1.0;
  render::BarsOptions options;
  options.title = fmt::format("{}: {}, one input at a time", configuration_name(arm),
                              response_title(response.response));
  options.x_label = fmt::format("change of {} from the base / {}",
                                response_title(response.response), display_unit(response.response));
  options.legend = {fmt::format("centre − {:g} std. dev.", step),
                    fmt::format("centre + {:g} std. dev.", step)};
  options.caption.push_back(totals_caption(response));
  if (order.order.size() > max_bars)
    options.caption.push_back(omitted_text(order, response.response));
  album.add({"tornado", arm.arm.name, name_of(response.response)},
            [&](const auto& file) { render::write_bars(file, bars, options); });
}

/// Returns one index of one input over the number of base points.
render::Series index_series(const IndexConvergence& index_convergence, std::size_t input,
                            IntervalEstimate SobolIndex::*which, const char* name) {
  const auto point_count = Eigen::Index(index_convergence.base_points.size());
  render::Series series;
  series.name = name;
  series.x = Eigen::VectorXd::LinSpaced(point_count, 0.0, double(point_count - 1));
  series.y.resize(point_count);
  series.lower.resize(point_count);
  series.upper.resize(point_count);
  for (Eigen::Index i = 0; i < point_count; ++i) {
    const IntervalEstimate& estimate = index_convergence.indices[std::size_t(i)][input].*which;
    series.y[i] = estimate.value;
    // The intervals of the first few points extend far beyond 0 .. 1 and would set the scale.
    series.lower[i] = std::max(estimate.low, -0.5);
    series.upper[i] = std::min(estimate.high, 1.5);
  }
  series.curve_style = render::CurveStyle::LineAndPoints;
  return series;
}

void write_indices(Album& album, const Budget& budget, const ConfigurationBudget& arm,
                   const ResponseBudget& response) {
  if (!response.index_convergence || response.index_convergence->base_points.empty()) return;
  const IndexConvergence& index_convergence = *response.index_convergence;
  const Ranking order = ranking(response, budget.study.inputs.size());
  if (order.order.empty()) return;  // the variation is below the numerical floor
  std::vector<render::Panel> panels;
  for (std::size_t k = 0; k < std::min(order.order.size(), max_panels); ++k) {
    const auto i = std::size_t(order.order[k]);
    render::Panel panel{input_name(budget, int(i), max_title_letters), "", "", {}, {}, {}};
    panel.series = {
        index_series(index_convergence, i, &SobolIndex::total, "total, 95 % confidence"),
        index_series(index_convergence, i, &SobolIndex::first, "alone, 95 % confidence")};
    const SobolIndex& last = index_convergence.indices.back()[i];
    panel.note = {render::fixed(last.total.value, 2)};
    for (const Eigen::Index points : index_convergence.base_points)
      panel.x_names.push_back(std::to_string(points));
    panels.push_back(panel);
  }
  render::GridOptions options;
  options.title = fmt::format("{}: convergence of the Sobol indices of {}", configuration_name(arm),
                              response_title(response.response));
  options.common_y = true;
  options.caption = {
      "fraction of the variance caused by an input alone, and with all its interactions; next to "
      "the name: total index for all base points"};
  if (order.order.size() > max_panels)
    options.caption.push_back(fmt::format("the {} inputs with the largest total indices, of {}",
                                          max_panels, order.order.size()));
  album.add({"indices", arm.arm.name, name_of(response.response)},
            [&](const auto& file) { render::write_grid(file, panels, options); });
}

std::string interval_text(Response response, const IntervalEstimate& estimate) {
  const auto text = [&](double value) { return render::figure(in_unit(response, value)); };
  return fmt::format("{} [{}, {}]", text(estimate.value), text(estimate.low), text(estimate.high));
}

render::DistributionSeries distribution_series(const ConfigurationBudget& arm,
                                               const ResponseBudget& response) {
  render::DistributionSeries series;
  series.name = configuration_name(arm);
  series.values =
      response.values.unaryExpr([&](double value) { return in_unit(response.response, value); });
  series.figures.assign(5, "");
  if (response.answers) {
    series.mean = in_unit(response.response, response.answers->mean.value);
    series.p95 = in_unit(response.response, response.answers->p95.value);
    series.figures[0] = interval_text(response.response, response.answers->mean);
    series.figures[1] =
        render::figure(in_unit(response.response, response.answers->standard_deviation.value));
    series.figures[2] = interval_text(response.response, response.answers->p95);
  }
  if (response.fraction_within)
    series.figures[3] =
        fmt::format("{} [{}, {}]", render::fixed(100.0 * response.fraction_within->value, 1),
                    render::fixed(100.0 * response.fraction_within->low, 1),
                    render::fixed(100.0 * response.fraction_within->high, 1));
  if (response.capability) series.figures[4] = render::fixed(*response.capability, 2);
  return series;
}

/// Writes the distributions of all configurations in one chart.
void write_distribution(Album& album, const Budget& budget, Response response) {
  std::vector<render::DistributionSeries> series;
  render::DistributionOptions options;
  std::size_t configurations = 0;
  for (const ConfigurationBudget& arm : budget.configurations)
    for (const ResponseBudget& response_budget : arm.responses) {
      if (response_budget.response != response || response_budget.values.size() == 0 ||
          ++configurations > max_configurations)
        continue;
      series.push_back(distribution_series(arm, response_budget));
      if (response_budget.limit) options.limit = in_unit(response, *response_budget.limit);
    }
  if (series.empty()) return;
  const std::string unit = display_unit(response);
  options.title = fmt::format("{}: {} of random machines", one_line(budget.study.title),
                              response_title(response));
  options.x_label = axis_text(response);
  options.unit = unit;
  options.headings = {"mean / " + unit, "std. dev.", "P95 / " + unit, "within / %", "Cpk"};
  if (options.limit)
    options.limit_label = fmt::format("limit {} {}", render::figure(*options.limit), unit);
  options.caption = {"brackets are 95 % confidence intervals"};
  if (configurations > max_configurations)
    options.caption.push_back(
        fmt::format("{} more configurations are omitted", configurations - max_configurations));
  album.add({"distribution", name_of(response)},
            [&](const auto& file) { render::write_distribution(file, series, options); });
}

/// Returns (inputs x 2) the correlations with a response, linear and of ranks; NaN for those that
/// chance may give.
Eigen::MatrixXd significant_correlations(const ResponseBudget& response, std::size_t inputs) {
  Eigen::MatrixXd correlations = Eigen::MatrixXd::Constant(Eigen::Index(inputs), 2, std::nan(""));
  const auto significant = [min_correlation =
                                chance_correlation(response)](const std::optional<double>& value) {
    return value && std::abs(*value) > min_correlation ? *value : std::nan("");
  };
  for (const Contribution& contribution : response.contributions)
    correlations.row(contribution.input) << significant(contribution.correlation),
        significant(contribution.rank_correlation);
  return correlations;
}

void write_correlation(Album& album, const Budget& budget, const ConfigurationBudget& arm) {
  const std::size_t inputs = budget.study.inputs.size();
  Eigen::MatrixXd correlations(Eigen::Index(inputs), 0);
  render::HeatMap map;
  double min_correlation = 0.0;
  for (const ResponseBudget& response : arm.responses) {
    if (std::none_of(response.contributions.begin(), response.contributions.end(),
                     [](const Contribution& contribution) {
                       return contribution.correlation || contribution.rank_correlation;
                     }))
      continue;
    correlations.conservativeResize(Eigen::NoChange, correlations.cols() + 2);
    correlations.rightCols(2) = significant_correlations(response, inputs);
    for (const char* kind : {"linear", "rank"})
      map.columns.push_back(response_title(response.response) + ", " + kind);
    min_correlation = std::max(min_correlation, chance_correlation(response));
  }
  std::vector<int> order;
  Eigen::VectorXd strongest = Eigen::VectorXd::Zero(correlations.rows());
  for (int i = 0; i < int(inputs); ++i) {
    for (const double value : correlations.row(i))
      if (std::abs(value) > strongest[i]) strongest[i] = std::abs(value);
    if (strongest[i] > 0.0) order.push_back(i);
  }
  if (order.empty()) return;
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return strongest[a] > strongest[b]; });
  const std::size_t significant_count = order.size();
  order.resize(std::min(significant_count, max_bars));
  for (const int i : order) map.rows.push_back(input_name(budget, i));
  map.values = correlations(order, Eigen::all);
  render::HeatMapOptions options;
  options.title = shortened_line(arm.arm.name, max_title_letters) + ": correlations";
  options.value_label = "correlation";
  options.range = 1.0;
  options.decimals = 2;
  options.caption = {"of the inputs with the responses of random machines",
                     fmt::format("–  at most {} (four standard errors), not significant",
                                 render::fixed(min_correlation, 3)),
                     fmt::format("{} of {} inputs {} a larger correlation", significant_count,
                                 inputs, significant_count == 1 ? "has" : "have")};
  if (significant_count > order.size())
    options.caption.back() += fmt::format(", the {} strongest are shown", order.size());
  album.add({"correlation", arm.arm.name},
            [&](const auto& file) { render::write_heat_map(file, map, options); });
}

/// Returns the label of an input with its unit: "EXX, factor", "thermal.link.3 / W_per_K".
std::string axis_text(const Input& input) {
  const std::string name = shortened_line(input.name, max_letters);
  return name + (input.element.empty() ? "" : ", factor") + " / " + display_unit(unit_of(input));
}

void write_sweep(Album& album, const Budget& budget, const SweepResult& result) {
  const Study& study = budget.study;
  const Sweep& sweep = study.sweeps[std::size_t(result.sweep)];
  const Input& input = study.inputs[std::size_t(sweep.input)];
  std::vector<render::Panel> panels;
  for (std::size_t r = 0; r < study.responses.size(); ++r) {
    render::Panel panel{response_title(study.responses[r]),
                        axis_text(input),
                        axis_text(study.responses[r]),
                        {},
                        {},
                        {}};
    for (std::size_t a = 0; a < result.answers.size(); ++a) {
      render::Series curve;
      curve.name = shortened_line(study.configurations[a].name, max_letters);
      curve.x = sweep.values;
      curve.y = result.answers[a][r].unaryExpr(
          [&](double value) { return in_unit(study.responses[r], value); });
      curve.curve_style = render::CurveStyle::LineAndPoints;
      panel.series.push_back(curve);
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
  double finished = 0.0;
  for (const ConfigurationBudget& arm : budget.configurations) {
    if (progress) progress("budget", finished++ / double(budget.configurations.size() + 1));
    write_pareto(album, budget, arm);
    for (const ResponseBudget& response_budget : arm.responses) {
      write_tornado(album, budget, arm, response_budget);
      write_indices(album, budget, arm, response_budget);
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
