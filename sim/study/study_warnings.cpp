#include "sim/study/study_warnings.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "errors/coefficients.h"
#include "kinematics/numbers.h"
#include "sim/scene/key_unit.h"
#include "sim/scene/scene.h"
#include "sim/scene/toml_tree.h"
#include "sim/scene/value_warnings.h"
#include "sim/study/study_inputs.h"

namespace abbe::sim::study {
namespace {

// a P95 of fewer has no case beyond it to be seen
constexpr std::uint64_t fewest_cases = 100;
// Of a factor of an element: machines differ by their own size, a few times that at most.
constexpr double widest_factor = 5.0;
// A factor of 7 for one standard deviation: nothing of a machine is so uncertain.
constexpr double widest_logarithm = 2.0;
// Of a length: no machine and no tool is known to 20 nm.
constexpr double finest_mm = 2e-5;
constexpr double widest_tool_mm = 1.0;  // as of the actual sizes of tools, value_warnings.cpp
constexpr double least_left = 0.2;      // of a standard deviation, between `low` and `high`
// Beyond them the distribution has one case in 370 and in 1e23.
constexpr double farthest_centre = 3.0, farthest_sweep = 10.0;

/// "errors.EXX.0.coefficients_um.1" without the indices: "errors.EXX.coefficients_um".
std::string without_indices(const std::string& path) {
  std::string key;
  for (std::size_t at = 0; at <= path.size();) {
    const std::size_t dot = std::min(path.find('.', at), path.size());
    const std::string part = path.substr(at, dot - at);
    if (!std::ranges::all_of(part, [](unsigned char c) { return std::isdigit(c) != 0; }))
      key += (key.empty() ? "" : ".") + part;
    at = dot + 1;
  }
  return key;
}

/// What a spread of a number of an element looks like: of um and urad as those of a clamping.
std::string mistaken_number(const std::string& unit, double spread) {
  return probable_mistake("setup.EX_" + unit, spread);
}

/// What a spread of the number at a key looks like.
/// @param centre  of that number
std::string mistaken_spread(const std::string& key, double centre, double spread) {
  const std::string unit = unit_name(key);
  const bool of_machine = key.starts_with("errors.") || key.starts_with("setup.");
  if (of_machine && (unit == "um" || unit == "urad")) return mistaken_number(unit, spread);
  if (key.ends_with("_C")) return probable_mistake(key, spread);
  if (key.ends_with("scale") && spread > widest_factor) return "percent";
  if (unit != "mm") return {};
  if (spread < finest_mm) return "m";
  if (centre != 0.0 && spread >= std::abs(centre)) return "um, as it is as large as its centre";
  return key.starts_with("tool.actual.") && spread > widest_tool_mm ? "um" : "";
}

/// Whether a belief states how uncertain a number is, and not the study.
bool is_of_belief(const std::string& number, const Study& study, const Scene& scene) {
  const errors::GeometricErrors& belief = scene.geometric;
  const auto is_it = [&](const errors::Coefficient& one) {
    return errors::name_of(one, belief.elements) == number;
  };
  return std::ranges::any_of(belief.covariance.of, is_it) ||
         std::ranges::find(study.unidentified, number, &Unidentified::number) !=
             study.unidentified.end();
}

std::string mistaken_spread(const Input& input) {
  const Distribution& d = input.distribution;
  if (d.kind == Distribution::Kind::LogNormal)
    return d.spread > widest_logarithm ? "one in the unit of the path or in percent, and it is of "
                                         "the logarithm"
                                       : "";
  if (!input.element.empty()) return d.spread > widest_factor ? "percent" : "";
  if (!input.number.empty()) return mistaken_number(input.unit, d.spread);
  for (const Setting& setting : input.settings)
    if (std::string mistake =
            mistaken_spread(without_indices(setting.path), setting.factor * d.centre,
                            std::abs(setting.factor) * d.spread);
        !mistake.empty())
      return mistake;
  return {};
}

std::string value_text(const Input& input, double value) {
  return fmt::format("{:.6g}{}{}", value, input.unit.empty() ? "" : " ", input.unit);
}

/// Spreads between two values of a distribution.
double spreads_between(const Distribution& d, double from, double to) {
  if (d.kind != Distribution::Kind::LogNormal) return std::abs(to - from) / d.spread;
  return from > 0.0 && to > 0.0 ? std::abs(std::log(to / from)) / d.spread : infinity;
}

void add_spread(const Input& input, std::vector<std::string>& warnings) {
  const Distribution& d = input.distribution;
  if (const std::string mistake = mistaken_spread(input); !mistake.empty())
    warnings.push_back(fmt::format("the spread of input \"{}\" is {}: looks like {}", input.name,
                                   value_text(input, d.spread), mistake));
  Distribution uncut = d;
  uncut.low = -infinity;
  uncut.high = infinity;
  const double stated = moments(uncut).standard_deviation, left = moments(d).standard_deviation;
  if (left < least_left * stated)
    warnings.push_back(fmt::format(
        "low and high of input \"{}\" leave a standard deviation of {}, and its spread makes {}: "
        "they are in the unit of its centre, neither multiples of the spread nor differences",
        input.name, value_text(input, left), value_text(input, stated)));
}

/// The base machine of a study has every input at its centre: it should be that of the scene.
void add_centre(const Input& input, const Scene& scene, std::vector<std::string>& warnings) {
  const Distribution& d = input.distribution;
  for (const Setting& setting : input.settings) {
    const std::optional<double> number = stated_number(scene, setting.path);
    if (!number || setting.factor == 0.0) continue;
    const double stated = *number / setting.factor;
    const double apart = spreads_between(d, d.centre, stated);
    if (apart <= farthest_centre) continue;
    warnings.push_back(fmt::format(
        "the centre of input \"{}\" is {}, {:.3g} spreads from the {} that the scene states: the "
        "study's machine is another one than the scene's",
        input.name, value_text(input, d.centre), apart, value_text(input, stated)));
    return;
  }
}

/// The element of the errors that an input changes: "EC0Y"; empty if it changes none.
std::string element_of(const Input& input) {
  if (!input.element.empty()) return input.element;
  if (!input.number.empty()) return input.number.substr(0, input.number.find_first_of("[ "));
  if (input.settings.empty()) return {};
  const std::string path = without_indices(input.settings.front().path), root = "errors.";
  if (!path.starts_with(root)) return {};
  const std::string name = path.substr(root.size(), path.find('.', root.size()) - root.size());
  return std::string(stem_of(name));
}

/// A factor of an element and a number of it, both uncertain, count one error twice.
void add_shared_elements(const Study& study, std::vector<std::string>& warnings) {
  std::map<std::string, std::string> factors;
  for (const Input& input : study.inputs)
    if (!input.element.empty()) factors.emplace(input.element, input.name);
  for (const Input& input : study.inputs) {
    if (!input.element.empty()) continue;
    const auto factor = factors.find(element_of(input));
    if (factor != factors.end())
      warnings.push_back(
          fmt::format("inputs \"{}\" and \"{}\" both change {}: its error counts twice", input.name,
                      factor->second, factor->first));
  }
}

void add_sweep(const Study& study, const Sweep& sweep, std::vector<std::string>& warnings) {
  const Input& input = study.inputs[std::size_t(sweep.input)];
  const Distribution& d = input.distribution;
  double farthest = d.centre;
  for (const double value : sweep.values)
    if (spreads_between(d, d.centre, value) > spreads_between(d, d.centre, farthest))
      farthest = value;
  if (spreads_between(d, d.centre, farthest) > farthest_sweep)
    warnings.push_back(fmt::format(
        "the sweep of input \"{}\" goes to {}, {:.3g} spreads from its centre {}: its values are "
        "those of the input itself",
        input.name, value_text(input, farthest), spreads_between(d, d.centre, farthest),
        value_text(input, d.centre)));
}

}  // namespace

std::vector<std::string> study_warnings(const Study& study, const Scene& scene) {
  std::vector<std::string> warnings;
  for (const Input& input : study.inputs) {
    if (!is_of_belief(input.number, study, scene)) add_spread(input, warnings);
    add_centre(input, scene, warnings);
  }
  add_shared_elements(study, warnings);
  for (const Sweep& sweep : study.sweeps) add_sweep(study, sweep, warnings);
  // the text is the study as it was understood, so lines of it are not those of the file
  for (std::string& text : value_warnings(parse_toml(study.text, "")))
    warnings.push_back(std::move(text));
  if (study.monte_carlo && study.monte_carlo->cases < fewest_cases)
    warnings.push_back(fmt::format(
        "monte_carlo.cases is {}: P95 and P99 of fewer than {} machines are extremes of a few",
        study.monte_carlo->cases, fewest_cases));
  return warnings;
}

}  // namespace abbe::sim::study
