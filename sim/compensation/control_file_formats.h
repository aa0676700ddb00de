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

/// What the formats of control_files.h share. Private to the .cpp files of this folder.
namespace abbe::sim::compensation::control {

inline constexpr std::size_t most_bytes = std::size_t(1) << 24;  ///< of one file that is read
inline constexpr std::size_t max_files = 64;

Export to_linuxcnc(const ParameterTables& tables, const kinematics::Chain& chain);
ParameterTables read_linuxcnc_tables(std::span<const ControlFile> files,
                                     const kinematics::Chain& chain);
Export to_siemens(const ParameterTables& tables, const kinematics::Chain& chain);
ParameterTables read_siemens_tables(std::span<const ControlFile> files,
                                    const kinematics::Chain& chain);
Export to_heidenhain(const ParameterTables& tables, const kinematics::Chain& chain);
ParameterTables read_heidenhain_tables(std::span<const ControlFile> files,
                                       const kinematics::Chain& chain);

/// mm or rad in a unit of the files: 1 of a slide, a degree of a turn.
double unit_of(const kinematics::Chain& chain, int joint);
/// "mm" or "deg".
const char* unit_name(const kinematics::Chain& chain, int joint);

/// Fixed decimals, and no minus before a zero.
std::string decimal(double value, int decimals);

/// Letter of a joint.
char axis_letter(const kinematics::Chain& chain, int joint);

/// Letters of two joints as "Z over Y", or "X" of one over itself.
std::string relation(const AxisTable& table, const kinematics::Chain& chain);

/// The tables with one for each pair of axes, in the order in which the pairs first come: the sum
/// of theirs at all of their positions.
std::vector<AxisTable> summed(const std::vector<AxisTable>& tables);

/// The same function of position, at other positions.
AxisTable at_positions(const AxisTable& table, const Eigen::VectorXd& positions);

/// What a format holds of a table.
struct Capacity {
  int max_points = 256;
  double min_spacing = 1e-6;  ///< mm or degrees: closer points might read the same
};
/// A table that fits: itself, or one read off at equidistant positions, and words about that.
struct FittedTable {
  AxisTable table;
  std::optional<std::string> left_out;
};
FittedTable fit_table(const AxisTable& table, const kinematics::Chain& chain,
                      const Capacity& capacity);
/// The same read off at equidistant positions, as many as there are, unless they are so already.
FittedTable equidistant(const AxisTable& table, const kinematics::Chain& chain);

/// What is said of every offset that is not zero: no table of a control holds it.
std::vector<std::string> offsets_left_out(const ParameterTables& tables,
                                          const kinematics::Chain& chain);

bool is_direction_independent(const AxisTable& table);

/// @throws BadInput for too many files, a file that is too large, or two of one name
void check_files(std::span<const ControlFile> files);

/// Joint that a letter names, if it is one that moves.
std::optional<int> movable(char letter, const kinematics::Chain& chain);
/// Letters of the joints that move, for refusals.
std::string movable_letters(const kinematics::Chain& chain);

/// Name of a file without folders, in capitals.
std::string base_name(const std::string& name);

}  // namespace abbe::sim::compensation::control
