#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "errors/identification/estimate.h"
#include "kinematics/chain.h"
#include "sim/calibration/calibration.h"
#include "sim/files/output.h"
#include "sim/report/figures_page.h"

namespace abbe::sim {

/// Writes a picture with a panel for each identified curve: its 95 % band and its readings, whose
/// files are named below the panels. Writes nothing if the program was built without VTK.
/// @throws OutputFailure
void write_curves_picture(const ResultFile& file,
                          const std::vector<errors::identification::CurveReadings>& curves,
                          const kinematics::Chain& nominal,
                          const std::vector<std::filesystem::path>& readings);

/// Returns the page of an identification: coefficients with their uncertainties, the curve of every
/// element with its 95 % band and readings, residuals, and confounded coefficients. The belief
/// files must have been written, because the page offers them for download.
/// @throws BadInput if the belief cannot be read
FiguresPage identification_page(const IdentificationResult& identified);

/// Returns the page of an identification's report NAME.json. The report has no curves and
/// residuals; a warning on the page says so.
/// @throws BadInput if it is not the report of an identification; names the file, what was expected
/// and what was found
FiguresPage identification_page(const std::filesystem::path& report);

}  // namespace abbe::sim
