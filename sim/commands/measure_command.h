#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sim/commands/command.h"
#include "sim/files/permissions.h"
#include "sim/measure/measure.h"

namespace abbe::sim {

/// Cuts the part of a scene in the case that the instrument names and measures it.
/// @throws BadInput naming the scene if it cannot
PartReadingsFile measured_part(const Scene& scene, const PartInstrumentDescription& instrument);

struct MeasureOptions {
  std::vector<Override> overrides;
  std::vector<std::string> instruments;  ///< names; empty: every one of the scene
  std::filesystem::path folder;          ///< NAME.csv of each goes there
  Permissions permissions = {};
};

/// One file that was written.
struct Measured {
  std::filesystem::path file;
  std::size_t readings = 0;
  std::size_t set_ups = 0;
  double duration_s = 0.0;                 ///< that it would take on a real machine
  std::vector<std::string> warnings = {};  ///< of the scene, and of the cut of a part
};

/// Measures and writes the readings.
/// @throws BadScene, BadInput, OutputFailure; BadInput where an instrument would read nothing
std::vector<Measured> measure(const std::filesystem::path& scene, const MeasureOptions& options);

/// `abbe measure`.
Command measure_command(Common& common);

}  // namespace abbe::sim
