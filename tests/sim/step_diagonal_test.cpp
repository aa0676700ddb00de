// The scene of the step diagonal: what it finds of translations, and what angles make of it.

#include <cmath>
#include <iostream>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "kinematics/units.h"
#include "sim/commands/calibration_commands.h"
#include "sim/report/identification_report.h"
#include "sim/report/verdict.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/measured_scene.h"

namespace abbe::sim {
namespace {

using Json = nlohmann::ordered_json;

struct Corrected {
  Json report;
  std::string text;
  double before_um = 0.0;  ///< machine's part of the map, RMS
  double after_um = 0.0;   ///< corrected by what was found
};

Corrected found(double angles) {
  const SceneFolder folder;
  std::vector<Override> changes{{"variant", "[]"},
                                {"errors.1.scale", fmt::format("{}", angles)},
                                {"part.vertices", "600"},
                                {"program.step_over_mm", "2"},
                                {"program.step_mm", "10"}};
  const Scene scene = read_scene(packaged("step_diagonal.toml"), changes);
  IdentificationOptions options;
  options.method = IdentificationOptions::Method::StepDiagonal;
  options.sensors = {"X_nut", "Y_nut", "Z_nut"};
  options.out = folder.path() / "belief.toml";
  Corrected result;
  const IdentificationResult found = identify(
      {folder.write("d.csv",
                    to_text(measure_machine(scene, find_instrument(scene, "step_diagonal"))))},
      options);
  result.report = to_json(found);
  result.text = identification_text(found);
  changes.push_back({"belief.identified", "\"" + options.out.string() + "\""});
  const Job job = job_of("step_diagonal.toml", changes);
  result.before_um = machine_um(job);
  result.after_um = machine_um(job, parse_case("identified-position-ideal"));
  return result;
}

double number_found(const Json& report, const std::string& name) {
  for (const Json& one : report["numbers"])
    if (one["name"] == name) return one["value"];
  ADD_FAILURE() << "no number " << name;
  return 0.0;
}

double trend(const Json& report, const std::string& name, const std::string& sensor) {
  for (const Json& one : report["per_K"])
    if (one["name"] == name) return one["per_K"][sensor];
  ADD_FAILURE() << "no trend of " << name;
  return 0.0;
}

TEST(StepDiagonalScene, TellsTranslationsAndTheirHeatAndIsSpoiltByAngles) {
  const Corrected alone = found(0.0), with_angles = found(1.0);
  for (const Corrected* one : {&alone, &with_angles})
    std::cout << fmt::format(
        "EC0Y {:.2f} EB0Z {:.2f} EA0Z {:.2f} urad, EXX at the end {:.2f} um, chi-square {:.2f}, "
        "flat "
        "{:.3f} -> {:.3f} um RMS\n",
        number_found(one->report, "EC0Y"), number_found(one->report, "EB0Z"),
        number_found(one->report, "EA0Z"), number_found(one->report, "EXX[10]"),
        one->report["reduced_chi_square"].get<double>(), one->before_um, one->after_um);
  // positioning from end to end of the places, by hand: Legendre orders 1 and 3 of EXX at +-0.96
  const double P3 = 0.5 * (5.0 * std::pow(0.96, 3) - 3.0 * 0.96);
  EXPECT_NEAR(number_found(alone.report, "EXX[10]"), 2.0 * (-5.43 * 0.96 - 2.67 * P3), 0.6);
  EXPECT_LT(alone.report["reduced_chi_square"].get<double>(), 2.0);
  EXPECT_GT(with_angles.report["reduced_chi_square"].get<double>(), 20.0);
  EXPECT_GT(std::abs(number_found(with_angles.report, "EA0Z") - number_found(alone.report, "EA0Z")),
            10.0);
  EXPECT_NE(with_angles.report["warnings"].dump().find("angular errors"), std::string::npos);
  for (const auto& [axis, injected] : {std::pair('X', 4.0), {'Y', 5.0}, {'Z', 6.0}}) {
    const std::string name = fmt::format("E{0}{0} slope", axis), nut = fmt::format("{}_nut", axis);
    EXPECT_NEAR(trend(alone.report, name, nut), injected, 0.2) << name;
    EXPECT_NEAR(trend(with_angles.report, name, nut), injected, 0.2)
        << name << ": angles do not change with heat here";
  }
  // of some two hundred trends a person is shown those that stand out
  std::size_t trends = 0;
  for (const Json& one : alone.report["per_K"]) trends += one["per_K"].size();
  const std::string& text = alone.text;
  std::size_t shown = 0;
  for (const char* nut : {"X_nut", "Y_nut", "Z_nut"})
    for (std::size_t at = 0; (at = text.find(std::string(" by ") + nut, at)) != std::string::npos;
         ++at)
      ++shown;
  EXPECT_EQ(shown, 12u);
  EXPECT_NE(text.find(fmt::format("and {} more temperature trends, each at most ", trends - 12)),
            std::string::npos)
      << text;
  for (const char* one : {"X", "Y", "Z"})
    EXPECT_NE(text.find(fmt::format("\nE{0}{0} slope", one)), std::string::npos) << text;
  EXPECT_LT(alone.after_um, 0.35 * alone.before_um);
  EXPECT_GT(with_angles.after_um, 0.8 * with_angles.before_um) << "what is believed is not so";
}

}  // namespace
}  // namespace abbe::sim
