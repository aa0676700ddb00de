#pragma once

#include <functional>

#include <Eigen/Core>

#include "sim/cut/corrector.h"
#include "sim/machine/machine.h"
#include "sim/scene/machine_description.h"

namespace abbe::sim {

/// Where the tool is in the part, T_wt, on whatever machine it is asked of.
using ToolAt = std::function<kinematics::Pose(const kinematics::AxisState&)>;

/// Shift of the work zero that the control makes after it found the datum on the wrong machine: the
/// tip is commanded to `point + offset`. Rotary axes stand at zero. `ideal` brings the tip to its
/// point exactly; `touch_off` sees one component a touch and leaves the directions that it never
/// touched.
/// @param tool_at    of that machine
/// @param corrector  acts while the datum is found; without one nothing does
/// @return mm, workpiece frame
Eigen::Vector3d datum_offset(const DatumDescription& datum, const Machine& machine,
                             const ToolAt& tool_at, const Corrector& corrector = {});

/// The shift that a compensator expects to be found by a control without it: what its corrections
/// take away at the datum, to the second order in them.
/// @return mm, workpiece frame
Eigen::Vector3d expected_offset(const DatumDescription& datum, const Machine& machine,
                                const Corrector& corrector);

/// Slide positions of a shift of the tip in the workpiece, rotary axes at zero; directions without
/// a slide are left. @return (joints)
kinematics::AxisVector slides_of_offset(const kinematics::Chain& chain,
                                        const Eigen::Vector3d& offset_w);

}  // namespace abbe::sim
