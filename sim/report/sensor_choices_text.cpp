#include "sim/report/sensor_choices_text.h"

#include <fmt/format.h>

#include "kinematics/escape.h"
#include "kinematics/units.h"
#include "sim/report/sensor_choices_json.h"

namespace abbe::sim {
namespace {

std::string begin_text(const DegreeStart& begin) {
  if (!begin.at)
    return fmt::format("    {} takes no part: it drifts within its noise\n",
                       escaped(begin.channel));
  return fmt::format(
      "    degrees with {} begin at {:.3f} h, its first drift beyond noise, {:.2f} um\n",
      escaped(begin.channel), begin.at->since_start_s / 3600.0, begin.at->drift / units::um);
}

/// Empty for a tilt or where no model could be fitted.
std::string displacement_text(const ChannelGrade& channel) {
  if (!channel.fitted.model || channel.angle) return "";
  std::string text = fmt::format("    {}: {:.3f} um on the day that chose", escaped(channel.name),
                                 channel.in_cycle.rms / units::um);
  for (const DayGrade& day : channel.other_days)
    text += fmt::format(", {:.3f} of {:.1f} um on {}", day.left.rms / units::um,
                        day.drift_range / units::um, escaped(day.day));
  return text + "\n";
}

/// "8 (100 %, rank 1 to 2), 12 (64 %, rank 2 to 5)" of what is chosen by a tenth of the draws or
/// more.
std::string spread_text(const GradedWay& way, const std::vector<std::string>& sensors) {
  constexpr double seldom = 0.1;
  if (!way.spread || way.spread->draws == 0) return "";
  const errors::identification::ChoiceSpread& spread = *way.spread;
  std::string text;
  for (const int i : errors::identification::ranking(spread.chosen)) {
    if (spread.chosen[i] < seldom) break;
    text += fmt::format("{}{} {:.0f} %", text.empty() ? "" : ", ", escaped(sensors[std::size_t(i)]),
                        100.0 * spread.chosen[i]);
    if (const int best = spread.best_rank[std::size_t(i)],
        worst = spread.worst_rank[std::size_t(i)];
        best > 0)
      text += best == worst ? fmt::format(" (degree {}.)", best)
                            : fmt::format(" (degree {}. to {}.)", best, worst);
  }
  return fmt::format(
      "    over start rows 0 to {} and noise, {} draws: {}; the same sensors in {:.0f} %\n",
      spread.last_start, spread.draws, text, 100.0 * spread.same);
}

std::string way_text(const GradedWay& way, const std::vector<std::string>& sensors) {
  std::string chosen;
  for (const std::string& name : way.chosen) chosen += (chosen.empty() ? "" : ", ") + escaped(name);
  std::string text = fmt::format("  {}: {}\n", escaped(name_of(way.way)), chosen);
  if (way.begins)
    for (const DegreeStart& begin : *way.begins) text += begin_text(begin);
  text += spread_text(way, sensors);
  for (const ChannelGrade& channel : way.channels) text += displacement_text(channel);
  if (way.rms_over_range)
    text += fmt::format("    together {:.1f} % of the range of days unseen\n",
                        100.0 * *way.rms_over_range);
  if (way.random)
    text += fmt::format(
        "    random choices of {}: {:.1f} % (median; 5 % of them below {:.1f}, 5 % above {:.1f}), "
        "{:.0f} % are worse than this choice\n",
        way.chosen.size(), 100.0 * way.random->p50, 100.0 * way.random->p05,
        100.0 * way.random->p95, 100.0 * way.random->beaten);
  return text;
}

}  // namespace

std::string sensor_choices_text(const ThermalChoice& choice) {
  std::string text = "\nsensors chosen, and RMS of the drift that their model leaves\n";
  for (const GradedWay& way : choice.ways) text += way_text(way, choice.sensors);
  for (const std::string& warning : choice.warnings)
    text += "  warning: " + escaped(warning) + "\n";
  return text;
}

}  // namespace abbe::sim
