#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "errors/identification/curve_readings.h"
#include "errors/identification/estimate.h"
#include "errors/identification/model.h"
#include "sim/files/permissions.h"

namespace abbe::sim {

struct IdentifyOptions {
  /// Without what only places the workpiece on a rotary table: no reading tells that.
  errors::identification::ModelOptions model = {.placement = false};
  errors::identification::EstimateOptions estimate;
  bool choose_orders = false;  ///< by cross-validation instead of `model.order`
  errors::identification::OrderOptions orders;
  enum class Method {
    Chain,         ///< least squares on the exact chain
    StepDiagonal,  ///< the published evaluation of one file of step diagonals
    Composite,     ///< a positioning from several starts: cold curve, and in NAME_thermal.txt the
                   ///< slopes on temperatures, the two beliefs that a case `composite` takes
    Thermal,       ///< a day: what heat adds to the elements, on temperatures; a belief of its own
                   ///< text format, as `[belief.thermal]` reads it
  } method = Method::Chain;
  std::vector<std::string> sensors;  ///< temperatures on which what was measured from several
                                     ///< starts is regressed; thermal: none, to have some chosen
  int sensor_count = 4;              ///< thermal: how many are chosen
  double margin =
      0.1;  ///< thermal, composite: part of its trained range by which a sensor may leave it
  std::filesystem::path out;  ///< belief file; beside it NAME.json and NAME.png
  Permissions permissions;
};

/// What was identified, before anything of it is written.
struct Identified {
  nlohmann::ordered_json report;
  std::string belief;          ///< text of the belief file
  std::string thermal_belief;  ///< text of a composite's thermal half, else empty
  std::vector<errors::identification::CurveReadings> curves;  ///< of the method chain
  kinematics::Chain nominal;
};

/// Identifies a machine from files of readings alone. Says which numbers no reading tells, what
/// hides them, what was left out, and how long the measurements would take.
/// @throws BadInput, BadScene; BadInput naming the files if they are of different machines
Identified identified(const std::vector<std::filesystem::path>& files,
                      const IdentifyOptions& options);

/// The thermal half of a composite: beside the cold one, with a name of its own.
std::filesystem::path thermal_file(const std::filesystem::path& out);

}  // namespace abbe::sim
