#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <sstream>

#include <gtest/gtest.h>

#include "sim/identify.h"
#include "sim/measure.h"
#include "tests/sim/scene_folder.h"

namespace abbe::sim {
namespace {

namespace fs = std::filesystem;

// um or urad: rounding of another processor, through a fit with directions that are hardly known
constexpr double same = 1e-4;

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
double difference(const std::string& a, const std::string& b) {
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
std::string identified(const char* scene, IdentifyOptions options, const char* out) {
  const SceneFolder folder;
  const fs::path file = fs::path(ABBE_SOURCE_DIR) / "scenes" / (std::string(scene) + ".toml");
  MeasureOptions measuring;
  measuring.folder = folder.path() / "readings";
  std::vector<fs::path> readings;
  for (const Measured& one : measure(file, measuring)) readings.push_back(one.file);
  std::sort(readings.begin(), readings.end());
  options.out = folder.path() / out;
  identify(readings, options);
  return bare(options.out);
}

std::string packaged(const char* belief) {
  return bare(fs::path(ABBE_SOURCE_DIR) / "scenes" / "beliefs" / belief);
}

TEST(BeliefFiles, PlatformIsWhatItsCalibrationGives) {
  IdentifyOptions options;
  options.model.order = 16;
  options.model.only = {"EXX", "EYX", "EZX", "EAX", "EBX", "ECX", "EXZ",
                        "EYZ", "EZZ", "EAZ", "EBZ", "ECZ", "EB0Z"};
  const double off = difference(identified("platform_calibration", options, "belief.toml"),
                                packaged("platform.toml"));
  std::cout << "platform: largest difference " << off << " um or urad\n";
  EXPECT_LT(off, same);
}

TEST(BeliefFiles, GantryIsWhatItsCalibrationGives) {
  IdentifyOptions options;
  options.choose_orders = true;
  options.model.pitch = {{'X', 16.0}, {'Y', 16.0}, {'Z', 12.0}};
  const double off =
      difference(identified("gantry_calibration", options, "belief.toml"), packaged("gantry.toml"));
  std::cout << "gantry: largest difference " << off << " um or urad\n";
  EXPECT_LT(off, same);
}

TEST(BeliefFiles, HeatOfTheGantryIsWhatItsTrainingDayGives) {
  IdentifyOptions options;
  options.method = IdentifyOptions::Method::Thermal;
  const double off = difference(identified("gantry_warmup_training", options, "belief.txt"),
                                packaged("gantry_warmup_thermal.txt"));
  std::cout << "gantry, heat: largest difference " << off << "\n";
  EXPECT_LT(off, 1e-6);
}

}  // namespace
}  // namespace abbe::sim
