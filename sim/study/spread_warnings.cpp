#include "sim/study/spread_warnings.h"

#include <algorithm>
#include <cctype>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/scene/key_unit.h"
#include "sim/scene/value_warnings.h"

namespace abbe::sim::study {
namespace {

// a P95 of fewer has no case beyond it to be seen
constexpr std::uint64_t fewest_cases = 100;
// Of a factor of an element: machines differ by their own size, a few times that at most.
constexpr double widest_factor = 5.0;

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

std::string mistaken_spread(const Input& input) {
  const Distribution& d = input.distribution;
  if (d.kind == Distribution::Kind::LogNormal) return {};  // of the logarithm: no unit
  if (!input.element.empty()) return d.spread > widest_factor ? "percent" : "";
  if (!input.number.empty()) return mistaken_number(input.unit, d.spread);
  for (const Setting& setting : input.settings) {
    const double spread = std::abs(setting.factor) * d.spread;
    const std::string key = without_indices(setting.path);
    const bool of_errors =
        key.starts_with("errors.") && (key.ends_with("_um") || key.ends_with("_urad"));
    const bool large = unit_name(key) == "mm" && d.centre != 0.0 && spread >= std::abs(d.centre);
    std::string mistake = of_errors ? mistaken_number(unit_name(key), spread)
                          : large   ? "um, as it is as large as its centre"
                          : key.ends_with("scale") && spread > widest_factor ? "percent"
                                                                             : "";
    if (!mistake.empty()) return mistake;
  }
  return {};
}

}  // namespace

std::vector<std::string> spread_warnings(const Study& study) {
  std::vector<std::string> warnings;
  for (const Input& input : study.inputs)
    if (const std::string mistake = mistaken_spread(input); !mistake.empty())
      warnings.push_back(fmt::format("the spread of input \"{}\" is {:.6g}{}{}: looks like {}",
                                     input.name, input.distribution.spread,
                                     input.unit.empty() ? "" : " ", input.unit, mistake));
  const auto add_limit = [&](const std::string& key, double limit_mm) {
    const double limit_um = limit_mm / units::um;
    if (const std::string mistake = probable_mistake("limits.pv_um", limit_um); !mistake.empty())
      warnings.push_back(fmt::format("{} is {:.6g}: looks like {}", key, limit_um, mistake));
  };
  for (const auto& [response, limit] : study.limits)
    add_limit(fmt::format("limits.{}_um", name_of(response)), limit);
  if (study.tolerance) add_limit("tolerance.limit_um", study.tolerance->limit);
  if (study.monte_carlo && study.monte_carlo->cases < fewest_cases)
    warnings.push_back(fmt::format(
        "monte_carlo.cases is {}: P95 and P99 of fewer than {} machines are extremes of a few",
        study.monte_carlo->cases, fewest_cases));
  return warnings;
}

}  // namespace abbe::sim::study
