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

}  // namespace

void write_curves_picture(const ResultFile& file, const std::vector<CurveReadings>& curves,
                          const kinematics::Chain& nominal, const std::string& from) {
  std::vector<render::Panel> panels;
  for (const CurveReadings& curve : curves) panels.push_back(panel_of(curve, nominal));
  if (panels.empty()) return;
  render::GridOptions options;
  options.title = "identified elements and the readings behind them";
  options.caption = {from.size() > 160 ? from.substr(0, 157) + "..." : from};
  write_file(file, [&](const std::filesystem::path& temporary) {
    render::write_grid(temporary, panels, options);
  });
}
#else
void write_curves_picture(const ResultFile&,
                          const std::vector<errors::identification::CurveReadings>&,
                          const kinematics::Chain&, const std::string&) {}
#endif

}  // namespace abbe::sim
