#include "sim/calibration/calibration.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "errors/coefficients.h"
#include "errors/geometric.h"
#include "errors/identification/thermal_epochs.h"
#include "errors/metrology/position_file.h"
#include "errors/metrology/reading_diagnostics.h"
#include "errors/metrology/test_results.h"
#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/files/progress.h"
#include "sim/readings/readings_file.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

namespace {

namespace metrology = errors::metrology;

metrology::Tests tests_of_sets(const std::vector<metrology::PositionSet>& sets,
                               const std::string& stem) {
  metrology::Tests tests;
  for (const metrology::PositionSet& set : sets) {
    metrology::AxisTest test;
    test.name = set.name.empty() ? stem : set.name;
    test.angle = test.rotary = set.rotary;
    test.runs = set.runs;
    tests.axes.push_back(std::move(test));
  }
  return tests;
}

std::vector<Evaluation::Temperatures> temperatures_of(const metrology::Readings& readings) {
  std::vector<Evaluation::Temperatures> all;
  if (readings.plan.measurements.empty()) return all;
  for (std::size_t k = 0; k < readings.sensors.size(); ++k) {
    const auto column = readings.T_C.col(Eigen::Index(k));
    all.push_back({readings.sensors[k], column.minCoeff(), column.maxCoeff()});
  }
  return all;
}

/// Reads a file by its content, without evaluating it.
Evaluation read(const std::filesystem::path& file) {
  Evaluation found{file, {}, {}, {}, {}, {}, {}};
  metrology::ReadingDiagnostics diagnostics;
  const std::string text = read_text(file, std::size_t(256) << 20);
  if (is_part_readings_text(text)) {
    found.part = read_part_readings(text, file.string());
    // fewer points determine no plane
    if (found.part->readings.deviation.size() < 3)
      throw BadInput(file.string(), 0, 0, "at least 3 points of a part", "fewer");
    found.kind = found.part->kind;
    diagnostics = metrology::diagnose(found.part->readings);
  } else if (is_readings_text(text)) {
    const metrology::Readings readings = read_readings(text, file.string());
    found.kind = readings.plan.kind;
    if (readings.value.size() > 0) found.tests = classify_readings(readings);
    found.temperatures = temperatures_of(readings);
    diagnostics = metrology::diagnose(readings);
  } else {
    found.kind = "position file";
    found.tests =
        tests_of_sets(metrology::read_positions(text, file.string()), file.stem().string());
    diagnostics = metrology::diagnose(found.tests.axes);
  }
  // a channel that no working instrument reads is an error: a standard would turn it into a figure
  std::vector<BadInput> errors;
  for (const std::string& error : diagnostics.errors)
    errors.emplace_back(file.string(), 0, 0, "readings of a working instrument", error);
  if (!errors.empty()) throw BadScene(std::move(errors));
  found.warnings = std::move(diagnostics.warnings);
  return found;
}

}  // namespace

Evaluation evaluate_readings(const std::filesystem::path& file) {
  Evaluation evaluation = read(file);
  try {
    evaluation.results = evaluation.part ? standard_results(evaluation.part->readings)
                                         : standard_results(evaluation.tests);
  } catch (const std::invalid_argument& fault) {
    throw BadInput(file.string(), 0, 0, "readings that a standard can evaluate", fault.what());
  }
  return evaluation;
}

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

/// Returns an error for each pair of files of which one repeats runs of the other, or for a file
/// that repeats its own runs.
std::vector<BadInput> repeated_files(const Files& files, const std::vector<Readings>& readings) {
  using errors::metrology::RepeatedSeries;
  std::map<std::pair<int, int>, std::vector<RepeatedSeries>> of_files;
  for (const RepeatedSeries& series : errors::metrology::repeated_series(readings))
    of_files[{series.again.file, series.first.file}].push_back(series);
  std::vector<BadInput> errors;
  for (const auto& [pair, list] : of_files) {
    const auto again = std::size_t(pair.first), first = std::size_t(pair.second);
    const std::string more =
        list.size() > 1 ? fmt::format("; so are {} more", list.size() - 1) : "";
    errors.emplace_back(
        files[again].string(), 0, 0, "readings of its own for every run",
        fmt::format("\"{}\" is the same as \"{}\" of {} to the last digit: copied, or rounded more "
                    "coarsely than it states{}",
                    series_text(readings[again], list.front().again),
                    series_text(readings[first], list.front().first), files[first].string(), more));
  }
  return errors;
}

/// Diagnoses every file.
/// @return warnings, each with its file
/// @throws BadScene with every error
std::vector<std::string> diagnose(const Files& files, const std::vector<Readings>& readings) {
  std::vector<std::string> warnings;
  std::vector<BadInput> errors;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const errors::metrology::ReadingDiagnostics found = errors::metrology::diagnose(readings[i]);
    for (const std::string& error : found.errors)
      errors.emplace_back(files[i].string(), 0, 0, "readings of a working instrument", error);
    for (const std::string& warning : found.warnings)
      warnings.push_back(files[i].string() + ": " + warning);
  }
  std::ranges::move(repeated_files(files, readings), std::back_inserter(errors));
  if (!errors.empty()) throw BadScene(std::move(errors));
  return warnings;
}

/// Reads all files.
/// @param logs_too  accepts a log of temperatures alone
std::vector<Readings> read_all(const Files& files, bool logs_too, const Progress& progress) {
  std::vector<Readings> all;
  std::set<std::filesystem::path> seen;
  for (const auto& file : files) {
    // compared by canonical path: a file given twice would count its readings twice
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

/// Returns the result that every method starts from: the sources, and the files of the belief.
Identified common(const Files& files, const std::vector<Readings>& readings,
                  const IdentifyOptions& options) {
  Identified result{
      belief_files(options), {}, readings.front().nominal, {}, {}, {}, {}, {}, {}, {}};
  for (std::size_t i = 0; i < files.size(); ++i) {
    const errors::metrology::Plan& plan = readings[i].plan;
    result.sources.push_back({files[i], plan.instrument, plan.kind, plan.measurements.size(),
                              plan.set_ups.size(), plan.duration_s});
  }
  return result;
}

double unit_of_value(const errors::Element& element) {
  return element.name.is_angle() ? units::urad : units::um;
}

/// Returns the covariance without the numbers that the model holds at their start.
errors::Covariance determined_covariance(const errors::Covariance& all) {
  errors::Covariance found;
  std::vector<Eigen::Index> rows;
  for (std::size_t i = 0; i < all.of.size(); ++i) {
    const auto k = Eigen::Index(i);
    // a number that is held has no variance
    if (!(all.matrix(k, k) > 0.0)) continue;
    rows.push_back(k);
    found.of.push_back(all.of[i]);
  }
  found.matrix = all.matrix(rows, rows);
  return found;
}

/// Returns the model without the curves of which no number was determined, and without elements
/// that have no curve left. Indices in the covariance follow.
errors::GeometricErrors determined_errors(const Estimate& estimate) {
  const errors::GeometricErrors& belief = estimate.belief;
  errors::GeometricErrors kept;
  kept.measuring_lines = belief.measuring_lines;
  const errors::Covariance found = determined_covariance(belief.covariance);
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

/// Returns the curves of which no number was determined, all at zero.
std::vector<errors::Element> undetermined_elements(const Estimate& estimate) {
  const errors::GeometricErrors& belief = estimate.belief;
  const errors::Covariance found = determined_covariance(belief.covariance);
  std::vector<errors::Element> rest;
  for (std::size_t e = 0; e < belief.elements.size(); ++e) {
    errors::Element element{belief.elements[e].name, {}};
    for (std::size_t c = 0; c < belief.elements[e].curves.size(); ++c)
      if (std::ranges::none_of(found.of, [&](const errors::Coefficient& one) {
            return one.element == int(e) && one.curve == int(c);
          }))
        element.curves.push_back(belief.elements[e].curves[c]);
    if (!element.curves.empty()) rest.push_back(std::move(element));
  }
  return errors::with_values(
      rest, Eigen::VectorXd::Zero(Eigen::Index(errors::coefficients(rest).size())));
}

std::vector<ChainFit::Outlier> outliers_of(const Files& files,
                                           const std::vector<Readings>& readings,
                                           const Estimate& estimate) {
  std::vector<ChainFit::Outlier> outliers;
  int at = 0;  // index among the readings of all files, without temperatures
  for (std::size_t f = 0; f < files.size(); ++f) {
    const auto& measurements = readings[f].plan.measurements;
    for (std::size_t row = 0; row < measurements.size(); ++row) {
      if (measurements[row].channel < 0) continue;
      if (std::ranges::count(estimate.outliers, at) > 0)
        outliers.push_back({files[f], row + 1, estimate.fit_residual[at]});
      ++at;
    }
  }
  return outliers;
}

/// Returns the residuals file by file, without temperatures.
std::vector<Eigen::VectorXd> residuals_of(const std::vector<Readings>& readings,
                                          const Estimate& estimate) {
  std::vector<Eigen::VectorXd> all;
  Eigen::Index at = 0;
  for (const Readings& one : readings) {
    const auto count = Eigen::Index(std::ranges::count_if(
        one.plan.measurements, [](const auto& measurement) { return measurement.channel >= 0; }));
    all.push_back(estimate.fit_residual.segment(at, count));
    at += count;
  }
  return all;
}

/// Returns true if the scatter is larger than chance gives in one fit of a thousand.
bool has_excess_scatter(const Estimate& estimate) {
  return estimate.reduced_chi_square >
         identification::chi_square_band(estimate.degrees_of_freedom).second;
}

const char* text_of(identification::Mistake mistake) {
  using identification::Mistake;
  switch (mistake) {
    case Mistake::Negated:
      return "with the other sign";
    case Mistake::Reversed:
      return "in reversed order";
    case Mistake::TimesThousand:
      return "a thousand times as large";
    case Mistake::OverThousand:
      return "a thousandth as large";
  }
  return "";
}

/// Returns the reduced chi-square of one file if it had been written with a mistake.
double corrected_reduced_chi_square(const Estimate& estimate,
                                    const identification::Alternative& alternative) {
  const identification::FitQuality& own = estimate.quality[std::size_t(alternative.readings)];
  // with half a degree of freedom or less the ratio says nothing
  return own.degrees_of_freedom > 0.5 ? alternative.own_chi_square / own.degrees_of_freedom : 0.0;
}

/// Returns the mistake that would explain a chi-square beyond chance; empty if none does. The file
/// must keep the noise that it states, since a file with very few readings fits anything.
std::string mistake_text(const Files& files, const Estimate& estimate) {
  // Limits of the file's reduced chi-square with the mistake undone; between them its noise is as
  // stated, within a factor of 2.
  constexpr double low = 0.3, high = 4.0;
  const double now = estimate.reduced_chi_square;
  const identification::Alternative* best = nullptr;
  // Distance of the fit from a reduced chi-square of 1, on a logarithmic scale, since a file may
  // also fit too well; 1e-300 avoids the logarithm of zero.
  const auto distance = [&](const identification::Alternative& one) {
    return std::abs(
        std::log(std::max(one.chi_square, 1e-300) / std::max(1, estimate.degrees_of_freedom)));
  };
  for (const identification::Alternative& one : estimate.alternatives) {
    const double own = corrected_reduced_chi_square(estimate, one);
    if (own > low && own < high && (best == nullptr || distance(one) < distance(*best)))
      best = &one;
  }
  // the mistake must remove half of the misfit, or it is no explanation
  if (best == nullptr || distance(*best) > 0.5 * std::abs(std::log(std::max(now, 1e-300))))
    return "";
  return fmt::format("; taken {} {} would come to a reduced chi-square of {:.3g}",
                     text_of(best->mistake), files[std::size_t(best->readings)].string(),
                     best->chi_square / std::max(1, estimate.degrees_of_freedom));
}

/// Returns a note on the file whose readings fit worst, if several files were read.
std::string worst_file_warning(const Files& files, const Estimate& estimate) {
  if (files.size() < 2 || estimate.quality.size() != files.size()) return "";
  const auto reduced = [&](std::size_t i) {
    const identification::FitQuality& one = estimate.quality[i];
    return one.degrees_of_freedom > 0.5 ? one.chi_square / one.degrees_of_freedom : 0.0;
  };
  std::size_t worst = 0;
  for (std::size_t i = 1; i < files.size(); ++i)
    if (reduced(i) > reduced(worst)) worst = i;
  return fmt::format(" (most in {}, {:.2f} times)", files[worst].string(),
                     std::sqrt(reduced(worst)));
}

bool has_stated_noise(const Readings& readings) {
  for (const auto& set_up : readings.plan.set_ups)
    for (const auto& channel : set_up.channels)
      if (!(errors::metrology::standard_deviation(channel) > 0.0)) return false;
  return true;
}

/// Returns warnings about files whose readings are nearer to the model than their noise allows.
std::vector<std::string> too_close_warnings(const Files& files,
                                            const std::vector<Readings>& readings,
                                            const Estimate& estimate) {
  constexpr double too_close = 0.5;  // of the expected value; rounding makes it a little smaller
  std::vector<std::string> warnings;
  for (std::size_t i = 0; i < files.size() && i < estimate.quality.size(); ++i) {
    const identification::FitQuality& one = estimate.quality[i];
    // fewer than 3 degrees of freedom scatter too widely
    if (!has_stated_noise(readings[i]) || one.degrees_of_freedom < 3.0) continue;
    const double reduced = one.chi_square / one.degrees_of_freedom;
    if (reduced <
        std::min(too_close, identification::chi_square_band(one.degrees_of_freedom).first))
      warnings.push_back(fmt::format(
          "{}: readings scatter {:.2g} times as much as their instrument says (reduced chi-square "
          "{:.2g}): they may be in another unit, smoothed or computed, and its uncertainties are "
          "of no use",
          files[i].string(), std::sqrt(reduced), reduced));
  }
  return warnings;
}

/// Returns the signs and orders of readings that no other reading checks.
std::vector<std::string> assumptions_of(const Files& files, const Estimate& estimate) {
  using identification::Mistake;
  constexpr double seen = 30.0;  // of chi-square: 5.5 standard deviations
  std::string signs, orders, units;
  const auto add = [&](std::string& list, const identification::Alternative& one) {
    const std::string file = files[std::size_t(one.readings)].string();
    if (list.find(file) == std::string::npos) list += (list.empty() ? "" : ", ") + file;
  };
  for (const identification::Alternative& one : estimate.alternatives) {
    // Readings of a thousandth are close to any model, so that alternative says nothing.
    if (one.chi_square > estimate.chi_square + seen || one.mistake == Mistake::OverThousand)
      continue;
    add(one.mistake == Mistake::Negated    ? signs
        : one.mistake == Mistake::Reversed ? orders
                                           : units,
        one);
  }
  std::vector<std::string> assumptions;
  const auto say = [&](const char* what, const std::string& list) {
    if (!list.empty())
      assumptions.push_back(fmt::format(
          "the {} of readings is as written, no other reading checks it: {}", what, list));
  };
  say("sign", signs);
  say("order", orders);
  say("unit", units);
  return assumptions;
}

/// Returns warnings about elements of the belief that no machine has, over the travel of the axes.
std::vector<std::string> size_warnings(const errors::GeometricErrors& belief,
                                       const kinematics::Chain& nominal) {
  kinematics::AxisVector low(nominal.size()), high(nominal.size());
  for (int j = 0; j < nominal.size(); ++j) {
    const kinematics::Joint& joint = nominal.joints()[std::size_t(j)];
    // a rotary axis of more than 100 rad turns without end; its errors repeat every turn
    const bool is_endless =
        joint.motion != kinematics::Motion::Linear && joint.max - joint.min > 100;
    low[j] = is_endless ? -pi : joint.min;
    high[j] = is_endless ? pi : joint.max;
  }
  return errors::element_warnings(errors::bind(belief, nominal), low, high, {.identified = true});
}

std::vector<std::string> warnings_of(const Files& files, const std::vector<Readings>& readings,
                                     const Estimate& estimate, const IdentifyOptions& options) {
  std::vector<std::string> warnings = too_close_warnings(files, readings, estimate);
  if (!warnings.empty()) warnings.back() += mistake_text(files, estimate);
  if (has_excess_scatter(estimate)) {
    const std::string mistake = mistake_text(files, estimate);
    warnings.push_back(fmt::format(
        "the readings scatter {:.2f} times as much as their instruments say{}, and the "
        "uncertainties were raised by it: {}",
        std::sqrt(estimate.reduced_chi_square), worst_file_warning(files, estimate),
        !mistake.empty() ? mistake.substr(2)
        : options.choose_orders
            ? "the curves may need the pitch of the screws (--pitch), or the machine does not "
              "repeat"
            : "the curves may need a higher order (--choose-orders) or the pitch of the screws "
              "(--pitch), or the machine does not repeat"));
  }
  // 2 % outliers: mistakes are rarer, so the curves or the noise are wrong
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
    // 50 um or urad: as much as the errors of the machine, so the number is not known
    if (covariance.matrix(k, k) > std::pow(50.0 * unit_of_value(element), 2))
      weak +=
          (weak.empty() ? "" : ", ") + errors::name_of(covariance.of[i], estimate.belief.elements);
  }
  if (!weak.empty())
    warnings.push_back("hardly identified by these readings (beyond 50 um or urad): " + weak);
  return warnings;
}

/// Returns warnings about pitches that no screw has: values in m, um or inches, or the length of a
/// travel.
std::vector<std::string> pitch_warnings(const std::map<char, double>& pitches) {
  constexpr double finest_mm = 0.4, coarsest_mm = 200.0;
  std::vector<std::string> warnings;
  for (const auto& [axis, pitch] : pitches)
    if (pitch < finest_mm || pitch > coarsest_mm)
      warnings.push_back(
          fmt::format("the pitch of {} is {:g} mm: looks like {}, {:g} to {:g} mm "
                      "expected",
                      axis, pitch, pitch < finest_mm ? "m" : "um", finest_mm, coarsest_mm));
  return warnings;
}

/// Returns the number of positions of a slide in the set-up that reads it at most positions.
std::size_t count_positions(const std::vector<Readings>& readings, int joint) {
  std::map<std::pair<std::size_t, int>, std::set<double>> positions;
  for (std::size_t f = 0; f < readings.size(); ++f)
    for (const auto& measurement : readings[f].plan.measurements)
      if (measurement.channel >= 0)
        // rounded to 1 um: readings at one target differ by less
        positions[{f, measurement.set_up}].insert(std::round(measurement.state.q[joint] * 1e3));
  std::size_t most = 0;
  for (const auto& [set_up, distinct] : positions) most = std::max(most, distinct.size());
  return most;
}

/// Returns warnings about slides whose curves have as many coefficients as there are positions;
/// they are free in between.
std::vector<std::string> order_warnings(const std::vector<Readings>& readings,
                                        const IdentifyOptions& options) {
  std::vector<std::string> warnings;
  const auto& joints = readings.front().nominal.joints();
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const std::size_t positions = count_positions(readings, int(j));
    if (joints[j].motion != kinematics::Motion::Linear || positions < 2) continue;
    if (options.model.order + 1 < int(positions)) continue;
    warnings.push_back(fmt::format(
        "curves of {} of order {} pass through every one of the {} positions that were read, and "
        "between them nothing holds them: lower --order, or --choose-orders",
        joints[j].name, options.model.order, positions));
  }
  return warnings;
}

Identified identify_by_chain(const Files& files, const std::vector<Readings>& readings,
                             IdentifyOptions options, const Progress& progress) {
  Identified result = common(files, readings, options);
  ChainFit fit;
  if (progress) options.orders.progress = [&](double fraction) { progress("orders", fraction); };
  if (options.choose_orders)
    fit.orders = options.model.orders =
        identification::choose_orders(readings, options.model, options.orders).orders;
  if (progress) progress("fit", 0.0);
  // the alternatives are needed for the warnings and the assumptions
  options.estimate.compare_mistakes = true;
  Estimate estimate = identification::estimate(
      identification::model_of(result.nominal, options.model), readings, options.estimate);
  if (!estimate.converged)
    throw std::runtime_error(
        fmt::format("{}: the fit did not converge in {} iterations, nothing was written: readings "
                    "of another unit, sign or machine, or far too few",
                    names_of(files), estimate.iterations));
  // Deviations that the model does not follow count as noise, so the uncertainties grow with them.
  if (has_excess_scatter(estimate))
    estimate.belief.covariance.matrix *= estimate.reduced_chi_square;
  result.belief = determined_errors(estimate);
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
  result.unidentified = undetermined_elements(estimate);
  result.assumptions = assumptions_of(files, estimate);
  result.warnings = warnings_of(files, readings, estimate, options);
  std::ranges::move(pitch_warnings(options.model.pitch), std::back_inserter(result.warnings));
  if (!options.choose_orders)
    std::ranges::move(order_warnings(readings, options), std::back_inserter(result.warnings));
  return result;
}

Identified identify_by_step_diagonal(const Files& files, const std::vector<Readings>& readings,
                                     const IdentifyOptions& options) {
  if (readings.size() != 1)
    throw BadInput(names_of(files), 0, 0, "one file of step diagonals",
                   std::to_string(readings.size()));
  const std::vector<Readings> starts = identification::split_by_start(readings.front());
  std::vector<identification::StepDiagonal> results;
  for (const Readings& start : starts) results.push_back(identification::step_diagonal(start));
  const identification::StepDiagonal& first = results.front();
  Identified result = common(files, readings, options);
  result.belief = first.belief;
  result.warnings = first.warnings;
  if (!first.caution.empty()) result.warnings.push_back(first.caution);
  constexpr double too_close = 0.05;  // three components of four diagonals leave few contradictions
  if (has_stated_noise(readings.front()) && first.reduced_chi_square < too_close)
    result.warnings.push_back(fmt::format(
        "the diagonals contradict each other less than their noise lets them (reduced chi-square "
        "{:.2g}): readings may be in another unit, smoothed or computed",
        first.reduced_chi_square));
  StepDiagonalFit fit{first.reduced_chi_square, options.sensors, {}};
  if (!options.sensors.empty())
    fit.trend = identification::step_diagonal_trend(
        results, identification::temperature_rise_K(starts, options.sensors));
  else if (starts.size() > 1)
    result.warnings.push_back(fmt::format(
        "{} sets of diagonals, of which the first is reported: name temperatures by --sensors to "
        "have the elements regressed on them",
        starts.size()));
  result.fit = std::move(fit);
  return result;
}

Identified identify_by_composite(const Files& files, const std::vector<Readings>& readings,
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

Identified identify_by_thermal(const Files& files, const std::vector<Readings>& readings,
                               const IdentifyOptions& options) {
  ThermalIdentificationResult found = identify_thermal(readings, thermal_identification(options));
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
  day.choice.groups = 3 * options.sensor_count;  // three clusters for each sensor, as in the
                                                 // packaged protocols
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

namespace {

Identified identify_by_method(const Files& files, const std::vector<Readings>& readings,
                              const IdentifyOptions& options, const Progress& progress) {
  switch (options.method) {
    case IdentifyOptions::Method::StepDiagonal:
      return identify_by_step_diagonal(files, readings, options);
    case IdentifyOptions::Method::Composite:
      return identify_by_composite(files, readings, options);
    case IdentifyOptions::Method::Thermal:
      return identify_by_thermal(files, readings, options);
    case IdentifyOptions::Method::Chain:
      break;
  }
  return identify_by_chain(files, readings, options, progress);
}

}  // namespace

Identified identified(const Files& files, const IdentifyOptions& options,
                      const Progress& progress) {
  const std::vector<Readings> readings =
      read_all(files, options.method == IdentifyOptions::Method::Thermal, progress);
  std::vector<std::string> warnings = diagnose(files, readings);
  // the chain reports its own stages
  if (progress && options.method != IdentifyOptions::Method::Chain) progress("fit", 0.0);
  try {
    Identified result = identify_by_method(files, readings, options, progress);
    std::ranges::move(size_warnings(result.belief, result.nominal), std::back_inserter(warnings));
    result.warnings.insert(result.warnings.begin(), warnings.begin(), warnings.end());
    return result;
  } catch (const std::invalid_argument& fault) {
    throw BadInput(names_of(files), 0, 0, "readings from which a machine can be identified",
                   fault.what());
  } catch (const std::out_of_range& fault) {
    throw BadInput(names_of(files), 0, 0, "readings within the range of the curves", fault.what());
  }
}

}  // namespace abbe::sim
