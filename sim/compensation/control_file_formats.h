#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "kinematics/chain.h"
#include "sim/compensation/parameter_tables.h"

/// The formats of control_files.h and the functions that they share. Only sources of this folder
/// include this header.
namespace abbe::sim::compensation::control {

inline constexpr std::size_t max_file_bytes = std::size_t(1) << 24;  ///< largest file that is read
inline constexpr std::size_t max_files = 64;                         ///< in one set of tables

// Writers and readers of the formats that hold corrections; parameter_tables.h describes the
// formats.
ControlExport to_linuxcnc(const ParameterTables& tables, const kinematics::Chain& chain);
ParameterTables read_linuxcnc_tables(std::span<const ControlFile> files,
                                     const kinematics::Chain& chain);
ControlExport to_siemens(const ParameterTables& tables, const kinematics::Chain& chain);
ParameterTables read_siemens_tables(std::span<const ControlFile> files,
                                    const kinematics::Chain& chain);
ControlExport to_heidenhain(const ParameterTables& tables, const kinematics::Chain& chain);
ParameterTables read_heidenhain_tables(std::span<const ControlFile> files,
                                       const kinematics::Chain& chain);

/// Returns the unit of an axis in the files: 1 (mm) for a slide, one degree in rad for a rotary
/// axis.
double unit_of(const kinematics::Chain& chain, int joint);
/// Returns the name of that unit, "mm" or "deg".
const char* unit_name(const kinematics::Chain& chain, int joint);

/// Returns the text of a number with a fixed number of decimals, without the sign of "-0".
std::string decimal(double value, int decimals);

/// Returns the letter of a joint.
char axis_letter(const kinematics::Chain& chain, int joint);

/// Returns a name for a table, such as "Z over Y" for the correction of Z over the position of Y,
/// or "X" for an axis over itself.
std::string relation(const AxisTable& table, const kinematics::Chain& chain);

/// Adds up the tables of each pair of axes at the union of their positions. The results have the
/// order in which the pairs first occur.
std::vector<AxisTable> summed(const std::vector<AxisTable>& tables);

/// Returns a table resampled at other positions.
AxisTable at_positions(const AxisTable& table, const Eigen::VectorXd& positions);

/// Limits of a format on a table.
struct Capacity {
  int max_points = 256;
  double min_spacing = 1e-6;  ///< mm or degrees; closer positions could become equal when rounded
};
/// A table that a format can hold: the original, or one resampled at equidistant positions.
struct FittedTable {
  AxisTable table;
  std::optional<std::string> omissions;  ///< note on the difference, if there is one
};
/// Returns a table that fits the capacity of a format.
FittedTable fit_table(const AxisTable& table, const kinematics::Chain& chain,
                      const Capacity& capacity);
/// Returns a table resampled at the same number of equidistant positions; the table itself if its
/// positions are already equidistant.
FittedTable equidistant(const AxisTable& table, const kinematics::Chain& chain);

/// Returns a note for every offset that is not zero, because the tables of a control cannot hold
/// it.
std::vector<std::string> offsets_left_out(const ParameterTables& tables,
                                          const kinematics::Chain& chain);

/// Returns true if the corrections of a table are the same in both directions of motion.
bool is_direction_independent(const AxisTable& table);

/// Throws BadInput if there are too many files, one is too large, or two have the same name.
void check_files(std::span<const ControlFile> files);

/// Returns the joint with a letter; nothing if there is none or it is a spindle.
std::optional<int> movable(char letter, const kinematics::Chain& chain);
/// Returns the letters of all joints but spindles, for messages.
std::string movable_letters(const kinematics::Chain& chain);

/// Returns the name of a file without folders, in capitals.
std::string base_name(const std::string& name);

}  // namespace abbe::sim::compensation::control
