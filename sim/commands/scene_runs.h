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

/// The work of `abbe run`, `compare` and `report`: prepares scenes, cuts their cases, writes
/// results.
namespace abbe::sim {

/// Returns the compensator of a named case; nothing for "error_free", "uncompensated" or an empty
/// name.
std::optional<CaseDescription> parse_compensator(const std::string& case_name);

/// Cuts the named case: error-free, uncompensated or with a compensator.
Cut cut_named_case(const Job& job, const std::string& case_name, const Progress& progress = {},
                   Retention retention = Retention::Map);

/// Measures the readings of a day, from which sensors are chosen.
/// @throws BadInput naming the scene if its instrument reads no drift or there is no history
DayReadings measure_day(const std::string& name, const Scene& scene);

/// Chooses sensors on the day of the scene, grades them on the days of its variants, and writes
/// `thermal.json` and `thermal.png`.
/// @param variants  in the order of the scene
/// @return nothing if the scene requests no choice
/// @throws BadInput, OutputFailure
std::optional<ThermalSensorChoice> choose_sensors(const ResultFolder& folder, const Scene& scene,
                                                  const std::vector<Scene>& variants);

/// Options of `run`, `compare` and `report`.
struct RunOptions {
  std::vector<Override> overrides;
  std::filesystem::path folder;  ///< for all files
  Permissions permissions;
  std::vector<std::string> formats = default_map_formats();  ///< formats in which maps are saved
  /// For `run`: error_free, uncompensated or a compensator; empty: the case that the scene names,
  /// or else uncompensated.
  std::string case_name;
  /// Compensators of the user: for `compare` additional cases, for `run` the case.
  std::vector<std::filesystem::path> plug_ins;
  std::vector<CaseDescription> functions = {};  ///< for `cut_scene_cases`: functions of the caller
  Progress progress = {};       ///< if set, receives the progress, which is not shown on stderr
  std::string report_language;  ///< "en" or "zh"; empty: no report.html is written
  std::string command;          ///< command line that reproduces the report, quoted in it
};

/// Result of `run` or `compare` besides its files.
struct Outcome {
  std::variant<Summary, Comparison> figures;  ///< Summary from `run`, Comparison from `compare`
  std::vector<std::string> exceeded_limits;   ///< acceptance limits that a judged case exceeds
  std::vector<std::string> failed;  ///< messages about failed plug-ins; other cases are valid
  std::optional<ThermalSensorChoice> sensors;  ///< if the scene requests a choice
};

/// Cuts one case of a scene and writes all its files.
/// @throws BadScene, BadInput, OutputFailure, Interrupted
Outcome run(const std::filesystem::path& scene, const RunOptions& options);

/// Cuts a scene and its variants with the error-free machine, with the uncompensated one and with
/// every compensator. Writes a folder for each case, `comparison.json` and `comparison.png`. The
/// maps of a variant are compared with its own error-free map, which is not reported as a case.
Outcome compare(const std::filesystem::path& scene, const RunOptions& options);

/// The job of a scene or of one of its variants.
struct VariantJob {
  std::string prefix;  ///< prefix of the names of its cases; empty for the scene itself
  Job job;
};

/// All cases of a scene and its variants.
struct CaseResults {
  std::vector<VariantJob> variant_jobs;
  std::vector<ComparedCase> cases;  ///< they refer to the jobs
  std::vector<FailedCase> failed;
  Comparison comparison;
  int max_parallel = 1;  ///< number of cases that fit into memory at the same time
};

/// Cuts the cases as `compare` does, but writes nothing.
/// @throws BadScene, BadInput, Interrupted
CaseResults cut_scene_cases(const std::filesystem::path& scene, const RunOptions& options);

/// Prepares the job of a scene as `run` does: selects the judged points of the part and checks the
/// memory.
/// @throws BadScene, BadInput, Interrupted
Job job_of(const std::filesystem::path& scene, const RunOptions& options);

/// Result of writing a report.
struct ReportOutcome {
  std::uintmax_t bytes = 0;
  std::vector<std::string> warnings;         ///< of the cases, and omissions of the page
  std::vector<std::string> exceeded_limits;  ///< see Outcome
  std::vector<std::string> failed;           ///< see Outcome
};

/// Cuts the cases as `compare` does, but writes only one page with all of them.
ReportOutcome report(const std::filesystem::path& scene, const RunOptions& options,
                     const std::filesystem::path& file);

}  // namespace abbe::sim
