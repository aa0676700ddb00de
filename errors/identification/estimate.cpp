#include "errors/identification/estimate.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <variant>

#include <fmt/format.h>

#include "errors/element.h"
#include "errors/identification/design.h"
#include "errors/identification/factor.h"
#include "errors/identification/model.h"
#include "errors/metrology/reading_diagnostics.h"
#include "kinematics/units.h"

namespace abbe::errors::identification {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using metrology::Readings;

// Order in which numbers are left out

enum Preference { ConstantOfMotion, SlopeOfStraightness, OtherNumber, Location, SetUpUnknown };

bool is_straightness(const ElementName& name, const kinematics::Chain& chain) {
  const kinematics::Joint& joint =
      chain.joints()[std::size_t(joint_of(name.axis, chain, to_string(name)))];
  Index along = 0;
  joint.direction_b.cwiseAbs().maxCoeff(&along);
  return joint.motion == kinematics::Motion::Linear && !name.is_angle() &&
         name.component() != int(along);
}

Preference number_preference(const Coefficient& coefficient, const GeometricErrors& model,
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
  return OtherNumber;
}

std::vector<int> preferences(const GeometricErrors& model, const Design& design,
                             const kinematics::Chain& chain) {
  std::vector<int> result(std::size_t(design.unknowns.size()), SetUpUnknown);
  for (std::size_t j = 0; j < design.unknowns.coefficients.size(); ++j)
    result[j] = number_preference(design.unknowns.coefficients[j], model, chain);
  return result;
}

// System of equations

void check(const EstimateOptions& options) {
  const auto expect = [](bool holds, const char* what) {
    if (!holds) throw std::invalid_argument(fmt::format("expected {}", what));
  };
  expect(options.rank_tolerance > 0.0 && options.rank_tolerance < 1.0,
         "a rank tolerance between 0 and 1");
  expect(options.outlier_limit >= 0.0, "an outlier limit of 0 or more");
  expect(options.weak_limit >= 0.0, "a limit of weak numbers of 0 or more");
  expect(options.max_iterations >= 1, "at least one iteration");
  expect(options.tolerance > 0.0, "a tolerance above 0");
}

/// Constant inputs of the fits, while readings are left out and values change.
struct Problem {
  const GeometricErrors& model;
  std::span<const Readings> readings;
  const EstimateOptions& options;
  Design design;
  std::vector<int> preference;
  VectorXd observed;
  VectorXd start;        ///< also the mean of the prior
  VectorXd first_guess;  ///< start of the iteration
};

std::vector<Index> used_rows(const std::vector<char>& is_out) {
  std::vector<Index> rows;
  for (std::size_t i = 0; i < is_out.size(); ++i)
    if (!is_out[i]) rows.push_back(Index(i));
  return rows;
}

Factor factor_of(const Problem& problem, const std::vector<char>& is_out) {
  const std::vector<Index> rows = used_rows(is_out);
  const Design& design = problem.design;
  MatrixXd A(Index(rows.size()) + design.prior.rows(), design.unknowns.size());
  A << design.A(rows, Eigen::all), design.prior;
  return factor(A, design.is_sought, problem.preference, problem.options.rank_tolerance);
}

/// Returns reading minus model in standard deviations, for every measurement (m).
VectorXd misfit(const Problem& problem, const VectorXd& x) {
  const VectorXd model = predicted(problem.model, problem.readings, problem.design, x);
  return (problem.observed - model).cwiseQuotient(problem.design.sigma);
}

struct Fit {
  Factor factor;
  VectorXd x;       ///< (n) all unknowns
  VectorXd misfit;  ///< (m)
  int iterations = 0;
  bool converged = false;
};

/// Returns true if the iteration has ended. Rounding of long readings may keep steps above the
/// tolerance; it also ends once they are far below the effect of noise on a number (1e-3 of its
/// standard deviation) and no longer shrink.
bool is_over(const VectorXd& step, const VectorXd& former, const VectorXd& deviation,
             double tolerance) {
  if (step.size() == 0 || step.cwiseAbs().maxCoeff() <= tolerance) return true;
  if (former.size() == 0) return false;
  const double now = step.cwiseQuotient(deviation).cwiseAbs().maxCoeff();
  const double before = former.cwiseQuotient(deviation).cwiseAbs().maxCoeff();
  return now <= 1e-3 && now >= 0.5 * before;
}

constexpr double max_plausible_step = 1e3;  // mm or rad: a larger step is that of a diverging fit

/// Chord iteration: the factor at zero deviations is used throughout. Its relative error is the
/// size of the deviations, about 1e-4, and every step reduces the error by that factor.
Fit fitted(const Problem& problem, const std::vector<char>& is_out) {
  Fit fit{factor_of(problem, is_out), problem.first_guess, {}, 0, false};
  const std::vector<Index> rows = used_rows(is_out);
  const VectorXd deviation = covariance(fit.factor).diagonal().cwiseSqrt();
  fit.misfit = misfit(problem, fit.x);
  VectorXd former;
  while (!fit.converged && fit.iterations < problem.options.max_iterations) {
    VectorXd b(Index(rows.size()) + problem.design.prior.rows());
    b << fit.misfit(rows), problem.design.prior * (problem.start - fit.x);
    const VectorXd step = solve(fit.factor, b);
    ++fit.iterations;
    if (!(step.size() == 0 || step.cwiseAbs().maxCoeff() < max_plausible_step)) break;
    fit.x(fit.factor.found) += step;
    fit.misfit = misfit(problem, fit.x);
    fit.converged = is_over(step, former, deviation, problem.options.tolerance);
    former = step;
  }
  return fit;
}

/// The numbers found by a first fit, without those that it determined too poorly.
struct Solution {
  std::vector<int> found;  ///< columns
  VectorXd x;              ///< (n) all unknowns
  bool converged = false;
  std::vector<Confounded> not_found;
};

/// Returns the index, among those found, of the number with the largest uncertainty relative to its
/// limit; empty if none exceeds it.
std::optional<Index> weakest(const Problem& problem, const Solution& solution,
                             const MatrixXd& covariance) {
  constexpr double significant = 4.0;  // standard deviations, rarely reached by chance
  std::optional<Index> worst;
  double most = 1.0;
  for (std::size_t i = 0; i < solution.found.size(); ++i) {
    const auto column = std::size_t(solution.found[i]);
    if (column >= problem.design.unknowns.coefficients.size()) continue;  // of a set-up
    const double deviation = std::sqrt(covariance(Index(i), Index(i)));
    const double change = solution.x[Index(column)] - problem.start[Index(column)];
    // Relative to the element, not to the number: high orders are needed where a curve requires
    // them, however small they usually are.
    const double typical =
        typical_deviation(element_of_number(problem.design.unknowns.names[column]));
    const double ratio = deviation / (problem.options.weak_limit * typical);
    if (ratio < most || std::abs(change) >= significant * deviation) continue;
    most = ratio;
    worst = Index(i);
  }
  return worst;
}

/// Returns a number to its start. The others move as they depend on it, and what it hid of those
/// left out before is now hidden by the others.
void leave(Index i, const Problem& problem, Solution& solution, MatrixXd& covariance) {
  const int column = solution.found[std::size_t(i)];
  const double variance = covariance(i, i);
  const VectorXd along = -covariance.col(i) / variance;  // change of all found, per unit of it
  const std::string& name = problem.design.unknowns.names[std::size_t(column)];
  Confounded one{name, {}, std::sqrt(variance)};
  const auto name_at = [&](std::size_t k) {
    return problem.design.unknowns.names[std::size_t(solution.found[k])];
  };
  const double back = problem.start[column] - solution.x[column];
  constexpr double heard = 0.01;  // relative to the standard deviation of the other; smaller
                                  // amounts are not named
  for (std::size_t k = 0; k < solution.found.size(); ++k) {
    const double share = along[Index(k)];
    solution.x[solution.found[k]] -= back * share;
    const double own = std::sqrt(covariance(Index(k), Index(k)) / variance);
    if (Index(k) != i && std::abs(share) > heard * own) one.with.emplace_back(name_at(k), share);
  }
  for (Confounded& other : solution.not_found) {
    const auto by_it = std::ranges::find(other.with, name, &std::pair<std::string, double>::first);
    if (by_it == other.with.end()) continue;
    const double amount = by_it->second;
    other.with.erase(by_it);
    for (const auto& [hiding, share] : one.with) {
      const auto at = std::ranges::find(other.with, hiding, &std::pair<std::string, double>::first);
      if (at == other.with.end())
        other.with.emplace_back(hiding, amount * share);
      else
        at->second += amount * share;
    }
  }
  solution.not_found.push_back(std::move(one));
  // Conditioning of a normal distribution on one of its numbers (Schur complement).
  covariance -= covariance.col(i) * covariance.row(i) / variance;
  std::vector<Index> rest;
  for (Index k = 0; k < Index(solution.found.size()); ++k)
    if (k != i) rest.push_back(k);
  covariance = MatrixXd(covariance(rest, rest));
  solution.found.erase(solution.found.begin() + i);
}

/// Returns the first fit without the numbers that are less certain than machines differ. They are
/// removed one after the other, since a number may be well determined once the one that hides it is
/// held.
Solution leave_out_weak(const Problem& problem, const Fit& first,
                        std::vector<Confounded> not_found) {
  Solution solution{first.factor.found, first.x, first.converged, std::move(not_found)};
  if (problem.options.weak_limit == 0.0) return solution;
  MatrixXd known = covariance(first.factor);
  while (const auto i = weakest(problem, solution, known)) leave(*i, problem, solution, known);
  return solution;
}

/// Restarts from a first solution with the numbers found there, and the equations linearised there.
/// The rank is determined at zero deviations: elsewhere confounded columns differ by products of
/// deviations, which is not information.
void restart_from(Problem& problem, const Solution& first) {
  std::vector<char>& is_sought = problem.design.is_sought;
  std::fill(is_sought.begin(), is_sought.end(), char(0));
  for (const int column : first.found) is_sought[std::size_t(column)] = 1;
  problem.first_guess = first.x;
  const bool may_multiply = problem.design.prior.rows() > 0;
  if (may_multiply && first.converged)
    problem.design = design_at(problem.design, problem.model, problem.readings, first.x);
}

// Quality of the fit

struct Quality {
  int degrees_of_freedom = 0;
  double chi_square = 0.0;
  double reduced_chi_square = 0.0;
};

Quality quality(const Problem& problem, const Fit& fit, const std::vector<char>& is_out) {
  const std::vector<Index> rows = used_rows(is_out);
  const double chi_square = fit.misfit(rows).squaredNorm() +
                            (problem.design.prior * (problem.start - fit.x)).squaredNorm();
  const int freedom = fit.factor.rows - int(fit.factor.found.size());
  return {freedom, chi_square, freedom > 0 ? chi_square / freedom : 0.0};
}

std::vector<FitQuality> reading_qualities(const Problem& problem, const Fit& fit,
                                          const std::vector<char>& is_out) {
  const std::vector<Index> rows = used_rows(is_out);
  const VectorXd share = leverage(fit.factor, problem.design.A(rows, Eigen::all));
  std::vector<FitQuality> result(problem.readings.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    FitQuality& one = result[std::size_t(problem.design.rows[std::size_t(rows[i])].readings)];
    one.chi_square += fit.misfit[rows[i]] * fit.misfit[rows[i]];
    one.degrees_of_freedom += 1.0 - share[Index(i)];
  }
  return result;
}

// Mistakes in the notation of readings

/// Returns the rows of channels whose readings are constant on the nominal machine, by channel.
std::vector<std::vector<Index>> steady_channels(const Problem& problem, int readings,
                                                const VectorXd& nominal) {
  constexpr double same = 1e-9;  // mm or rad
  const Readings& of = problem.readings[std::size_t(readings)];
  std::vector<Index> row_at(of.plan.measurements.size(), -1);
  for (std::size_t i = 0; i < problem.design.rows.size(); ++i)
    if (problem.design.rows[i].readings == readings)
      row_at[std::size_t(problem.design.rows[i].measurement)] = Index(i);
  std::vector<std::vector<Index>> channels;
  for (const metrology::ChannelMeasurements& channel : metrology::channel_measurements(of.plan)) {
    std::vector<Index> rows;
    for (const int measurement : channel.measurements)
      rows.push_back(row_at[std::size_t(measurement)]);
    const VectorXd v = nominal(rows);
    if (v.maxCoeff() - v.minCoeff() <= same) channels.push_back(std::move(rows));
  }
  return channels;
}

/// Returns the change of a channel's readings by a mistake, given their departure from nominal.
VectorXd change_by(Mistake mistake, const VectorXd& departure) {
  switch (mistake) {
    case Mistake::Negated:
      return -2.0 * departure;
    case Mistake::Reversed:
      return departure.reverse() - departure;
    case Mistake::TimesThousand:
      return 999.0 * departure;
    case Mistake::OverThousand:
      return -0.999 * departure;
  }
  return {};
}

/// Uses the factor of the fit, so that each alternative costs one linear solution.
std::vector<Alternative> alternatives(const Problem& problem, const Fit& fit,
                                      const std::vector<char>& is_out) {
  const std::vector<Index> rows = used_rows(is_out);
  const Design& design = problem.design;
  const VectorXd nominal =
      predicted(problem.model, problem.readings, design, VectorXd::Zero(design.unknowns.size()));
  const VectorXd prior = design.prior * (problem.start - fit.x);
  std::vector<Alternative> result;
  for (int readings = 0; readings < int(problem.readings.size()); ++readings) {
    const auto channels = steady_channels(problem, readings, nominal);
    if (channels.empty()) continue;
    for (const Mistake mistake :
         {Mistake::Negated, Mistake::Reversed, Mistake::TimesThousand, Mistake::OverThousand}) {
      VectorXd misfit = fit.misfit;
      for (const std::vector<Index>& of : channels)
        misfit(of) +=
            change_by(mistake, problem.observed(of) - nominal(of)).cwiseQuotient(design.sigma(of));
      VectorXd b(Index(rows.size()) + prior.size());
      b << misfit(rows), prior;
      const VectorXd step = solve(fit.factor, b);
      b.head(Index(rows.size())) -= design.A(rows, fit.factor.found) * step;
      b.tail(prior.size()) -= design.prior(Eigen::all, fit.factor.found) * step;
      double own = 0.0;
      for (std::size_t i = 0; i < rows.size(); ++i)
        if (design.rows[std::size_t(rows[i])].readings == readings)
          own += b[Index(i)] * b[Index(i)];
      result.push_back({readings, mistake, b.squaredNorm(), own});
    }
  }
  return result;
}

/// Returns the studentised residuals of the readings used; 0 where a reading is fitted whatever its
/// value (m).
VectorXd studentised(const Problem& problem, const Fit& fit, const std::vector<char>& is_out) {
  const std::vector<Index> rows = used_rows(is_out);
  const VectorXd share = leverage(fit.factor, problem.design.A(rows, Eigen::all));
  const Quality q = quality(problem, fit, is_out);
  const bool scale = problem.options.noise_from_residuals && q.reduced_chi_square > 0.0;
  const double noise = scale ? std::sqrt(q.reduced_chi_square) : 1.0;
  VectorXd result = VectorXd::Zero(fit.misfit.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const double rest = 1.0 - share[Index(i)];
    // 1e-9: below it the residual of a fully determined reading is only rounding.
    if (rest > 1e-9) result[rows[i]] = fit.misfit[rows[i]] / (noise * std::sqrt(rest));
  }
  return result;
}

/// Leaves out readings beyond the limit, the worst first together with those at least half as bad,
/// but never so many that fewer numbers can be found.
Fit without_outliers(const Problem& problem, std::vector<char>& is_out) {
  Fit fit = fitted(problem, is_out);
  if (problem.options.outlier_limit == 0.0) return fit;
  std::vector<char> is_needed(is_out.size(), 0);
  for (std::size_t round = 0; round < is_out.size(); ++round) {
    VectorXd t = studentised(problem, fit, is_out).cwiseAbs();
    for (std::size_t i = 0; i < is_needed.size(); ++i)
      if (is_needed[i]) t[Index(i)] = 0.0;
    Index worst = 0;
    if (t.size() == 0 || t.maxCoeff(&worst) <= problem.options.outlier_limit) break;
    const auto with_out = [&](double limit) {
      std::vector<char> more = is_out;
      for (Index i = 0; i < t.size(); ++i)
        if (t[i] >= limit) more[std::size_t(i)] = 1;
      return more;
    };
    // Half of the worst: one large outlier inflates the residuals of its neighbours, which must not
    // be removed with it.
    std::vector<char> more = with_out(std::max(problem.options.outlier_limit, 0.5 * t[worst]));
    Fit next = fitted(problem, more);
    if (next.factor.found.size() < fit.factor.found.size()) {
      more = with_out(t[worst]);
      next = fitted(problem, more);
    }
    if (next.factor.found.size() < fit.factor.found.size()) {
      is_needed[std::size_t(worst)] = 1;
      continue;
    }
    is_out = more;
    fit = std::move(next);
  }
  return fit;
}

// Result

std::vector<Confounded> confounded(const Problem& problem, const Factor& factor) {
  const Design& design = problem.design;
  std::vector<Confounded> result;
  for (int j = 0; j < design.unknowns.size(); ++j) {
    const std::string& name = design.unknowns.names[std::size_t(j)];
    if (design.is_unobservable[std::size_t(j)]) result.push_back({name, {}, {}});
    const auto at = std::find(factor.left.begin(), factor.left.end(), j);
    if (at == factor.left.end()) continue;
    Confounded one{name, {}, {}};
    const auto column = factor.hidden.col(at - factor.left.begin());
    for (Index i = 0; i < column.size(); ++i)
      if (column[i] != 0.0) one.with.emplace_back(design.unknowns.names[std::size_t(i)], column[i]);
    result.push_back(std::move(one));
  }
  return result;
}

/// Returns the covariance of the numbers found, and zeros for those of zero variance from the
/// start.
Covariance belief_covariance(const Problem& problem, const Factor& factor, double variance) {
  const auto& all = problem.design.unknowns.coefficients;
  Covariance result;
  std::vector<Index> at;  // indices among those found
  for (std::size_t i = 0; i < factor.found.size(); ++i) {
    const auto column = std::size_t(factor.found[i]);
    if (column >= all.size()) continue;
    result.of.push_back(all[column]);
    at.push_back(Index(i));
  }
  const auto n = Index(at.size());
  const Covariance& before = problem.model.covariance;
  for (std::size_t i = 0; i < before.of.size(); ++i)
    if (before.matrix(Index(i), Index(i)) == 0.0) result.of.push_back(before.of[i]);
  result.matrix = MatrixXd::Zero(Index(result.of.size()), Index(result.of.size()));
  result.matrix.topLeftCorner(n, n) = variance * covariance(factor)(at, at);
  return result;
}

void check(const Problem& problem) {
  const Design& design = problem.design;
  const auto p = design.unknowns.coefficients.size();
  if (p == 0) throw std::invalid_argument("there is nothing to find: the model has no numbers");
  if (design.rows.empty())
    throw std::invalid_argument("there is nothing to find it by: the readings hold no value");
}

}  // namespace

std::pair<double, double> chi_square_band(double degrees_of_freedom) {
  if (!(degrees_of_freedom > 0.0)) return {0.0, HUGE_VAL};
  constexpr double one_in_a_thousand = 3.09;  // standard deviations
  // Wilson and Hilferty: the cube root of chi-square over its freedom is nearly normal.
  const double variance = 2.0 / (9.0 * degrees_of_freedom);
  const auto at = [&](double z) {
    return std::pow(std::max(0.0, 1.0 - variance + z * std::sqrt(variance)), 3);
  };
  return {at(-one_in_a_thousand), at(one_in_a_thousand)};
}

Estimate estimate(const GeometricErrors& model, std::span<const Readings> readings,
                  const EstimateOptions& options) {
  check(options);
  Problem problem{model, readings, options, design(model, readings), {}, {}, {}, {}};
  check(problem);
  problem.preference = preferences(model, problem.design, readings.front().nominal);
  problem.observed = observed(readings, problem.design);
  problem.start = problem.first_guess = start(model, problem.design.unknowns);

  std::vector<char> is_out(problem.design.rows.size(), 0);
  const Fit first = fitted(problem, is_out);
  Solution solution = leave_out_weak(problem, first, confounded(problem, first.factor));
  restart_from(problem, solution);
  const Fit fit = without_outliers(problem, is_out);
  const Quality q = quality(problem, fit, is_out);
  const bool scale = options.noise_from_residuals && q.degrees_of_freedom > 0;

  const Unknowns& unknowns = problem.design.unknowns;
  const auto p = Index(unknowns.coefficients.size());
  Estimate result;
  result.value = fit.x.head(p);
  result.names.assign(unknowns.names.begin(), unknowns.names.begin() + p);
  result.belief = {with_values(model.elements, result.value), model.measuring_lines,
                   belief_covariance(problem, fit.factor, scale ? q.reduced_chi_square : 1.0)};
  result.confounded = std::move(solution.not_found);
  result.set_ups = set_ups(readings, unknowns, fit.x);
  result.fit_residual = fit.misfit;
  for (std::size_t i = 0; i < is_out.size(); ++i)
    if (is_out[i]) result.outliers.push_back(int(i));
  result.degrees_of_freedom = q.degrees_of_freedom;
  result.chi_square = q.chi_square;
  result.reduced_chi_square = q.reduced_chi_square;
  if (options.compare_mistakes) {
    result.quality = reading_qualities(problem, fit, is_out);
    result.alternatives = alternatives(problem, fit, is_out);
  }
  result.condition = fit.factor.condition;
  result.iterations = first.iterations + fit.iterations;
  result.converged = fit.converged;
  return result;
}

namespace {

// Points of a plotted curve.
constexpr Index samples = 121;

/// The numbers of one element: their position among all.
struct Numbers {
  int first = 0;
  int count = 0;
};

std::vector<Numbers> numbers_of(const GeometricErrors& belief) {
  std::vector<Numbers> result(belief.elements.size());
  const std::vector<Coefficient> all = coefficients(belief.elements);
  for (std::size_t i = 0; i < all.size(); ++i) {
    Numbers& one = result[std::size_t(all[i].element)];
    if (one.count++ == 0) one.first = int(i);
  }
  return result;
}

VectorXd basis_of(const Element& element, int count, const CurveState& state) {
  VectorXd result(count);
  Index at = 0;
  for (const Curve& curve : element.curves) {
    const VectorXd one = basis(curve, state);
    result.segment(at, one.size()) = one;
    at += one.size();
  }
  return result;
}

/// Returns the covariance of the numbers of one element; numbers without covariance count as exact.
Eigen::MatrixXd covariance_of(const GeometricErrors& belief, int element, const Numbers& numbers) {
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(numbers.count, numbers.count);
  const std::vector<Coefficient> all = coefficients(belief.elements);
  const auto& of = belief.covariance.of;
  const auto place = [&](const Coefficient& one) {
    return int(std::find(all.begin(), all.end(), one) - all.begin()) - numbers.first;
  };
  for (std::size_t i = 0; i < of.size(); ++i)
    for (std::size_t k = 0; k < of.size(); ++k)
      if (of[i].element == element && of[k].element == element)
        result(place(of[i]), place(of[k])) = belief.covariance.matrix(Index(i), Index(k));
  return result;
}

/// Returns, for each row and element, true if the row is informative about the element: its
/// numbers, each of 1 um or 10 urad, would change the reading at least a quarter as much as those
/// of the element that changes it most. (rows x elements)
std::vector<std::vector<bool>> is_informative(const Design& design, const GeometricErrors& belief,
                                              const std::vector<Numbers>& numbers) {
  std::vector<std::vector<bool>> result(design.rows.size());
  for (std::size_t i = 0; i < result.size(); ++i) {
    std::vector<double> change(numbers.size(), 0.0);
    for (std::size_t e = 0; e < numbers.size(); ++e) {
      if (belief.elements[e].name.location || numbers[e].count == 0) continue;
      const double usual = belief.elements[e].name.is_angle() ? 10 * units::urad : units::um;
      change[e] = usual * design.A.row(Index(i)).segment(numbers[e].first, numbers[e].count).norm();
    }
    const double most = *std::max_element(change.begin(), change.end());
    for (const double one : change) result[i].push_back(most > 0.0 && one >= 0.25 * most);
  }
  return result;
}

/// Returns true if the element is the same at every position, so that there is no curve to plot.
bool is_constant(const Element& element) {
  return std::all_of(element.curves.begin(), element.curves.end(), [](const Curve& curve) {
    return std::holds_alternative<Constant>(curve.shape);
  });
}

/// Inputs for the curves of an estimate.
struct CurveInputs {
  const Estimate& estimate;
  std::span<const Readings> readings;
  Design design;
  GeometricModel bound;
  std::vector<Numbers> numbers;
  std::vector<std::vector<bool>> is_informative;
  std::vector<bool> outlier;  ///< (rows)

  int joint(std::size_t e) const {
    return joint_of(estimate.belief.elements[e].name.axis, readings.front().nominal, "a belief");
  }
  VectorXd basis(std::size_t e, const kinematics::AxisState& state) const {
    return basis_of(estimate.belief.elements[e], numbers[e].count,
                    curve_state(bound, state, joint(e)));
  }
  VectorXd found(std::size_t e) const {
    return estimate.value.segment(numbers[e].first, numbers[e].count);
  }
  const kinematics::AxisState& state(std::size_t row) const {
    const Row& at = design.rows[row];
    return readings[std::size_t(at.readings)].plan.measurements[std::size_t(at.measurement)].state;
  }
};

/// Adds the readings of one element, each converted to its value.
void add_readings(const CurveInputs& drawing, std::size_t e, CurveReadings& curve) {
  std::vector<double> at, seen;
  for (std::size_t i = 0; i < drawing.is_informative.size(); ++i) {
    if (!drawing.is_informative[i][e] || drawing.outlier[i]) continue;
    const VectorXd b = drawing.basis(e, drawing.state(i));
    Index k = 0;
    if (b.cwiseAbs().maxCoeff(&k) == 0.0) continue;
    // Any number of the element converts the residual into its value; the largest basis value does
    // so with the least rounding.
    const double per_value = drawing.design.A(Index(i), drawing.numbers[e].first + k) / b[k];
    if (per_value == 0.0) continue;
    at.push_back(drawing.state(i).q[drawing.joint(e)]);
    seen.push_back(b.dot(drawing.found(e)) + drawing.estimate.fit_residual[Index(i)] / per_value);
  }
  curve.reading_q = VectorXd::Map(at.data(), Index(at.size()));
  curve.reading = VectorXd::Map(seen.data(), Index(seen.size()));
}

/// Adds the curve over the range of its readings, or over the travel.
void add_curve(const CurveInputs& drawing, std::size_t e, CurveReadings& curve) {
  const kinematics::Chain& nominal = drawing.readings.front().nominal;
  const kinematics::Joint& joint = nominal.joints()[std::size_t(drawing.joint(e))];
  double least = joint.min, most = joint.max;
  if (curve.reading_q.size() > 0 && curve.reading_q.maxCoeff() > curve.reading_q.minCoeff()) {
    least = curve.reading_q.minCoeff();
    most = curve.reading_q.maxCoeff();
  } else if (joint.motion != kinematics::Motion::Linear) {
    least = std::max(least, -pi);
    most = std::min(most, pi);
  }
  curve.q = VectorXd::LinSpaced(samples, least, most);
  curve.value.resize(samples);
  curve.sigma.resize(samples);
  const Eigen::MatrixXd covariance =
      covariance_of(drawing.estimate.belief, int(e), drawing.numbers[e]);
  kinematics::AxisState state;
  state.q = kinematics::AxisVector::Zero(nominal.size());
  for (Index i = 0; i < samples; ++i) {
    state.q[drawing.joint(e)] = curve.q[i];
    const VectorXd b = drawing.basis(e, state);
    curve.value[i] = b.dot(drawing.found(e));
    curve.sigma[i] = std::sqrt(std::max(0.0, b.dot(covariance * b)));
  }
}

}  // namespace

std::vector<CurveReadings> curve_readings(const Estimate& estimate,
                                          std::span<const Readings> readings) {
  const GeometricErrors& belief = estimate.belief;
  CurveInputs drawing{estimate,
                      readings,
                      design(belief, readings),
                      bind(belief, readings.front().nominal),
                      numbers_of(belief),
                      {},
                      {}};
  drawing.is_informative = is_informative(drawing.design, belief, drawing.numbers);
  drawing.outlier.resize(drawing.is_informative.size(), false);
  for (const int i : estimate.outliers) drawing.outlier[std::size_t(i)] = true;
  std::vector<CurveReadings> result;
  for (std::size_t e = 0; e < drawing.numbers.size(); ++e) {
    const Element& element = belief.elements[e];
    if (element.name.location || drawing.numbers[e].count == 0 || is_constant(element)) continue;
    CurveReadings curve;
    curve.element = element.name;
    add_readings(drawing, e, curve);
    add_curve(drawing, e, curve);
    result.push_back(std::move(curve));
  }
  return result;
}

}  // namespace abbe::errors::identification
