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

/// A day with the readings from which its sensors are chosen.
/// @throws BadInput naming the scene if its instrument reads no drift or there is no history
DayReadings measured_day(const std::string& name, const Scene& scene);

/// Chooses sensors on the scene's own day, grades them on those of its variants, and writes
/// `thermal.json` and `thermal.png`.
/// @param variants  of the scene, in its order
/// @return none where the scene asks for no choice
/// @throws BadInput, OutputFailure
std::optional<ThermalChoice> choose_sensors(const ResultFolder& folder, const Scene& scene,
                                            const std::vector<Scene>& variants);

struct RunOptions {
  std::vector<Override> overrides;
  std::filesystem::path folder;  ///< every file goes there
  Permissions permissions;
  std::vector<std::string> formats = usual_map_formats();  ///< in which maps are saved
  std::string case_name;  ///< `run`: error_free, uncompensated or a compensator; empty: what
                          ///< the scene names, else uncompensated
  std::vector<std::filesystem::path> plug_ins;  ///< compensators of the user's own; `compare`: more
                                                ///< cases, `run`: the case
  std::vector<CaseDescription> functions =
      {};                       ///< `cut_scene_cases`: compensators of the caller's own
  Progress progress = {};       ///< called instead of what is said on stderr
  std::string report_language;  ///< of report.html, "en" or "zh"; empty: none is written
  std::string command;          ///< line that asks for the same again, as the report quotes it
};

/// What a command leaves besides its files.
struct Outcome {
  std::variant<Summary, Comparison> figures;  ///< of `run` the one, of `compare` the other
  std::vector<std::string> exceeded_limits;   ///< acceptance limits that a judged case breaks
  std::vector<std::string> failed;       ///< plug-ins that failed, in words; the other cases stand
  std::optional<ThermalChoice> sensors;  ///< chosen where the scene asks for it
};

/// Cuts one case of a scene and writes every file of it.
/// @throws BadScene, BadInput, OutputFailure, Interrupted
Outcome run(const std::filesystem::path& scene, const RunOptions& options);

/// Cuts the error-free machine, the uncompensated one and every compensator of the scene, for every
/// variant, and writes a folder a case, `comparison.json` and `comparison.png`. The maps of a
/// variant are measured against an error-free map of its own, which is not reported as a case.
Outcome compare(const std::filesystem::path& scene, const RunOptions& options);

/// A scene or one variant of it.
struct Batch {
  std::string prefix;  ///< of the names of its cases; empty for the scene itself
  Job job;
};

/// The cases of a scene and its variants beside each other.
struct CaseResults {
  std::vector<Batch> batches;
  std::vector<Compared> cases;  ///< each refers to the job of its batch
  std::vector<FailedCase> failed;
  Comparison comparison;
  int at_once = 1;  ///< so many have room beside each other
};

/// Cuts the cases as `compare` does and writes nothing.
/// @throws BadScene, BadInput, Interrupted
CaseResults cut_scene_cases(const std::filesystem::path& scene, const RunOptions& options);

/// The job of a scene as `run` cuts it: the places of the part chosen, the memory looked at.
/// @throws BadScene, BadInput, Interrupted
Job job_of(const std::filesystem::path& scene, const RunOptions& options);

/// A report as it was written.
struct ReportOutcome {
  std::uintmax_t bytes = 0;
  std::vector<std::string> warnings;         ///< of the cases, and what the page leaves out
  std::vector<std::string> exceeded_limits;  ///< as of an Outcome
  std::vector<std::string> failed;           ///< the same
};

/// Cuts the cases as `compare` does and writes one page of them, nothing else.
ReportOutcome report(const std::filesystem::path& scene, const RunOptions& options,
                     const std::filesystem::path& file);

}  // namespace abbe::sim
