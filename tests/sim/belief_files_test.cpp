#include <nlohmann/json.hpp>
#include "errors/coefficients.h"
#include "sim/commands/calibration_commands.h"
#include "sim/files/program_file.h"
#include "sim/readings/belief_file.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/scene_folder.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

using errors::Coefficient;
using errors::GeometricErrors;

Scene scene_with_errors(const std::string& errors, const SceneFolder& folder) {
  const auto file = folder.write("belief.toml", errors);
  return read_scene(packaged("gantry_dome.toml"), {{"errors", "\"" + file.string() + "\""}});
}

double largest_apart(const GeometricErrors& a, const GeometricErrors& b) {
  return (errors::values(a.elements) - errors::values(b.elements)).cwiseAbs().maxCoeff();
}

TEST(BeliefFile, EveryPackagedErrorFileReadsBackAsItWas) {
  for (const char* name : {"gantry_dome.toml", "platform_plane.toml"}) {
    const SceneFolder folder;
    const Scene scene = read_scene(packaged(name));
    GeometricErrors known = scene.geometric;
    for (auto& element : known.elements)
      std::erase_if(element.curves, [](const auto& curve) { return errors::is_random(curve); });
    std::erase_if(known.elements, [](const auto& element) { return element.curves.empty(); });
    const auto file = folder.write("b.toml", errors_file_text(known, scene.machine.joints));
    const Scene again = read_scene(packaged(name), {{"errors", "\"" + file.string() + "\""}});
    ASSERT_EQ(again.geometric.elements.size(), known.elements.size());
    for (std::size_t i = 0; i < known.elements.size(); ++i)
      EXPECT_EQ(again.geometric.elements[i].name, known.elements[i].name);
    const double apart = largest_apart(again.geometric, known);
    std::cout << name << ": " << apart << " mm or rad apart\n";
    EXPECT_LT(apart, 1e-17);
  }
}

GeometricErrors some_belief() {
  GeometricErrors belief;
  belief.elements = {{errors::parse_element_name("EXX"),
                      {{errors::Legendre{Vector3d(0.0, -5e-3, 1e-3), 10.0, 300.0}}}},
                     {errors::parse_element_name("EBX"),
                      {{errors::make_table(Vector2d(-300, 300), Vector2d(1e-5, -2e-5),
                                           errors::TableInterpolation::Spline,
                                           errors::TableExtrapolation::Hold)}}},
                     {errors::parse_element_name("EC0Y"), {{errors::Constant{3e-5}}}},
                     {errors::parse_element_name("EYY"),
                      {{errors::Backlash{1e-3}, "reversal"}, {errors::Constant{2e-3}}}},
                     {errors::parse_element_name("EXC"),
                      {{errors::Fourier{Vector2d(1e-3, 2e-3), Vector2d(3e-3, 4e-3), 2 * pi}}}}};
  const std::vector<Coefficient> numbers = errors::coefficients(belief.elements);
  belief.covariance.of = {numbers[1], numbers[3], numbers[5]};
  belief.covariance.matrix.resize(3, 3);
  belief.covariance.matrix << 1e-8, 2e-11, 1e-11, 2e-11, 4e-12, -1e-12, 1e-11, -1e-12, 1e-12;
  return belief;
}

TEST(BeliefFile, ItsCovarianceReadsBack) {
  const SceneFolder folder;
  const Scene scene = read_scene(packaged("gantry_dome.toml"));
  const GeometricErrors belief = some_belief();
  const std::string text = errors_file_text(belief, scene.machine.joints, {"a belief"});
  const GeometricErrors again = scene_with_errors(text, folder).geometric;
  // elements come in the machine's order; each number keeps its own row
  ASSERT_EQ(again.covariance.of.size(), 3u);
  std::vector<std::string> names;
  for (const Coefficient& one : again.covariance.of)
    names.push_back(errors::name_of(one, again.elements));
  std::vector<std::string> wanted;
  for (const Coefficient& one : belief.covariance.of)
    wanted.push_back(errors::name_of(one, belief.elements));
  EXPECT_EQ(names, wanted);
  const MatrixXd apart = again.covariance.matrix - belief.covariance.matrix;
  EXPECT_LT((apart.array() / belief.covariance.matrix.array()).abs().maxCoeff(), 1e-12);
}

TEST(BeliefFile, TwoErrorFilesKeepTheCovarianceOfEach) {
  const SceneFolder folder;
  const Scene scene = read_scene(packaged("gantry_dome.toml"));
  GeometricErrors belief = some_belief();
  const auto one = folder.write("one.toml", errors_file_text(belief, scene.machine.joints));
  const auto two =
      folder.write("two.toml", "scale = 2\n" + errors_file_text(belief, scene.machine.joints));
  const GeometricErrors both =
      read_scene(packaged("gantry_dome.toml"),
                 {{"errors", "[\"" + one.string() + "\", \"" + two.string() + "\"]"}})
          .geometric;
  ASSERT_EQ(both.covariance.of.size(), 6u);
  for (std::size_t i = 0; i < 6; ++i) {
    const Coefficient& number = both.covariance.of[i];
    const auto& element = both.elements[std::size_t(number.element)];
    ASSERT_LT(std::size_t(number.curve), element.curves.size());
    EXPECT_EQ(element.curves[std::size_t(number.curve)].scale, i < 3 ? 1.0 : 2.0);
  }
  EXPECT_TRUE(both.covariance.matrix.topRightCorner(3, 3).isZero(0.0));
}

TEST(BeliefFile, ABrokenCovarianceIsRefusedByPlace) {
  const SceneFolder folder;
  const std::string curve = "EXX = { kind = \"constant\", value_um = 1 }\n[covariance]\n";
  const auto refusal = [&](const std::string& covariance) {
    const auto file = folder.write("belief.toml", curve + covariance);
    return faults_of(packaged("gantry_dome.toml"), {{"errors", "\"" + file.string() + "\""}});
  };
  const std::string good = "of = [\"EXX\"]\nstandard_uncertainty_um_urad = [0.1]\n";
  EXPECT_EQ(refusal(good), "");
  EXPECT_HAS(refusal("of = [\"EXX[1]\"]\nstandard_uncertainty_um_urad = [0.1]\n"),
             "belief.toml:3:7: expected a coefficient of the curves in this file");
  EXPECT_NE(refusal("of = [\"EXX\"]\nstandard_uncertainty_um_urad = [0.1, 1]\n"), "");
  EXPECT_HAS(refusal("of = [\"EXX\"]\nstandard_uncertainty_um_urad = [-0.1]\n"), ">= 0");
  EXPECT_HAS(refusal("of = [\"EXX\", \"EXX\"]\nstandard_uncertainty_um_urad = [0.1, 0.1]\n"
                     "correlation = [0.5]\n"),
             "each number once");
}

TEST(BeliefFile, ChanceIsNotABelief) {
  GeometricErrors belief;
  belief.elements = {{errors::parse_element_name("EXX"), {{errors::Repeatability{1e-3, 1}}}}};
  EXPECT_THROW(errors_file_text(belief, {}), std::invalid_argument);
}

// um or urad: rounding of another processor, through a fit with directions that are hardly known
constexpr double rounding = 1e-4;

/// A belief file without its comments and covariance.
std::string bare(const fs::path& file) {
  std::ifstream stream(file);
  std::string text;
  for (std::string line; std::getline(stream, line);) {
    if (line == "[covariance]") break;
    if (!line.empty() && line.front() != '#') text += line + "\n";
  }
  return text;
}

/// Largest difference of two texts whose words are the same, number by number; infinite if the
/// words differ.
double largest_difference(const std::string& a, const std::string& b) {
  const char *p = a.c_str(), *q = b.c_str();
  double largest = 0.0;
  while (*p != 0 && *q != 0) {
    char *p_end = nullptr, *q_end = nullptr;
    const bool number = std::isdigit(static_cast<unsigned char>(*p)) || *p == '-';
    const double x = number ? std::strtod(p, &p_end) : 0.0;
    const double y = number ? std::strtod(q, &q_end) : 0.0;
    if (number && p_end != p && q_end != q) {
      largest = std::max(largest, std::abs(x - y));
      p = p_end;
      q = q_end;
    } else if (*p++ != *q++) {
      return HUGE_VAL;
    }
  }
  return *p == *q ? largest : HUGE_VAL;
}

/// What measuring a scene and identifying its machine give, as the head of a belief file says.
std::string identified_bare(const char* scene, IdentificationOptions options, const char* out,
                            const std::vector<Override>& changes = {},
                            const std::vector<std::string>& instruments = {}) {
  const SceneFolder folder;
  const fs::path file = fs::path(ABBE_SOURCE_DIR) / "scenes" / (std::string(scene) + ".toml");
  MeasureOptions measuring;
  measuring.folder = folder.path() / "readings";
  measuring.overrides = changes;
  measuring.instruments = instruments;
  std::vector<fs::path> readings;
  for (const MeasuredFile& one : measure(file, measuring)) readings.push_back(one.file);
  std::sort(readings.begin(), readings.end());
  options.out = folder.path() / out;
  identify(readings, options);
  return bare(options.out);
}

std::string packaged_bare(const char* belief) {
  return bare(fs::path(ABBE_SOURCE_DIR) / "scenes" / "beliefs" / belief);
}

TEST(BeliefFiles, PlatformIsWhatItsCalibrationGives) {
  IdentificationOptions options;
  options.model.order = 16;
  options.model.only = {"EXX", "EYX", "EZX", "EAX", "EBX", "ECX", "EXZ",
                        "EYZ", "EZZ", "EAZ", "EBZ", "ECZ", "EB0Z"};
  const double off =
      largest_difference(identified_bare("platform_calibration", options, "belief.toml"),
                         packaged_bare("platform.toml"));
  std::cout << "platform: largest difference " << off << " um or urad\n";
  EXPECT_LT(off, rounding);
}

TEST(BeliefFiles, GantryIsWhatItsCalibrationGives) {
  IdentificationOptions options;
  options.choose_orders = true;
  options.model.pitch = {{'X', 16.0}, {'Y', 16.0}, {'Z', 12.0}};
  const double off = largest_difference(
      identified_bare("gantry_calibration", options, "belief.toml"), packaged_bare("gantry.toml"));
  std::cout << "gantry: largest difference " << off << " um or urad\n";
  EXPECT_LT(off, rounding);
}

TEST(BeliefFiles, HeatOfTheGantryIsWhatItsTrainingDayGives) {
  IdentificationOptions options;
  options.method = IdentificationOptions::Method::Thermal;
  const double off =
      largest_difference(identified_bare("gantry_warmup_training", options, "belief.txt"),
                         packaged_bare("gantry_warmup_thermal.txt"));
  std::cout << "gantry, heat: largest difference " << off << "\n";
  EXPECT_LT(off, 1e-6);
}

TEST(BeliefFiles, StepDiagonalIsWhatItsReadingsGiveWithAnglesAndWithout) {
  IdentificationOptions options;
  options.method = IdentificationOptions::Method::StepDiagonal;
  options.sensors = {"X_nut", "Y_nut", "Z_nut"};
  const double with = largest_difference(identified_bare("step_diagonal", options, "belief.toml"),
                                         packaged_bare("step_diagonal.toml"));
  const double without = largest_difference(
      identified_bare("step_diagonal", options, "belief.toml", {{"errors.1.scale", "0"}}),
      packaged_bare("step_diagonal_translations.toml"));
  std::cout << "step diagonal: largest difference " << with << ", without angles " << without
            << " um or urad\n";
  EXPECT_LT(with, rounding);
  EXPECT_LT(without, rounding);
}

TEST(BeliefFiles, GrowthOfTheSpindleIsWhatItsDayGives) {
  IdentificationOptions options;
  options.method = IdentificationOptions::Method::Thermal;
  options.model.only = {"EZS"};
  options.margin = 1.5;
  const double off = largest_difference(
      identified_bare("thermal_protocol_chen", options, "belief.txt",
                      {{"instrument.drift.start_h", "-8"}, {"instrument.drift.duration_h", "8"}},
                      {"drift"}),
      packaged_bare("thermal_protocol_chen.txt"));
  std::cout << "growth of the spindle: largest difference " << off << "\n";
  EXPECT_LT(off, 1e-6);
}

// A new version makes them again, by the commands in their heads or in the heads of their scenes.
TEST(BeliefFiles, SayTheVersionThatMakesThem) {
  const std::string wanted = "identified from readings by abbe " + version() + ".\n";
  int files = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(ABBE_SOURCE_DIR) / "scenes/beliefs")) {
    std::ifstream stream(entry.path());
    std::stringstream text;
    text << stream.rdbuf();
    EXPECT_HAS(text.str(), wanted) << entry.path();
    ++files;
  }
  EXPECT_EQ(files, 8);
}

}  // namespace
}  // namespace abbe::sim
