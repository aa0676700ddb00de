// Yang 2012: what instruments read on our machines, evaluated by his laws: the composite
// positioning element and the step diagonal.

#include "sim/commands/calibration_commands.h"
#include "sim/readings/readings_file.h"
#include "sim/report/identification_report.h"
#include "tests/figures/figure.h"
#include "tests/sim/scene_folder.h"
#include "tests/test.h"

namespace abbe::figures {
namespace {

using nlohmann::ordered_json;

const std::string no_figure = "no figure";
const std::string ours = "the machine and its heat are chosen";

/// What `abbe identify` reports of one instrument of a scene, without places of a user's disk.
ordered_json identified(const std::string& scene, const std::string& instrument,
                        const std::vector<sim::Override>& set, sim::IdentificationOptions options) {
  const sim::SceneFolder folder;
  const sim::Scene measured = scene_of(scene, set);
  const auto readings = folder.write(
      instrument + ".csv",
      sim::to_text(sim::measure_machine(measured, sim::find_instrument(measured, instrument))));
  options.out = folder.path() / "belief.toml";
  return sim::to_json(sim::identify({readings}, options));
}

// ---- the composite element

const ordered_json& composite() {
  static const ordered_json report = [] {
    sim::IdentificationOptions options;
    options.method = sim::IdentificationOptions::Method::Composite;
    options.sensors = {"T7_screw", "T8_nut"};
    options.margin = 0.5;
    return identified("yang_composite", "laser", {}, options);
  }();
  return report["composite"][0];
}

std::string slopes_per_K() {
  const auto with_error = [](const char* sensor) {
    return fmt::format("{:.3f} ± {:.3f}", composite()["slope_um_per_m_K"][sensor].get<double>(),
                       composite()["standard_error_um_per_m_K"][sensor].get<double>());
  };
  return with_error("T7_screw") + ", " + with_error("T8_nut");
}

std::string slope_at_zero() {
  const ordered_json& slope = composite()["slope_at_zero_of_dT_um_per_m"];
  return fmt::format("{:.2f} ± {:.2f}", slope["value"].get<double>(),
                     slope["standard_error"].get<double>());
}

Figure composite_rest(const std::string& variant, const std::string& when) {
  return {yang_2012,
          "flat under the composite element, " + when +
              ": machine's part uncompensated, by the cold curve, by both, µm RMS",
          no_figure,
          [variant] {
            const auto rest = [&](const char* name) {
              return machine_um({"yang_composite", {}, name, variant});
            };
            return fmt::format("{:.2f}, {:.2f}, {:.2f}", rest(""),
                               rest("identified-position-ideal"), rest("composite-position-ideal"));
          },
          "`abbe compare scenes/yang_composite.toml`, `machine_um`",
          "the paper shows the element and no part",
          true};
}

// ---- the step diagonal

/// With the angles of the slides, or with translations alone.
const ordered_json& step_diagonal(bool angles) {
  static std::map<bool, ordered_json> all;
  if (const auto known = all.find(angles); known != all.end()) return known->second;
  sim::IdentificationOptions options;
  options.method = sim::IdentificationOptions::Method::StepDiagonal;
  options.sensors = {"X_nut", "Y_nut", "Z_nut"};
  const std::vector<sim::Override> set{{"errors.1.scale", angles ? "1" : "0"}};
  return all[angles] = identified("step_diagonal", "step_diagonal", set, options);
}

const ordered_json& named(const ordered_json& list, const std::string& name) {
  for (const ordered_json& one : list)
    if (one["name"] == name) return one;
  throw std::invalid_argument("no " + name);
}

std::string squarenesses(bool angles) {
  std::vector<std::string> words;
  for (const char* name : {"EC0Y", "EB0Z", "EA0Z"})
    words.push_back(fmt::format(
        "{:.1f}", named(step_diagonal(angles)["numbers"], name)["value"].get<double>()));
  return joined(words, ", ");
}

std::string chi_square(bool angles) {
  const double value = step_diagonal(angles)["reduced_chi_square"];
  return angles ? fmt::format("{:.0f}", value) : fmt::format("{:.2f}", value);
}

std::string positionings_per_K() {
  std::vector<std::string> words;
  for (const char axis : {'X', 'Y', 'Z'}) {
    const ordered_json& slope =
        named(step_diagonal(false)["per_K"], fmt::format("E{0}{0} slope", axis));
    words.push_back(
        fmt::format("{:.2f}", slope["per_K"][fmt::format("{}_nut", axis)].get<double>()));
  }
  return joined(words, ", ");
}

Figure step_rest(const std::string& variant, const std::string& when, const std::string& why) {
  return {
      yang_2012,
      "flat corrected by the step diagonal, " + when + ": machine's part before → after, µm RMS",
      no_figure,
      [variant] {
        return fmt::format("{:.2f} → {:.2f}", machine_um({"step_diagonal", {}, "", variant}),
                           machine_um({"step_diagonal", {}, "identified-position-ideal", variant}));
      },
      "`abbe compare scenes/step_diagonal.toml`, `machine_um`",
      why,
      true};
}

std::vector<Figure> composite_rows() {
  const std::string identify =
      "`abbe measure scenes/yang_composite.toml --out out/yang`, `abbe identify out/yang/laser.csv "
      "--method composite --sensors T7_screw,T8_nut --margin 0.5 --out out/yang.toml`";
  const std::string noise = "read by a laser with noise; the published law is what is injected";
  return {
      {yang_2012, "composite element separated: slope by screw and nut, µm/m/K", "-0.496, 3.360",
       slopes_per_K, identify, noise},
      {yang_2012, "composite element separated: slope that later starts leave at ΔT = 0, µm/m",
       no_figure, slope_at_zero, identify, "zero by the law; read by a laser with noise"},
      composite_rest("cold", "cold"),
      composite_rest("", "an hour after work"),
      composite_rest("3 h", "after 3 h"),
      composite_rest("another day", "on another day"),
  };
}

std::vector<Figure> step_rows() {
  const auto by = [](bool angles) {
    return std::string("`abbe measure scenes/step_diagonal.toml --out out/step") +
           (angles ? "" : " --set errors.1.scale=0") +
           "`, `abbe identify out/step/step_diagonal.csv --method step_diagonal --sensors "
           "X_nut,Y_nut,Z_nut --out out/step.toml`";
  };
  const std::string injected =
      ours + ": 32, −26 and 21 µrad with the slopes of the straightnesses are injected";
  const std::string spoilt = "angles take the tool off the beam, which reads as a length";
  return {
      {yang_2012, "step diagonal, translations alone: EC0Y, EB0Z, EA0Z, µrad", no_figure,
       [] { return squarenesses(false); }, by(false), injected},
      {yang_2012, "step diagonal, with angles: EC0Y, EB0Z, EA0Z, µrad", no_figure,
       [] { return squarenesses(true); }, by(true), injected + "; " + spoilt},
      {yang_2012, "step diagonal, translations alone: reduced chi-square", no_figure,
       [] { return chi_square(false); }, by(false), ours},
      {yang_2012, "step diagonal, with angles: reduced chi-square", no_figure,
       [] { return chi_square(true); }, by(true), spoilt},
      {yang_2012, "step diagonal, translations alone: EXX, EYY, EZZ by their nuts, µm/m/K",
       no_figure, positionings_per_K, by(false), ours + ": 4, 5 and 6 are injected"},
      step_rest("translations alone", "translations alone", ours),
      step_rest("", "with angles", ours + "; " + spoilt),
  };
}

}  // namespace

std::vector<Figure> yang_readings() {
  std::vector<Figure> rows = composite_rows();
  for (Figure& row : step_rows()) rows.push_back(std::move(row));
  return rows;
}

}  // namespace abbe::figures
