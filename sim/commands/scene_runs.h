#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "sim/calibration/sensor_choice.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/report/result_files.h"
#include "sim/report/summary.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// Returns a day with the readings from which its sensors are chosen.
/// @throws BadInput naming the scene if its instrument reads no drift or there is no history
DayReadings measured_day(const std::string& name, const Scene& scene);

/// Chooses sensors on the scene's own day, grades them on the days of its variants, and writes
/// `thermal.json` and `thermal.png`.
/// @param variants  of the scene, in its order
/// @return empty if the scene requests no choice
/// @throws BadInput, OutputFailure
std::optional<ThermalChoice> choose_sensors(const ResultFolder& folder, const Scene& scene,
                                            const std::vector<Scene>& variants);

/// Options of `run`, `compare` and `report`.
struct RunOptions {
  std::vector<Override> overrides;
  std::filesystem::path folder;  ///< all files are written there
  Permissions permissions;
  std::vector<std::string> formats = usual_map_formats();  ///< formats in which maps are saved
  std::string case_name;  ///< for `run`: error_free, uncompensated or a compensator; empty: the
                          ///< case that the scene names, else uncompensated
  std::vector<std::filesystem::path> plug_ins;  ///< the user's own compensators; `compare`:
                                                ///< additional cases, `run`: the case
  std::vector<CaseDescription> functions =
      {};                       ///< `cut_scene_cases`: compensators of the caller's own
  Progress progress = {};       ///< called instead of the progress display on stderr
  std::string report_language;  ///< language of report.html, "en" or "zh"; empty: none is written
  std::string command;          ///< command line that reproduces the report, quoted in it
};

/// Result of a command besides its files.
struct Outcome {
  std::variant<Summary, Comparison> figures;  ///< Summary from `run`, Comparison from `compare`
  std::vector<std::string> exceeded_limits;   ///< acceptance limits that a judged case exceeds
  std::vector<std::string> failed;       ///< messages about failed plug-ins; the other cases remain
                                         ///< valid
  std::optional<ThermalChoice> sensors;  ///< if the scene requests a choice
};

/// Cuts one case of a scene and writes all its files.
/// @throws BadScene, BadInput, OutputFailure, Interrupted
Outcome run(const std::filesystem::path& scene, const RunOptions& options);

/// Cuts the error-free machine, the uncompensated one and every compensator of the scene, for every
/// variant, and writes a folder for each case, `comparison.json` and `comparison.png`. The maps of
/// a variant are compared with its own error-free map, which is not reported as a case.
Outcome compare(const std::filesystem::path& scene, const RunOptions& options);

/// A scene or one variant of it.
struct Batch {
  std::string prefix;  ///< prefix of the names of its cases; empty for the scene itself
  Job job;
};

/// All cases of a scene and its variants.
struct CaseResults {
  std::vector<Batch> batches;
  std::vector<Compared> cases;  ///< each refers to the job of its batch
  std::vector<FailedCase> failed;
  Comparison comparison;
  int at_once = 1;  ///< number of cases that fit into memory at the same time
};

/// Cuts the cases like `compare` and writes nothing.
/// @throws BadScene, BadInput, Interrupted
CaseResults cut_scene_cases(const std::filesystem::path& scene, const RunOptions& options);

/// Returns the job of a scene as `run` cuts it, with the judged points of the part chosen and the
/// memory checked.
/// @throws BadScene, BadInput, Interrupted
Job job_of(const std::filesystem::path& scene, const RunOptions& options);

/// Result of writing a report.
struct ReportOutcome {
  std::uintmax_t bytes = 0;
  std::vector<std::string> warnings;         ///< of the cases, and omissions of the page
  std::vector<std::string> exceeded_limits;  ///< as in Outcome
  std::vector<std::string> failed;           ///< as in Outcome
};

/// Cuts the cases like `compare` and writes one page of them, nothing else.
ReportOutcome report(const std::filesystem::path& scene, const RunOptions& options,
                     const std::filesystem::path& file);

}  // namespace abbe::sim
