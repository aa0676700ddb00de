#include "sim/report/identify_text.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "errors/identification/model.h"
#include "kinematics/escape.h"
#include "kinematics/units.h"
#include "sim/report/identified_figures.h"

namespace abbe::sim {
namespace {

using Eigen::Index;

/// Element of a number: "EXX" of "EXX[2]" and "EXX screw pitch cos 1".
std::string element_of(const std::string& number) {
  return number.substr(0, number.find_first_of("[ "));
}

/// A line an element: every number found with its standard uncertainty.
std::string numbers_text(const errors::GeometricErrors& belief) {
  if (belief.elements.empty()) return "";
  std::string text = "\nelements in um and urad, with their standard uncertainty", element;
  for (const NumberFigure& one : number_figures(belief)) {
    const std::optional<double>& u = one.standard_uncertainty;
    if ((u ? *u : std::abs(one.value)) <= 0.0) continue;  // held at its place
    if (one.element != element) {
      element = one.element;
      text += fmt::format("\n{:<5}", element);
    }
    const std::string which =
        one.name.size() > element.size() ? one.name.substr(element.size()) + " " : "";
    text += fmt::format("  {}{:.3f}", which, one.value);
    if (u) text += fmt::format(" ({:.2g})", *u);
  }
  return text + "\n";
}

/// What hides a number: others by name, the zeros and places of set-ups counted only.
std::string hiding_text(const errors::identification::Confounded& one) {
  std::string with;
  std::set<std::string> set_ups;  // several starts share their names
  for (const auto& [other, share] : one.with) {
    if (other.find(": ") != std::string::npos)
      set_ups.insert(other);
    else
      with += fmt::format("{}{:.4g} {}", with.empty() ? "" : ", ", share, escaped(other));
  }
  if (!set_ups.empty())
    with += fmt::format("{}{} unknown{} of set-ups", with.empty() ? "" : " and ", set_ups.size(),
                        set_ups.size() > 1 ? "s" : "");
  return with;
}

/// "ECS cos 1 to 500 urad (10)": how badly a number is known, and by how much machines differ.
std::string weak_text(const errors::identification::Confounded& one) {
  const double unit = errors::identification::shown_unit(one.name);
  return fmt::format("{} to {:.2g} {} ({:.2g})", escaped(one.name), *one.standard_deviation / unit,
                     unit == units::um ? "um" : "urad",
                     errors::identification::typical_deviation(element_of(one.name)) / unit);
}

/// Numbers that were not found: those that others hide, then those that no reading depends on,
/// counted by element.
std::string confounded_text(const std::vector<errors::identification::Confounded>& confounded) {
  std::map<std::string, int> unobservable;
  std::string text, weak;
  for (const auto& one : confounded)
    if (one.standard_deviation)
      weak += (weak.empty() ? "" : ", ") + weak_text(one);
    else if (one.with.empty())
      ++unobservable[element_of(escaped(one.name))];
    else
      text += fmt::format("\n{} is left at 0: a unit of it reads the same as {}", escaped(one.name),
                          hiding_text(one));
  if (!weak.empty())
    text +=
        "\nleft at 0, since the readings determine them far worse than new machines differ (in "
        "brackets): " +
        weak;
  std::string names;
  for (const auto& [element, count] : unobservable)
    names += fmt::format("{}{} ({})", names.empty() ? "" : ", ", element, count);
  if (!names.empty()) text += "\nunobservable, left out (numbers): " + names;
  return text;
}

std::string axis_text(const CompositeAxis& axis, const std::vector<std::string>& sensors) {
  const errors::identification::CompositeFit& fit = axis.fit;
  std::string text =
      fmt::format("\n{}: cold curve of start 1 at {:.2f} h, RMS {:.3f} um about the law\n",
                  axis.axis, axis.cold_s / 3600.0, fit.rms / units::um);
  for (std::size_t k = 0; k < sensors.size(); ++k)
    text += fmt::format("  dT = 0 at                    {:>9.2f} C  {}\n", axis.cold_C[Index(k)],
                        escaped(sensors[k]));
  for (Index i = 0; i < fit.slope.size(); ++i)
    text += fmt::format("  slope from start {:<11} {:>9.4f} ({:.2g}) um/m\n",
                        fit.later[std::size_t(i)] + 1, fit.slope[i] / um_per_m,
                        fit.slope_error[i] / um_per_m);
  for (std::size_t k = 0; k < sensors.size(); ++k)
    text += fmt::format("  {:<28} {:>9.4f} ({:.2g}) um/m/K\n", escaped(sensors[k]),
                        fit.thermal[Index(k)] / um_per_m,
                        fit.slope_fit.standard_error[Index(k)] / um_per_m);
  if (axis.with_constant)
    text += fmt::format("  {:<28} {:>9.4f} ({:.2g}) um/m, by the later starts alone\n",
                        "slope left at dT = 0", axis.with_constant->constant / um_per_m,
                        axis.with_constant->standard_error[0] / um_per_m);
  return text;
}

std::string text_of(const Identified& identified, const CompositeFits& fit) {
  std::string text;
  for (const CompositeAxis& axis : fit.axes) text += axis_text(axis, fit.sensors);
  return text + fmt::format("[belief] identified: {}\n[belief] thermal: {}\n",
                            escaped(identified.files.belief.string()),
                            escaped(identified.files.thermal->string()));
}

std::string text_of(const Identified&, const ThermalDay& day) {
  std::string text = fmt::format("\nwhat heat adds, from {} epochs\n", day.epochs.size());
  for (const RegressedTerm& term : day.terms) {
    const TermFigures figures = term_figures(term);
    text += fmt::format("{:<12} moved by {:.3f} {}, of which {:.2g} is left (R^2 {:.3f})\n",
                        figures.name, figures.range, figures.unit, figures.residual_sd,
                        term.regression.r_squared);
    for (std::size_t k = 0; k < day.sensors.size(); ++k)
      text += fmt::format("  {:<28} {:>9.4f} ({:.2g}) {}/K\n", escaped(day.sensors[k]),
                          figures.per_K[Index(k)], figures.standard_error[Index(k)], figures.unit);
  }
  for (std::size_t k = 0; k < day.sensors.size(); ++k)
    text += fmt::format("{:<30} trained from {:.2f} to {:.2f} K\n", escaped(day.sensors[k]),
                        day.dT_K.col(Index(k)).minCoeff(), day.dT_K.col(Index(k)).maxCoeff());
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

std::vector<Trend> trends_of(const StepDiagonalFit& fit) {
  std::vector<Trend> trends;
  for (const TrendFigures& one : trend_figures(fit))
    for (std::size_t k = 0; k < fit.sensors.size(); ++k) {
      trends.push_back({one.name, escaped(fit.sensors[k]), one.unit, one.per_K[Index(k)], {}});
      if (one.standard_uncertainty.size() > 0) trends.back().u = one.standard_uncertainty[Index(k)];
    }
  return trends;
}

/// The trends that stand out most of their uncertainty, all of a few; the others are counted.
std::string trends_text(const StepDiagonalFit& fit) {
  constexpr std::size_t most = 12;
  std::vector<Trend> trends = trends_of(fit);
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

std::string text_of(const Identified&, const StepDiagonalFit& fit) {
  return trends_text(fit) + fmt::format("\nreduced chi-square {:.3f}", fit.reduced_chi_square);
}

std::string text_of(const Identified&, const ChainFit& fit) {
  std::string text;
  if (!fit.outliers.empty())
    text = fmt::format("\n{} readings left out as outliers; they are in the report",
                       fit.outliers.size());
  return text + fmt::format("\nreduced chi-square {:.3f}", fit.reduced_chi_square);
}

}  // namespace

std::string identify_text(const Identified& identified) {
  std::string text = fmt::format("machine {}\n\n{:>10} {:>9} {:>9}   file\n",
                                 escaped(machine_of(identified)), "readings", "set-ups", "hours");
  for (const ReadingsSource& one : identified.sources)
    text += fmt::format("{:>10} {:>9} {:>9.2f}   {}\n", one.readings, one.set_ups,
                        one.duration_s / 3600.0, escaped(one.file.string()));
  text += numbers_text(identified.belief) + confounded_text(identified.confounded);
  text += std::visit([&](const auto& fit) { return text_of(identified, fit); }, identified.fit);
  text += fmt::format("\n{:.1f} hours on a real machine\n", hours_of(identified));
  for (const std::string& assumption : identified.assumptions)
    text += "assumed: " + escaped(assumption) + "\n";
  for (const std::string& warning : identified.warnings)
    text += "warning: " + escaped(warning) + "\n";
  return text;
}

}  // namespace abbe::sim
