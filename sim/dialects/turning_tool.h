#pragma once

#include <optional>

#include "sim/program/canon.h"

/// The tool of a turning control: which point of it X and Z lead.
namespace abbe::sim::dialects {

/// Returns the control's chain to the tip of a tool, which for a round nose is its centre: that of
/// the tool's own number if the scene has several; null where no kinematics are known.
const kinematics::Chain* chain_to_tip(const program::NcOptions& control, int tool);

/// Returns the shift of a tool offset that has been measured: with it X Z lead the tip in the
/// workpiece, X0 on the spindle line. (axes) mm
/// @throws BadInput unless the slides are at right angles
kinematics::AxisVector measured_offset(const program::Canon& canon, const kinematics::Chain& chain,
                                       const program::Cause& cause);

/// Returns the displacement from the imaginary tip of a nose to its centre, (axes) mm.
/// @param tip  0 to 9, as Fanuc and Siemens number them: 1 X+ Z+, 2 X+ Z-, 3 X- Z-, 4 X- Z+,
///             5 Z+, 6 X+, 7 Z-, 8 X- of the centre, 0 and 9 the centre
kinematics::AxisVector nose_from_tip(const program::Canon& canon, int tip,
                                     std::optional<double> radius);

}  // namespace abbe::sim::dialects
