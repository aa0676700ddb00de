#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "sim/report/identify_text.h"

namespace abbe::sim {
namespace {

using Json = nlohmann::ordered_json;

/// Element of a number: "EXX" of "EXX[2]" and "EXX screw pitch cos 1".
std::string element_of(const std::string& number) {
  return number.substr(0, number.find_first_of("[ "));
}

/// A line an element: every number found with its standard uncertainty.
std::string numbers_text(const Json& numbers) {
  std::string text = "\nelements in um and urad, with their standard uncertainty", element;
  for (const Json& one : numbers) {
    const Json& u = one["standard_uncertainty"];
    const bool told = u.is_null() ? one["value"].get<double>() != 0.0 : u.get<double>() > 0.0;
    if (!told) continue;  // or held at its place
    const std::string name = one["name"].get<std::string>();
    if (element_of(name) != element) {
      element = element_of(name);
      text += fmt::format("\n{:<5}", element);
    }
    const std::string which = name.size() > element.size() ? name.substr(element.size()) + " " : "";
    text += fmt::format("  {}{:.3f}", which, one["value"].get<double>());
    if (!u.is_null()) text += fmt::format(" ({:.2g})", u.get<double>());
  }
  return text + "\n";
}

/// Numbers that were not found: those that no reading tells, an element a line, then those that
/// others hide; the zeros and places of set-ups among these are counted only.
std::string confounded_text(const Json& confounded) {
  std::map<std::string, int> untold;
  std::string text;
  for (const Json& one : confounded) {
    const std::string name = one["name"].get<std::string>();
    if (one["hidden_by"].empty()) {
      ++untold[element_of(name)];
      continue;
    }
    std::string with;
    int set_ups = 0;
    for (const auto& [other, share] : one["hidden_by"].items()) {
      if (other.find(": ") != std::string::npos)
        ++set_ups;
      else
        with += fmt::format("{}{:.4g} {}", with.empty() ? "" : ", ", share.get<double>(), other);
    }
    if (set_ups > 0)
      with += fmt::format("{}{} unknown{} of set-ups", with.empty() ? "" : " and ", set_ups,
                          set_ups > 1 ? "s" : "");
    text += fmt::format("\n{} is left at 0: a unit of it reads the same as {}", name, with);
  }
  std::string names;
  for (const auto& [element, count] : untold)
    names += fmt::format("{}{} ({})", names.empty() ? "" : ", ", element, count);
  if (!names.empty()) text += "\nunobservable, left out (numbers): " + names;
  return text;
}

std::string composite_text(const Json& axes) {
  std::string text;
  for (const Json& axis : axes) {
    text += fmt::format("\n{}: cold curve of {} at {:.2f} h, RMS {:.3f} um about the law\n",
                        axis["axis"].get<std::string>(), axis["zero_of_dT"].get<std::string>(),
                        axis["zero_of_dT_h"].get<double>(), axis["rms_um"].get<double>());
    for (const auto& [sensor, T_C] : axis["zero_of_dT_C"].items())
      text +=
          fmt::format("  dT = 0 at                    {:>9.2f} C  {}\n", T_C.get<double>(), sensor);
    for (const Json& slope : axis["slopes"])
      text += fmt::format("  slope from start {:<11} {:>9.4f} ({:.2g}) um/m\n",
                          slope["start"].get<int>(), slope["slope_um_per_m"].get<double>(),
                          slope["standard_error"].get<double>());
    for (const auto& [sensor, per_K] : axis["slope_um_per_m_K"].items())
      text += fmt::format("  {:<28} {:>9.4f} ({:.2g}) um/m/K\n", sensor, per_K.get<double>(),
                          axis["standard_error_um_per_m_K"][sensor].get<double>());
    if (const Json& zero = axis["slope_at_zero_of_dT_um_per_m"]; !zero.is_null())
      text += fmt::format("  {:<28} {:>9.4f} ({:.2g}) um/m, by the later starts alone\n",
                          "slope left at dT = 0", zero["value"].get<double>(),
                          zero["standard_error"].get<double>());
  }
  return text;
}

std::string thermal_text(const Json& thermal) {
  std::string text = fmt::format("\nwhat heat adds, from {} epochs\n", thermal["epochs_h"].size());
  for (const Json& term : thermal["terms"]) {
    text += fmt::format("{:<12} moved by {:.3f} {}, of which {:.2g} is left (R^2 {:.3f})\n",
                        term["name"].get<std::string>(), term["range"].get<double>(),
                        term["unit"].get<std::string>(), term["residual_sd"].get<double>(),
                        term["r_squared"].get<double>());
    for (const auto& [sensor, one] : term["per_K"].items())
      text += fmt::format("  {:<28} {:>9.4f} ({:.2g}) {}/K\n", sensor, one["value"].get<double>(),
                          one["standard_error"].get<double>(), term["unit"].get<std::string>());
  }
  for (const auto& [sensor, range] : thermal["trained_K"].items())
    text += fmt::format("{:<30} trained from {:.2f} to {:.2f} K\n", sensor, range[0].get<double>(),
                        range[1].get<double>());
  return text;
}

/// How a number follows a sensor.
struct Trend {
  std::string name, sensor, unit;
  double value = 0.0;
  std::optional<double> u;  ///< standard uncertainty; unknown where no start is to spare
  /// Of what is looked at first: how often its uncertainty it is, first of all where that is
  /// unknown.
  double weight() const {
    return !u ? HUGE_VAL : (*u > 0.0 ? std::abs(value) / *u : (value != 0.0 ? HUGE_VAL : 0.0));
  }
};

std::vector<Trend> trends_of(const Json& per_K) {
  std::vector<Trend> trends;
  for (const Json& one : per_K)
    for (const auto& [sensor, value] : one["per_K"].items()) {
      trends.push_back({one["name"], sensor, one["unit"], value, {}});
      if (const Json& u = one["standard_uncertainty"]; u.contains(sensor))
        trends.back().u = u[sensor].get<double>();
    }
  return trends;
}

/// The trends that stand out most of their uncertainty, all of a few; the others are counted.
std::string trends_text(const Json& per_K) {
  constexpr std::size_t most = 12;
  std::vector<Trend> trends = trends_of(per_K);
  const std::size_t count = trends.size(), shown = std::min(count, most);
  if (count > most)
    std::stable_sort(trends.begin(), trends.end(), [](const Trend& a, const Trend& b) {
      return std::pair(a.weight(), std::abs(a.value)) > std::pair(b.weight(), std::abs(b.value));
    });
  std::string text;
  for (std::size_t i = 0; i < shown; ++i) {
    const Trend& one = trends[i];
    text += fmt::format("\n{:<12} {:>10.4f} ({}) {} by {}", one.name, one.value,
                        one.u ? fmt::format("{:.2g}", *one.u) : "-", one.unit, one.sensor);
  }
  if (shown == count) return text;
  const double next = trends[shown].weight();
  return text + fmt::format("\nand {} more trends by temperature{}; all are in the report",
                            count - shown,
                            std::isfinite(next) ? fmt::format(", each at most {:.3g} times its "
                                                              "standard uncertainty",
                                                              next)
                                                : "");
}

}  // namespace

std::string identify_text(const Json& report) {
  std::string text =
      fmt::format("machine {}\n\n{:>10} {:>9} {:>9}   file\n", report["machine"].get<std::string>(),
                  "readings", "set-ups", "hours");
  for (const Json& one : report["readings"])
    text += fmt::format("{:>10} {:>9} {:>9.2f}   {}\n", one["readings"].get<std::size_t>(),
                        one["set_ups"].get<std::size_t>(), one["hours"].get<double>(),
                        one["file"].get<std::string>());
  if (!report["numbers"].empty()) text += numbers_text(report["numbers"]);
  text += confounded_text(report["confounded"]);
  if (report.contains("per_K")) text += trends_text(report["per_K"]);
  if (report.contains("thermal")) text += thermal_text(report["thermal"]);
  if (report.contains("composite")) {
    text += composite_text(report["composite"]);
    for (const auto& [key, file] : report["beliefs"].items())
      text += fmt::format("[belief] {}: {}\n", key, file.get<std::string>());
  }
  if (report.contains("outliers") && !report["outliers"].empty())
    text += fmt::format("\n{} readings left out as outliers; they are in the report",
                        report["outliers"].size());
  if (report.contains("reduced_chi_square"))
    text += fmt::format("\nreduced chi-square {:.3f}", report["reduced_chi_square"].get<double>());
  text += fmt::format("\n{:.1f} hours on a real machine\n", report["hours"].get<double>());
  for (const Json& warning : report["warnings"])
    text += "warning: " + warning.get<std::string>() + "\n";
  return text;
}

}  // namespace abbe::sim
