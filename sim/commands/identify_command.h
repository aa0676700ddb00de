#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sim/calibration/identify.h"
#include "sim/commands/command.h"

namespace abbe::sim {

/// Identifies a machine from files of readings alone and writes a belief file (an errors file with
/// covariance), the report of the fit and a sheet of every curve with its readings and 95 % band.
/// Says which numbers no reading tells, what hides them, what was left out, and how long the
/// measurements would take.
/// @return the report
/// @throws BadInput, BadScene, OutputFailure; BadInput naming the files if they are of different
/// machines
nlohmann::ordered_json identify(const std::vector<std::filesystem::path>& files,
                                const IdentifyOptions& options);

/// `abbe identify`.
Command identify_command(Common& common);

}  // namespace abbe::sim
