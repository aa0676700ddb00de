// Peng et al. 2017: the XZ platform.

#include "errors/geometric.h"
#include "sim/machine/machine.h"
#include "sim/machine/truth.h"
#include "tests/figures/figure.h"
#include "tests/test.h"

namespace abbe::figures {
namespace {

const std::string peng_2017 = "Peng et al. 2017";
const std::string inferred = "two numbers inferred",
                  identified_case = "identified-position-program";

struct Part {
  std::string name, published;
};
const std::vector<Part> parts{{"plane", "16 → 12"}, {"cone", "20 → 14"}, {"sphere", "25 → 20"}};

/// Range of an element over the 100 mm of travel of its axis, um or urad.
double range(const std::string& element) {
  const sim::Scene scene = scene_of("platform_plane", {{"errors", "errors/platform_peng.toml"}});
  const kinematics::Chain chain = sim::make_machine(scene).nominal;
  const errors::GeometricModel model = errors::bind(scene.geometric, chain);
  const errors::ElementName name = errors::parse_element_name(element);
  const int joint = chain.find(name.axis).value();
  const auto& travel = chain.joints()[std::size_t(joint)];
  double least = 0.0, most = 0.0;
  const int steps = 10000;
  for (int i = 0; i <= steps; ++i) {
    kinematics::AxisState state;
    state.q = kinematics::AxisVector::Zero(chain.size());
    state.q[joint] = travel.min + (travel.max - travel.min) * i / steps;
    const double value =
        errors::deviations(model, state)[std::size_t(joint)].motion[name.component()];
    least = i == 0 ? value : std::min(least, value);
    most = i == 0 ? value : std::max(most, value);
  }
  return (most - least) / (name.is_angle() ? units::urad : units::um);
}

Figure range_figure(const std::string& what, const std::string& published,
                    const std::string& element) {
  const bool angle = errors::parse_element_name(element).is_angle();
  return {peng_2017,
          what + " over 100 mm, " + (angle ? "mrad" : "µm"),
          published,
          [element, angle] {
            return fmt::format(fmt::runtime(angle ? "{:.4f}" : "{:.2f}"),
                               range(element) * (angle ? 1e-3 : 1.0));
          },
          "`abbe check scenes/platform_plane.toml --picture`",
          angle ? "coefficients of the errors file are rounded to 0.1 µrad" : ""};
}

std::vector<Figure> ranges() {
  std::vector<Figure> rows{range_figure("Z: positioning", "6.51", "EZZ"),
                           range_figure("Z: straightness in X", "3.86", "EXZ"),
                           range_figure("Z: straightness in Y", "11.23", "EYZ"),
                           range_figure("Z: yaw", "0.0894", "EBZ"),
                           range_figure("Z: pitch", "0.5161", "EAZ"),
                           range_figure("X: positioning", "9.02", "EXX"),
                           range_figure("X: straightness in Y", "11.40", "EYX"),
                           range_figure("X: straightness in Z", "5.56", "EZX"),
                           range_figure("X: yaw", "0.4244", "EBX"),
                           range_figure("X: pitch", "0.6725", "ECX")};
  rows.push_back({peng_2017, "squareness of X and Z, mrad", "0.0942",
                  [] {
                    const sim::Scene scene = scene_of("platform_plane");
                    for (const errors::Element& element : scene.geometric.elements)
                      if (errors::to_string(element.name) == "EB0Z")
                        return fmt::format(
                            "{:.4f}",
                            std::get<errors::Constant>(element.curves.at(0).shape).value / 1e-3);
                    return std::string("none");
                  },
                  "`abbe check scenes/platform_plane.toml`", ""});
  return rows;
}

std::string pv(const SceneCase& before, const SceneCase& after) {
  const auto of = [](const SceneCase& one) {
    return summary_of(one)["residual_um"]["pv"].get<double>();
  };
  return fmt::format("{:.2f} → {:.2f}", of(before), of(after));
}

/// Peak to valley before and after compensation of each part.
void add_parts(std::vector<Figure>& rows, const std::string& what, SceneCase before,
               SceneCase after, const std::string& why) {
  for (const Part& part : parts) {
    before.scene = after.scene = "platform_" + part.name;
    rows.push_back({peng_2017, fmt::format("{}: PV before → after, µm, {}", part.name, what),
                    part.published, [before, after] { return pv(before, after); }, command(after),
                    why, what != inferred});
  }
}

/// What one off-centre tool alone does to a part.
Figure centring(const std::string& part, const std::string& published) {
  const SceneCase one{"platform_" + part, {{"errors.scale", "0"}}};
  return {
      peng_2017,
      part + ": PV by a tool 0.1 mm off centre alone, µm",
      published,
      [one] { return fmt::format("{:.2f}", summary_of(one)["residual_um"]["pv"].get<double>()); },
      command(one),
      "e times the slope; the computed one has the cusps of the feed as well",
      true};
}

}  // namespace

std::vector<Figure> peng() {
  std::vector<Figure> rows = ranges();
  rows.push_back(
      {peng_2017, "spindle, feed, nose, radius of the part", "150 rpm, 20 µm, 249 µm, 10.8 mm",
       [] {
         const sim::Scene scene = scene_of("platform_plane");
         const auto& spiral = std::get<sim::program::Spiral>(scene.program.source);
         const auto& disc = std::get<cutting::Disc>(std::get<cutting::Primitive>(scene.part.shape));
         return fmt::format(
             "{:.0f} rpm, {:.0f} µm, {:.0f} µm, {:.1f} mm", spiral.spindle_speed / units::rpm,
             spiral.feed_per_revolution / units::um,
             std::get<cutting::Nose>(scene.tool.nominal).radius / units::um, disc.radius);
       },
       "`abbe check scenes/platform_plane.toml`", ""});
  const SceneCase perfect{"platform_perfect"};
  rows.push_back({peng_2017, "cusp of the feed, R − sqrt(R² − f²/4), µm", "0.200884",
                  [perfect] {
                    return fmt::format("{:.6f}",
                                       summary_of(perfect)["residual_um"]["pv"].get<double>());
                  },
                  command(perfect), ""});
  add_parts(
      rows, "two numbers inferred", {"", {}, "", inferred}, {"", {}, identified_case, inferred},
      "a fit: axial motion of the spindle and the side of the tool are inferred from these six "
      "values; on the cone 2 to 3 µm stay open");
  add_parts(rows, "spindle and tool chosen", {}, {"", {}, identified_case},
            "spindle and place of the tool were not published; chosen before any part was cut");
  const sim::Override centred{"tool", "tools/diamond_r249um.toml"};
  add_parts(rows, "spindle chosen, tool centred", {"", {centred}}, {"", {centred}, identified_case},
            "the same without the tool's place");
  const sim::Override elements{"errors", "errors/platform_peng.toml"};
  add_parts(rows, "13 elements alone", {"", {elements, centred}},
            {"", {elements, centred}, identified_case},
            "curves in the published ranges make no more");
  const SceneCase nothing{"", {}, identified_case, "believing nothing"};
  add_parts(rows, "believing nothing", {}, nothing, "nothing is believed, so nothing is gained");
  rows.push_back(centring("plane", "0"));
  rows.push_back(centring("cone", "4"));
  rows.push_back(centring("sphere", "8"));
  return rows;
}

}  // namespace abbe::figures
