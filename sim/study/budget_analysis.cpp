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
/// the coefficients that hide them. Its maps are only read for slopes, so no machine is cut to
/// check them.
Study probe_of(Study study) {
  std::vector<Input> inputs;
  const auto add = [&](const std::string& number, double spread) {
    if (std::ranges::find(inputs, number, &Input::number) != inputs.end()) return;
    Input input;
    input.name = input.number = number;
    const auto own = std::ranges::find(study.inputs, number, &Input::number);
    if (own != study.inputs.end()) input.distribution.centre = own->distribution.centre;
    input.distribution.spread = spread;
    inputs.push_back(std::move(input));
  };
  for (const Unidentified& one : study.unidentified) {
    add(one.number, one.spread > 0.0 ? one.spread : 1.0);
    for (const auto& [number, amount] : one.hidden_by)
      if (std::ranges::find(study.inputs, number, &Input::number) != study.inputs.end())
        add(number, one.spread > 0.0 ? one.spread : 1.0);
  }
  study.inputs = std::move(inputs);
  study.copula = Copula(int(study.inputs.size()));
  study.influence.checks = 0;
  return study;
}

/// Returns the change of the map by one standard deviation of a coefficient, mm. The coefficients
/// of the belief that absorbed it change the other way, as an identification would.
Eigen::VectorXd change_by(const Unidentified& number, const Study& probe,
                          const Eigen::MatrixXd& effects) {
  Eigen::VectorXd change = Eigen::VectorXd::Zero(effects.cols());
  const auto add = [&](const std::string& name, double amount) {
    const auto at = std::ranges::find(probe.inputs, name, &Input::number) - probe.inputs.begin();
    if (at < std::ssize(probe.inputs))
      change += amount * number.spread * effects.row(at).transpose();
  };
  add(number.number, 1.0);
  for (const auto& [name, amount] : number.hidden_by) add(name, -amount);
  return change;
}

cutting::Surface surface_with(const InfluenceMap& influence, const Eigen::VectorXd& change) {
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
  if (study.unidentified.empty() || ready.commanded_for_each) return {};
  const Study probe = probe_of(study);
  std::vector<UnidentifiedEffect> result;
  try {
    const InfluenceMap influence = influence_map(probe, ready, progress);
    const Eigen::MatrixXd all = effects(influence);
    for (const Unidentified& number : study.unidentified) {
      const cutting::Surface changed = surface_with(influence, change_by(number, probe, all));
      const cutting::Surface judged =
          cutting::aligned(changed, influence.design, {ready.job.scene.alignment}).surface;
      const cutting::Statistics figures = cutting::statistics(judged, influence.design, {});
      result.push_back({number, figures.rms.value_or(0.0), figures.pv.value_or(0.0)});
    }
  } catch (const BadInput&) {
    // The maps cannot represent this configuration, or its part is gouged; the study reports it.
    return {};
  } catch (const std::invalid_argument&) {
    return {};
  }
  return result;
}

std::string unidentified_warning(const Study& study, const ConfigurationBudget& arm) {
  constexpr double heard = 1e-6;  // mm, RMS of all together: the numerical floor of the map
  constexpr std::size_t max_named = 6;
  std::vector<const UnidentifiedEffect*> left_out;
  double together = 0.0;
  for (const UnidentifiedEffect& one : arm.unidentified)
    if (!one.number.is_drawn) {
      left_out.push_back(&one);
      together += one.rms * one.rms;
    }
  const std::string cure =
      "(unidentified = { EY0A_um = 20 } or \"typical\" in [[inputs]] draws it)";
  if (left_out.empty() && arm.unidentified.empty() &&
      std::ranges::any_of(study.unidentified, [](const auto& one) { return !one.is_drawn; }))
    return fmt::format(
        "every figure of {} leaves out {} numbers that were not identified and have no prior {}",
        arm.arm.name,
        std::ranges::count_if(study.unidentified, [](const auto& one) { return !one.is_drawn; }),
        cure);
  if (std::sqrt(together) < heard) return "";
  std::ranges::stable_sort(left_out, std::greater<>(), &UnidentifiedEffect::rms);
  std::string text = fmt::format(
      "every figure of {} leaves out what was not identified and has no prior {}: the map feels ",
      arm.arm.name, cure);
  double rest = 0.0;
  std::size_t named = 0;
  for (const UnidentifiedEffect* one : left_out) {
    // An effect below 5 % of the largest one changes the total by 0.1 % if added in squares.
    if (named < max_named && one->rms >= std::max(heard, 0.05 * left_out.front()->rms)) {
      text += fmt::format("{}{} by {:.3g} um RMS per {:.3g} {}", named > 0 ? ", " : "",
                          one->number.number, one->rms / units::um, one->number.spread,
                          one->number.unit);
      ++named;
    } else {
      rest += one->rms * one->rms;
    }
  }
  if (rest > heard * heard)
    text += fmt::format(", and {} more by {:.3g} um together", left_out.size() - named,
                        std::sqrt(rest) / units::um);
  return text;
}

namespace {

constexpr std::uint64_t bootstrap_stream = 0x9e3779b97f4a7c15ULL;

/// Gives access to finished rows by analysis.
class RowsByAnalysis {
 public:
  RowsByAnalysis(const Plan& plan, const std::vector<Row>& rows) : plan_(plan), rows_(rows) {}

  /// Returns the responses of a block in one column; NaN where a case is not finished.
  /// (block.count)
  Eigen::VectorXd column(const Block& block, std::size_t column) const {
    Eigen::VectorXd values = Eigen::VectorXd::Constant(Index(block.count), none);
    const auto before = [](const Row& row, std::uint64_t index) { return row.index < index; };
    for (auto row = std::lower_bound(rows_.begin(), rows_.end(), block.first, before);
         row != rows_.end() && row->index < block.first + block.count; ++row)
      values[Index(row->index - block.first)] = row->answers[column];
    return values;
  }

  const Block* find(Block::Kind kind) const {
    for (const Block& block : plan_.blocks)
      if (block.kind == kind) return &block;
    return nullptr;
  }

 private:
  const Plan& plan_;
  const std::vector<Row>& rows_;
};

std::optional<double> finite_value(double value) {
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

/// Adds the one-at-a-time changes and their totals. The totals need every change; a study that is
/// still running has none.
void add_one_at_a_time(const Eigen::VectorXd& values, ResponseBudget& budget) {
  double squares = 0.0, sum = 0.0;
  bool whole = true;
  for (std::size_t i = 0; i < budget.contributions.size(); ++i) {
    Contribution& one = budget.contributions[i];
    one.low = finite_value(values[2 * Index(i)] - budget.base);
    one.high = finite_value(values[2 * Index(i) + 1] - budget.base);
    whole = whole && one.low && one.high;
    const double larger =
        std::max(std::abs(one.low.value_or(0.0)), std::abs(one.high.value_or(0.0)));
    squares += larger * larger;
    sum += larger;
  }
  if (!whole) return;
  budget.root_sum_square = std::sqrt(squares);
  budget.sum = sum;
}

void add_monte_carlo(const Study& study, const Eigen::VectorXd& answered,
                     const Eigen::MatrixXd& inputs, ResponseBudget& budget) {
  budget.values = answered;
  if (answered.size() < 2) return;
  budget.answers = answers(answered);
  // A limit applies to one response only.
  for (const auto& [response, limit] : study.limits) {
    if (response != budget.response) continue;
    budget.limit = limit;
    budget.capability = cpk(answered, limit);
    budget.fraction_within = fraction_below(answered, limit);
  }
  const Correlations all = correlations(inputs, answered);
  const Eigen::VectorXd alone = main_effects(inputs, answered);
  for (std::size_t i = 0; i < budget.contributions.size(); ++i) {
    budget.contributions[i].correlation = all.linear[Index(i)];
    budget.contributions[i].rank_correlation = all.rank[Index(i)];
    budget.contributions[i].main_effect = alone[Index(i)];
  }
}

void add_sobol(const Study& study, const Eigen::VectorXd& values, ResponseBudget& budget) {
  const Index columns = Index(study.inputs.size()) + 2;
  const Eigen::MatrixXd table =
      Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
          values.data(), values.size() / columns, columns);
  // sobol_indices requires 8 complete base points; an unfinished study may have fewer.
  if ((table.array().isFinite().rowwise().all()).count() < 8) return;
  budget.convergence = convergence(table, study.seed ^ bootstrap_stream);
  const std::vector<SobolIndex>& last = budget.convergence->indices.back();
  for (std::size_t i = 0; i < budget.contributions.size(); ++i)
    budget.contributions[i].sobol = last[i];
}

/// Monte-Carlo cases with a response in one column, and their inputs.
struct Drawn {
  std::vector<Index> which;
  Eigen::MatrixXd inputs;  ///< (inputs x which)
};
Drawn cases_with_responses(const Study& study, const Plan& plan, const Block& block,
                           const Eigen::VectorXd& values) {
  Drawn drawn;
  for (Index i = 0; i < values.size(); ++i)
    if (std::isfinite(values[i])) drawn.which.push_back(i);
  const Eigen::MatrixXd x = inputs_of(study, plan, block.first, block.first + block.count);
  drawn.inputs = x(Eigen::all, drawn.which);
  return drawn;
}

ResponseBudget response_budget(const Study& study, const Plan& plan, const RowsByAnalysis& finished,
                               std::size_t column, Response response) {
  ResponseBudget budget;
  budget.response = response;
  for (std::size_t i = 0; i < study.inputs.size(); ++i)
    budget.contributions.emplace_back().input = int(i);
  if (const Block* block = finished.find(Block::Kind::Base))
    budget.base = finished.column(*block, column)[0];
  if (const Block* block = finished.find(Block::Kind::OneAtATime))
    add_one_at_a_time(finished.column(*block, column), budget);
  if (const Block* block = finished.find(Block::Kind::MonteCarlo)) {
    const Eigen::VectorXd values = finished.column(*block, column);
    const Drawn drawn = cases_with_responses(study, plan, *block, values);
    add_monte_carlo(study, values(drawn.which), drawn.inputs, budget);
  }
  if (const Block* block = finished.find(Block::Kind::Sobol))
    add_sobol(study, finished.column(*block, column), budget);
  return budget;
}

/// Compares the two engines case by case. A mean or a fraction in tolerance may be zero for one
/// machine, so their differences are relative to the largest value instead of the case's own.
Proof engine_proof(const Eigen::VectorXd& full, const Eigen::VectorXd& linear, Proof proof) {
  const bool can_be_zero =
      proof.response == Response::Mean || proof.response == Response::InTolerance;
  const auto known = full.array().isFinite();
  const double largest = known.select(full.cwiseAbs(), 0.0).maxCoeff();
  for (Index i = 0; i < full.size(); ++i) {
    if (std::isfinite(full[i]) != std::isfinite(linear[i])) ++proof.one_sided;
    if (!std::isfinite(full[i]) || !std::isfinite(linear[i])) continue;
    ++proof.compared;
    const double size = can_be_zero ? largest : std::abs(full[i]);
    if (!(size > 0.0)) continue;
    proof.percent =
        std::max(proof.percent.value_or(0.0), 100.0 * std::abs(linear[i] - full[i]) / size);
  }
  return proof;
}

std::vector<Proof> proofs(const Study& study, const RowsByAnalysis& finished) {
  const Block* cut = finished.find(Block::Kind::Proof);
  const Block* estimated = finished.find(Block::Kind::MonteCarlo);
  std::vector<Proof> all;
  if (!cut || !estimated) return all;
  for (std::size_t arm = 0; arm < study.arms.size(); ++arm)
    for (std::size_t r = 0; r < study.responses.size(); ++r) {
      const std::size_t column = response_column(study, arm, r);
      const Eigen::VectorXd full = finished.column(*cut, column);
      Proof proof;
      proof.arm = study.arms[arm].name;
      proof.response = study.responses[r];
      all.push_back(
          engine_proof(full, finished.column(*estimated, column).head(full.size()), proof));
    }
  return all;
}

std::vector<SweepResult> sweepings(const Study& study, const Plan& plan,
                                   const RowsByAnalysis& finished) {
  std::vector<SweepResult> all;
  for (const Block& block : plan.blocks) {
    if (block.kind != Block::Kind::Sweep) continue;
    SweepResult one{block.sweep, {}};
    for (std::size_t arm = 0; arm < study.arms.size(); ++arm) {
      one.answers.emplace_back();
      for (std::size_t r = 0; r < study.responses.size(); ++r)
        one.answers.back().push_back(finished.column(block, response_column(study, arm, r)));
    }
    all.push_back(std::move(one));
  }
  return all;
}

/// Adds the contributions of the inputs to the whole map: E[map^2], averaged over the area, is the
/// mean square of the mean map plus one part for every input; a covariance of two inputs counts
/// half for each.
void add_maps(const Study& study, const InfluenceMap& influence, ConfigurationBudget& budget) {
  const Eigen::MatrixXd G = effects(influence);
  Eigen::VectorXd mean(Index(study.inputs.size())), sd = spreads(study);
  for (Index i = 0; i < mean.size(); ++i)
    mean[i] = moments(study.inputs[std::size_t(i)].distribution).mean;
  const Eigen::VectorXd mean_map = maps(influence, mean).col(0) - influence.error_free;
  const Eigen::MatrixXd S = covariance_of(study);
  Eigen::MatrixXd square = Eigen::MatrixXd::Zero(S.rows(), S.cols());
  Eigen::VectorXd least = Eigen::VectorXd::Constant(S.rows(), std::numeric_limits<double>::max());
  Eigen::VectorXd most = -least;
  double area = 0.0, constant = 0.0;
  // One rank-1 update per vertex sums G G^T, of which only the lower half is computed.
  for (Index v = 0; v < G.cols(); ++v) {
    if (!std::isfinite(mean_map[v])) continue;
    const double weight = influence.design.area[v];
    area += weight;
    constant += weight * mean_map[v] * mean_map[v];
    square.selfadjointView<Eigen::Lower>().rankUpdate(G.col(v), weight);
    least = least.cwiseMin(G.col(v));
    most = most.cwiseMax(G.col(v));
  }
  if (!(area > 0.0)) return;
  const Eigen::MatrixXd M = Eigen::MatrixXd(square.selfadjointView<Eigen::Lower>()) / area;
  const Eigen::VectorXd part = M.cwiseProduct(S).rowwise().sum();
  const double total = constant / area + part.sum();
  budget.map_mean_rms = std::sqrt(constant / area);
  budget.map_rms = std::sqrt(total);
  for (Index i = 0; i < S.rows(); ++i)
    budget.maps.push_back({std::sqrt(M(i, i)) * sd[i], (most[i] - least[i]) * sd[i],
                           part.sum() > 0.0 ? part[i] / part.sum() : 0.0});
}

using Statuses = std::vector<cutting::VertexStatus>;

double percent_of(const Statuses& all, cutting::VertexStatus status, const Eigen::VectorXd& area) {
  double judged = 0.0, part = 0.0;
  for (std::size_t v = 0; v < all.size(); ++v) {
    if (all[v] == cutting::VertexStatus::Outside) continue;
    judged += area[Index(v)];
    if (all[v] == status) part += area[Index(v)];
  }
  return judged > 0.0 ? 100.0 * part / judged : 0.0;
}

/// Returns the status of every vertex with every input at its centre; empty if that machine cannot
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

/// Adds the fractions of the area that the figures leave out.
void add_left_out(const Statuses& status, const Eigen::VectorXd& area, ConfigurationBudget& arm) {
  arm.uncut_percent = percent_of(status, cutting::VertexStatus::Uncut, area);
  arm.gouged_percent = percent_of(status, cutting::VertexStatus::Gouged, area);
}

/// Adds the results that need an influence map. A configuration that gouges gets none of them: its
/// map is missing where it is worst.
void add_influence(const PreparedStudy& ready, std::size_t arm, ConfigurationBudget& one) {
  const Study& study = ready.study;
  const InfluenceMap& influence = ready.influences[arm];
  add_left_out(influence.status, influence.design.area, one);
  if (study.influence.checks > 0) one.flagged_percent = influence.flagged_percent;
  if (gouges_of(influence) > 0) return;
  add_maps(study, influence, one);
  if (study.worst_case)
    for (ResponseBudget& response : one.responses) {
      const Corner corner = worst_corner(study, ready.arms[arm], influence, response.response);
      response.worst = corner.response;
      response.worst_bound = finite_value(corner.bound);
    }
  if (study.tolerance) one.allocation = allocation(study, ready.arms[arm], influence);
}

/// Adds a warning for every kind of failed case. Messages differ from case to case after "seen", so
/// cases are grouped by the text before it.
void add_faults(const std::vector<Row>& rows, Budget& budget) {
  constexpr std::size_t max_listed = 10;
  std::map<std::string, std::pair<std::uint64_t, std::string>> input_errors;
  for (const Row& row : rows) {
    if (row.fault.empty()) continue;
    auto& [count, example] = input_errors[row.fault.substr(0, row.fault.find(", seen "))];
    if (count++ == 0) example = row.fault;
    ++budget.failed;
  }
  std::size_t listed = 0;
  for (const auto& [kind, fault] : input_errors) {
    if (listed++ == max_listed) {
      budget.warnings.push_back(fmt::format("{} more kinds of faults: cases.csv has them",
                                            input_errors.size() - max_listed));
      break;
    }
    budget.warnings.push_back(fmt::format("{} case{} without an answer: {}", fault.first,
                                          fault.first == 1 ? "" : "s", fault.second));
  }
}

/// Adds warnings where influence maps are not reliable.
void add_warnings(Budget& budget) {
  constexpr double max_flagged = 2.0, max_off = 5.0;  // percent
  for (const ConfigurationBudget& arm : budget.arms) {
    if (arm.flagged_percent && *arm.flagged_percent > max_flagged)
      budget.warnings.push_back(fmt::format(
          "influence maps of {} fail on {:.3g} % of the area: its figures are not to be "
          "trusted; take smaller spreads, or engine = \"full\"",
          arm.arm.name, *arm.flagged_percent));
    if (arm.uncut_percent && *arm.uncut_percent > 0.0)
      budget.warnings.push_back(
          fmt::format("{:.3g} % of the judged area is not cut with every input at its centre, and "
                      "left out ({})",
                      *arm.uncut_percent, arm.arm.name));
    if (arm.gouged_percent && *arm.gouged_percent > 0.0)
      budget.warnings.push_back(fmt::format(
          "{:.3g} % of the judged area is gouged deeper than the band with every input at "
          "its centre: such a machine has no figures ({})",
          *arm.gouged_percent, arm.arm.name));
  }
  for (const Proof& proof : budget.proofs) {
    if (proof.percent && *proof.percent > max_off)
      budget.warnings.push_back(fmt::format("{} of {} by influence maps is {:.3g} % off a full cut",
                                            name_of(proof.response), proof.arm, *proof.percent));
    if (proof.one_sided > 0)
      budget.warnings.push_back(fmt::format("{} of {}: {} proofs are answered by one engine alone",
                                            name_of(proof.response), proof.arm, proof.one_sided));
  }
}

}  // namespace

Budget compute_budget(const Study& study, const Plan& plan, const std::vector<Row>& rows) {
  Budget budget;
  budget.study = study;
  budget.cases = rows.size();
  add_faults(rows, budget);
  const RowsByAnalysis finished(plan, rows);
  for (std::size_t arm = 0; arm < study.arms.size(); ++arm) {
    ConfigurationBudget one;
    one.arm = study.arms[arm];
    for (std::size_t r = 0; r < study.responses.size() && !study.inputs.empty(); ++r)
      one.responses.push_back(response_budget(study, plan, finished, response_column(study, arm, r),
                                              study.responses[r]));
    budget.arms.push_back(std::move(one));
  }
  budget.proofs = proofs(study, finished);
  budget.sweeps = sweepings(study, plan, finished);
  return budget;
}

Budget compute_budget(const PreparedStudy& ready, const std::vector<Row>& rows,
                      const Progress& progress) {
  const Study& study = ready.study;
  Budget budget = compute_budget(study, ready.plan, rows);
  for (std::size_t arm = 0; arm < ready.arms.size(); ++arm) {
    if (progress) progress("budget", double(arm) / double(ready.arms.size()));
    if (!ready.influences.empty())
      add_influence(ready, arm, budget.arms[arm]);
    else if (const auto status = centre_statuses(study, ready.arms[arm]))
      add_left_out(*status, ready.arms[arm].job.design_w.area, budget.arms[arm]);
    budget.arms[arm].unidentified = unidentified_effects(study, ready.arms[arm]);
    if (std::string text = unidentified_warning(study, budget.arms[arm]); !text.empty())
      budget.warnings.push_back(std::move(text));
  }
  for (const PreparedConfiguration& arm : ready.arms)
    for (const std::string& warning : arm.job.warnings)  // programs that all configurations share
                                                         // are reported once
      if (std::find(budget.warnings.begin(), budget.warnings.end(), warning) ==
          budget.warnings.end())
        budget.warnings.push_back(warning);
  add_warnings(budget);
  return budget;
}

}  // namespace abbe::sim::study
