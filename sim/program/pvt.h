#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "kinematics/chain.h"
#include "sim/program/nc_reader.h"
#include "sim/program/path.h"

/// Position-velocity-time (PVT) programs: reading, writing, and conversion of paths.
namespace abbe::sim::program {

/// Reads a position-velocity-time program. It is CSV with a header that names the columns and their
/// units, `time_s,X_mm,Z_mm,S_deg,X_mm_per_s,Z_mm_per_s,S_deg_per_s`. Rotations may be in deg or
/// rad. Axes without columns stay at the start. Motion between rows is cubic. Lines that start with
/// # are comments. Throws BadInput.
Path read_pvt(std::string_view text, const std::string& file, const NcOptions& options);
/// Reads a PVT program from a file.
Path read_pvt_file(const std::filesystem::path& file, const NcOptions& options);

/// One row of a PVT file.
struct PvtRow {
  double time_s = 0.0;
  kinematics::AxisVector position;  ///< (axes) mm, rad
  kinematics::AxisVector velocity;  ///< (axes) mm/s, rad/s
};

/// Returns the velocity at each row as the slope of the parabola through the positions of the row
/// and its neighbours. Needs at least two rows; ignores their velocities.
std::vector<kinematics::AxisVector> parabola_rates(std::span<const PvtRow> rows);

/// Returns the position on the Hermite cubic between two rows at fraction u of their time.
kinematics::AxisVector hermite_position(const PvtRow& a, const PvtRow& b, double u);

/// Returns rows as PVT text with the fewest digits that read back as the same bits. Rotations are
/// in rad because a conversion to degrees would change the last bit. `columns` holds the indices of
/// the axes that get columns.
std::string write_pvt(std::span<const PvtRow> rows, std::span<const ControlledAxis> axes,
                      std::span<const int> columns);

/// Returns the rows of a path that was read from a PVT file. Throws std::invalid_argument if a
/// block is not a cubic.
std::vector<PvtRow> pvt_rows(const Path& path);

/// Tolerance and limits of a conversion to PVT.
struct PvtConversionOptions {
  double within = 0.001;  ///< mm, tolerance of the path; rotary axes count with `lever`
  double lever = 100.0;   ///< mm
  std::size_t max_rows = 20'000'000;
};

/// Result of a conversion to PVT.
struct PvtConversion {
  std::vector<PvtRow> rows;
  /// mm, largest deviation of the cubics from the path, sampled at three instants of each cubic
  double max_deviation = 0.0;
};

/// Converts a path to positions, velocities and times. Rows are close to both sides of each corner,
/// because a cubic cannot change direction at once, and between corners as dense as curved moves
/// need. The deviation at a corner falls with the time to the adjacent rows. Throws BadInput if
/// there are more rows than allowed or the slides do not reach a tip.
PvtConversion convert_to_pvt(const Path& path, const kinematics::Chain& control,
                             const PvtConversionOptions& options = {});

}  // namespace abbe::sim::program
