#include "sim/calibration/identify.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "errors/identification/epochs.h"
#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/files/progress.h"
#include "sim/readings/readings_file.h"

namespace abbe::sim {
namespace {

namespace identification = errors::identification;
using errors::metrology::Readings;
using identification::Estimate;
using Files = std::vector<std::filesystem::path>;

std::string names_of(const Files& files) {
  std::string text;
  for (const auto& file : files) text += (text.empty() ? "" : ", ") + file.string();
  return text;
}

/// @param logs_too  a log of temperatures alone is a file as well
std::vector<Readings> read_all(const Files& files, bool logs_too, const Progress& progress) {
  std::vector<Readings> all;
  std::set<std::filesystem::path> seen;
  for (const auto& file : files) {
    std::error_code ignored;
    const std::filesystem::path canonical = std::filesystem::canonical(file, ignored);
    if (!canonical.empty() && !seen.insert(canonical).second)
      throw BadInput(file.string(), 0, 0, "each file once", "it again");
    if (progress) progress("read", double(all.size()) / double(files.size()));
    all.push_back(read_readings_file(file));
    if (all.back().value.size() == 0 && !logs_too)
      throw BadInput(file.string(), 0, 0, "readings of the machine", "a log of temperatures alone");
  }
  return all;
}

/// What every method says: the files, and where the belief will be written.
Identified common(const Files& files, const std::vector<Readings>& readings,
                  const IdentifyOptions& options) {
  Identified result{belief_files(options), {}, readings.front().nominal, {}, {}, {}, {}, {}};
  for (std::size_t i = 0; i < files.size(); ++i) {
    const errors::metrology::Plan& plan = readings[i].plan;
    result.sources.push_back({files[i], plan.instrument, plan.kind, plan.looks.size(),
                              plan.set_ups.size(), plan.duration_s});
  }
  return result;
}

double unit_of_value(const errors::Element& element) {
  return element.name.is_angle() ? units::urad : units::um;
}

/// The covariance without the numbers that the model holds at their place.
errors::Covariance of_found(const errors::Covariance& all) {
  errors::Covariance found;
  std::vector<Eigen::Index> rows;
  for (std::size_t i = 0; i < all.of.size(); ++i) {
    const auto k = Eigen::Index(i);
    if (!(all.matrix(k, k) > 0.0)) continue;
    rows.push_back(k);
    found.of.push_back(all.of[i]);
  }
  found.matrix = all.matrix(rows, rows);
  return found;
}

/// The model without the curves of which no number was found, nor the elements of which nothing is
/// left.
errors::GeometricErrors what_was_found(const Estimate& estimate) {
  const errors::GeometricErrors& belief = estimate.belief;
  errors::GeometricErrors kept;
  kept.measuring_lines = belief.measuring_lines;
  const errors::Covariance found = of_found(belief.covariance);
  kept.covariance = found;
  for (std::size_t e = 0; e < belief.elements.size(); ++e) {
    errors::Element element{belief.elements[e].name, {}};
    for (std::size_t c = 0; c < belief.elements[e].curves.size(); ++c) {
      bool known = false;
      for (std::size_t i = 0; i < found.of.size(); ++i) {
        if (found.of[i].element != int(e) || found.of[i].curve != int(c)) continue;
        known = true;
        kept.covariance.of[i].element = int(kept.elements.size());
        kept.covariance.of[i].curve = int(element.curves.size());
      }
      if (known) element.curves.push_back(belief.elements[e].curves[c]);
    }
    if (!element.curves.empty()) kept.elements.push_back(std::move(element));
  }
  return kept;
}

std::vector<ChainFit::Outlier> outliers_of(const Files& files,
                                           const std::vector<Readings>& readings,
                                           const Estimate& estimate) {
  std::vector<ChainFit::Outlier> outliers;
  int at = 0;  // among the readings of all files, temperatures left out
  for (std::size_t f = 0; f < files.size(); ++f) {
    const auto& looks = readings[f].plan.looks;
    for (std::size_t row = 0; row < looks.size(); ++row) {
      if (looks[row].channel < 0) continue;
      if (std::ranges::count(estimate.outliers, at) > 0)
        outliers.push_back({files[f], row + 1, estimate.fit_residual[at]});
      ++at;
    }
  }
  return outliers;
}

/// The residuals file by file, temperatures left out.
std::vector<Eigen::VectorXd> residuals_of(const std::vector<Readings>& readings,
                                          const Estimate& estimate) {
  std::vector<Eigen::VectorXd> all;
  Eigen::Index at = 0;
  for (const Readings& one : readings) {
    const auto count = Eigen::Index(
        std::ranges::count_if(one.plan.looks, [](const auto& look) { return look.channel >= 0; }));
    all.push_back(estimate.fit_residual.segment(at, count));
    at += count;
  }
  return all;
}

/// Beyond what chance gives one fit in a thousand.
bool scatters(const Estimate& estimate) {
  const int degrees = estimate.degrees_of_freedom;
  return degrees > 20 && estimate.reduced_chi_square > 1.0 + 3.1 * std::sqrt(2.0 / degrees);
}

std::vector<std::string> warnings_of(const Estimate& estimate, const IdentifyOptions& options) {
  std::vector<std::string> warnings;
  if (!estimate.converged) warnings.push_back("the fit did not converge");
  if (scatters(estimate))
    warnings.push_back(fmt::format(
        "the readings scatter {:.2f} times as much as their instruments say, and the uncertainties "
        "were raised by it: the curves may need {}, or the machine does not repeat",
        std::sqrt(estimate.reduced_chi_square),
        options.choose_orders ? "the pitch of the screws (--pitch)"
                              : "a higher order (--choose-orders) or the pitch of the screws "
                                "(--pitch)"));
  const auto n = double(estimate.fit_residual.size());
  if (double(estimate.outliers.size()) > 0.02 * n)
    warnings.push_back(fmt::format(
        "{} of {} readings were left out as outliers: that many are no mistakes, the curves do not "
        "follow the machine",
        estimate.outliers.size(), n));
  std::string weak;
  const errors::Covariance& covariance = estimate.belief.covariance;
  for (std::size_t i = 0; i < covariance.of.size(); ++i) {
    const auto& element = estimate.belief.elements[std::size_t(covariance.of[i].element)];
    const auto k = Eigen::Index(i);
    if (covariance.matrix(k, k) > std::pow(50.0 * unit_of_value(element), 2))
      weak +=
          (weak.empty() ? "" : ", ") + errors::name_of(covariance.of[i], estimate.belief.elements);
  }
  if (!weak.empty())
    warnings.push_back("hardly identified by these readings (beyond 50 um or urad): " + weak);
  return warnings;
}

Identified by_chain(const Files& files, const std::vector<Readings>& readings,
                    IdentifyOptions options, const Progress& progress) {
  Identified result = common(files, readings, options);
  ChainFit fit;
  if (progress) options.orders.progress = [&](double fraction) { progress("orders", fraction); };
  if (options.choose_orders)
    fit.orders = options.model.orders =
        identification::choose_orders(readings, options.model, options.orders).orders;
  if (progress) progress("fit", 0.0);
  Estimate estimate = identification::estimate(
      identification::model_of(result.nominal, options.model), readings, options.estimate);
  // what the model does not follow counts as noise
  if (scatters(estimate)) estimate.belief.covariance.matrix *= estimate.reduced_chi_square;
  result.belief = what_was_found(estimate);
  stop_if_interrupted();
  fit.unknowns = estimate.names.size();
  fit.reduced_chi_square = estimate.reduced_chi_square;
  fit.degrees_of_freedom = estimate.degrees_of_freedom;
  fit.condition = estimate.condition;
  fit.outliers = outliers_of(files, readings, estimate);
  fit.curves = identification::curve_readings(estimate, readings);
  fit.residual_sd = residuals_of(readings, estimate);
  result.fit = std::move(fit);
  result.confounded = estimate.confounded;
  result.warnings = warnings_of(estimate, options);
  return result;
}

Identified by_step_diagonal(const Files& files, const std::vector<Readings>& readings,
                            const IdentifyOptions& options) {
  if (readings.size() != 1)
    throw BadInput(names_of(files), 0, 0, "one file of step diagonals",
                   std::to_string(readings.size()));
  const std::vector<Readings> starts = identification::by_start(readings.front());
  std::vector<identification::StepDiagonal> results;
  for (const Readings& start : starts) results.push_back(identification::step_diagonal(start));
  const identification::StepDiagonal& first = results.front();
  Identified result = common(files, readings, options);
  result.belief = first.belief;
  result.warnings = first.warnings;
  if (!first.caution.empty()) result.warnings.push_back(first.caution);
  StepDiagonalFit fit{first.reduced_chi_square, options.sensors, {}};
  if (!options.sensors.empty())
    fit.trend = identification::step_diagonal_trend(
        results, identification::warmed_K(starts, options.sensors));
  else if (starts.size() > 1)
    result.warnings.push_back(fmt::format(
        "{} sets of diagonals, of which the first is reported: name temperatures by --sensors to "
        "have the elements regressed on them",
        starts.size()));
  result.fit = std::move(fit);
  return result;
}

Identified by_composite(const Files& files, const std::vector<Readings>& readings,
                        const IdentifyOptions& options) {
  if (readings.size() != 1)
    throw BadInput(names_of(files), 0, 0, "one file of positioning from several starts",
                   std::to_string(readings.size()));
  Composite composite =
      identify_composite(readings.front(), {options.sensors, options.model.order, options.margin});
  Identified result = common(files, readings, options);
  result.belief = std::move(composite.cold);
  result.thermal = std::move(composite.thermal);
  result.fit = CompositeFits{options.sensors, std::move(composite.axes)};
  result.warnings = std::move(composite.warnings);
  return result;
}

Identified by_thermal(const Files& files, const std::vector<Readings>& readings,
                      const IdentifyOptions& options) {
  IdentifiedThermal found = identify_thermal(readings, thermal_identification(options));
  Identified result = common(files, readings, options);
  result.thermal = std::move(found.belief);
  result.fit = std::move(found.day);
  result.confounded = std::move(found.confounded);
  result.warnings = std::move(found.warnings);
  return result;
}

}  // namespace

ThermalIdentification thermal_identification(const IdentifyOptions& options) {
  ThermalIdentification day;
  day.elements = options.model.only;
  day.sensors = options.sensors;
  day.choice.count = options.sensor_count;
  day.choice.groups = 3 * options.sensor_count;  // as the packaged protocols choose
  day.margin = options.margin;
  return day;
}

BeliefFiles belief_files(const IdentifyOptions& options) {
  const std::filesystem::path& out = options.out;
  BeliefFiles files{out, out, out, {}};
  files.report.replace_extension(".json");
  files.picture.replace_extension(".png");
  if (options.method == IdentifyOptions::Method::Composite)
    files.thermal = out.parent_path() / (out.stem().string() + "_thermal.txt");
  return files;
}

Identified identified(const Files& files, const IdentifyOptions& options,
                      const Progress& progress) {
  const std::vector<Readings> readings =
      read_all(files, options.method == IdentifyOptions::Method::Thermal, progress);
  if (progress && options.method != IdentifyOptions::Method::Chain) progress("fit", 0.0);
  try {
    switch (options.method) {
      case IdentifyOptions::Method::StepDiagonal:
        return by_step_diagonal(files, readings, options);
      case IdentifyOptions::Method::Composite:
        return by_composite(files, readings, options);
      case IdentifyOptions::Method::Thermal:
        return by_thermal(files, readings, options);
      case IdentifyOptions::Method::Chain:
        break;
    }
    return by_chain(files, readings, options, progress);
  } catch (const std::invalid_argument& fault) {
    throw BadInput(names_of(files), 0, 0, "readings from which a machine can be identified",
                   fault.what());
  } catch (const std::out_of_range& fault) {
    throw BadInput(names_of(files), 0, 0, "readings within the range of the curves", fault.what());
  }
}

}  // namespace abbe::sim
