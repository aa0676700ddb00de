#include "sim/study/budget_analysis.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <stdexcept>

#include <fmt/format.h>

#include "cutting/map/form.h"
#include "cutting/map/residual.h"
#include "kinematics/units.h"
#include "sim/scene/toml.h"
#include "sim/study/influence.h"
#include "sim/study/response_statistics.h"
#include "sim/study/uncertainty.h"
#include "sim/study/worst_case.h"

namespace abbe::sim::study {

namespace {

using Eigen::Index;

/// Returns a study of the same configurations whose inputs are the unidentified coefficients and
/// those that hide them. Only the slopes of its maps are used, so no machine is cut to check them.
Study coefficient_study(Study study) {
  std::vector<Input> inputs;
  const auto add = [&](const std::string& number, double spread) {
    if (std::ranges::find(inputs, number, &Input::number) != inputs.end()) return;
    Input input;
    input.name = input.number = number;
    const auto study_input = std::ranges::find(study.inputs, number, &Input::number);
    if (study_input != study.inputs.end())
      input.distribution.centre = study_input->distribution.centre;
    input.distribution.spread = spread;
    inputs.push_back(std::move(input));
  };
  for (const UnidentifiedCoefficient& coefficient : study.unidentified) {
    add(coefficient.number, coefficient.spread > 0.0 ? coefficient.spread : 1.0);
    for (const auto& [number, amount] : coefficient.hidden_by)
      if (std::ranges::find(study.inputs, number, &Input::number) != study.inputs.end())
        add(number, coefficient.spread > 0.0 ? coefficient.spread : 1.0);
  }
  study.inputs = std::move(inputs);
  study.copula = Copula(int(study.inputs.size()));
  study.influence.checks = 0;
  return study;
}

/// Returns the change of the map by one standard deviation of a coefficient, mm. The coefficients
/// of the belief that hide it change in the opposite direction, as in an identification.
Eigen::VectorXd coefficient_change(const UnidentifiedCoefficient& number, const Study& probe,
                                   const Eigen::MatrixXd& effects) {
  Eigen::VectorXd change = Eigen::VectorXd::Zero(effects.cols());
  const auto add = [&](const std::string& name, double amount) {
    const auto index = std::ranges::find(probe.inputs, name, &Input::number) - probe.inputs.begin();
    if (index < std::ssize(probe.inputs))
      change += amount * number.spread * effects.row(index).transpose();
  };
  add(number.number, 1.0);
  for (const auto& [name, amount] : number.hidden_by) add(name, -amount);
  return change;
}

cutting::Surface surface_of_change(const InfluenceMap& influence, const Eigen::VectorXd& change) {
  cutting::Surface surface;
  surface.residual = change;
  surface.status = influence.status;
  surface.cut_time_s = Eigen::VectorXd::Zero(change.size());
  surface.cut_line.assign(std::size_t(change.size()), 0);
  return surface;
}

}  // namespace

std::vector<UnidentifiedEffect> unidentified_effects(const Study& study,
                                                     const PreparedConfiguration& ready,
                                                     const Progress& progress) {
  if (study.unidentified.empty() || ready.needs_commands_per_case) return {};
  const Study probe = coefficient_study(study);
  std::vector<UnidentifiedEffect> result;
  try {
    const InfluenceMap influence = influence_map(probe, ready, progress);
    const Eigen::MatrixXd input_effects = effects(influence);
    for (const UnidentifiedCoefficient& number : study.unidentified) {
      const cutting::Surface changed_surface =
          surface_of_change(influence, coefficient_change(number, probe, input_effects));
      const cutting::Surface aligned_surface =
          cutting::aligned(changed_surface, influence.design, {ready.job.scene.alignment}).surface;
      const cutting::Statistics figures =
          cutting::statistics(aligned_surface, influence.design, {});
      result.push_back({number, figures.rms.value_or(0.0), figures.pv.value_or(0.0)});
    }
  } catch (const BadInput&) {
    // The maps cannot represent this configuration, or its part is gouged; the study reports both.
    return {};
  } catch (const std::invalid_argument&) {
    return {};
  }
  return result;
}

std::string unidentified_warning(const Study& study, const ConfigurationBudget& arm) {
  constexpr double min_reported = 1e-6;  // mm RMS, the numerical floor of the map
  constexpr std::size_t max_named = 6;
  std::vector<const UnidentifiedEffect*> effects;
  double squared_sum = 0.0;
  for (const UnidentifiedEffect& effect : arm.unidentified)
    if (!effect.number.is_drawn) {
      effects.push_back(&effect);
      squared_sum += effect.rms * effect.rms;
    }
  const std::string advice =
      "(to sample them, set unidentified = { EY0A_um = 20 } or \"typical\" in [[inputs]])";
  if (effects.empty() && arm.unidentified.empty() &&
      std::ranges::any_of(study.unidentified, [](const UnidentifiedCoefficient& coefficient) {
        return !coefficient.is_drawn;
      }))
    return fmt::format(
        "all figures of {} ignore {} coefficients that were not identified and have no prior {}",
        arm.arm.name,
        std::ranges::count_if(
            study.unidentified,
            [](const UnidentifiedCoefficient& coefficient) { return !coefficient.is_drawn; }),
        advice);
  if (std::sqrt(squared_sum) < min_reported) return "";
  std::ranges::stable_sort(effects, std::greater<>(), &UnidentifiedEffect::rms);
  std::string text = fmt::format(
      "all figures of {} ignore coefficients that were not identified and have no prior {}: the "
      "map changes with ",
      arm.arm.name, advice);
  double squared_rest = 0.0;
  std::size_t named_count = 0;
  for (const UnidentifiedEffect* effect : effects) {
    // An effect of 5 % of the largest changes the root-sum-square by 0.1 %.
    if (named_count < max_named &&
        effect->rms >= std::max(min_reported, 0.05 * effects.front()->rms)) {
      text += fmt::format("{}{} by {:.3g} um RMS per {:.3g} {}", named_count > 0 ? ", " : "",
                          effect->number.number, effect->rms / units::um, effect->number.spread,
                          effect->number.unit);
      ++named_count;
    } else {
      squared_rest += effect->rms * effect->rms;
    }
  }
  if (squared_rest > min_reported * min_reported)
    text += fmt::format(", and {} more by {:.3g} um in total", effects.size() - named_count,
                        std::sqrt(squared_rest) / units::um);
  return text;
}

namespace {

constexpr std::uint64_t bootstrap_stream = 0x9e3779b97f4a7c15ULL;

/// The rows of finished cases by analysis.
class RowsByAnalysis {
 public:
  RowsByAnalysis(const Plan& plan, const std::vector<Row>& rows) : plan_(plan), rows_(rows) {}

  /// Returns (block.count) the responses of a block in one column, NaN for cases that are not
  /// finished.
  Eigen::VectorXd column(const Block& block, std::size_t column) const {
    Eigen::VectorXd values = Eigen::VectorXd::Constant(Index(block.count), none);
    const auto before = [](const Row& row, std::uint64_t index) { return row.index < index; };
    for (auto row = std::lower_bound(rows_.begin(), rows_.end(), block.first, before);
         row != rows_.end() && row->index < block.first + block.count; ++row)
      values[Index(row->index - block.first)] = row->response_values[column];
    return values;
  }

  /// Returns the first block of an analysis; null if the study does not have it.
  const Block* find(Block::Kind kind) const {
    const auto block = std::ranges::find(plan_.blocks, kind, &Block::kind);
    return block == plan_.blocks.end() ? nullptr : &*block;
  }

 private:
  const Plan& plan_;
  const std::vector<Row>& rows_;
};

std::optional<double> optional_if_finite(double value) {
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

/// Adds the one-at-a-time changes, and their totals if every change is known.
void add_one_at_a_time(const Eigen::VectorXd& values, ResponseBudget& budget) {
  double squared_sum = 0.0, sum = 0.0;
  bool is_complete = true;
  for (std::size_t i = 0; i < budget.contributions.size(); ++i) {
    Contribution& contribution = budget.contributions[i];
    contribution.low = optional_if_finite(values[2 * Index(i)] - budget.base);
    contribution.high = optional_if_finite(values[2 * Index(i) + 1] - budget.base);
    is_complete = is_complete && contribution.low && contribution.high;
    const double max_change = larger_change(contribution).value_or(0.0);
    squared_sum += max_change * max_change;
    sum += max_change;
  }
  if (!is_complete) return;
  budget.root_sum_square = std::sqrt(squared_sum);
  budget.sum = sum;
}

void add_monte_carlo(const Study& study, const Eigen::VectorXd& responses,
                     const Eigen::MatrixXd& inputs, ResponseBudget& budget) {
  budget.values = responses;
  if (responses.size() < 2) return;
  budget.answers = answers(responses);
  for (const auto& [response, limit] : study.limits) {
    if (response != budget.response) continue;
    budget.limit = limit;
    budget.capability = process_capability(responses, limit);
    budget.fraction_within = fraction_within_limit(responses, limit);
  }
  const Correlations correlations_of_inputs = correlations(inputs, responses);
  const Eigen::VectorXd effects = main_effects(inputs, responses);
  for (std::size_t i = 0; i < budget.contributions.size(); ++i) {
    budget.contributions[i].correlation = correlations_of_inputs.linear[Index(i)];
    budget.contributions[i].rank_correlation = correlations_of_inputs.rank[Index(i)];
    budget.contributions[i].main_effect = effects[Index(i)];
  }
}

void add_sobol(const Study& study, const Eigen::VectorXd& values, ResponseBudget& budget) {
  const Index columns = Index(study.inputs.size()) + 2;
  const Eigen::MatrixXd table =
      Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
          values.data(), values.size() / columns, columns);
  // The indices need 8 complete base points, which an unfinished study may not have.
  if ((table.array().isFinite().rowwise().all()).count() < 8) return;
  budget.index_convergence = index_convergence(table, study.seed ^ bootstrap_stream);
  const std::vector<SobolIndex>& last = budget.index_convergence->indices.back();
  for (std::size_t i = 0; i < budget.contributions.size(); ++i)
    budget.contributions[i].sobol = last[i];
}

/// Monte-Carlo cases with a response in one column, and their inputs.
struct DrawnCases {
  std::vector<Index> which;
  Eigen::MatrixXd inputs;  ///< (inputs x which)
};
DrawnCases cases_with_responses(const Study& study, const Plan& plan, const Block& block,
                                const Eigen::VectorXd& values) {
  DrawnCases cases;
  for (Index i = 0; i < values.size(); ++i)
    if (std::isfinite(values[i])) cases.which.push_back(i);
  const Eigen::MatrixXd x = case_inputs(study, plan, block.first, block.first + block.count);
  cases.inputs = x(Eigen::all, cases.which);
  return cases;
}

ResponseBudget response_budget(const Study& study, const Plan& plan,
                               const RowsByAnalysis& rows_by_analysis, std::size_t column,
                               Response response) {
  ResponseBudget budget;
  budget.response = response;
  for (std::size_t i = 0; i < study.inputs.size(); ++i)
    budget.contributions.emplace_back().input = int(i);
  if (const Block* block = rows_by_analysis.find(Block::Kind::Base))
    budget.base = rows_by_analysis.column(*block, column)[0];
  if (const Block* block = rows_by_analysis.find(Block::Kind::OneAtATime))
    add_one_at_a_time(rows_by_analysis.column(*block, column), budget);
  if (const Block* block = rows_by_analysis.find(Block::Kind::MonteCarlo)) {
    const Eigen::VectorXd values = rows_by_analysis.column(*block, column);
    const DrawnCases cases = cases_with_responses(study, plan, *block, values);
    add_monte_carlo(study, values(cases.which), cases.inputs, budget);
  }
  if (const Block* block = rows_by_analysis.find(Block::Kind::Sobol))
    add_sobol(study, rows_by_analysis.column(*block, column), budget);
  return budget;
}

/// Compares the two engines case by case. Differences are relative to the value of the case, but
/// those of a mean and of an area in tolerance, which may be zero, to the largest value.
Proof engine_proof(const Eigen::VectorXd& full, const Eigen::VectorXd& linear, Proof proof) {
  const bool can_be_zero =
      proof.response == Response::Mean || proof.response == Response::InTolerance;
  const auto is_known = full.array().isFinite();
  const double largest = is_known.select(full.cwiseAbs(), 0.0).maxCoeff();
  for (Index i = 0; i < full.size(); ++i) {
    if (std::isfinite(full[i]) != std::isfinite(linear[i])) ++proof.one_sided;
    if (!std::isfinite(full[i]) || !std::isfinite(linear[i])) continue;
    ++proof.compared;
    const double reference = can_be_zero ? largest : std::abs(full[i]);
    if (!(reference > 0.0)) continue;
    proof.percent =
        std::max(proof.percent.value_or(0.0), 100.0 * std::abs(linear[i] - full[i]) / reference);
  }
  return proof;
}

std::vector<Proof> proofs(const Study& study, const RowsByAnalysis& rows_by_analysis) {
  const Block* full_block = rows_by_analysis.find(Block::Kind::Proof);
  const Block* linear_block = rows_by_analysis.find(Block::Kind::MonteCarlo);
  std::vector<Proof> result;
  if (!full_block || !linear_block) return result;
  for (std::size_t arm = 0; arm < study.configurations.size(); ++arm)
    for (std::size_t r = 0; r < study.responses.size(); ++r) {
      const std::size_t column = response_column(study, arm, r);
      const Eigen::VectorXd full = rows_by_analysis.column(*full_block, column);
      Proof proof;
      proof.arm = study.configurations[arm].name;
      proof.response = study.responses[r];
      result.push_back(engine_proof(
          full, rows_by_analysis.column(*linear_block, column).head(full.size()), proof));
    }
  return result;
}

std::vector<SweepResult> sweep_results(const Study& study, const Plan& plan,
                                       const RowsByAnalysis& rows_by_analysis) {
  std::vector<SweepResult> results;
  for (const Block& block : plan.blocks) {
    if (block.kind != Block::Kind::Sweep) continue;
    SweepResult result{block.sweep, {}};
    for (std::size_t arm = 0; arm < study.configurations.size(); ++arm) {
      result.answers.emplace_back();
      for (std::size_t r = 0; r < study.responses.size(); ++r)
        result.answers.back().push_back(
            rows_by_analysis.column(block, response_column(study, arm, r)));
    }
    results.push_back(std::move(result));
  }
  return results;
}

/// Adds the contributions of the inputs to the map: E[map^2], averaged over the area, is the mean
/// square of the mean map plus a part for every input. Half of the covariance of two inputs counts
/// for each.
void add_maps(const Study& study, const InfluenceMap& influence, ConfigurationBudget& budget) {
  const Eigen::MatrixXd G = effects(influence);
  Eigen::VectorXd mean(Index(study.inputs.size())), sd = spreads(study);
  for (Index i = 0; i < mean.size(); ++i)
    mean[i] = moments(study.inputs[std::size_t(i)].distribution).mean;
  const Eigen::VectorXd mean_map = maps(influence, mean).col(0) - influence.error_free;
  const Eigen::MatrixXd S = input_covariance(study);
  Eigen::MatrixXd square = Eigen::MatrixXd::Zero(S.rows(), S.cols());
  Eigen::VectorXd min_effect =
      Eigen::VectorXd::Constant(S.rows(), std::numeric_limits<double>::max());
  Eigen::VectorXd max_effect = -min_effect;
  double area = 0.0, mean_part = 0.0;
  // A rank-1 update for each vertex sums the lower half of G G^T.
  for (Index v = 0; v < G.cols(); ++v) {
    if (!std::isfinite(mean_map[v])) continue;
    const double weight = influence.design.area[v];
    area += weight;
    mean_part += weight * mean_map[v] * mean_map[v];
    square.selfadjointView<Eigen::Lower>().rankUpdate(G.col(v), weight);
    min_effect = min_effect.cwiseMin(G.col(v));
    max_effect = max_effect.cwiseMax(G.col(v));
  }
  if (!(area > 0.0)) return;
  const Eigen::MatrixXd M = Eigen::MatrixXd(square.selfadjointView<Eigen::Lower>()) / area;
  const Eigen::VectorXd parts = M.cwiseProduct(S).rowwise().sum();
  const double total = mean_part / area + parts.sum();
  budget.map_mean_rms = std::sqrt(mean_part / area);
  budget.map_rms = std::sqrt(total);
  for (Index i = 0; i < S.rows(); ++i)
    budget.maps.push_back({std::sqrt(M(i, i)) * sd[i], (max_effect[i] - min_effect[i]) * sd[i],
                           parts.sum() > 0.0 ? parts[i] / parts.sum() : 0.0});
}

using Statuses = std::vector<cutting::VertexStatus>;

double area_percent(const Statuses& statuses, cutting::VertexStatus status,
                    const Eigen::VectorXd& area) {
  double judged = 0.0, matching = 0.0;
  for (std::size_t v = 0; v < statuses.size(); ++v) {
    if (statuses[v] == cutting::VertexStatus::Outside) continue;
    judged += area[Index(v)];
    if (statuses[v] == status) matching += area[Index(v)];
  }
  return judged > 0.0 ? 100.0 * matching / judged : 0.0;
}

/// Returns the status of every vertex with all inputs at their centres; none if that machine cannot
/// cut the part, which the rows of the study report.
std::optional<Statuses> centre_statuses(const Study& study, const PreparedConfiguration& arm) {
  try {
    return cut_at(study, arm, arm.job, centre(study)).surface.status;
  } catch (const BadScene&) {
    return std::nullopt;
  } catch (const BadInput&) {
    return std::nullopt;
  }
}

/// Adds the fractions of the area that are left out of the figures.
void add_uncut_and_gouged(const Statuses& status, const Eigen::VectorXd& area,
                          ConfigurationBudget& arm) {
  arm.uncut_percent = area_percent(status, cutting::VertexStatus::Uncut, area);
  arm.gouged_percent = area_percent(status, cutting::VertexStatus::Gouged, area);
}

/// Adds the results that need an influence map. A configuration that gouges has none of them, since
/// its map lacks its worst part.
void add_influence(const PreparedStudy& ready, std::size_t arm, ConfigurationBudget& budget) {
  const Study& study = ready.study;
  const InfluenceMap& influence = ready.influences[arm];
  add_uncut_and_gouged(influence.status, influence.design.area, budget);
  if (study.influence.checks > 0) budget.flagged_percent = influence.flagged_percent;
  if (gouge_count(influence) > 0) return;
  add_maps(study, influence, budget);
  if (study.worst_case)
    for (ResponseBudget& response : budget.responses) {
      const Corner corner =
          worst_corner(study, ready.configurations[arm], influence, response.response);
      response.worst = corner.response;
      response.worst_bound = optional_if_finite(corner.bound);
    }
  if (study.tolerance) budget.allocation = allocation(study, ready.configurations[arm], influence);
}

/// Adds a warning for every kind of failed case. Cases of a kind have the same message up to
/// "seen".
void add_failed_case_warnings(const std::vector<Row>& rows, Budget& budget) {
  constexpr std::size_t max_listed = 10;
  std::map<std::string, std::pair<std::uint64_t, std::string>> kinds;
  for (const Row& row : rows) {
    if (row.fault.empty()) continue;
    auto& [count, example] = kinds[row.fault.substr(0, row.fault.find(", seen "))];
    if (count++ == 0) example = row.fault;
    ++budget.failed;
  }
  std::size_t listed_count = 0;
  for (const auto& [kind, occurrences] : kinds) {
    if (listed_count++ == max_listed) {
      budget.warnings.push_back(fmt::format("{} more kinds of errors are listed in cases.csv",
                                            kinds.size() - max_listed));
      break;
    }
    budget.warnings.push_back(fmt::format("{} case{} without a result: {}", occurrences.first,
                                          occurrences.first == 1 ? "" : "s", occurrences.second));
  }
}

/// Adds warnings about unreliable influence maps and about area without figures.
void add_warnings(Budget& budget) {
  constexpr double max_flagged = 2.0, max_difference = 5.0;  // percent
  for (const ConfigurationBudget& arm : budget.configurations) {
    if (arm.flagged_percent && *arm.flagged_percent > max_flagged)
      budget.warnings.push_back(
          fmt::format("influence maps of {} are invalid on {:.3g} % of the area: its figures are "
                      "unreliable; use smaller spreads or engine = \"full\"",
                      arm.arm.name, *arm.flagged_percent));
    if (arm.uncut_percent && *arm.uncut_percent > 0.0)
      budget.warnings.push_back(
          fmt::format("{:.3g} % of the judged area is not cut with every input at its centre and "
                      "is omitted ({})",
                      *arm.uncut_percent, arm.arm.name));
    if (arm.gouged_percent && *arm.gouged_percent > 0.0)
      budget.warnings.push_back(
          fmt::format("{:.3g} % of the judged area is gouged deeper than the band with every input "
                      "at its centre, so no figures are computed ({})",
                      *arm.gouged_percent, arm.arm.name));
  }
  for (const Proof& proof : budget.proofs) {
    if (proof.percent && *proof.percent > max_difference)
      budget.warnings.push_back(
          fmt::format("{} of {} from influence maps differs by {:.3g} % from a full cut",
                      name_of(proof.response), proof.arm, *proof.percent));
    if (proof.one_sided > 0)
      budget.warnings.push_back(
          fmt::format("{} of {}: {} proofs have a result from only one engine",
                      name_of(proof.response), proof.arm, proof.one_sided));
  }
}

}  // namespace

Budget compute_budget(const Study& study, const Plan& plan, const std::vector<Row>& rows) {
  Budget budget;
  budget.study = study;
  budget.cases = rows.size();
  add_failed_case_warnings(rows, budget);
  const RowsByAnalysis rows_by_analysis(plan, rows);
  for (std::size_t arm = 0; arm < study.configurations.size(); ++arm) {
    ConfigurationBudget arm_budget;
    arm_budget.arm = study.configurations[arm];
    for (std::size_t r = 0; r < study.responses.size() && !study.inputs.empty(); ++r)
      arm_budget.responses.push_back(response_budget(
          study, plan, rows_by_analysis, response_column(study, arm, r), study.responses[r]));
    budget.configurations.push_back(std::move(arm_budget));
  }
  budget.proofs = proofs(study, rows_by_analysis);
  budget.sweeps = sweep_results(study, plan, rows_by_analysis);
  return budget;
}

Budget compute_budget(const PreparedStudy& ready, const std::vector<Row>& rows,
                      const Progress& progress) {
  const Study& study = ready.study;
  Budget budget = compute_budget(study, ready.plan, rows);
  for (std::size_t arm = 0; arm < ready.configurations.size(); ++arm) {
    if (progress) progress("budget", double(arm) / double(ready.configurations.size()));
    if (!ready.influences.empty())
      add_influence(ready, arm, budget.configurations[arm]);
    else if (const auto status = centre_statuses(study, ready.configurations[arm]))
      add_uncut_and_gouged(*status, ready.configurations[arm].job.design_w.area,
                           budget.configurations[arm]);
    budget.configurations[arm].unidentified =
        unidentified_effects(study, ready.configurations[arm]);
    if (std::string text = unidentified_warning(study, budget.configurations[arm]); !text.empty())
      budget.warnings.push_back(std::move(text));
  }
  for (const PreparedConfiguration& arm : ready.configurations)
    for (const std::string& warning : arm.job.warnings)
      // Configurations that share a program share its warnings.
      if (std::ranges::find(budget.warnings, warning) == budget.warnings.end())
        budget.warnings.push_back(warning);
  add_warnings(budget);
  return budget;
}

}  // namespace abbe::sim::study
