#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sim/program/nc.h"
#include "sim/program/path.h"

namespace abbe::sim::program {

/// Reads a position-velocity-time program: CSV with a head that names its columns with their units,
/// `time_s,X_mm,Z_mm,S_deg,X_mm_per_s,Z_mm_per_s,S_deg_per_s`; turns may be in deg or rad, axes
/// left out keep their start, cubic between rows. Lines that start with # are comments.
/// @throws BadInput
Path read_pvt(std::string_view text, const std::string& file, const NcOptions& options);
Path read_pvt_file(const std::filesystem::path& file, const NcOptions& options);

/// One row of such a file.
struct PvtRow {
  double time_s = 0.0;
  kinematics::AxisVector position;  ///< (axes) mm, rad
  kinematics::AxisVector velocity;  ///< (axes) mm/s, rad/s
};

/// Rates of positions known at instants: of the parabola through each row and its neighbours.
/// @param rows  at least two, their velocities not read
/// @return (rows)
std::vector<kinematics::AxisVector> rates(std::span<const PvtRow> rows);

/// Writes rows with the fewest digits that read back as the same bits; turns in rad for that
/// reason.
/// @param columns  indices of the axes that get columns
std::string write_pvt(std::span<const PvtRow> rows, std::span<const ControlledAxis> axes,
                      std::span<const int> columns);

/// The rows of a path that was read from such a file.
/// @throws std::invalid_argument if a block is not a cubic
std::vector<PvtRow> pvt_rows(const Path& path);

}  // namespace abbe::sim::program
