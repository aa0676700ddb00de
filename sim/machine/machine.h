#pragma once

#include <optional>

#include "kinematics/chain.h"

namespace abbe::sim {

/// A machine as it is meant to be and as its control believes it to be, with its tool. Immutable.
struct Machine {
  kinematics::Chain nominal;             ///< as designed, the tool as ordered
  kinematics::Chain control;             ///< as the control believes it to be
  std::optional<int> workpiece_spindle;  ///< joint that turns the workpiece under a turning tool
};

/// Whether a joint is a spindle, of the tool or of the workpiece: it turns without limits and is no
/// axis that is positioned.
bool is_spindle(const Machine& machine, int joint);

/// The joint that turns the tool or the workpiece, if there is one.
std::optional<int> spindle_of(const Machine& machine);

/// Whether two chains bring the tool to the same place for the same commands, bit for bit.
bool same(const kinematics::Chain& a, const kinematics::Chain& b);

}  // namespace abbe::sim
