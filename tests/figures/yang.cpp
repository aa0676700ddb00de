// Yang 2012: the composite element, the thermal protocol, decoupled five-axis compensation.

#include "sim/report/verdict.h"
#include "tests/figures/figure.h"
#include "tests/test.h"

namespace abbe::figures {
namespace {

using nlohmann::ordered_json;

/// His law as printed, um, x in cm.
double law(double x, double dT7, double dT8) {
  return 1.1192e-6 * std::pow(x, 4) + 8.9455e-5 * std::pow(x, 3) + 9.0575e-4 * x * x -
         6.2218e-3 * x + 0.29717 + (-0.027523 - 0.0049600 * dT7 + 0.033601 * dT8) * x;
}

/// Both ends of the axis at an instant, in hours: what the scene has and what the law says there.
struct Ends {
  double least, most;
  double law_least, law_most;
};
Ends ends(double time_h) {
  const sim::Job job =
      sim::prepare(scene_of("yang_axis", {{"part.vertices", "500"}, {"program.step_mm", "10"}}));
  const VectorXd dT = errors::temperatures(job.truth.heat->run, 3600 * time_h).array() - 20.0;
  const auto positioning = [&](double x) {
    kinematics::AxisState state;
    state.q = kinematics::AxisVector::Zero(job.machine.nominal.size());
    state.q[job.machine.nominal.find('X').value()] = x;
    state.time_s = 3600 * time_h;
    return (sim::tool_in_workpiece(job.truth, state).translation() -
            job.machine.nominal.tool_in_workpiece(state.q).translation())
               .x() /
           units::um;
  };
  return {positioning(-400), positioning(400), law(-40, dT[0], dT[1]), law(40, dT[0], dT[1])};
}

Figure row_by_law(const std::string& when, double time_h) {
  const Ends e = ends(time_h);
  return {yang_2012,
          "EXX at X = −400 and 400 mm, µm, " + when,
          fmt::format("{:.3f}, {:.3f}", e.law_least, e.law_most),
          [e] { return fmt::format("{:.3f}, {:.3f}", e.least, e.most); },
          "`abbe run scenes/yang_axis.toml`, `EXX-temperatures.png`",
          ""};
}

std::string protocol() {
  const sim::Scene scene = scene_of("thermal_protocol");
  std::vector<std::string> hours;
  double speed = 0.0;
  for (const sim::ThermalPhase& phase : scene.thermal->history) {
    hours.push_back(fmt::format("{:.0f} h {}", phase.duration / 3600,
                                phase.spindle_speed > 0.0 ? "on" : "off"));
    speed = std::max(speed, phase.spindle_speed);
  }
  return fmt::format("{:.0f} °C, {:.0f} rpm, {}", scene.thermal->room_T_C[0], speed / units::rpm,
                     joined(hours, ", "));
}

const ordered_json& protocol_choice() { return thermal_choice_of("thermal_protocol"); }

const ordered_json& comprehensive() {
  return choice_of(protocol_choice(), "comprehensive degree, Yang 2012");
}

const ordered_json& regression_choice() {
  return choice_of(protocol_choice(), "deng, regression screening");
}

std::string chosen_names(const ordered_json& choice) {
  std::vector<std::string> names;
  for (const auto& name : choice["chosen"]) {
    std::string words = name.get<std::string>();
    for (char& c : words) c = c == '_' ? ' ' : c;
    names.push_back(words);
  }
  return joined(names, ", ");
}

/// Rest of the machine's part after one linear step, of errors of a scale, um RMS.
double decoupled_rest(const std::string& scale) {
  return machine_um({"gantry_tilted_flat", {{"errors.scale", scale}}, "perfect-decoupled-ideal"});
}

/// How the four of 18 were chosen here, and what a regression on them misses.
std::vector<Figure> sensor_rows() {
  const std::string pictures =
      "raw curves stand only in pictures; the machine and its day are chosen";
  const std::string compare = "`abbe compare scenes/thermal_protocol.toml`, `thermal.json`";
  const std::string choices = compare + ", `choices`";
  const std::string vector4 = "Y nut, X nut, Z nut, spindle box front right", none = "no figure";
  const std::string grey = "the degree looks for likeness, not for what four sensors tell together";
  return {
      {yang_2012, "four of 18 sensors", vector4, [] { return chosen_names(protocol_choice()); },
       compare, pictures + "; screened by regression"},
      {yang_2012, "four of 18 sensors by Deng's degree, interval image", vector4,
       [] {
         return chosen_names(
             thermal_choice_of("thermal_protocol", {{"sensor_choice.screening", "degree"}}));
       },
       "the same with `--set sensor_choice.screening=degree`", pictures},
      {yang_2012, "four of 18 sensors by the comprehensive degree", vector4,
       [] { return chosen_names(comprehensive()); }, choices, pictures},
      {yang_2012,
       "X, Y and Z missed by a regression on the four of the comprehensive degree, µm RMS", none,
       [] { return missed_on_its_day(comprehensive()); }, choices, grey},
      {yang_2012,
       "X, Y and Z missed on another day by the four of the comprehensive degree, µm RMS; "
       "together, of the ranges",
       none, [] { return missed_on_another_day(comprehensive()); }, choices, grey},
      {yang_2012,
       "random fours that the four of the comprehensive degree beat on another day, %; median of "
       "what random fours miss, % of the ranges",
       none,
       [] {
         const ordered_json& random = comprehensive()["random_choices_rms_over_range"];
         return fmt::format("{:.0f}; {:.1f}", 100.0 * random["beaten_by_the_choice"].get<double>(),
                            100.0 * random["p50"].get<double>());
       },
       choices, "a choice by likeness is no better than chance here"},
      {yang_2012, "X, Y and Z missed by the four of the regression, µm RMS", none,
       [] { return missed_on_its_day(regression_choice()); }, choices, pictures},
      {yang_2012,
       "X, Y and Z missed on another day by the four of the regression, µm RMS; together, of the "
       "ranges",
       none, [] { return missed_on_another_day(regression_choice()); }, choices, pictures},
  };
}

}  // namespace

std::vector<Figure> yang() {
  std::vector<Figure> rows{
      row_by_law("cold", -5),
      row_by_law("after 3 h", -1),
      {yang_2012, "air cutting", "25 °C, 12000 rpm, 3 h on, 1 h off, 3 h on, 1 h off", protocol,
       "`abbe check scenes/thermal_protocol.toml`", ""},
  };
  for (Figure& row : sensor_rows()) rows.push_back(std::move(row));
  rows.push_back(
      {yang_2012, "decoupled: what one linear step leaves at half the errors, part of 1", "0.25",
       [] { return fmt::format("{:.3f}", decoupled_rest("0.5") / decoupled_rest("1")); },
       "`abbe compare scenes/gantry_tilted_flat.toml --set errors.scale=0.5`, `machine_um`", "",
       true});
  return rows;
}

}  // namespace abbe::figures
