#pragma once

#include <span>
#include <string>
#include <vector>

#include "errors/geometric.h"
#include "kinematics/chain.h"
#include "sim/compensation/parameter_tables.h"

/// Compensation tables in the layouts of real controls, written and read back. Lengths are mm,
/// angles of rotary axes degrees; axes bear the letters of the chain.
namespace abbe::sim::compensation {

/// Several tables of one axis over one axis become their sum. Tables with more points than the
/// format holds, and for Siemens tables that are not equidistant, are read off at as many
/// equidistant ones; `left_out` says how far that misses the given points.
/// @throws std::invalid_argument for tables that `validate` refuses and for ControlFormat::Isg,
///         which holds deviations and not corrections
Export to_control(const ParameterTables& tables, const kinematics::Chain& chain,
                  ControlFormat format);

/// What those files make a control do. Inverse of `to_control` for what it could hold, to half a
/// unit of the last digit that is written (LinuxCnc: and single precision): 1e-8 mm or degrees,
/// Heidenhain 1e-4. Stricter than the controls: what one would pass over in silence is refused;
/// only .COM tables that no line in force names do nothing.
/// @throws BadInput with file, line and column; std::invalid_argument for ControlFormat::Isg
ParameterTables read_control_tables(std::span<const ControlFile> files,
                                    const kinematics::Chain& chain, ControlFormat format);

/// Deviations of every carriage for a volumetric compensation, from what is believed of a machine,
/// at the positions at which its joint is looked up (`table_positions`). What depends on the
/// direction of motion is written as its mean.
/// @throws std::out_of_range where a table of the belief is left; std::invalid_argument as
///         `table_positions`
Export to_volumetric(const errors::GeometricModel& believed, const kinematics::Chain& chain,
                     const TableOptions& options = {});
/// @throws BadInput with file, line and column
errors::GeometricErrors read_volumetric_deviations(std::span<const ControlFile> files,
                                                   const kinematics::Chain& chain);

}  // namespace abbe::sim::compensation
