#pragma once

#include "errors/metrology/plan_builder.h"

/// Measuring plans, one function for each kind of instrument. `plan` has checked the members of the
/// instrument before.
namespace abbe::errors::metrology {

/// Returns a channel that measures the tool in the workpiece, with the instrument's noise and
/// resolution.
Channel channel(const Instrument& instrument, const std::string& name, Quantity quantity,
                const Eigen::Vector3d& direction_w);
/// Returns a set-up with the instrument's alignment, scale and drift. The positions of its points
/// are exact.
SetUp set_up(const Instrument& instrument, const std::string& name, std::vector<Channel> channels);

/// Returns a path that moves one axis and leaves the others at rest.
Path along(const kinematics::AxisVector& q, int joint);

// Lines and directions across them
Plan laser(const Instrument& instrument, const kinematics::Chain& nominal);
Plan straightness(const Instrument& instrument, const kinematics::Chain& nominal);
Plan angle_optics(const Instrument& instrument, const kinematics::Chain& nominal);
Plan square(const Instrument& instrument, const kinematics::Chain& nominal);
Plan level(const Instrument& instrument, const kinematics::Chain& nominal);
Plan roll_lines(const Instrument& instrument, const kinematics::Chain& nominal);
// Diagonals
Plan diagonals(const Instrument& instrument, const kinematics::Chain& nominal);
Plan step_diagonal(const Instrument& instrument, const kinematics::Chain& nominal);
// Circles and rotary axes
Plan ball_bar(const Instrument& instrument, const kinematics::Chain& nominal);
Plan ball_bar_rotary(const Instrument& instrument, const kinematics::Chain& nominal);
Plan r_test(const Instrument& instrument, const kinematics::Chain& nominal);
Plan sphere(const Instrument& instrument, const kinematics::Chain& nominal);
// Volume
Plan tracker(const Instrument& instrument, const kinematics::Chain& nominal);
Plan multilateration(const Instrument& instrument, const kinematics::Chain& nominal);
// Time
Plan spindle(const Instrument& instrument, const kinematics::Chain& nominal);
Plan drift(const Instrument& instrument, const kinematics::Chain& nominal);
Plan temperature(const Instrument& instrument, const kinematics::Chain& nominal);

}  // namespace abbe::errors::metrology
