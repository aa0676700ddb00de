#pragma once

#include "errors/metrology/plan_builder.h"

/// Plans of each kind of instrument, one function per kind. The numbers of the instrument are
/// already checked.
namespace abbe::errors::metrology {

/// Returns a channel of the instrument with its noise and resolution, of the tool in the workpiece.
Channel channel(const Instrument& instrument, const std::string& name, Quantity quantity,
                const Eigen::Vector3d& direction_w);
/// Returns a set-up with the instrument's alignment, scale and drift, with exact positions of
/// points.
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
