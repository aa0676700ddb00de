#include "sim/calibration/identify.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "errors/identification/curve_readings.h"
#include "errors/identification/step_diagonal.h"
#include "kinematics/topology.h"
#include "kinematics/units.h"
#include "sim/calibration/identify_composite.h"
#include "sim/calibration/identify_thermal.h"
#include "sim/files/progress.h"
#include "sim/files/versions.h"
#include "sim/readings/belief_file.h"
#include "sim/readings/readings_file.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {
namespace {

namespace identification = errors::identification;
using errors::metrology::Readings;
using identification::Estimate;
using Json = nlohmann::ordered_json;
using Files = std::vector<std::filesystem::path>;

std::string names_of(const Files& files) {
  std::string text;
  for (const auto& file : files) text += (text.empty() ? "" : ", ") + file.string();
  return text;
}

/// @param logs_too  a log of temperatures alone is a file as well
std::vector<Readings> read_all(const Files& files, bool logs_too) {
  std::vector<Readings> all;
  std::set<std::filesystem::path> seen;
  for (const auto& file : files) {
    std::error_code ignored;
    const std::filesystem::path canonical = std::filesystem::canonical(file, ignored);
    if (!canonical.empty() && !seen.insert(canonical).second)
      throw BadInput(file.string(), 0, 0, "each file once", "it again");
    all.push_back(read_readings_file(file));
    if (all.back().value.size() == 0 && !logs_too)
      throw BadInput(file.string(), 0, 0, "readings of the machine", "a log of temperatures alone");
  }
  return all;
}

Json sources_json(const Files& files, const std::vector<Readings>& readings) {
  Json list = Json::array();
  for (std::size_t i = 0; i < files.size(); ++i)
    list.push_back({{"file", files[i].string()},
                    {"instrument", readings[i].plan.instrument},
                    {"kind", readings[i].plan.kind},
                    {"readings", readings[i].plan.looks.size()},
                    {"set_ups", readings[i].plan.set_ups.size()},
                    {"hours", readings[i].plan.duration_s / 3600.0}});
  return list;
}

double hours_of(const std::vector<Readings>& readings) {
  double hours = 0.0;
  for (const Readings& one : readings) hours += one.plan.duration_s / 3600.0;
  return hours;
}

std::string machine_of(const kinematics::Chain& chain) {
  return kinematics::to_string(kinematics::topology_of(chain.joints()));
}

double unit_of_value(const errors::Element& element) {
  return element.name.is_angle() ? units::urad : units::um;
}

/// Every number with its standard uncertainty, in um or urad; null where it was not found.
Json numbers_json(const errors::GeometricErrors& belief) {
  std::map<std::string, double> sigma;
  const errors::Covariance& covariance = belief.covariance;
  for (std::size_t i = 0; i < covariance.of.size(); ++i)
    sigma[errors::name_of(covariance.of[i], belief.elements)] =
        std::sqrt(std::max(0.0, covariance.matrix(Eigen::Index(i), Eigen::Index(i))));
  Json numbers = Json::array();
  const auto all = errors::coefficients(belief.elements);
  const Eigen::VectorXd values = errors::values(belief.elements);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const errors::Element& element = belief.elements[std::size_t(all[i].element)];
    const std::string name = errors::name_of(all[i], belief.elements);
    const double unit = unit_of_value(element);
    const auto known = sigma.find(name);
    numbers.push_back({{"name", name},
                       {"unit", element.name.is_angle() ? "urad" : "um"},
                       {"value", values[Eigen::Index(i)] / unit},
                       {"standard_uncertainty",
                        known == sigma.end() ? Json(nullptr) : Json(known->second / unit)}});
  }
  return numbers;
}

Json confounded_json(const std::vector<identification::Confounded>& list) {
  Json result = Json::array();
  for (const identification::Confounded& one : list) {
    Json with = Json::object();
    for (const auto& [name, share] : one.with) with[name] = share;
    result.push_back({{"name", one.name}, {"hidden_by", with}});
  }
  return result;
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

/// What a belief file holds of a model: curves of which no number was found are left out, and so
/// are the elements of which nothing is left.
errors::GeometricErrors told(const Estimate& estimate) {
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

std::vector<std::string> comments_of(const Json& report) {
  std::vector<std::string> comments{
      "Belief about a machine, identified from readings by abbe " +
          versions()["abbe"].get<std::string>() + ".",
      fmt::format("Machine {}, {} readings; {}.", report["machine"].get<std::string>(),
                  report["count"].get<std::size_t>(), report["method"].get<std::string>())};
  for (const Json& one : report["readings"])
    comments.push_back("from " + to_toml_value(one["file"].get<std::string>()));
  for (const Json& one : report["confounded"])
    comments.push_back("not identified by these readings: " + one["name"].get<std::string>());
  return comments;
}

/// A report and its belief as a text, without curves or a thermal half.
Identified identified(Json report, const errors::GeometricErrors& belief,
                      const kinematics::Chain& nominal) {
  const std::string text = to_errors_file(belief, nominal.joints(), comments_of(report));
  return {std::move(report), text, "", {}, nominal};
}

Json common_report(const Files& files, const std::vector<Readings>& readings) {
  std::size_t count = 0;
  for (const Readings& one : readings) count += one.plan.looks.size();
  return {{"machine", machine_of(readings.front().nominal)},
          {"readings", sources_json(files, readings)},
          {"count", count},
          {"hours", hours_of(readings)}};
}

/// Readings that were left out: file, number of its row and residual in standard deviations.
Json outliers_json(const Files& files, const std::vector<Readings>& readings,
                   const Estimate& estimate) {
  Json list = Json::array();
  int first = 0;
  for (std::size_t f = 0; f < files.size(); ++f) {
    const auto& looks = readings[f].plan.looks;
    int at = first;
    for (std::size_t row = 0; row < looks.size(); ++row) {
      if (looks[row].channel < 0) continue;
      if (std::count(estimate.outliers.begin(), estimate.outliers.end(), at) > 0)
        list.push_back({{"file", files[f].string()},
                        {"row", row + 1},
                        {"residual_sd", estimate.fit_residual[at]}});
      ++at;
    }
    first = at;
  }
  return list;
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
                    IdentifyOptions options) {
  const kinematics::Chain& nominal = readings.front().nominal;
  Json report = common_report(files, readings);
  if (options.choose_orders) {
    const auto choice = identification::choose_orders(readings, options.model, options.orders);
    options.model.orders = choice.orders;
    report["orders"] = choice.orders;
  }
  Estimate estimate = identification::estimate(identification::model_of(nominal, options.model),
                                               readings, options.estimate);
  // what the model does not follow counts as noise
  if (scatters(estimate)) estimate.belief.covariance.matrix *= estimate.reduced_chi_square;
  const errors::GeometricErrors belief = told(estimate);
  stop_if_interrupted();
  report["method"] = "least squares on the exact chain";
  report["unknowns"] = estimate.names.size();
  report["found"] = belief.covariance.of.size();
  report["reduced_chi_square"] = estimate.reduced_chi_square;
  report["degrees_of_freedom"] = estimate.degrees_of_freedom;
  report["condition"] = estimate.condition;
  report["outliers"] = outliers_json(files, readings, estimate);
  report["confounded"] = confounded_json(estimate.confounded);
  report["numbers"] = numbers_json(belief);
  report["warnings"] = warnings_of(estimate, options);
  Identified found = identified(std::move(report), belief, nominal);
  found.curves = identification::curve_readings(estimate, readings);
  return found;
}

/// Readings of four step diagonals each, as they follow one another.
std::vector<Readings> fours_of(const Readings& all) {
  std::vector<Readings> result;
  const std::size_t n = all.plan.set_ups.size();
  if (n % 4 != 0) return {all};  // which step_diagonal refuses with a sentence
  for (std::size_t first = 0; first < n; first += 4) {
    Readings four{
        {all.plan.instrument, all.plan.kind, {}, {}, 0.0}, all.nominal, {}, all.sensors, {}};
    four.plan.set_ups.assign(all.plan.set_ups.begin() + std::ptrdiff_t(first),
                             all.plan.set_ups.begin() + std::ptrdiff_t(first + 4));
    std::vector<Eigen::Index> rows;
    for (std::size_t i = 0; i < all.plan.looks.size(); ++i) {
      const auto set_up = std::size_t(all.plan.looks[i].set_up);
      if (set_up < first || set_up >= first + 4) continue;
      rows.push_back(Eigen::Index(i));
      four.plan.looks.push_back(all.plan.looks[i]);
      four.plan.looks.back().set_up -= int(first);
    }
    four.value = all.value(rows);
    four.T_C = all.T_C(rows, Eigen::all);
    result.push_back(std::move(four));
  }
  return result;
}

/// Mean temperatures of the sensors during each of them, less those of the first. (fours x sensors)
Eigen::MatrixXd warmed_K(const std::vector<Readings>& fours,
                         const std::vector<std::string>& sensors) {
  const std::vector<std::string>& known = fours.front().sensors;
  Eigen::MatrixXd T_C(Eigen::Index(fours.size()), Eigen::Index(sensors.size()));
  for (std::size_t k = 0; k < sensors.size(); ++k) {
    const auto found = std::find(known.begin(), known.end(), sensors[k]);
    if (found == known.end())
      throw std::invalid_argument("expected a sensor that was logged, seen " + sensors[k]);
    for (std::size_t i = 0; i < fours.size(); ++i)
      T_C(Eigen::Index(i), Eigen::Index(k)) = fours[i].T_C.col(found - known.begin()).mean();
  }
  const Eigen::RowVectorXd cold = T_C.row(0);
  return T_C.rowwise() - cold;
}

Json trend_json(const identification::StepDiagonalTrend& trend,
                const std::vector<std::string>& sensors) {
  Json list = Json::array();
  for (std::size_t v = 0; v < trend.names.size(); ++v) {
    const auto row = Eigen::Index(v);
    const bool is_length = trend.names[v].find('[') != std::string::npos;
    Json per_K = Json::object(), sigma = Json::object();
    for (std::size_t k = 0; k < sensors.size(); ++k) {
      const double unit = is_length ? units::um : 1e-6;  // slopes are um/m, squareness urad
      per_K[sensors[k]] = trend.per_K(row, Eigen::Index(k)) / unit;
      if (trend.per_K_sigma.size() > 0)
        sigma[sensors[k]] = trend.per_K_sigma(row, Eigen::Index(k)) / unit;
    }
    list.push_back({{"name", trend.names[v]},
                    {"unit", is_length ? "um/K" : "um/m/K or urad/K"},
                    {"per_K", per_K},
                    {"standard_uncertainty", sigma}});
  }
  return list;
}

Identified by_step_diagonal(const Files& files, const std::vector<Readings>& readings,
                            const IdentifyOptions& options) {
  if (readings.size() != 1)
    throw BadInput(names_of(files), 0, 0, "one file of step diagonals",
                   std::to_string(readings.size()));
  const std::vector<Readings> fours = fours_of(readings.front());
  std::vector<identification::StepDiagonal> results;
  for (const Readings& four : fours) results.push_back(identification::step_diagonal(four));
  const identification::StepDiagonal& first = results.front();
  Json report = common_report(files, readings);
  report["method"] = "step diagonal as published: 12 elements of translation";
  report["found"] = first.belief.covariance.of.size();
  report["reduced_chi_square"] = first.reduced_chi_square;
  report["confounded"] = Json::array();
  report["numbers"] = numbers_json(first.belief);
  report["warnings"] = first.warnings;
  if (!first.caution.empty()) report["warnings"].push_back(first.caution);
  if (options.sensors.empty() && fours.size() > 1)
    report["warnings"].push_back(fmt::format(
        "{} sets of diagonals, of which the first is reported: name temperatures by --sensors to "
        "have the elements regressed on them",
        fours.size()));
  if (!options.sensors.empty())
    report["per_K"] =
        trend_json(identification::step_diagonal_trend(results, warmed_K(fours, options.sensors)),
                   options.sensors);
  return identified(std::move(report), first.belief, readings.front().nominal);
}

std::vector<std::string> slope_comments(const std::filesystem::path& out, const Json& report) {
  std::vector<std::string> comments{
      "Slopes of positioning by temperatures, the thermal half of a composite belief; identified "
      "from "
      "readings by abbe " +
          versions()["abbe"].get<std::string>() + ".",
      "The cold half is " + out.filename().string() +
          ", which holds the cold slope; at the temperatures of its start these slopes are zero."};
  for (const Json& axis : report["composite"]) {
    std::string cold;
    for (const auto& [sensor, T_C] : axis["zero_of_dT_C"].items())
      cold += fmt::format("{}{} {:.2f} C", cold.empty() ? "" : ", ", sensor, T_C.get<double>());
    comments.push_back(fmt::format("{}: cold at {}, {:.2f} h: {}", axis["axis"].get<std::string>(),
                                   axis["zero_of_dT"].get<std::string>(),
                                   axis["zero_of_dT_h"].get<double>(), cold));
  }
  for (const Json& one : report["readings"])
    comments.push_back("from " + to_toml_value(one["file"].get<std::string>()));
  return comments;
}

Identified by_composite(const Files& files, const std::vector<Readings>& readings,
                        const IdentifyOptions& options) {
  if (readings.size() != 1)
    throw BadInput(names_of(files), 0, 0, "one file of positioning from several starts",
                   std::to_string(readings.size()));
  const Composite composite =
      identify_composite(readings.front(), {options.sensors, options.model.order, options.margin});
  Json report = common_report(files, readings);
  report["method"] = "composite: cold curve, and slopes regressed on temperatures";
  report["confounded"] = Json::array();
  report["numbers"] = numbers_json(composite.cold);
  report["composite"] = composite.axes;
  report["beliefs"] = {{"identified", options.out.string()},
                       {"thermal", thermal_file(options.out).string()}};
  report["warnings"] = composite.warnings;
  const std::string slopes = to_text(composite.thermal, slope_comments(options.out, report));
  Identified found = identified(std::move(report), composite.cold, readings.front().nominal);
  found.thermal_belief = slopes;
  return found;
}

std::vector<std::string> thermal_comments(const Json& report) {
  const Json& thermal = report["thermal"];
  std::vector<std::string> comments{
      "What heat does to a machine, by temperatures; identified from readings by abbe " +
          versions()["abbe"].get<std::string>() + ".",
      fmt::format("Machine {}, {} readings; {}.", report["machine"].get<std::string>(),
                  report["count"].get<std::size_t>(), report["method"].get<std::string>()),
      "Changes of temperature count from the first row that a control reads."};
  for (const Json& one : report["readings"])
    comments.push_back("from " + to_toml_value(one["file"].get<std::string>()));
  for (const auto& [sensor, range] : thermal["trained_K"].items())
    comments.push_back(fmt::format("trained: {} from {:.2f} to {:.2f} K, held {:.0f} % beyond",
                                   sensor, range[0].get<double>(), range[1].get<double>(),
                                   100.0 * thermal["margin"].get<double>()));
  for (const Json& term : thermal["terms"])
    comments.push_back(fmt::format(
        "{}: moved by {:.3g} {}, of which these temperatures leave {:.2g} (standard deviation)",
        term["name"].get<std::string>(), term["range"].get<double>(),
        term["unit"].get<std::string>(), term["residual_sd"].get<double>()));
  return comments;
}

Identified by_thermal(const Files& files, const std::vector<Readings>& readings,
                      const IdentifyOptions& options) {
  ThermalIdentification day;
  day.elements = options.model.only;
  day.sensors = options.sensors;
  day.choice.count = options.sensor_count;
  day.choice.groups = 3 * options.sensor_count;  // as the packaged protocols choose
  day.margin = options.margin;
  const IdentifiedThermal found = identify_thermal(readings, day);
  Json report = common_report(files, readings);
  report["method"] =
      "thermal: elements at every start on the exact chain, regressed on temperatures";
  report["confounded"] = confounded_json(found.confounded);
  report["numbers"] = Json::array();
  report["thermal"] = found.report;
  report["warnings"] = found.warnings;
  const std::string belief = to_text(found.belief, thermal_comments(report));
  return {std::move(report), belief, "", {}, readings.front().nominal};
}

}  // namespace

std::filesystem::path thermal_file(const std::filesystem::path& out) {
  return out.parent_path() / (out.stem().string() + "_thermal.txt");
}

Identified identified(const Files& files, const IdentifyOptions& options) {
  const std::vector<Readings> readings =
      read_all(files, options.method == IdentifyOptions::Method::Thermal);
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
    return by_chain(files, readings, options);
  } catch (const std::invalid_argument& fault) {
    throw BadInput(names_of(files), 0, 0, "readings from which a machine can be identified",
                   fault.what());
  } catch (const std::out_of_range& fault) {
    throw BadInput(names_of(files), 0, 0, "readings within the range of the curves", fault.what());
  }
}

}  // namespace abbe::sim
