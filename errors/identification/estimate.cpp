#include "errors/identification/estimate.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <variant>

#include <fmt/format.h>

#include "errors/element.h"
#include "errors/identification/design.h"
#include "errors/identification/model.h"
#include "errors/identification/regression.h"
#include "errors/metrology/reading_diagnostics.h"
#include "kinematics/units.h"

namespace abbe::errors::identification {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using metrology::Readings;

/// Groups of unknowns. If columns depend on each other, unknowns are left out in this order of
/// their groups.
enum Preference { ConstantOfMotion, SlopeOfStraightness, OtherCoefficient, Location, SetUpUnknown };

/// Returns true for the displacement of a linear axis across its direction of travel.
bool is_straightness(const ElementName& name, const kinematics::Chain& chain) {
  const kinematics::Joint& joint =
      chain.joints()[std::size_t(axis_joint(name.axis, chain, to_string(name)))];
  Index along = 0;
  joint.direction_b.cwiseAbs().maxCoeff(&along);
  return joint.motion == kinematics::Motion::Linear && !name.is_angle() &&
         name.component() != int(along);
}

/// Returns the group of a coefficient. The first coefficients of a series are its constant and its
/// slope.
Preference coefficient_preference(const Coefficient& coefficient, const GeometricErrors& model,
                                  const kinematics::Chain& chain) {
  const Element& element = model.elements[std::size_t(coefficient.element)];
  if (element.name.location) return Location;
  const Shape& shape = element.curves[std::size_t(coefficient.curve)].shape;
  const bool is_series =
      std::holds_alternative<Polynomial>(shape) || std::holds_alternative<Legendre>(shape);
  if (std::holds_alternative<Constant>(shape) || (is_series && coefficient.number == 0))
    return ConstantOfMotion;
  if (is_series && coefficient.number == 1 && is_straightness(element.name, chain))
    return SlopeOfStraightness;
  return OtherCoefficient;
}

std::vector<int> preferences(const GeometricErrors& model, const Design& design,
                             const kinematics::Chain& chain) {
  std::vector<int> result(std::size_t(design.unknowns.size()), SetUpUnknown);
  for (std::size_t j = 0; j < design.unknowns.coefficients.size(); ++j)
    result[j] = coefficient_preference(design.unknowns.coefficients[j], model, chain);
  return result;
}

void check(const EstimateOptions& options) {
  const auto expect = [](bool holds, const char* what) {
    if (!holds) throw std::invalid_argument(fmt::format("expected {}", what));
  };
  expect(options.rank_tolerance > 0.0 && options.rank_tolerance < 1.0,
         "a rank tolerance between 0 and 1");
  expect(options.outlier_limit >= 0.0, "an outlier limit of at least 0");
  expect(options.weak_limit >= 0.0, "a weak-coefficient limit of at least 0");
  expect(options.max_iterations >= 1, "at least one iteration");
  expect(options.tolerance > 0.0, "a tolerance above 0");
}

/// Inputs of the fits. They stay the same while readings are left out and values change.
struct Problem {
  const GeometricErrors& model;
  std::span<const Readings> reading_sets;
  const EstimateOptions& options;
  Design design;
  std::vector<int> preference;
  VectorXd observed;
  VectorXd start;        ///< also the mean of the prior
  VectorXd first_guess;  ///< start of the iteration
};

std::vector<Index> used_rows(const std::vector<char>& is_excluded) {
  std::vector<Index> rows;
  for (std::size_t i = 0; i < is_excluded.size(); ++i)
    if (!is_excluded[i]) rows.push_back(Index(i));
  return rows;
}

/// Returns the factor of the design matrix with the prior and without the excluded rows.
Factor reduced_factor(const Problem& problem, const std::vector<char>& is_excluded) {
  const std::vector<Index> rows = used_rows(is_excluded);
  const Design& design = problem.design;
  MatrixXd A(Index(rows.size()) + design.prior.rows(), design.unknowns.size());
  A << design.A(rows, Eigen::all), design.prior;
  return factor(A, design.is_sought, problem.preference, problem.options.rank_tolerance);
}

/// Returns reading minus model in standard deviations, for every measurement (m).
VectorXd misfit(const Problem& problem, const VectorXd& x) {
  const VectorXd model = predicted_readings(problem.model, problem.reading_sets, problem.design, x);
  return (problem.observed - model).cwiseQuotient(problem.design.sigma);
}

struct Fit {
  Factor factor;
  VectorXd x;       ///< (n) all unknowns
  VectorXd misfit;  ///< (m)
  int iterations = 0;
  bool converged = false;
};

/// Returns true if the iteration has converged. Rounding of long readings may keep steps above the
/// tolerance, so it also ends once they are far below the effect of noise on a coefficient (1e-3 of
/// its standard deviation) and no longer shrink.
bool iteration_ended(const VectorXd& step, const VectorXd& previous_step, const VectorXd& deviation,
                     double tolerance) {
  if (step.size() == 0 || step.cwiseAbs().maxCoeff() <= tolerance) return true;
  if (previous_step.size() == 0) return false;
  const double relative_step = step.cwiseQuotient(deviation).cwiseAbs().maxCoeff();
  const double previous_relative_step =
      previous_step.cwiseQuotient(deviation).cwiseAbs().maxCoeff();
  return relative_step <= 1e-3 && relative_step >= 0.5 * previous_relative_step;
}

constexpr double max_plausible_step = 1e3;  // mm or rad: a larger step is that of a diverging fit

/// Fits all readings but those left out, by chord iteration: the factor at zero deviations is used
/// throughout. Its relative error is the size of the deviations, about 1e-4, and every step reduces
/// the error by that factor.
Fit fit_readings(const Problem& problem, const std::vector<char>& is_excluded) {
  Fit fit{reduced_factor(problem, is_excluded), problem.first_guess, {}, 0, false};
  const std::vector<Index> rows = used_rows(is_excluded);
  const VectorXd deviation = covariance(fit.factor).diagonal().cwiseSqrt();
  fit.misfit = misfit(problem, fit.x);
  VectorXd previous_step;
  while (!fit.converged && fit.iterations < problem.options.max_iterations) {
    VectorXd b(Index(rows.size()) + problem.design.prior.rows());
    b << fit.misfit(rows), problem.design.prior * (problem.start - fit.x);
    const VectorXd step = solve(fit.factor, b);
    ++fit.iterations;
    if (!(step.size() == 0 || step.cwiseAbs().maxCoeff() < max_plausible_step)) break;
    fit.x(fit.factor.determined) += step;
    fit.misfit = misfit(problem, fit.x);
    fit.converged = iteration_ended(step, previous_step, deviation, problem.options.tolerance);
    previous_step = step;
  }
  return fit;
}

/// Coefficients of a first fit, without those that it determined too poorly.
struct Solution {
  std::vector<int> determined;  ///< columns
  VectorXd x;                   ///< (n) all unknowns
  bool converged = false;
  std::vector<ConfoundedCoefficient> confounded_list;
};

/// Returns the index, among those found, of the coefficient with the largest uncertainty relative
/// to its limit. Returns nothing if none exceeds its limit.
std::optional<Index> weakest_coefficient(const Problem& problem, const Solution& solution,
                                         const MatrixXd& covariance) {
  constexpr double min_significance = 4.0;  // standard deviations; noise rarely causes so much
  std::optional<Index> worst_index;
  double max_ratio = 1.0;
  for (std::size_t i = 0; i < solution.determined.size(); ++i) {
    const auto column = std::size_t(solution.determined[i]);
    if (column >= problem.design.unknowns.coefficients.size()) continue;  // unknown of a set-up
    const double deviation = std::sqrt(covariance(Index(i), Index(i)));
    const double change = solution.x[Index(column)] - problem.start[Index(column)];
    // The limit is relative to the element, not to the coefficient: a curve may need high orders,
    // however small they usually are.
    const double typical =
        typical_deviation(coefficient_element(problem.design.unknowns.names[column]));
    const double ratio = deviation / (problem.options.weak_limit * typical);
    if (ratio < max_ratio || std::abs(change) >= min_significance * deviation) continue;
    max_ratio = ratio;
    worst_index = Index(i);
  }
  return worst_index;
}

/// Wherever `entry.name` hides another coefficient by an amount a, each of its own hiding
/// coefficients takes over a times its amount.
void replace_hiding_coefficient(const ConfoundedCoefficient& entry,
                                std::vector<ConfoundedCoefficient>& confounded_list) {
  for (ConfoundedCoefficient& other : confounded_list) {
    const auto hidden_entry =
        std::ranges::find(other.with, entry.name, &std::pair<std::string, double>::first);
    if (hidden_entry == other.with.end()) continue;
    const double amount = hidden_entry->second;
    other.with.erase(hidden_entry);
    for (const auto& [hiding, unit_change] : entry.with) {
      const auto hiding_entry =
          std::ranges::find(other.with, hiding, &std::pair<std::string, double>::first);
      if (hiding_entry == other.with.end())
        other.with.emplace_back(hiding, amount * unit_change);
      else
        hiding_entry->second += amount * unit_change;
    }
  }
}

/// Sets a coefficient back to its start. Correlated coefficients are corrected accordingly.
/// Wherever this coefficient was listed as hiding one left out earlier, they replace it.
void leave_out(Index i, const Problem& problem, Solution& solution, MatrixXd& covariance) {
  const int column = solution.determined[std::size_t(i)];
  const double variance = covariance(i, i);
  // Change of all coefficients found, per unit of this one.
  const VectorXd unit_changes = -covariance.col(i) / variance;
  const std::string& name = problem.design.unknowns.names[std::size_t(column)];
  ConfoundedCoefficient entry{name, {}, std::sqrt(variance)};
  const auto name_at = [&](std::size_t k) {
    return problem.design.unknowns.names[std::size_t(solution.determined[k])];
  };
  const double displacement = problem.start[column] - solution.x[column];
  constexpr double min_named_amount = 0.01;  // relative to the other's standard deviation;
                                             // smaller amounts are not named
  for (std::size_t k = 0; k < solution.determined.size(); ++k) {
    const double unit_change = unit_changes[Index(k)];
    solution.x[solution.determined[k]] -= displacement * unit_change;
    const double deviation_ratio = std::sqrt(covariance(Index(k), Index(k)) / variance);
    if (Index(k) != i && std::abs(unit_change) > min_named_amount * deviation_ratio)
      entry.with.emplace_back(name_at(k), unit_change);
  }
  replace_hiding_coefficient(entry, solution.confounded_list);
  solution.confounded_list.push_back(std::move(entry));
  // Conditioning of a normal distribution on one of its components (Schur complement).
  covariance -= covariance.col(i) * covariance.row(i) / variance;
  std::vector<Index> remaining;
  for (Index k = 0; k < Index(solution.determined.size()); ++k)
    if (k != i) remaining.push_back(k);
  covariance = MatrixXd(covariance(remaining, remaining));
  solution.determined.erase(solution.determined.begin() + i);
}

/// Returns the first fit without the coefficients that are less certain than they vary between
/// machines. They are removed one by one, since a coefficient may be well determined once the one
/// that hides it is held.
Solution leave_out_weak(const Problem& problem, const Fit& first_fit,
                        std::vector<ConfoundedCoefficient> confounded_list) {
  Solution solution{first_fit.factor.determined, first_fit.x, first_fit.converged,
                    std::move(confounded_list)};
  if (problem.options.weak_limit == 0.0) return solution;
  MatrixXd covariance_matrix = covariance(first_fit.factor);
  while (const auto i = weakest_coefficient(problem, solution, covariance_matrix))
    leave_out(*i, problem, solution, covariance_matrix);
  return solution;
}

/// Prepares a second fit of the coefficients that the first one determined: it starts from their
/// values and, with a prior, linearises the equations there. The rank is determined at zero
/// deviations: elsewhere confounded columns differ by products of deviations, which carry no
/// information.
void restart_from(Problem& problem, const Solution& first_solution) {
  std::vector<char>& is_sought = problem.design.is_sought;
  std::fill(is_sought.begin(), is_sought.end(), char(0));
  for (const int column : first_solution.determined) is_sought[std::size_t(column)] = 1;
  problem.first_guess = first_solution.x;
  const bool has_prior = problem.design.prior.rows() > 0;
  if (has_prior && first_solution.converged)
    problem.design =
        design_at(problem.design, problem.model, problem.reading_sets, first_solution.x);
}

struct Quality {
  int degrees_of_freedom = 0;
  double chi_square = 0.0;
  double reduced_chi_square = 0.0;
};

Quality quality(const Problem& problem, const Fit& fit, const std::vector<char>& is_excluded) {
  const std::vector<Index> rows = used_rows(is_excluded);
  const double chi_square = fit.misfit(rows).squaredNorm() +
                            (problem.design.prior * (problem.start - fit.x)).squaredNorm();
  const int freedom = fit.factor.rows - int(fit.factor.determined.size());
  return {freedom, chi_square, freedom > 0 ? chi_square / freedom : 0.0};
}

/// Returns the quality of the fit for every set of readings.
std::vector<FitQuality> reading_qualities(const Problem& problem, const Fit& fit,
                                          const std::vector<char>& is_excluded) {
  const std::vector<Index> rows = used_rows(is_excluded);
  const VectorXd leverages = leverage(fit.factor, problem.design.A(rows, Eigen::all));
  std::vector<FitQuality> result(problem.reading_sets.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    FitQuality& quality = result[std::size_t(problem.design.rows[std::size_t(rows[i])].readings)];
    quality.chi_square += fit.misfit[rows[i]] * fit.misfit[rows[i]];
    quality.degrees_of_freedom += 1.0 - leverages[Index(i)];
  }
  return result;
}

/// Returns the rows of every channel whose readings are constant on the nominal machine.
std::vector<std::vector<Index>> constant_channels(const Problem& problem, int set_index,
                                                  const VectorXd& nominal) {
  constexpr double tolerance = 1e-9;  // mm or rad
  const Readings& reading_set = problem.reading_sets[std::size_t(set_index)];
  std::vector<Index> row_at(reading_set.plan.measurements.size(), -1);
  for (std::size_t i = 0; i < problem.design.rows.size(); ++i)
    if (problem.design.rows[i].readings == set_index)
      row_at[std::size_t(problem.design.rows[i].measurement)] = Index(i);
  std::vector<std::vector<Index>> channels;
  for (const metrology::ChannelMeasurements& channel :
       metrology::channel_measurements(reading_set.plan)) {
    std::vector<Index> rows;
    for (const int measurement : channel.measurements)
      rows.push_back(row_at[std::size_t(measurement)]);
    const VectorXd v = nominal(rows);
    if (v.maxCoeff() - v.minCoeff() <= tolerance) channels.push_back(std::move(rows));
  }
  return channels;
}

/// Returns the change of a channel's readings that a recording mistake causes.
/// @param departure  readings minus those of the nominal machine
VectorXd mistake_effect(Mistake mistake, const VectorXd& departure) {
  switch (mistake) {
    case Mistake::Negated:
      return -2.0 * departure;
    case Mistake::Reversed:
      return departure.reverse() - departure;
    case Mistake::MultipliedByThousand:
      return 999.0 * departure;
    case Mistake::DividedByThousand:
      return -0.999 * departure;
  }
  return {};
}

/// Fits the readings once for every set and mistake. The factor of the fit is reused, so that each
/// alternative costs one linear solution.
std::vector<Alternative> mistake_alternatives(const Problem& problem, const Fit& fit,
                                              const std::vector<char>& is_excluded) {
  const std::vector<Index> rows = used_rows(is_excluded);
  const Design& design = problem.design;
  const VectorXd nominal = predicted_readings(problem.model, problem.reading_sets, design,
                                              VectorXd::Zero(design.unknowns.size()));
  const VectorXd prior = design.prior * (problem.start - fit.x);
  std::vector<Alternative> result;
  for (int set_index = 0; set_index < int(problem.reading_sets.size()); ++set_index) {
    const auto channels = constant_channels(problem, set_index, nominal);
    if (channels.empty()) continue;
    for (const Mistake mistake : {Mistake::Negated, Mistake::Reversed,
                                  Mistake::MultipliedByThousand, Mistake::DividedByThousand}) {
      VectorXd misfit = fit.misfit;
      for (const std::vector<Index>& channel : channels)
        misfit(channel) += mistake_effect(mistake, problem.observed(channel) - nominal(channel))
                               .cwiseQuotient(design.sigma(channel));
      VectorXd b(Index(rows.size()) + prior.size());
      b << misfit(rows), prior;
      const VectorXd step = solve(fit.factor, b);
      b.head(Index(rows.size())) -= design.A(rows, fit.factor.determined) * step;
      b.tail(prior.size()) -= design.prior(Eigen::all, fit.factor.determined) * step;
      double own_chi_square = 0.0;
      for (std::size_t i = 0; i < rows.size(); ++i)
        if (design.rows[std::size_t(rows[i])].readings == set_index)
          own_chi_square += b[Index(i)] * b[Index(i)];
      result.push_back({set_index, mistake, b.squaredNorm(), own_chi_square});
    }
  }
  return result;
}

/// Returns the studentised residuals of the readings used (m); 0 for excluded readings and for
/// those that the fit reproduces whatever their value.
VectorXd studentised_residuals(const Problem& problem, const Fit& fit,
                               const std::vector<char>& is_excluded) {
  const std::vector<Index> rows = used_rows(is_excluded);
  const VectorXd leverages = leverage(fit.factor, problem.design.A(rows, Eigen::all));
  const Quality q = quality(problem, fit, is_excluded);
  const bool scales_noise = problem.options.noise_from_residuals && q.reduced_chi_square > 0.0;
  const double noise = scales_noise ? std::sqrt(q.reduced_chi_square) : 1.0;
  VectorXd result = VectorXd::Zero(fit.misfit.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const double redundancy = 1.0 - leverages[Index(i)];
    // 1e-9: below it the residual is only rounding, since the fit reproduces the reading.
    if (redundancy > 1e-9) result[rows[i]] = fit.misfit[rows[i]] / (noise * std::sqrt(redundancy));
  }
  return result;
}

/// Fits the readings without those beyond the outlier limit. Every round removes the worst one
/// together with those at least half as bad, but never so many that fewer unknowns can be found.
Fit fit_without_outliers(const Problem& problem, std::vector<char>& is_excluded) {
  Fit fit = fit_readings(problem, is_excluded);
  if (problem.options.outlier_limit == 0.0) return fit;
  std::vector<char> is_needed(is_excluded.size(), 0);
  for (std::size_t round = 0; round < is_excluded.size(); ++round) {
    VectorXd t = studentised_residuals(problem, fit, is_excluded).cwiseAbs();
    for (std::size_t i = 0; i < is_needed.size(); ++i)
      if (is_needed[i]) t[Index(i)] = 0.0;
    Index worst_index = 0;
    if (t.size() == 0 || t.maxCoeff(&worst_index) <= problem.options.outlier_limit) break;
    const auto excluding = [&](double limit) {
      std::vector<char> enlarged = is_excluded;
      for (Index i = 0; i < t.size(); ++i)
        if (t[i] >= limit) enlarged[std::size_t(i)] = 1;
      return enlarged;
    };
    // Half of the worst only: a large outlier inflates the residuals of its neighbours, which must
    // not be removed with it.
    std::vector<char> enlarged =
        excluding(std::max(problem.options.outlier_limit, 0.5 * t[worst_index]));
    Fit refit = fit_readings(problem, enlarged);
    if (refit.factor.determined.size() < fit.factor.determined.size()) {
      enlarged = excluding(t[worst_index]);
      refit = fit_readings(problem, enlarged);
    }
    if (refit.factor.determined.size() < fit.factor.determined.size()) {
      is_needed[std::size_t(worst_index)] = 1;
      continue;
    }
    is_excluded = enlarged;
    fit = std::move(refit);
  }
  return fit;
}

/// Returns the unknowns that the readings cannot separate, with those that hide them.
std::vector<ConfoundedCoefficient> confounded(const Problem& problem, const Factor& factor) {
  const Design& design = problem.design;
  std::vector<ConfoundedCoefficient> result;
  for (int j = 0; j < design.unknowns.size(); ++j) {
    const std::string& name = design.unknowns.names[std::size_t(j)];
    if (design.is_unobservable[std::size_t(j)]) result.push_back({name, {}, {}});
    const auto left_column = std::find(factor.left_out.begin(), factor.left_out.end(), j);
    if (left_column == factor.left_out.end()) continue;
    ConfoundedCoefficient entry{name, {}, {}};
    const auto column = factor.hidden.col(left_column - factor.left_out.begin());
    for (Index i = 0; i < column.size(); ++i)
      if (column[i] != 0.0)
        entry.with.emplace_back(design.unknowns.names[std::size_t(i)], column[i]);
    result.push_back(std::move(entry));
  }
  return result;
}

/// Returns the covariance of the coefficients found; coefficients held by a prior variance of zero
/// are listed with zeros.
Covariance belief_covariance(const Problem& problem, const Factor& factor, double variance) {
  const auto& model_coefficients = problem.design.unknowns.coefficients;
  Covariance result;
  std::vector<Index> indices;  // among the unknowns found
  for (std::size_t i = 0; i < factor.determined.size(); ++i) {
    const auto column = std::size_t(factor.determined[i]);
    if (column >= model_coefficients.size()) continue;
    result.of.push_back(model_coefficients[column]);
    indices.push_back(Index(i));
  }
  const auto n = Index(indices.size());
  const Covariance& prior_covariance = problem.model.covariance;
  for (std::size_t i = 0; i < prior_covariance.of.size(); ++i)
    if (prior_covariance.matrix(Index(i), Index(i)) == 0.0)
      result.of.push_back(prior_covariance.of[i]);
  result.matrix = MatrixXd::Zero(Index(result.of.size()), Index(result.of.size()));
  result.matrix.topLeftCorner(n, n) = variance * covariance(factor)(indices, indices);
  return result;
}

void check(const Problem& problem) {
  const Design& design = problem.design;
  const auto p = design.unknowns.coefficients.size();
  if (p == 0) throw std::invalid_argument("nothing to identify: the model has no coefficients");
  if (design.rows.empty())
    throw std::invalid_argument("nothing to identify from: the readings hold no values");
}

}  // namespace

std::pair<double, double> chi_square_band(double degrees_of_freedom) {
  if (!(degrees_of_freedom > 0.0)) return {0.0, HUGE_VAL};
  constexpr double thousandth_quantile = 3.09;  // standard deviations
  // Wilson and Hilferty: the cube root of chi-square over its freedom is nearly normal.
  const double variance = 2.0 / (9.0 * degrees_of_freedom);
  const auto ratio_at = [&](double z) {
    return std::pow(std::max(0.0, 1.0 - variance + z * std::sqrt(variance)), 3);
  };
  return {ratio_at(-thousandth_quantile), ratio_at(thousandth_quantile)};
}

Estimate estimate(const GeometricErrors& model, std::span<const Readings> reading_sets,
                  const EstimateOptions& options) {
  check(options);
  Problem problem{model, reading_sets, options, design(model, reading_sets), {}, {}, {}, {}};
  check(problem);
  problem.preference = preferences(model, problem.design, reading_sets.front().nominal);
  problem.observed = observed_readings(reading_sets, problem.design);
  problem.start = problem.first_guess = start(model, problem.design.unknowns);

  std::vector<char> is_excluded(problem.design.rows.size(), 0);
  const Fit first = fit_readings(problem, is_excluded);
  Solution solution = leave_out_weak(problem, first, confounded(problem, first.factor));
  restart_from(problem, solution);
  const Fit fit = fit_without_outliers(problem, is_excluded);
  const Quality q = quality(problem, fit, is_excluded);
  const bool scales_noise = options.noise_from_residuals && q.degrees_of_freedom > 0;

  const Unknowns& unknowns = problem.design.unknowns;
  const auto p = Index(unknowns.coefficients.size());
  Estimate result;
  result.value = fit.x.head(p);
  result.names.assign(unknowns.names.begin(), unknowns.names.begin() + p);
  result.belief = {
      with_values(model.elements, result.value), model.measuring_lines,
      belief_covariance(problem, fit.factor, scales_noise ? q.reduced_chi_square : 1.0)};
  result.confounded = std::move(solution.confounded_list);
  result.set_ups = set_ups(reading_sets, unknowns, fit.x);
  result.fit_residual = fit.misfit;
  for (std::size_t i = 0; i < is_excluded.size(); ++i)
    if (is_excluded[i]) result.outliers.push_back(int(i));
  result.degrees_of_freedom = q.degrees_of_freedom;
  result.chi_square = q.chi_square;
  result.reduced_chi_square = q.reduced_chi_square;
  if (options.compare_mistakes) {
    result.quality = reading_qualities(problem, fit, is_excluded);
    result.alternatives = mistake_alternatives(problem, fit, is_excluded);
  }
  result.condition = fit.factor.condition;
  result.iterations = first.iterations + fit.iterations;
  result.converged = fit.converged;
  return result;
}

namespace {

// Points of a plotted curve; enough for a smooth line in a picture.
constexpr Index curve_point_count = 121;

/// Range of the coefficients of one element among those of all elements.
struct CoefficientRange {
  int first = 0;
  int count = 0;
};

std::vector<CoefficientRange> element_ranges(const GeometricErrors& belief) {
  std::vector<CoefficientRange> result(belief.elements.size());
  const std::vector<Coefficient> all_coefficients = coefficients(belief.elements);
  for (std::size_t i = 0; i < all_coefficients.size(); ++i) {
    CoefficientRange& range = result[std::size_t(all_coefficients[i].element)];
    if (range.count++ == 0) range.first = int(i);
  }
  return result;
}

VectorXd element_basis(const Element& element, int count, const CurveState& state) {
  VectorXd result(count);
  Index first = 0;
  for (const Curve& curve : element.curves) {
    const VectorXd values = basis(curve, state);
    result.segment(first, values.size()) = values;
    first += values.size();
  }
  return result;
}

/// Returns the covariance of the coefficients of one element; coefficients without covariance count
/// as exact.
Eigen::MatrixXd element_covariance(const GeometricErrors& belief, int element,
                                   const CoefficientRange& range) {
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(range.count, range.count);
  const std::vector<Coefficient> all_coefficients = coefficients(belief.elements);
  const auto& covariance_coefficients = belief.covariance.of;
  const auto index_in_element = [&](const Coefficient& coefficient) {
    return int(std::find(all_coefficients.begin(), all_coefficients.end(), coefficient) -
               all_coefficients.begin()) -
           range.first;
  };
  for (std::size_t i = 0; i < covariance_coefficients.size(); ++i)
    for (std::size_t k = 0; k < covariance_coefficients.size(); ++k)
      if (covariance_coefficients[i].element == element &&
          covariance_coefficients[k].element == element)
        result(index_in_element(covariance_coefficients[i]),
               index_in_element(covariance_coefficients[k])) =
            belief.covariance.matrix(Index(i), Index(k));
  return result;
}

/// Returns true for each row and element (rows x elements) if the row is informative about the
/// element: its coefficients, each of 1 um or 10 urad, would change the reading at least a quarter
/// as much as those of the element that changes it most.
std::vector<std::vector<bool>> is_informative(const Design& design, const GeometricErrors& belief,
                                              const std::vector<CoefficientRange>& ranges) {
  std::vector<std::vector<bool>> result(design.rows.size());
  for (std::size_t i = 0; i < result.size(); ++i) {
    std::vector<double> change(ranges.size(), 0.0);
    for (std::size_t e = 0; e < ranges.size(); ++e) {
      if (belief.elements[e].name.location || ranges[e].count == 0) continue;
      const double unit_size = belief.elements[e].name.is_angle() ? 10 * units::urad : units::um;
      change[e] =
          unit_size * design.A.row(Index(i)).segment(ranges[e].first, ranges[e].count).norm();
    }
    const double max_change = *std::max_element(change.begin(), change.end());
    for (const double value : change)
      result[i].push_back(max_change > 0.0 && value >= 0.25 * max_change);
  }
  return result;
}

/// Returns true if the element has the same value at every position; such an element is not
/// plotted.
bool is_constant(const Element& element) {
  return std::all_of(element.curves.begin(), element.curves.end(), [](const Curve& curve) {
    return std::holds_alternative<Constant>(curve.shape);
  });
}

/// Inputs for the curves of an estimate.
struct CurveInputs {
  const Estimate& estimate;
  std::span<const Readings> reading_sets;
  Design design;
  GeometricModel bound;
  std::vector<CoefficientRange> ranges;  ///< (elements)
  std::vector<std::vector<bool>> is_informative;
  std::vector<bool> is_outlier;  ///< (rows)

  int joint(std::size_t e) const {
    return axis_joint(estimate.belief.elements[e].name.axis, reading_sets.front().nominal,
                      "a belief");
  }
  VectorXd basis(std::size_t e, const kinematics::AxisState& state) const {
    return element_basis(estimate.belief.elements[e], ranges[e].count,
                         curve_state(bound, state, joint(e)));
  }
  VectorXd coefficient_values(std::size_t e) const {
    return estimate.value.segment(ranges[e].first, ranges[e].count);
  }
  const kinematics::AxisState& state(std::size_t row) const {
    const Row& position = design.rows[row];
    return reading_sets[std::size_t(position.readings)]
        .plan.measurements[std::size_t(position.measurement)]
        .state;
  }
};

/// Adds the informative readings of one element, each converted to a value of the element.
void add_readings(const CurveInputs& inputs, std::size_t e, CurveReadings& curve) {
  std::vector<double> positions, element_values;
  for (std::size_t i = 0; i < inputs.is_informative.size(); ++i) {
    if (!inputs.is_informative[i][e] || inputs.is_outlier[i]) continue;
    const VectorXd b = inputs.basis(e, inputs.state(i));
    Index k = 0;
    if (b.cwiseAbs().maxCoeff(&k) == 0.0) continue;
    // Any coefficient of the element converts the residual into its value; the largest basis value
    // does so with the least rounding.
    const double per_value = inputs.design.A(Index(i), inputs.ranges[e].first + k) / b[k];
    if (per_value == 0.0) continue;
    positions.push_back(inputs.state(i).q[inputs.joint(e)]);
    element_values.push_back(b.dot(inputs.coefficient_values(e)) +
                             inputs.estimate.fit_residual[Index(i)] / per_value);
  }
  curve.reading_q = VectorXd::Map(positions.data(), Index(positions.size()));
  curve.reading = VectorXd::Map(element_values.data(), Index(element_values.size()));
}

/// Adds the curve over the range of its readings, or over the travel.
void add_curve(const CurveInputs& inputs, std::size_t e, CurveReadings& curve) {
  const kinematics::Chain& nominal = inputs.reading_sets.front().nominal;
  const kinematics::Joint& joint = nominal.joints()[std::size_t(inputs.joint(e))];
  double min_q = joint.min, max_q = joint.max;
  if (curve.reading_q.size() > 0 && curve.reading_q.maxCoeff() > curve.reading_q.minCoeff()) {
    min_q = curve.reading_q.minCoeff();
    max_q = curve.reading_q.maxCoeff();
  } else if (joint.motion != kinematics::Motion::Linear) {
    min_q = std::max(min_q, -pi);
    max_q = std::min(max_q, pi);
  }
  curve.q = VectorXd::LinSpaced(curve_point_count, min_q, max_q);
  curve.value.resize(curve_point_count);
  curve.sigma.resize(curve_point_count);
  const Eigen::MatrixXd covariance =
      element_covariance(inputs.estimate.belief, int(e), inputs.ranges[e]);
  kinematics::AxisState state;
  state.q = kinematics::AxisVector::Zero(nominal.size());
  for (Index i = 0; i < curve_point_count; ++i) {
    state.q[inputs.joint(e)] = curve.q[i];
    const VectorXd b = inputs.basis(e, state);
    curve.value[i] = b.dot(inputs.coefficient_values(e));
    curve.sigma[i] = std::sqrt(std::max(0.0, b.dot(covariance * b)));
  }
}

}  // namespace

std::vector<CurveReadings> curve_readings(const Estimate& estimate,
                                          std::span<const Readings> reading_sets) {
  const GeometricErrors& belief = estimate.belief;
  CurveInputs inputs{estimate,
                     reading_sets,
                     design(belief, reading_sets),
                     bind(belief, reading_sets.front().nominal),
                     element_ranges(belief),
                     {},
                     {}};
  inputs.is_informative = is_informative(inputs.design, belief, inputs.ranges);
  inputs.is_outlier.resize(inputs.is_informative.size(), false);
  for (const int i : estimate.outliers) inputs.is_outlier[std::size_t(i)] = true;
  std::vector<CurveReadings> result;
  for (std::size_t e = 0; e < inputs.ranges.size(); ++e) {
    const Element& element = belief.elements[e];
    if (element.name.location || inputs.ranges[e].count == 0 || is_constant(element)) continue;
    CurveReadings curve;
    curve.element = element.name;
    add_readings(inputs, e, curve);
    add_curve(inputs, e, curve);
    result.push_back(std::move(curve));
  }
  return result;
}

}  // namespace abbe::errors::identification
