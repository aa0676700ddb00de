#pragma once

#include "errors/metrology/plan_builder.h"

/// The plans of `plan`, a family a file. The instrument's numbers have been looked at.
namespace abbe::errors::metrology {

/// A channel of the instrument with its noise and resolution, of the tool in the workpiece.
Channel channel(const Instrument& instrument, const std::string& name, Quantity quantity,
                const Eigen::Vector3d& direction_w);
/// A set-up with the instrument's alignment, scale and drift; places of points left exact.
SetUp set_up(const Instrument& instrument, const std::string& name, std::vector<Channel> channels);

/// A path that moves one axis and leaves the others where they stand.
Path along(const kinematics::AxisVector& q, int joint);

// along and across lines
Plan laser(const Instrument& instrument, const kinematics::Chain& nominal);
Plan straightness(const Instrument& instrument, const kinematics::Chain& nominal);
Plan angle_optics(const Instrument& instrument, const kinematics::Chain& nominal);
Plan square(const Instrument& instrument, const kinematics::Chain& nominal);
Plan level(const Instrument& instrument, const kinematics::Chain& nominal);
Plan roll_lines(const Instrument& instrument, const kinematics::Chain& nominal);
// along diagonals
Plan diagonals(const Instrument& instrument, const kinematics::Chain& nominal);
Plan step_diagonal(const Instrument& instrument, const kinematics::Chain& nominal);
// on circles and around rotary axes
Plan ball_bar(const Instrument& instrument, const kinematics::Chain& nominal);
Plan ball_bar_rotary(const Instrument& instrument, const kinematics::Chain& nominal);
Plan r_test(const Instrument& instrument, const kinematics::Chain& nominal);
Plan sphere(const Instrument& instrument, const kinematics::Chain& nominal);
// in the volume
Plan tracker(const Instrument& instrument, const kinematics::Chain& nominal);
Plan multilateration(const Instrument& instrument, const kinematics::Chain& nominal);
// over time
Plan spindle(const Instrument& instrument, const kinematics::Chain& nominal);
Plan drift(const Instrument& instrument, const kinematics::Chain& nominal);
Plan temperature(const Instrument& instrument, const kinematics::Chain& nominal);

}  // namespace abbe::errors::metrology
