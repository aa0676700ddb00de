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

/// The formats behind control_files.h and what they share. Only the sources of this folder use it.
namespace abbe::sim::compensation::control {

inline constexpr std::size_t most_bytes = std::size_t(1) << 24;  ///< largest file that is read
inline constexpr std::size_t max_files = 64;                     ///< of one set of tables

// Writers and readers of the formats that hold corrections.
Export to_linuxcnc(const ParameterTables& tables, const kinematics::Chain& chain);
ParameterTables read_linuxcnc_tables(std::span<const ControlFile> files,
                                     const kinematics::Chain& chain);
Export to_siemens(const ParameterTables& tables, const kinematics::Chain& chain);
ParameterTables read_siemens_tables(std::span<const ControlFile> files,
                                    const kinematics::Chain& chain);
Export to_heidenhain(const ParameterTables& tables, const kinematics::Chain& chain);
ParameterTables read_heidenhain_tables(std::span<const ControlFile> files,
                                       const kinematics::Chain& chain);

/// Returns the unit of an axis in the files: 1 mm for a slide, a degree in rad for a rotary axis.
double unit_of(const kinematics::Chain& chain, int joint);
/// Returns the name of that unit, "mm" or "deg".
const char* unit_name(const kinematics::Chain& chain, int joint);

/// Returns a number with a fixed number of decimals, and never "-0".
std::string decimal(double value, int decimals);

/// Returns the letter of a joint.
char axis_letter(const kinematics::Chain& chain, int joint);

/// Returns the corrected axis and the one on which it depends as "Z over Y"; "X" if they are the
/// same.
std::string relation(const AxisTable& table, const kinematics::Chain& chain);

/// Returns one table for each pair of axes, in the order in which the pairs first occur. It is the
/// sum of all tables of the pair, at the union of their positions.
std::vector<AxisTable> summed(const std::vector<AxisTable>& tables);

/// Returns a table resampled at other positions.
AxisTable at_positions(const AxisTable& table, const Eigen::VectorXd& positions);

/// Capacity of a format.
struct Capacity {
  int max_points = 256;
  double min_spacing = 1e-6;  ///< mm or degrees; closer positions could become equal when rounded
};
/// A table that a format can hold: the original, or one resampled at equidistant positions.
struct FittedTable {
  AxisTable table;
  std::optional<std::string> left_out;  ///< note on the difference; empty if there is none
};
/// Fits a table into the capacity of a format.
FittedTable fit_table(const AxisTable& table, const kinematics::Chain& chain,
                      const Capacity& capacity);
/// Returns a table resampled at the same number of equidistant positions; unchanged if it is
/// equidistant already.
FittedTable equidistant(const AxisTable& table, const kinematics::Chain& chain);

/// Returns a note for every offset that is not zero, since the tables of a control cannot hold it.
std::vector<std::string> offsets_left_out(const ParameterTables& tables,
                                          const kinematics::Chain& chain);

/// Returns true if the corrections of a table are the same in both directions of motion.
bool is_direction_independent(const AxisTable& table);

/// Throws BadInput if there are too many files, one is too large, or two have the same name.
void check_files(std::span<const ControlFile> files);

/// Returns the joint with a letter; empty if there is none or it cannot be positioned.
std::optional<int> movable(char letter, const kinematics::Chain& chain);
/// Returns the letters of the joints that can be positioned, for messages.
std::string movable_letters(const kinematics::Chain& chain);

/// Returns the name of a file without folders, in capitals.
std::string base_name(const std::string& name);

}  // namespace abbe::sim::compensation::control
