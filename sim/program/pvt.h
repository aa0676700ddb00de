#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "sim/program/nc.h"
#include "sim/program/path.h"

namespace abbe::sim::program {

/// Reads a position-velocity-time program: CSV with a head that names its columns with their units,
/// `time_s,X_mm,Z_mm,S_deg,X_mm_per_s,Z_mm_per_s,S_deg_per_s`, axes left out keep their start, cubic between rows.
/// @throws BadInput
Path read_pvt(std::string_view text, const std::string& file, const NcOptions& options);
Path read_pvt_file(const std::filesystem::path& file, const NcOptions& options);

}  // namespace abbe::sim::program
