#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sim/calibration/calibration.h"
#include "sim/commands/command.h"
#include "sim/files/output.h"
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
Command measure_command(CommonOptions& common);

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
Command identify_command(CommonOptions& common);

struct EvaluateOptions {
  std::filesystem::path folder;  ///< evaluation.json and pictures; empty: none are written
  Permissions permissions = {};
  std::string report_language = {};  ///< of report.html, "en" or "zh"; empty: none is written
};

/// An evaluation and the pictures that were written of it.
struct EvaluationOutcome {
  Evaluation evaluation;
  std::vector<std::filesystem::path> pictures;
};

/// Evaluates readings (sim/calibration/calibration.h) and writes what the options ask for.
/// @throws BadInput, BadScene, OutputFailure
EvaluationOutcome evaluate(const std::filesystem::path& readings,
                           const EvaluateOptions& options = {});

/// `abbe evaluate`.
Command evaluate_command(CommonOptions& common);

}  // namespace abbe::sim
