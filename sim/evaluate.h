#pragma once

#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

#include "sim/permissions.h"

namespace abbe::sim {

struct EvaluateOptions {
  std::filesystem::path folder;  ///< evaluation.json and pictures; empty: none are written
  Permissions permissions;
};

/// Evaluates readings as the standards prescribe: positioning (ISO 230-2), diagonals (230-6),
/// circles (230-4), drift (230-3), straightness, angles and squareness (230-1), a probed or
/// measured part (flatness, circularity, ISO 25178). Takes files of `measure`, position readings as
/// plain CSV and the position files of laser interferometers (errors/metrology/position_file.h).
/// @return {"file", "kind", "tests": [{"name", "standard", ...}], "pictures"}; figures in um and
/// urad
/// @throws BadInput, BadScene, OutputFailure
nlohmann::ordered_json evaluate(const std::filesystem::path& readings,
                                const EvaluateOptions& options = {});

/// The same as a person reads it: a table a test.
std::string evaluation_text(const nlohmann::ordered_json& evaluation);

}  // namespace abbe::sim
