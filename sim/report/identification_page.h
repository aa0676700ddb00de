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

/// Writes a sheet of every identified curve with its 95 % band over its readings; their files are
/// named below it. Writes nothing if the program was built without VTK.
/// @throws OutputFailure
void write_curves_picture(const ResultFile& file,
                          const std::vector<errors::identification::CurveReadings>& curves,
                          const kinematics::Chain& nominal,
                          const std::vector<std::filesystem::path>& readings);

/// Returns the page of an identification: its coefficients with their uncertainties, the curve of
/// every element with its 95 % band and its readings, residuals, confounded coefficients. The files
/// to which it was written must exist.
/// @throws BadInput if the belief cannot be read
FiguresPage identify_page(const Identified& identified);

/// Returns the page of an identification's report NAME.json. Curves and residuals are left out, and
/// a warning says so.
/// @throws BadInput naming the file, what was expected and what was found, if it is not the report
/// of an identification
FiguresPage identify_page(const std::filesystem::path& report);

}  // namespace abbe::sim
