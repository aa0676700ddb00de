// The scene of the step diagonal: what it finds of translations, and what angles make of it.

#include "sim/commands/calibration_commands.h"
#include "sim/cut/cut.h"
#include "sim/dialects/linuxcnc/rs274.h"
#include "sim/report/identification_report.h"
#include "sim/report/verdict.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/measured_scene.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

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
  EXPECT_HAS(with_angles.report["warnings"].dump(), "angular errors");
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
  EXPECT_HAS(text, fmt::format("and {} more temperature trends, each at most ", trends - 12));
  for (const char* one : {"X", "Y", "Z"}) EXPECT_HAS(text, fmt::format("\nE{0}{0} slope", one));
  EXPECT_LT(alone.after_um, 0.35 * alone.before_um);
  EXPECT_GT(with_angles.after_um, 0.8 * with_angles.before_um) << "what is believed is not so";
}

// LinuxCNC's own five-axis samples, from its programs to what is left of a block. The samples come
// with LinuxCNC.

const std::string samples =
    "usr/share/doc/linuxcnc/examples/sample-configs/sim/axis/vismach/5axis/table-rotary-tilting/"
    "demos/";

/// Where the samples are, if they are.
std::optional<fs::path> demos() {
  const std::optional<fs::path> packages = dialects::find_linuxcnc();
  if (!packages || !fs::is_directory(*packages / samples)) return std::nullopt;
  return *packages / samples;
}

Cut cut_of(const std::string& scene, const std::string& program,
           const std::vector<Override>& changes) {
  std::vector<Override> all{{"program.file", "\"" + (*demos() / program).string() + "\""}};
  all.insert(all.end(), changes.begin(), changes.end());
  return cut(job_of("linuxcnc/" + scene, all));
}

TEST(LinuxCncSamples, BoatStandsOnAFlatFloor) {
  if (!demos()) GTEST_SKIP() << "no LinuxCNC: ./abbe setup --linuxcnc";
  const Cut boat = cut_of("boat.toml", "boat-xyzac.ngc",
                          {{"part.vertices", "2000"}, {"cutting.spacing_mm", "1"}});
  std::vector<double> off;
  for (Index i = 0; i < boat.surface.residual.size(); ++i)
    if (boat.surface.status[std::size_t(i)] == cutting::VertexStatus::Cut)
      off.push_back(std::abs(boat.surface.residual[i]));
  ASSERT_GT(off.size(), 500u);
  std::sort(off.begin(), off.end());
  std::cout << off.size() << " places of the floor, nine in ten within " << off[off.size() * 9 / 10]
            << " mm\n";
  EXPECT_LT(off[off.size() * 9 / 10], 1e-9);

  ASSERT_TRUE(boat.process.stock);
  const cutting::Stock& left = *boat.process.stock;
  const double block = 97.0 * 54.0 * 20.0, removed = totals(boat.process).removed;
  EXPECT_NEAR(volume(left), block - removed, 0.01 * block);
  EXPECT_GT(depth(left, {0, 0, -5}), 0.0) << "below the keel";
  EXPECT_LT(depth(left, {0, 0, -1}), 0.0) << "above the keel";
  EXPECT_LT(depth(left, {0, 24, -12}), 0.0) << "beside the hull";
  EXPECT_LT(depth(left, {0, -24, -12}), 0.0) << "beside the hull";
  EXPECT_LT(depth(left, {-30, -20, -3}), 0.0) << "before the shoulder";
  EXPECT_TRUE(boat.process.crash_lines.empty());
}

TEST(LinuxCncSamples, ImpellerHasSevenBladesAllAlike) {
  if (!demos()) GTEST_SKIP() << "no LinuxCNC: ./abbe setup --linuxcnc";
  const Cut impeller = cut_of("impeller.toml", "impeller-7bl-xyzac.ngc",
                              {{"part.vertices", "2000"}, {"cutting.spacing_mm", "0.5"}});
  ASSERT_TRUE(impeller.process.stock);
  const cutting::Stock& left = *impeller.process.stock;
  for (const auto& [radius, z] : {std::pair{32.0, 8.5}, {25.5, 14.0}, {20.5, 20.0}}) {
    constexpr int places = 3600;
    const auto material = [&, radius = radius, z = z](int k) {
      const double angle = 2.0 * std::numbers::pi * k / places;
      return depth(left, {radius * std::cos(angle), radius * std::sin(angle), z}) > 0.0;
    };
    int edges = 0;
    double alike = 0.0;
    for (int k = 0; k < places; ++k) {
      edges += material(k) != material(k + 1);
      alike += material(k) == material(k + int(std::lround(places / 7.0)));
    }
    std::cout << "at radius " << radius << ", z " << z << ": " << edges << " edges, "
              << 100.0 * alike / places << " % as one blade further\n";
    EXPECT_EQ(edges, 14);
    EXPECT_GT(alike, 0.97 * places);
  }
}

}  // namespace
}  // namespace abbe::sim
