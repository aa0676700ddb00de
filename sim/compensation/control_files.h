#pragma once

#include <span>
#include <string>
#include <vector>

#include "errors/geometric.h"
#include "kinematics/chain.h"
#include "sim/compensation/parameter_tables.h"

/// Writes and reads compensation tables in the formats of real controls. Lengths are in mm, angles
/// of rotary axes in degrees; axes have the letters of the chain.
namespace abbe::sim::compensation {

/// Writes tables in the format of a control. Tables for the same pair of axes are added into one. A
/// table is resampled at equidistant points if it has more or closer points than the format allows
/// or, for Siemens, if its points are not equidistant; `omissions` states the largest difference at
/// the original points.
/// @throws std::invalid_argument for tables that `validate` rejects, and for ControlFormat::Isg,
///     which holds deviations and not corrections
ControlExport to_control(const ParameterTables& tables, const kinematics::Chain& chain,
                         ControlFormat format);

/// Returns the correction that a control with these files applies. For files written by
/// `to_control` it equals the original correction, except for the `omissions` and for rounding by
/// half of the last digit. The last digit is 1e-8 mm or degrees, for Heidenhain 1e-4. LinuxCNC also
/// rounds to single precision. Input that a control would silently ignore is an error here. The
/// only exceptions are Heidenhain .COM files that the active line of CONFIG.CMA does not name: they
/// are ignored.
/// @throws BadInput with file, line and column; std::invalid_argument for ControlFormat::Isg
ParameterTables read_control_tables(std::span<const ControlFile> files,
                                    const kinematics::Chain& chain, ControlFormat format);

/// Returns files with the believed deviations of every carriage, for a volumetric compensation, at
/// the positions of its joint (`table_positions`). If they depend on the direction of motion, their
/// mean is written.
/// @throws std::out_of_range if a position lies outside a table of the belief
/// @throws std::invalid_argument for options that `table_positions` rejects
ControlExport to_volumetric(const errors::GeometricModel& believed, const kinematics::Chain& chain,
                            const TableOptions& options = {});
/// Reads deviations of a volumetric compensation. Throws BadInput with file, line and column.
errors::GeometricErrors read_volumetric_deviations(std::span<const ControlFile> files,
                                                   const kinematics::Chain& chain);

}  // namespace abbe::sim::compensation
