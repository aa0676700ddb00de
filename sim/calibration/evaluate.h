#pragma once

#include <filesystem>
#include <optional>

#include <nlohmann/json.hpp>

#include "sim/calibration/evaluate_tests.h"
#include "sim/readings/part_readings_file.h"

namespace abbe::sim {

/// Readings and what the standards make of them.
struct Evaluation {
  nlohmann::ordered_json json;  ///< {"file", "kind", "tests": [{"name", "standard", ...}]}; figures
                                ///< in um and urad
  Tests tests;                  ///< those of a machine
  std::optional<PartReadingsFile> part;
};

/// Evaluates readings as the standards prescribe: positioning (ISO 230-2), diagonals (230-6),
/// circles (230-4), drift (230-3), straightness, angles and squareness (230-1), a probed or
/// measured part (flatness, circularity, ISO 25178). Takes files of `measure`, position readings as
/// plain CSV and the position files of laser interferometers (errors/metrology/position_file.h).
/// @throws BadInput, BadScene
Evaluation evaluation_of(const std::filesystem::path& readings);

}  // namespace abbe::sim
