#pragma once

#include <filesystem>
#include <vector>

#include "sim/calibration/identify.h"
#include "sim/commands/command.h"

namespace abbe::sim {

/// Identifies a machine from files of readings alone and writes a belief file (an errors file with
/// covariance, or a thermal belief), of a composite its thermal half too, the report of the fit and
/// a sheet of every curve with its readings and 95 % band. What may not be written is refused
/// before the work.
/// @param instead  called in place of what is said on stderr
/// @throws BadInput, BadScene, OutputFailure; BadInput naming the files if they are of different
/// machines
Identified identify(const std::vector<std::filesystem::path>& files, const IdentifyOptions& options,
                    const Progress& instead = {});

/// `abbe identify`.
Command identify_command(Common& common);

}  // namespace abbe::sim
