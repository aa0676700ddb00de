#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <sstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "sim/commands/calibration_commands.h"
#include "sim/files/program_file.h"
#include "tests/sim/scene_folder.h"

namespace abbe::sim {
namespace {

namespace fs = std::filesystem;

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
    EXPECT_NE(text.str().find(wanted), std::string::npos) << entry.path();
    ++files;
  }
  EXPECT_EQ(files, 8);
}

}  // namespace
}  // namespace abbe::sim
