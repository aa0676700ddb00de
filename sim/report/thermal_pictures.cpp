#include "sim/report/thermal_pictures.h"

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/files/output.h"
#if ABBE_RENDER
#include "render/plot.h"
#endif

namespace abbe::sim {

#if ABBE_RENDER
void write_thermal_picture(const ResultFile& file, const ThermalChoice& choice) {
  std::vector<render::Panel> panels;
  std::size_t days = 1;
  for (const DriftSeries& one : choice.series) {
    const double unit = one.angle ? units::urad : units::um;
    const bool training = one.day == choice.series.front().day;
    if (one.channel == choice.series.front().channel && !training) ++days;
    const double rms =
        std::sqrt((one.read - one.predicted).squaredNorm() / double(one.read.size())) / unit;
    panels.push_back(
        {fmt::format("{} on {} ({})", one.channel, one.day, training ? "trained" : "never seen"),
         "time / h",
         one.angle ? "drift / µrad" : "drift / µm",
         {{"read", one.hours, one.read / unit, {}, {}, render::Mark::Line, 1},
          {"predicted", one.hours, one.predicted / unit, {}, {}, render::Mark::Line, 0}},
         {fmt::format("RMS {:.2f} {}", rms, one.angle ? "µrad" : "µm")}});
  }
  if (panels.empty()) return;
  std::string chosen;
  for (const std::string& name : choice.ways.front().chosen)
    chosen += (chosen.empty() ? "" : ", ") + name;
  render::CurvesOptions options;
  options.title = "drift predicted from " + chosen;
  options.columns = int(days);
  options.width = days > 1 ? 2400 : 1600;
  write_file(file, [&](const std::filesystem::path& temporary) {
    render::write_curves(temporary, panels, options);
  });
}
#else
void write_thermal_picture(const ResultFile&, const ThermalChoice&) {}
#endif

}  // namespace abbe::sim
