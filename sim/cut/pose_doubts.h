#pragma once

#include <string>
#include <vector>

#include "sim/cut/pose.h"
#include "sim/cut/pose_list.h"

namespace abbe::sim {

/// What answers about poses leave out or assume of this machine, a sentence each with figures:
/// reversal and chance, since nothing moves; curves beyond the range over which they are stated.
/// @param least, most  (joints) between which the poses lie
std::vector<std::string> doubts(const IdleMachine& idle, const kinematics::AxisVector& least,
                                const kinematics::AxisVector& most);

/// The same, and what a column of time cannot say: of a machine without heat, before its history,
/// after it.
std::vector<std::string> doubts(const IdleMachine& idle, const PoseList& poses);

}  // namespace abbe::sim
