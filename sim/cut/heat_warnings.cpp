#include "sim/cut/heat_warnings.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::sim {
namespace {

// bearings are run below 120 deg C, windings up to 155: their insulation ends there
constexpr double coldest_T_C = -40.0, hottest_T_C = 150.0;
// Beyond what a law of power was stated for nobody knows it; 60 and 9.55 are 1/s and rad/s for rpm.
constexpr double most_times_faster = 5.0, least_of_stated = 1.0 / 30;

std::string temperature_text(const errors::ThermalRun& run) {
  Eigen::Index knot = 0, node = 0;
  const double hottest = run.T_C.maxCoeff(&knot, &node);
  if (!(hottest > hottest_T_C)) {
    const double coldest = run.T_C.minCoeff(&knot, &node);
    if (!(coldest < coldest_T_C)) return {};
  }
  return fmt::format(
      "thermal.node \"{}\" comes to {:.4g} deg C at {:.4g} h, and no machine runs beyond {:g} to "
      "{:g}: a power, capacity, conductance, speed or duration of [thermal] looks like another "
      "unit",
      run.network.nodes[std::size_t(node)].name, run.T_C(knot, node),
      run.knots[std::size_t(knot)].time_s / 3600.0, coldest_T_C, hottest_T_C);
}

/// Returns the speed that is odd beside that at which the heat of a source is stated; 0 if none is.
/// Slow turns are odd in the history alone, where nobody taps or reams.
double odd_speed(const errors::ThermalRun& run, double stated) {
  double odd = 0.0;
  for (const errors::Activity& knot : run.knots) {
    const double times = std::abs(knot.spindle_speed) / stated;
    const bool slow = times > 0.0 && times < least_of_stated && knot.time_s < 0.0;
    if (slow || times > most_times_faster) odd = std::max(odd, std::abs(knot.spindle_speed));
  }
  return odd;
}

std::string speed_text(const errors::ThermalRun& run) {
  for (const errors::HeatSource& source : run.network.sources) {
    const auto* heat = std::get_if<errors::SpindleHeat>(&source.law);
    if (heat == nullptr || heat->power_W == 0.0) continue;
    const double speed = odd_speed(run, heat->reference_speed);
    if (speed == 0.0) continue;
    return fmt::format(
        "the spindle runs at {:.4g} rpm, {:.3g} times the speed at which the heat of "
        "thermal.source \"{}\" is stated (at_rpm = {:.4g}): one of the two looks like 1/s, rad/s "
        "or "
        "1000 rpm",
        speed / units::rpm, speed / heat->reference_speed,
        run.network.nodes[std::size_t(source.node)].name, heat->reference_speed / units::rpm);
  }
  return {};
}

std::string datum_text(const DatumDescription& datum, const errors::ThermalRun& run) {
  constexpr double rounding_s = 1.0;  // durations in hours add up to no whole second
  if (datum.kind == DatumDescription::Kind::None) return {};
  const double begin_s = run.knots.front().time_s, end_s = run.knots.back().time_s;
  if (datum.time_s < begin_s - rounding_s)
    return fmt::format(
        "datum.time_h is {:.4g} and the history begins at {:.4g} h: the machine is then as at its "
        "beginning",
        datum.time_s / 3600.0, begin_s / 3600.0);
  if (datum.time_s > end_s + rounding_s)
    return fmt::format(
        "datum.time_h is {:.4g} and the program ends at {:.4g} h: a datum found before the program "
        "has a negative time",
        datum.time_s / 3600.0, end_s / 3600.0);
  return {};
}

}  // namespace

std::vector<std::string> heat_warnings(const DatumDescription& datum, const Truth& truth) {
  std::vector<std::string> warnings;
  if (!truth.heat) return warnings;
  const errors::ThermalRun& run = truth.heat->run;
  for (std::string text : {temperature_text(run), speed_text(run), datum_text(datum, run)})
    if (!text.empty()) warnings.push_back(std::move(text));
  return warnings;
}

}  // namespace abbe::sim
