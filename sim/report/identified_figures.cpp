#include "sim/report/identified_figures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "errors/coefficients.h"
#include "kinematics/topology.h"
#include "kinematics/units.h"

namespace abbe::sim {
namespace {

using Eigen::Index;

constexpr double per_metre = 1000.0;  // mm: slopes of a day are numbers over a metre

}  // namespace

std::string machine_of(const Identified& identified) {
  return kinematics::to_string(kinematics::topology_of(identified.nominal.joints()));
}

std::string method_of(const Identified& identified) {
  constexpr std::array words{
      "least squares on the exact chain", "step diagonal as published: 12 elements of translation",
      "composite: cold curve, and slopes regressed on temperatures",
      "thermal: elements at every start on the exact chain, regressed on temperatures"};
  static_assert(words.size() == std::variant_size_v<decltype(Identified::fit)>);
  return words.at(identified.fit.index());
}

std::size_t readings_of(const Identified& identified) {
  std::size_t count = 0;
  for (const ReadingsSource& one : identified.sources) count += one.readings;
  return count;
}

double hours_of(const Identified& identified) {
  double hours = 0.0;
  for (const ReadingsSource& one : identified.sources) hours += one.duration_s / 3600.0;
  return hours;
}

std::vector<NumberFigure> number_figures(const errors::GeometricErrors& belief) {
  std::map<std::string, double> sigma;
  const errors::Covariance& covariance = belief.covariance;
  for (std::size_t i = 0; i < covariance.of.size(); ++i)
    sigma[errors::name_of(covariance.of[i], belief.elements)] =
        std::sqrt(std::max(0.0, covariance.matrix(Index(i), Index(i))));
  std::vector<NumberFigure> figures;
  const auto all = errors::coefficients(belief.elements);
  const Eigen::VectorXd values = errors::values(belief.elements);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const errors::ElementName& element = belief.elements[std::size_t(all[i].element)].name;
    const double unit = element.is_angle() ? units::urad : units::um;
    figures.push_back({errors::name_of(all[i], belief.elements),
                       to_string(element),
                       element.is_angle() ? "urad" : "um",
                       values[Index(i)] / unit,
                       {}});
    const auto known = sigma.find(figures.back().name);
    if (known != sigma.end()) figures.back().standard_uncertainty = known->second / unit;
  }
  return figures;
}

TermFigures term_figures(const RegressedTerm& term) {
  const bool angle = term.name.is_angle();
  const double unit = term.slope ? um_per_m : angle ? units::urad : units::um;
  const double of_number = (term.slope ? 1.0 / per_metre : 1.0) / unit;
  const errors::identification::Regression& regression = term.regression;
  TermFigures figures;
  figures.name = name_of(term);
  figures.unit = std::string(angle ? "urad" : "um") + (term.slope ? "/m" : "");
  figures.at_epochs = of_number * term.at_epochs;
  figures.range = figures.at_epochs.maxCoeff() - figures.at_epochs.minCoeff();
  const Eigen::VectorXd sigma = of_number * term.sigma;
  figures.standard_uncertainty = sigma.mean();
  figures.constant = regression.constant / unit;
  figures.per_K = regression.beta / unit;
  figures.standard_error = regression.standard_error.tail(regression.beta.size()) / unit;
  figures.residual_sd = regression.residual_sd / unit;
  return figures;
}

std::vector<TrendFigures> trend_figures(const StepDiagonalFit& fit) {
  std::vector<TrendFigures> figures;
  if (!fit.trend) return figures;
  for (std::size_t v = 0; v < fit.trend->names.size(); ++v) {
    const bool is_length = fit.trend->is_length[v];
    const double unit = is_length ? units::um : um_per_m;  // slopes are um/m, squareness urad
    figures.push_back({fit.trend->names[v],
                       is_length ? "um/K" : "um/m/K or urad/K",
                       fit.trend->per_K.row(Index(v)) / unit,
                       {}});
    if (fit.trend->per_K_sigma.size() > 0)
      figures.back().standard_uncertainty = fit.trend->per_K_sigma.row(Index(v)) / unit;
  }
  return figures;
}

}  // namespace abbe::sim
