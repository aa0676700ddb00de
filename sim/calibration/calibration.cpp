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

/// Returns the readings of position files as tests of axes.
metrology::MachineTests position_tests(const std::vector<metrology::PositionSet>& sets,
                                       const std::string& stem) {
  metrology::MachineTests tests;
  for (const metrology::PositionSet& set : sets) {
    metrology::AxisTest test;
    test.name = set.name.empty() ? stem : set.name;
    test.angle = test.rotary = set.rotary;
    test.runs = set.runs;
    tests.axes.push_back(std::move(test));
  }
  return tests;
}

/// Returns the range of every temperature sensor.
std::vector<Evaluation::Temperatures> temperature_ranges(const metrology::Readings& readings) {
  std::vector<Evaluation::Temperatures> result;
  if (readings.plan.measurements.empty()) return result;
  for (std::size_t k = 0; k < readings.sensors.size(); ++k) {
    const auto column = readings.T_C.col(Eigen::Index(k));
    result.push_back({readings.sensors[k], column.minCoeff(), column.maxCoeff()});
  }
  return result;
}

/// Reads a file in the format that its content shows. The result is without `results`.
Evaluation read_evaluation(const std::filesystem::path& file) {
  Evaluation evaluation{file, {}, {}, {}, {}, {}, {}};
  metrology::ReadingDiagnostics diagnostics;
  const std::string text = read_text(file, std::size_t(256) << 20);
  if (is_part_readings_text(text)) {
    evaluation.part = read_part_readings(text, file.string());
    // Fewer points determine no plane.
    if (evaluation.part->readings.deviation.size() < 3)
      throw BadInput(file.string(), 0, 0, "at least 3 points of a part", "fewer");
    evaluation.kind = evaluation.part->kind;
    diagnostics = metrology::diagnose(evaluation.part->readings);
  } else if (is_readings_text(text)) {
    const metrology::Readings readings = read_readings(text, file.string());
    evaluation.kind = readings.plan.kind;
    if (readings.value.size() > 0) evaluation.tests = classify_readings(readings);
    evaluation.temperatures = temperature_ranges(readings);
    diagnostics = metrology::diagnose(readings);
  } else {
    evaluation.kind = "position file";
    evaluation.tests =
        position_tests(metrology::read_positions(text, file.string()), file.stem().string());
    diagnostics = metrology::diagnose(evaluation.tests.axes);
  }
  // A channel that no working instrument reads is an error, since a standard would give results for
  // it.
  std::vector<BadInput> errors;
  for (const std::string& error : diagnostics.errors)
    errors.emplace_back(file.string(), 0, 0, "readings of a working instrument", error);
  if (!errors.empty()) throw BadScene(std::move(errors));
  evaluation.warnings = std::move(diagnostics.warnings);
  return evaluation;
}

}  // namespace

Evaluation evaluate_readings(const std::filesystem::path& file) {
  Evaluation evaluation = read_evaluation(file);
  try {
    evaluation.results = evaluation.part ? standard_results(evaluation.part->readings)
                                         : standard_results(evaluation.tests);
  } catch (const std::invalid_argument& exception) {
    throw BadInput(file.string(), 0, 0, "readings that can be evaluated by a standard",
                   exception.what());
  }
  return evaluation;
}

namespace {

namespace identification = errors::identification;
using errors::metrology::Readings;
using identification::Estimate;
using Files = std::vector<std::filesystem::path>;

std::string file_names(const Files& files) {
  std::string text;
  for (const auto& file : files) text += (text.empty() ? "" : ", ") + file.string();
  return text;
}

/// Returns an error for each file that repeats runs of another file or its own runs.
std::vector<BadInput> repeated_files(const Files& files, const std::vector<Readings>& readings) {
  using errors::metrology::RepeatedSeries;
  std::map<std::pair<int, int>, std::vector<RepeatedSeries>> repeats_by_files;
  for (const RepeatedSeries& series : errors::metrology::repeated_series(readings))
    repeats_by_files[{series.again.file, series.first.file}].push_back(series);
  std::vector<BadInput> errors;
  for (const auto& [pair, list] : repeats_by_files) {
    const auto again = std::size_t(pair.first), first = std::size_t(pair.second);
    const std::string remaining =
        list.size() > 1 ? fmt::format("; {} more are duplicates too", list.size() - 1) : "";
    errors.emplace_back(files[again].string(), 0, 0, "separate readings for every run",
                        fmt::format("\"{}\" equals \"{}\" of {} to the last digit: it was copied, "
                                    "or rounded more coarsely than stated{}",
                                    series_text(readings[again], list.front().again),
                                    series_text(readings[first], list.front().first),
                                    files[first].string(), remaining));
  }
  return errors;
}

/// Diagnoses every file.
/// @return warnings, each with the name of its file
/// @throws BadScene with all errors
std::vector<std::string> diagnose(const Files& files, const std::vector<Readings>& readings) {
  std::vector<std::string> warnings;
  std::vector<BadInput> errors;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const errors::metrology::ReadingDiagnostics diagnostics =
        errors::metrology::diagnose(readings[i]);
    for (const std::string& error : diagnostics.errors)
      errors.emplace_back(files[i].string(), 0, 0, "readings of a working instrument", error);
    for (const std::string& warning : diagnostics.warnings)
      warnings.push_back(files[i].string() + ": " + warning);
  }
  std::ranges::move(repeated_files(files, readings), std::back_inserter(errors));
  if (!errors.empty()) throw BadScene(std::move(errors));
  return warnings;
}

/// Reads all files.
/// @param accepts_logs  true: a log of temperatures alone is accepted
std::vector<Readings> read_all_readings(const Files& files, bool accepts_logs,
                                        const Progress& progress) {
  std::vector<Readings> result;
  std::set<std::filesystem::path> earlier_files;
  for (const auto& file : files) {
    // Canonical paths are compared, since a file named twice would count twice.
    std::error_code ignored;
    const std::filesystem::path canonical = std::filesystem::canonical(file, ignored);
    if (!canonical.empty() && !earlier_files.insert(canonical).second)
      throw BadInput(file.string(), 0, 0, "each file only once", "the same file again");
    if (progress) progress("read", double(result.size()) / double(files.size()));
    result.push_back(read_readings_file(file));
    if (result.back().value.size() == 0 && !accepts_logs)
      throw BadInput(file.string(), 0, 0, "readings of the machine", "only a temperature log");
  }
  return result;
}

/// Returns a result with the sources and the files of the belief, for any method.
IdentificationResult initial_result(const Files& files, const std::vector<Readings>& readings,
                                    const IdentificationOptions& options) {
  IdentificationResult result{
      belief_files(options), {}, readings.front().nominal, {}, {}, {}, {}, {}, {}, {}};
  for (std::size_t i = 0; i < files.size(); ++i) {
    const errors::metrology::Plan& plan = readings[i].plan;
    result.sources.push_back({files[i], plan.instrument, plan.kind, plan.measurements.size(),
                              plan.set_ups.size(), plan.duration_s});
  }
  return result;
}

double element_unit(const errors::Element& element) {
  return element.name.is_angle() ? units::urad : units::um;
}

/// Returns the covariance without the coefficients that the model holds at their start.
errors::Covariance determined_covariance(const errors::Covariance& covariance) {
  errors::Covariance result;
  std::vector<Eigen::Index> rows;
  for (std::size_t i = 0; i < covariance.of.size(); ++i) {
    const auto k = Eigen::Index(i);
    // A coefficient that is held has no variance.
    if (!(covariance.matrix(k, k) > 0.0)) continue;
    rows.push_back(k);
    result.of.push_back(covariance.of[i]);
  }
  result.matrix = covariance.matrix(rows, rows);
  return result;
}

/// Returns the belief without undetermined curves and without elements that have no curve left. The
/// indices in the covariance are adapted.
errors::GeometricErrors determined_errors(const Estimate& estimate) {
  const errors::GeometricErrors& belief = estimate.belief;
  errors::GeometricErrors result;
  result.measuring_lines = belief.measuring_lines;
  const errors::Covariance determined = determined_covariance(belief.covariance);
  result.covariance = determined;
  for (std::size_t e = 0; e < belief.elements.size(); ++e) {
    errors::Element element{belief.elements[e].name, {}};
    for (std::size_t c = 0; c < belief.elements[e].curves.size(); ++c) {
      bool is_determined = false;
      for (std::size_t i = 0; i < determined.of.size(); ++i) {
        if (determined.of[i].element != int(e) || determined.of[i].curve != int(c)) continue;
        is_determined = true;
        result.covariance.of[i].element = int(result.elements.size());
        result.covariance.of[i].curve = int(element.curves.size());
      }
      if (is_determined) element.curves.push_back(belief.elements[e].curves[c]);
    }
    if (!element.curves.empty()) result.elements.push_back(std::move(element));
  }
  return result;
}

/// Returns the curves without any determined coefficient, at zero.
std::vector<errors::Element> undetermined_elements(const Estimate& estimate) {
  const errors::GeometricErrors& belief = estimate.belief;
  const errors::Covariance determined = determined_covariance(belief.covariance);
  std::vector<errors::Element> undetermined;
  for (std::size_t e = 0; e < belief.elements.size(); ++e) {
    errors::Element element{belief.elements[e].name, {}};
    for (std::size_t c = 0; c < belief.elements[e].curves.size(); ++c)
      if (std::ranges::none_of(determined.of, [&](const errors::Coefficient& coefficient) {
            return coefficient.element == int(e) && coefficient.curve == int(c);
          }))
        element.curves.push_back(belief.elements[e].curves[c]);
    if (!element.curves.empty()) undetermined.push_back(std::move(element));
  }
  return errors::with_values(
      undetermined, Eigen::VectorXd::Zero(Eigen::Index(errors::coefficients(undetermined).size())));
}

/// Returns the readings left out, with file and row.
std::vector<ChainFit::Outlier> outlier_list(const Files& files,
                                            const std::vector<Readings>& readings,
                                            const Estimate& estimate) {
  std::vector<ChainFit::Outlier> outliers;
  int index = 0;  // among the readings of all files, without temperatures
  for (std::size_t f = 0; f < files.size(); ++f) {
    const auto& measurements = readings[f].plan.measurements;
    for (std::size_t row = 0; row < measurements.size(); ++row) {
      if (measurements[row].channel < 0) continue;
      if (std::ranges::count(estimate.outliers, index) > 0)
        outliers.push_back({files[f], row + 1, estimate.fit_residual[index]});
      ++index;
    }
  }
  return outliers;
}

/// Returns the residuals of every file, without temperatures.
std::vector<Eigen::VectorXd> file_residuals(const std::vector<Readings>& readings,
                                            const Estimate& estimate) {
  std::vector<Eigen::VectorXd> residuals;
  Eigen::Index first = 0;
  for (const Readings& file_readings : readings) {
    const auto count = Eigen::Index(
        std::ranges::count_if(file_readings.plan.measurements,
                              [](const auto& measurement) { return measurement.channel >= 0; }));
    residuals.push_back(estimate.fit_residual.segment(first, count));
    first += count;
  }
  return residuals;
}

/// Returns true if the scatter is so large that chance causes it in less than one fit of a
/// thousand.
bool has_excess_scatter(const Estimate& estimate) {
  return estimate.reduced_chi_square >
         identification::chi_square_band(estimate.degrees_of_freedom).second;
}

const char* mistake_phrase(identification::Mistake mistake) {
  using identification::Mistake;
  switch (mistake) {
    case Mistake::Negated:
      return "with reversed sign";
    case Mistake::Reversed:
      return "in reverse order";
    case Mistake::MultipliedByThousand:
      return "multiplied by 1000";
    case Mistake::DividedByThousand:
      return "divided by 1000";
  }
  return "";
}

/// Returns the reduced chi-square of a file if it had been written with a mistake.
double corrected_reduced_chi_square(const Estimate& estimate,
                                    const identification::Alternative& alternative) {
  const identification::FitQuality& file_quality =
      estimate.quality[std::size_t(alternative.readings)];
  // With half a degree of freedom or less the ratio is meaningless.
  return file_quality.degrees_of_freedom > 0.5
             ? alternative.own_chi_square / file_quality.degrees_of_freedom
             : 0.0;
}

/// Returns the mistake that would explain a chi-square beyond chance, or an empty text. The scatter
/// of the corrected file must agree with its stated noise, since a file with very few readings fits
/// anything.
std::string mistake_text(const Files& files, const Estimate& estimate) {
  // Limits of the file's reduced chi-square after correction: its noise agrees with the stated one
  // within a factor of 2.
  constexpr double low = 0.3, high = 4.0;
  const double current = estimate.reduced_chi_square;
  const identification::Alternative* best = nullptr;
  // Distance of the fit from a reduced chi-square of 1, on a logarithmic scale, since a file may
  // also fit too well; 1e-300 avoids the logarithm of zero.
  const auto distance = [&](const identification::Alternative& alternative) {
    return std::abs(std::log(std::max(alternative.chi_square, 1e-300) /
                             std::max(1, estimate.degrees_of_freedom)));
  };
  for (const identification::Alternative& alternative : estimate.alternatives) {
    const double reduced = corrected_reduced_chi_square(estimate, alternative);
    if (reduced > low && reduced < high &&
        (best == nullptr || distance(alternative) < distance(*best)))
      best = &alternative;
  }
  // A mistake explains the misfit only if its correction removes half of it.
  if (best == nullptr || distance(*best) > 0.5 * std::abs(std::log(std::max(current, 1e-300))))
    return "";
  return fmt::format("; taken {} {} would have a reduced chi-square of {:.3g}",
                     mistake_phrase(best->mistake), files[std::size_t(best->readings)].string(),
                     best->chi_square / std::max(1, estimate.degrees_of_freedom));
}

/// Returns the name of the file whose readings fit worst, for a warning; empty for a single file.
std::string worst_file_text(const Files& files, const Estimate& estimate) {
  if (files.size() < 2 || estimate.quality.size() != files.size()) return "";
  const auto reduced = [&](std::size_t i) {
    const identification::FitQuality& file_quality = estimate.quality[i];
    return file_quality.degrees_of_freedom > 0.5
               ? file_quality.chi_square / file_quality.degrees_of_freedom
               : 0.0;
  };
  std::size_t worst = 0;
  for (std::size_t i = 1; i < files.size(); ++i)
    if (reduced(i) > reduced(worst)) worst = i;
  return fmt::format(" (most in {}, {:.2f} times)", files[worst].string(),
                     std::sqrt(reduced(worst)));
}

/// Returns true if every channel states noise or resolution.
bool has_stated_noise(const Readings& readings) {
  for (const auto& set_up : readings.plan.set_ups)
    for (const auto& channel : set_up.channels)
      if (!(errors::metrology::standard_deviation(channel) > 0.0)) return false;
  return true;
}

/// Returns warnings about files whose readings scatter less than their noise allows.
std::vector<std::string> scatter_warnings(const Files& files, const std::vector<Readings>& readings,
                                          const Estimate& estimate) {
  constexpr double too_close =
      0.5;  // relative to the expected value, which rounding lowers a little
  std::vector<std::string> warnings;
  for (std::size_t i = 0; i < files.size() && i < estimate.quality.size(); ++i) {
    const identification::FitQuality& file_quality = estimate.quality[i];
    // With fewer than 3 degrees of freedom the ratio varies too widely.
    if (!has_stated_noise(readings[i]) || file_quality.degrees_of_freedom < 3.0) continue;
    const double reduced = file_quality.chi_square / file_quality.degrees_of_freedom;
    if (reduced <
        std::min(too_close, identification::chi_square_band(file_quality.degrees_of_freedom).first))
      warnings.push_back(
          fmt::format("{}: readings scatter {:.2g} times as much as stated for the instrument "
                      "(reduced chi-square {:.2g}): check whether the unit is wrong or they are "
                      "smoothed or computed; the uncertainties are useless",
                      files[i].string(), std::sqrt(reduced), reduced));
  }
  return warnings;
}

/// Returns the assumptions about signs, orders and units of readings that no other reading checks.
std::vector<std::string> unchecked_assumptions(const Files& files, const Estimate& estimate) {
  using identification::Mistake;
  constexpr double significant_increase = 30.0;  // of chi-square; 5.5 standard deviations
  std::string signs, orders, units;
  const auto add = [&](std::string& list, const identification::Alternative& alternative) {
    const std::string file = files[std::size_t(alternative.readings)].string();
    if (list.find(file) == std::string::npos) list += (list.empty() ? "" : ", ") + file;
  };
  for (const identification::Alternative& alternative : estimate.alternatives) {
    // Readings divided by a thousand agree with any model, so that alternative is not informative.
    if (alternative.chi_square > estimate.chi_square + significant_increase ||
        alternative.mistake == Mistake::DividedByThousand)
      continue;
    add(alternative.mistake == Mistake::Negated    ? signs
        : alternative.mistake == Mistake::Reversed ? orders
                                                   : units,
        alternative);
  }
  std::vector<std::string> assumptions;
  const auto add_assumption = [&](const char* what, const std::string& list) {
    if (!list.empty())
      assumptions.push_back(fmt::format(
          "the {} of readings is taken as written because no other reading checks it: {}", what,
          list));
  };
  add_assumption("sign", signs);
  add_assumption("order", orders);
  add_assumption("unit", units);
  return assumptions;
}

/// Returns warnings about elements of the belief that are too large for any machine, over the
/// travel of the axes.
std::vector<std::string> size_warnings(const errors::GeometricErrors& belief,
                                       const kinematics::Chain& nominal) {
  kinematics::AxisVector low(nominal.size()), high(nominal.size());
  for (int j = 0; j < nominal.size(); ++j) {
    const kinematics::Joint& joint = nominal.joints()[std::size_t(j)];
    // A rotary axis with more than 100 rad of travel is endless; its errors repeat every turn.
    const bool is_endless =
        joint.motion != kinematics::Motion::Linear && joint.max - joint.min > 100;
    low[j] = is_endless ? -pi : joint.min;
    high[j] = is_endless ? pi : joint.max;
  }
  return errors::element_warnings(errors::bind(belief, nominal), low, high, {.identified = true});
}

/// Returns warnings about the scatter, the outliers and weakly determined coefficients of a fit.
std::vector<std::string> fit_warnings(const Files& files, const std::vector<Readings>& readings,
                                      const Estimate& estimate,
                                      const IdentificationOptions& options) {
  std::vector<std::string> warnings = scatter_warnings(files, readings, estimate);
  if (!warnings.empty()) warnings.back() += mistake_text(files, estimate);
  if (has_excess_scatter(estimate)) {
    const std::string mistake = mistake_text(files, estimate);
    warnings.push_back(fmt::format(
        "the readings scatter {:.2f} times as much as stated for their instruments{}, and the "
        "uncertainties were increased accordingly: {}",
        std::sqrt(estimate.reduced_chi_square), worst_file_text(files, estimate),
        !mistake.empty() ? mistake.substr(2)
        : options.choose_orders
            ? "the curves may need the screw pitch (--pitch), or the machine is not repeatable"
            : "the curves may need a higher order (--choose-orders) or the screw pitch (--pitch), "
              "or the machine is not repeatable"));
  }
  // Mistakes are rarer than 2 % of the readings; more outliers mean wrong curves or a wrong noise.
  const auto n = double(estimate.fit_residual.size());
  if (double(estimate.outliers.size()) > 0.02 * n)
    warnings.push_back(
        fmt::format("{} of {} readings were rejected as outliers: too many to be mistakes, the "
                    "curves do not fit the machine",
                    estimate.outliers.size(), n));
  std::string weak_names;
  const errors::Covariance& covariance = estimate.belief.covariance;
  for (std::size_t i = 0; i < covariance.of.size(); ++i) {
    const auto& element = estimate.belief.elements[std::size_t(covariance.of[i].element)];
    const auto k = Eigen::Index(i);
    // 50 um or urad is as large as the errors of a machine, so the coefficient is practically
    // unknown.
    if (covariance.matrix(k, k) > std::pow(50.0 * element_unit(element), 2))
      weak_names += (weak_names.empty() ? "" : ", ") +
                    errors::name_of(covariance.of[i], estimate.belief.elements);
  }
  if (!weak_names.empty())
    warnings.push_back("poorly identified by these readings (uncertainty above 50 um or urad): " +
                       weak_names);
  return warnings;
}

/// Returns warnings about pitches that no screw has, such as values in m or um.
std::vector<std::string> pitch_warnings(const std::map<char, double>& pitches) {
  constexpr double min_pitch_mm = 0.4, max_pitch_mm = 200.0;
  std::vector<std::string> warnings;
  for (const auto& [axis, pitch] : pitches)
    if (pitch < min_pitch_mm || pitch > max_pitch_mm)
      warnings.push_back(fmt::format(
          "the pitch of {} is {:g} mm: check whether it is in {} ({:g} to {:g} mm expected)", axis,
          pitch, pitch < min_pitch_mm ? "m" : "um", min_pitch_mm, max_pitch_mm));
  return warnings;
}

/// Returns the largest number of positions of a slide in any set-up.
std::size_t count_positions(const std::vector<Readings>& readings, int joint) {
  std::map<std::pair<std::size_t, int>, std::set<double>> positions;
  for (std::size_t f = 0; f < readings.size(); ++f)
    for (const auto& measurement : readings[f].plan.measurements)
      if (measurement.channel >= 0)
        // Rounded to 1 um, since positions of one target differ by less.
        positions[{f, measurement.set_up}].insert(std::round(measurement.state.q[joint] * 1e3));
  std::size_t max_count = 0;
  for (const auto& [set_up, distinct_positions] : positions)
    max_count = std::max(max_count, distinct_positions.size());
  return max_count;
}

/// Returns warnings about slides whose curves have at least as many coefficients as there are
/// positions. Such curves are undetermined between the positions.
std::vector<std::string> order_warnings(const std::vector<Readings>& readings,
                                        const IdentificationOptions& options) {
  std::vector<std::string> warnings;
  const auto& joints = readings.front().nominal.joints();
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const std::size_t positions = count_positions(readings, int(j));
    if (joints[j].motion != kinematics::Motion::Linear || positions < 2) continue;
    if (options.model.order + 1 < int(positions)) continue;
    warnings.push_back(
        fmt::format("curves of {} of order {} pass through all {} measured positions and are "
                    "undetermined between them: use a lower --order or --choose-orders",
                    joints[j].name, options.model.order, positions));
  }
  return warnings;
}

IdentificationResult identify_by_chain(const Files& files, const std::vector<Readings>& readings,
                                       IdentificationOptions options, const Progress& progress) {
  IdentificationResult result = initial_result(files, readings, options);
  ChainFit fit;
  if (progress) options.orders.progress = [&](double fraction) { progress("orders", fraction); };
  if (options.choose_orders)
    fit.orders = options.model.orders =
        identification::choose_orders(readings, options.model, options.orders).orders;
  if (progress) progress("fit", 0.0);
  // Warnings and assumptions need the alternatives.
  options.estimate.compare_mistakes = true;
  Estimate estimate = identification::estimate(
      identification::error_model(result.nominal, options.model), readings, options.estimate);
  if (!estimate.converged)
    throw std::runtime_error(
        fmt::format("{}: the fit did not converge in {} iterations and nothing was written: check "
                    "unit, sign, machine and number of the readings",
                    file_names(files), estimate.iterations));
  // Deviations that the model does not follow count as noise, so they increase the uncertainties.
  if (has_excess_scatter(estimate))
    estimate.belief.covariance.matrix *= estimate.reduced_chi_square;
  result.belief = determined_errors(estimate);
  stop_if_interrupted();
  fit.unknowns = estimate.names.size();
  fit.reduced_chi_square = estimate.reduced_chi_square;
  fit.degrees_of_freedom = estimate.degrees_of_freedom;
  fit.condition = estimate.condition;
  fit.outliers = outlier_list(files, readings, estimate);
  fit.curves = identification::curve_readings(estimate, readings);
  fit.residual_sd = file_residuals(readings, estimate);
  result.fit = std::move(fit);
  result.confounded = estimate.confounded;
  result.undetermined_curves = undetermined_elements(estimate);
  result.assumptions = unchecked_assumptions(files, estimate);
  result.warnings = fit_warnings(files, readings, estimate, options);
  std::ranges::move(pitch_warnings(options.model.pitch), std::back_inserter(result.warnings));
  if (!options.choose_orders)
    std::ranges::move(order_warnings(readings, options), std::back_inserter(result.warnings));
  return result;
}

IdentificationResult identify_by_step_diagonal(const Files& files,
                                               const std::vector<Readings>& readings,
                                               const IdentificationOptions& options) {
  if (readings.size() != 1)
    throw BadInput(file_names(files), 0, 0, "one file of step diagonals",
                   std::to_string(readings.size()));
  const std::vector<Readings> starts = identification::split_by_start(readings.front());
  std::vector<identification::StepDiagonal> results;
  for (const Readings& start : starts) results.push_back(identification::step_diagonal(start));
  const identification::StepDiagonal& first = results.front();
  IdentificationResult result = initial_result(files, readings, options);
  result.belief = first.belief;
  result.warnings = first.warnings;
  if (!first.caution.empty()) result.warnings.push_back(first.caution);
  constexpr double too_close =
      0.05;  // small: four diagonals of three components leave few contradictions
  if (has_stated_noise(readings.front()) && first.reduced_chi_square < too_close)
    result.warnings.push_back(
        fmt::format("the diagonals agree better than their noise allows (reduced chi-square "
                    "{:.2g}): check whether the unit is wrong or they are smoothed or computed",
                    first.reduced_chi_square));
  StepDiagonalFit fit{first.reduced_chi_square, options.sensors, {}};
  if (!options.sensors.empty())
    fit.trend = identification::step_diagonal_trend(
        results, identification::temperature_rise_K(starts, options.sensors));
  else if (starts.size() > 1)
    result.warnings.push_back(
        fmt::format("{} sets of diagonals, only the first is reported: name temperatures with "
                    "--sensors to regress the elements on them",
                    starts.size()));
  result.fit = std::move(fit);
  return result;
}

IdentificationResult identify_by_composite(const Files& files,
                                           const std::vector<Readings>& readings,
                                           const IdentificationOptions& options) {
  if (readings.size() != 1)
    throw BadInput(file_names(files), 0, 0, "one file of positioning from several starts",
                   std::to_string(readings.size()));
  Composite composite =
      identify_composite(readings.front(), {options.sensors, options.model.order, options.margin});
  IdentificationResult result = initial_result(files, readings, options);
  result.belief = std::move(composite.cold);
  result.thermal = std::move(composite.thermal);
  result.fit = CompositeFits{options.sensors, std::move(composite.axes)};
  result.warnings = std::move(composite.warnings);
  return result;
}

IdentificationResult identify_by_thermal(const Files& files, const std::vector<Readings>& readings,
                                         const IdentificationOptions& options) {
  ThermalIdentificationResult thermal_result =
      identify_thermal(readings, thermal_identification(options));
  IdentificationResult result = initial_result(files, readings, options);
  result.thermal = std::move(thermal_result.belief);
  result.fit = std::move(thermal_result.day);
  result.confounded = std::move(thermal_result.confounded);
  result.warnings = std::move(thermal_result.warnings);
  return result;
}

}  // namespace

ThermalIdentification thermal_identification(const IdentificationOptions& options) {
  ThermalIdentification day;
  day.elements = options.model.only;
  day.sensors = options.sensors;
  day.choice.count = options.sensor_count;
  day.choice.groups = 3 * options.sensor_count;  // three groups for each sensor, as in the
                                                 // packaged protocols
  day.margin = options.margin;
  return day;
}

BeliefFiles belief_files(const IdentificationOptions& options) {
  const std::filesystem::path& out = options.out;
  BeliefFiles files{out, out, out, {}};
  files.report.replace_extension(".json");
  files.picture.replace_extension(".png");
  if (options.method == IdentificationOptions::Method::Composite)
    files.thermal = out.parent_path() / (out.stem().string() + "_thermal.txt");
  return files;
}

namespace {

IdentificationResult identify_by_method(const Files& files, const std::vector<Readings>& readings,
                                        const IdentificationOptions& options,
                                        const Progress& progress) {
  switch (options.method) {
    case IdentificationOptions::Method::StepDiagonal:
      return identify_by_step_diagonal(files, readings, options);
    case IdentificationOptions::Method::Composite:
      return identify_by_composite(files, readings, options);
    case IdentificationOptions::Method::Thermal:
      return identify_by_thermal(files, readings, options);
    case IdentificationOptions::Method::Chain:
      break;
  }
  return identify_by_chain(files, readings, options, progress);
}

}  // namespace

IdentificationResult identified(const Files& files, const IdentificationOptions& options,
                                const Progress& progress) {
  const std::vector<Readings> readings =
      read_all_readings(files, options.method == IdentificationOptions::Method::Thermal, progress);
  std::vector<std::string> warnings = diagnose(files, readings);
  // The chain method reports its own stages.
  if (progress && options.method != IdentificationOptions::Method::Chain) progress("fit", 0.0);
  try {
    IdentificationResult result = identify_by_method(files, readings, options, progress);
    std::ranges::move(size_warnings(result.belief, result.nominal), std::back_inserter(warnings));
    result.warnings.insert(result.warnings.begin(), warnings.begin(), warnings.end());
    return result;
  } catch (const std::invalid_argument& exception) {
    throw BadInput(file_names(files), 0, 0, "readings from which a machine can be identified",
                   exception.what());
  } catch (const std::out_of_range& exception) {
    throw BadInput(file_names(files), 0, 0, "readings within the range of the curves",
                   exception.what());
  }
}

}  // namespace abbe::sim
