#pragma once

#include <span>
#include <string>
#include <vector>

#include "errors/geometric.h"
#include "kinematics/chain.h"
#include "sim/compensation/parameter_tables.h"

/// Compensation tables in the layouts of real controls, written and read back. Lengths are mm,
/// angles of rotary axes degrees; axes have the letters of the chain.
namespace abbe::sim::compensation {

/// Writes tables in the format of a control. Several tables of one axis over one axis become their
/// sum. Tables with more points than the format holds, and for Siemens tables that are not
/// equidistant, are sampled at as many equidistant points; `left_out` states the largest difference
/// from the given points.
/// @throws std::invalid_argument for tables that `validate` rejects, and for ControlFormat::Isg,
///     which holds deviations and not corrections
Export to_control(const ParameterTables& tables, const kinematics::Chain& chain,
                  ControlFormat format);

/// Returns the correction that the files make a control apply. Inverse of `to_control` for what it
/// could hold, to half a unit of the last written digit (LinuxCnc: and single precision): 1e-8 mm
/// or degrees, Heidenhain 1e-4. Stricter than the controls: input that one would silently ignore is
/// an error; only .COM tables that no line in force names have no effect.
/// @throws BadInput with file, line and column; std::invalid_argument for ControlFormat::Isg
ParameterTables read_control_tables(std::span<const ControlFile> files,
                                    const kinematics::Chain& chain, ControlFormat format);

/// Returns the believed deviations of every carriage for a volumetric compensation, at the
/// positions of its joint (`table_positions`). A dependence on the direction of motion is written
/// as its mean.
/// @throws std::out_of_range if a position lies outside a table of the belief
/// @throws std::invalid_argument as `table_positions`
Export to_volumetric(const errors::GeometricModel& believed, const kinematics::Chain& chain,
                     const TableOptions& options = {});
/// Reads deviations of a volumetric compensation. Throws BadInput with file, line and column.
errors::GeometricErrors read_volumetric_deviations(std::span<const ControlFile> files,
                                                   const kinematics::Chain& chain);

}  // namespace abbe::sim::compensation
