#include "sim/report/identify_pictures.h"

#include <fmt/format.h>

#include "errors/bound_element.h"
#include "kinematics/units.h"
#include "sim/files/output.h"
#if ABBE_RENDER
#include "render/plot.h"
#endif

namespace abbe::sim {

#if ABBE_RENDER
namespace {

using errors::identification::CurveReadings;

render::Panel panel_of(const CurveReadings& curve, const kinematics::Chain& nominal) {
  const bool angle = curve.element.is_angle();
  const double unit = angle ? units::urad : units::um;
  const int joint = errors::joint_of(curve.element.axis, nominal, "a belief");
  const bool slide = nominal.joints()[std::size_t(joint)].motion == kinematics::Motion::Linear;
  const double position = slide ? 1.0 : units::deg;
  render::Panel panel{to_string(curve.element),
                      fmt::format("{} / {}", curve.element.axis, slide ? "mm" : "deg"),
                      angle ? "µrad" : "µm",
                      {},
                      {}};
  if (curve.reading.size() > 0)
    panel.series.push_back({"readings",
                            curve.reading_q / position,
                            curve.reading / unit,
                            {},
                            {},
                            render::Mark::Points,
                            1});
  panel.series.push_back({"identified, 95 % band", curve.q / position, curve.value / unit,
                          (curve.value - 1.96 * curve.sigma) / unit,
                          (curve.value + 1.96 * curve.sigma) / unit, render::Mark::Line, 0});
  return panel;
}

/// The names of these files without their folders, as many as a line of the picture holds.
std::string names_of(const std::vector<std::filesystem::path>& files) {
  std::string names;
  for (std::size_t k = 0; k < files.size(); ++k) {
    const std::string name = files[k].filename().string();
    if (k > 0 && names.size() + name.size() > 140)
      return fmt::format("{} and {} more", names, files.size() - k);
    names += (k > 0 ? ", " : "") + name;
  }
  return names;
}

}  // namespace

void write_curves_picture(const ResultFile& file, const std::vector<CurveReadings>& curves,
                          const kinematics::Chain& nominal,
                          const std::vector<std::filesystem::path>& readings) {
  std::vector<render::Panel> panels;
  for (const CurveReadings& curve : curves) panels.push_back(panel_of(curve, nominal));
  if (panels.empty()) return;
  render::GridOptions options;
  options.title = "identified elements and the readings behind them";
  options.caption = {names_of(readings)};
  write_file(file, [&](const std::filesystem::path& temporary) {
    render::write_grid(temporary, panels, options);
  });
}
#else
void write_curves_picture(const ResultFile&,
                          const std::vector<errors::identification::CurveReadings>&,
                          const kinematics::Chain&, const std::vector<std::filesystem::path>&) {}
#endif

}  // namespace abbe::sim
