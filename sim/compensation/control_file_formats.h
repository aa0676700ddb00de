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

/// Functions shared by the formats of control_files.h; private to the .cpp files of this folder.
namespace abbe::sim::compensation::control {

inline constexpr std::size_t most_bytes = std::size_t(1) << 24;  ///< of one file to be read
inline constexpr std::size_t max_files = 64;

/// Writers and readers of the formats that hold corrections.
Export to_linuxcnc(const ParameterTables& tables, const kinematics::Chain& chain);
ParameterTables read_linuxcnc_tables(std::span<const ControlFile> files,
                                     const kinematics::Chain& chain);
Export to_siemens(const ParameterTables& tables, const kinematics::Chain& chain);
ParameterTables read_siemens_tables(std::span<const ControlFile> files,
                                    const kinematics::Chain& chain);
Export to_heidenhain(const ParameterTables& tables, const kinematics::Chain& chain);
ParameterTables read_heidenhain_tables(std::span<const ControlFile> files,
                                       const kinematics::Chain& chain);

/// Returns the size of a unit of the files, in mm or rad: 1 for a slide, a degree for a rotary
/// axis.
double unit_of(const kinematics::Chain& chain, int joint);
/// Returns "mm" or "deg".
const char* unit_name(const kinematics::Chain& chain, int joint);

/// Returns a number with fixed decimals, without a minus before a zero.
std::string decimal(double value, int decimals);

/// Returns the letter of a joint.
char axis_letter(const kinematics::Chain& chain, int joint);

/// Returns the letters of two joints as "Z over Y", or "X" for one over itself.
std::string relation(const AxisTable& table, const kinematics::Chain& chain);

/// Returns one table for each pair of axes, in the order in which the pairs first occur: the sum of
/// their tables at all of their positions.
std::vector<AxisTable> summed(const std::vector<AxisTable>& tables);

/// Returns the same function of position at other positions.
AxisTable at_positions(const AxisTable& table, const Eigen::VectorXd& positions);

/// The capacity of a format.
struct Capacity {
  int max_points = 256;
  double min_spacing = 1e-6;  ///< mm or degrees: closer points might read the same
};
/// A table that fits: the table itself, or one sampled at equidistant positions, with a note on the
/// difference.
struct FittedTable {
  AxisTable table;
  std::optional<std::string> left_out;
};
/// Returns a table that fits the capacity of a format.
FittedTable fit_table(const AxisTable& table, const kinematics::Chain& chain,
                      const Capacity& capacity);
/// Returns a table sampled at as many equidistant positions, unless it is equidistant already.
FittedTable equidistant(const AxisTable& table, const kinematics::Chain& chain);

/// Returns a note for every offset that is not zero, since no table of a control holds it.
std::vector<std::string> offsets_left_out(const ParameterTables& tables,
                                          const kinematics::Chain& chain);

/// Returns true if a table has the same corrections in both directions.
bool is_direction_independent(const AxisTable& table);

/// Throws BadInput if there are too many files, a file is too large, or two have one name.
void check_files(std::span<const ControlFile> files);

/// Returns the joint that a letter names, if it can move.
std::optional<int> movable(char letter, const kinematics::Chain& chain);
/// Returns the letters of the joints that can move, for messages.
std::string movable_letters(const kinematics::Chain& chain);

/// Returns the name of a file without folders, in capitals.
std::string base_name(const std::string& name);

}  // namespace abbe::sim::compensation::control
