#pragma once

#include <span>
#include <string>
#include <vector>

#include "errors/geometric.h"
#include "kinematics/chain.h"
#include "sim/compensation/parameter_tables.h"

/// Writing and reading of compensation tables in the layouts of real controls. Lengths are in mm,
/// angles of rotary axes in degrees; axes have the letters of the chain.
namespace abbe::sim::compensation {

/// Writes tables in the format of a control. Several tables of one pair of axes become their sum.
/// Tables with more points than the format holds, and for Siemens tables that are not equidistant,
/// are resampled at equidistant points; `left_out` states the largest difference from the original
/// points.
/// @throws std::invalid_argument for tables that `validate` rejects, and for ControlFormat::Isg,
///     which holds deviations and not corrections
ControlExport to_control(const ParameterTables& tables, const kinematics::Chain& chain,
                         ControlFormat format);

/// Returns the correction that a control with these files applies. It is the inverse of
/// `to_control` up to omissions and half a unit of the last written digit: 1e-8 mm or degrees
/// (LinuxCnc: and single precision), for Heidenhain 1e-4. Input that a control would silently
/// ignore is an error here; only .COM tables that the active line does not name have no effect.
/// @throws BadInput with file, line and column; std::invalid_argument for ControlFormat::Isg
ParameterTables read_control_tables(std::span<const ControlFile> files,
                                    const kinematics::Chain& chain, ControlFormat format);

/// Writes the believed deviations of every carriage for a volumetric compensation, at the positions
/// of its joint (`table_positions`). If they depend on the direction of motion, their mean is
/// written.
/// @throws std::out_of_range if a position lies outside a table of the belief
/// @throws std::invalid_argument as `table_positions`
ControlExport to_volumetric(const errors::GeometricModel& believed, const kinematics::Chain& chain,
                            const TableOptions& options = {});
/// Reads deviations of a volumetric compensation. Throws BadInput with file, line and column.
errors::GeometricErrors read_volumetric_deviations(std::span<const ControlFile> files,
                                                   const kinematics::Chain& chain);

}  // namespace abbe::sim::compensation
