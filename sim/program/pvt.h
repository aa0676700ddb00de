#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "kinematics/chain.h"
#include "sim/program/nc_reader.h"
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

struct PvtConversionOptions {
  double within = 0.001;  ///< mm, of the path; a rotary axis counts with `lever`
  double lever = 100.0;   ///< mm
  std::size_t max_rows = 20'000'000;
};

struct PvtConversion {
  std::vector<PvtRow> rows;
  double off = 0.0;  ///< mm, the farthest that the cubics were seen from the path, three times in
                     ///< each
};

/// A path as positions, velocities and times: rows close to the corners, where cubics cannot turn
/// at once, and as many between them as curved moves need. What cubics leave by a corner falls with
/// the time to the rows beside it.
/// @throws BadInput for more rows than allowed, and where slides do not reach a tip
PvtConversion convert_to_pvt(const Path& path, const kinematics::Chain& control,
                             const PvtConversionOptions& options = {});

}  // namespace abbe::sim::program
