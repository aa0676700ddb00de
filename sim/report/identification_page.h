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

/// A sheet of every identified curve over its readings (from these files, named below it) with its
/// 95 % band; nothing is written where the program was built without VTK. @throws OutputFailure
void write_curves_picture(const ResultFile& file,
                          const std::vector<errors::identification::CurveReadings>& curves,
                          const kinematics::Chain& nominal,
                          const std::vector<std::filesystem::path>& readings);

/// The page of an identification: its numbers with their uncertainties, the curve of every element
/// with its band of 95 % and the readings behind it, residuals, what is confounded. The files that
/// it was written to must be there.
/// @throws BadInput where the belief cannot be read
FiguresPage identify_page(const Identified& identified);

/// The page of its report NAME.json. Curves and residuals are not in it, and its warnings say so.
/// @throws BadInput naming the file, what was expected and what was seen, if it is no report of an
///         identification
FiguresPage identify_page(const std::filesystem::path& report);

}  // namespace abbe::sim
