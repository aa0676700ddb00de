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
/// element with its 95 % band and readings, residuals, confounded coefficients, and those of its
/// files that have been written for download.
/// @throws BadInput if a file cannot be read
FiguresPage identification_page(const IdentificationResult& identified);

/// Returns the file that holds this page, NAME_page.json beside the report NAME.json.
std::filesystem::path identification_page_file(const std::filesystem::path& report);

/// Returns the saved page of the report NAME.json.
/// @throws BadInput as read_page()
FiguresPage saved_identification_page(const std::filesystem::path& report);

}  // namespace abbe::sim
