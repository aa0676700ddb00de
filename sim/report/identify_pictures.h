#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "errors/identification/curve_readings.h"
#include "kinematics/chain.h"
#include "sim/files/output.h"

namespace abbe::sim {

/// A sheet of every identified curve over its readings (from these files, named below it) with its
/// 95 % band; nothing is written where the program was built without VTK. @throws OutputFailure
void write_curves_picture(const ResultFile& file,
                          const std::vector<errors::identification::CurveReadings>& curves,
                          const kinematics::Chain& nominal,
                          const std::vector<std::filesystem::path>& readings);

}  // namespace abbe::sim
