#include "sim/report/belief_text.h"

#include <algorithm>

#include <fmt/format.h>

#include "errors/identification/model.h"
#include "kinematics/units.h"
#include "sim/files/versions.h"
#include "sim/readings/belief_file.h"
#include "sim/report/identified_figures.h"
#include "sim/scene/toml_text.h"
#include "sim/scene/unidentified.h"

namespace abbe::sim {
namespace {

using Eigen::Index;
using errors::identification::shown_unit;
using Comments = std::vector<std::string>;

std::string made_by() { return "identified from readings by abbe " + version() + "."; }

std::string basis(const Identified& identified) {
  return fmt::format("Machine {}, {} readings; {}.", machine_of(identified),
                     readings_of(identified), method_of(identified));
}

void add_sources(Comments& comments, const Identified& identified) {
  for (const ReadingsSource& one : identified.sources)
    comments.push_back("from " + to_toml_value(one.file.string()));
}

/// The belief with the curves of which nothing is known, at zero, behind its own.
errors::GeometricErrors completed(const Identified& identified) {
  errors::GeometricErrors errors = identified.belief;
  for (const errors::Element& element : identified.unidentified) {
    const auto at = std::ranges::find(errors.elements, element.name, &errors::Element::name);
    if (at == errors.elements.end())
      errors.elements.push_back(element);
    else
      at->curves.insert(at->curves.end(), element.curves.begin(), element.curves.end());
  }
  return errors;
}

/// What hides a number, without unknowns of set-ups, which no machine has.
std::vector<UnidentifiedNumber> unidentified_of(const Identified& identified) {
  std::vector<UnidentifiedNumber> numbers;
  for (const auto& confounded : identified.confounded) {
    if (confounded.name.find(": ") != std::string::npos) continue;
    UnidentifiedNumber number{confounded.name, {}};
    for (const auto& [other, amount] : confounded.with)
      if (other.find(": ") == std::string::npos)
        number.hidden_by.emplace_back(other,
                                      amount * shown_unit(confounded.name) / shown_unit(other));
    numbers.push_back(std::move(number));
  }
  return numbers;
}

std::string geometric_text(const Identified& identified) {
  Comments comments{"Belief about a machine, " + made_by(), basis(identified)};
  add_sources(comments, identified);
  for (const auto& one : identified.confounded)
    comments.push_back("not identified by these readings: " + one.name);
  for (const std::string& assumption : identified.assumptions)
    comments.push_back("assumed: " + assumption);
  std::string text;
  for (const std::string& comment : comments) text += "# " + comment + "\n";
  text += fmt::format("machine = {}\n", to_toml_value(machine_of(identified)));
  text += unidentified_text(unidentified_of(identified));
  return text + to_errors_file(completed(identified), identified.nominal.joints());
}

std::string day_text(const Identified& identified, const ThermalDay& day) {
  Comments comments{"What heat does to a machine, by temperatures; " + made_by(), basis(identified),
                    "Changes of temperature count from the first row that a control reads."};
  add_sources(comments, identified);
  for (std::size_t k = 0; k < day.sensors.size(); ++k)
    comments.push_back(fmt::format("trained: {} from {:.2f} to {:.2f} K, held {:.0f} % beyond",
                                   day.sensors[k], day.dT_K.col(Index(k)).minCoeff(),
                                   day.dT_K.col(Index(k)).maxCoeff(), 100.0 * day.margin));
  for (const RegressedTerm& term : day.terms) {
    const TermFigures figures = term_figures(term);
    comments.push_back(fmt::format(
        "{}: moved by {:.3g} {}, of which these temperatures leave {:.2g} (standard deviation)",
        figures.name, figures.range, figures.unit, figures.residual_sd));
  }
  return to_text(identified.thermal, comments);
}

}  // namespace

std::string belief_text(const Identified& identified) {
  const auto* day = std::get_if<ThermalDay>(&identified.fit);
  return day ? day_text(identified, *day) : geometric_text(identified);
}

std::string thermal_half_text(const Identified& composite) {
  const auto& fit = std::get<CompositeFits>(composite.fit);
  Comments comments{
      "Slopes of positioning by temperatures, the thermal half of a composite belief; " + made_by(),
      "The cold half is " + composite.files.belief.filename().string() +
          ", which holds the cold slope; at the temperatures of its start these slopes are zero."};
  for (const CompositeAxis& axis : fit.axes) {
    std::string cold;
    for (std::size_t k = 0; k < fit.sensors.size(); ++k)
      cold += fmt::format("{}{} {:.2f} C", cold.empty() ? "" : ", ", fit.sensors[k],
                          axis.cold_C[Index(k)]);
    comments.push_back(
        fmt::format("{}: cold at start 1, {:.2f} h: {}", axis.axis, axis.cold_s / 3600.0, cold));
  }
  add_sources(comments, composite);
  return to_text(composite.thermal, comments);
}

}  // namespace abbe::sim
