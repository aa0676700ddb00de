#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sim/calibration/calibration.h"
#include "sim/commands/command.h"
#include "sim/files/output.h"
#include "sim/measure/measure.h"

/// The commands `abbe measure`, `abbe identify` and `abbe evaluate`.
namespace abbe::sim {

/// Cuts the part of a scene in the case that the instrument names, and measures it.
/// @throws BadInput naming the scene if it cannot be cut or measured
PartReadingsFile measure_cut_part(const Scene& scene, const PartInstrumentDescription& instrument);

/// Options of `abbe measure`.
struct MeasureOptions {
  std::vector<Override> overrides;
  std::vector<std::string> instruments;  ///< names; empty: all instruments of the scene
  std::filesystem::path folder;          ///< for NAME.csv of each instrument
  Permissions permissions = {};
};

/// A file of readings that was written.
struct MeasuredFile {
  std::filesystem::path file;
  std::size_t readings = 0;
  std::size_t set_ups = 0;
  double duration_s = 0.0;                 ///< time on a real machine
  std::vector<std::string> warnings = {};  ///< of the scene, and of the cut of a part
};

/// Measures and writes the readings.
/// @throws BadScene, BadInput, OutputFailure; BadInput if an instrument would read nothing
std::vector<MeasuredFile> measure(const std::filesystem::path& scene,
                                  const MeasureOptions& options);

/// Returns the command `abbe measure`.
Command measure_command(CommonOptions& common);

/// Identifies a machine from files of readings alone. Writes a belief file (an errors file with
/// covariance, or a thermal belief; for a composite also its thermal half), the report of the fit,
/// and a sheet of every curve with its readings and 95 % band. Output files that may not be written
/// are an error before the work begins.
/// @param instead  called instead of the progress display on stderr
/// @throws BadInput, BadScene, OutputFailure; BadInput naming the files if they are of different
/// machines
IdentificationResult identify(const std::vector<std::filesystem::path>& files,
                              const IdentificationOptions& options, const Progress& observer = {});

/// Returns the command `abbe identify`.
Command identify_command(CommonOptions& common);

/// Options of `abbe evaluate`.
struct EvaluateOptions {
  std::filesystem::path folder;  ///< for evaluation.json and pictures; empty: nothing is written
  Permissions permissions = {};
  std::string report_language = {};  ///< "en" or "zh"; empty: no report.html is written
};

/// An evaluation and the pictures that were written.
struct EvaluationOutcome {
  Evaluation evaluation;
  std::vector<std::filesystem::path> pictures;
};

/// Evaluates readings (sim/calibration/calibration.h) and writes the files that the options
/// request.
/// @throws BadInput, BadScene, OutputFailure
EvaluationOutcome evaluate(const std::filesystem::path& readings,
                           const EvaluateOptions& options = {});

/// Returns the command `abbe evaluate`.
Command evaluate_command(CommonOptions& common);

}  // namespace abbe::sim
