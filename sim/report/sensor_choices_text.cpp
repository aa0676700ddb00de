#include "sim/report/sensor_choices_text.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace abbe::sim {

using Json = nlohmann::ordered_json;

std::string sensor_choices_text(const Json& all) {
  std::string text = "\nsensors chosen, and RMS of the drift that their model leaves\n";
  for (const Json& way : all["choices"]) {
    std::string chosen;
    for (const Json& name : way["chosen"])
      chosen += (chosen.empty() ? "" : ", ") + name.get<std::string>();
    text += fmt::format("  {}: {}\n", way["name"].get<std::string>(), chosen);
    if (way["method"].contains("begins"))
      for (const auto& [name, begin] : way["method"]["begins"].items())
        text += begin.is_null()
                    ? fmt::format("    {} takes no part: it drifts within its noise\n", name)
                    : fmt::format(
                          "    degrees with {} begin at {:.3f} h, its first drift beyond "
                          "noise, {:.2f} um\n",
                          name, begin["h"].get<double>(), begin["drift_um"].get<double>());
    for (const Json& channel : way["channels"]) {
      if (!channel.contains("in_cycle") || channel["unit"] != "um") continue;
      text +=
          fmt::format("    {}: {:.3f} um on the day that chose", channel["name"].get<std::string>(),
                      channel["in_cycle"]["rms"].get<double>());
      for (const Json& day : channel["cross_day"])
        text +=
            fmt::format(", {:.3f} of {:.1f} um on {}", day["figures"]["rms"].get<double>(),
                        day["figures"]["drift_range"].get<double>(), day["day"].get<std::string>());
      text += "\n";
    }
    if (!way["rms_over_range"].is_null())
      text += fmt::format("    together {:.1f} % of the range of days unseen\n",
                          100.0 * way["rms_over_range"].get<double>());
  }
  for (const Json& warning : all["warnings"])
    text += "  warning: " + warning.get<std::string>() + "\n";
  return text;
}

}  // namespace abbe::sim
