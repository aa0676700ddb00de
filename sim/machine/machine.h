#pragma once

#include <optional>

#include "kinematics/chain.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// A machine compiled from its description, with its tool mounted and its part clamped. Immutable.
struct Machine {
  kinematics::Chain nominal;  ///< as designed, the tool as ordered
  kinematics::Chain control;  ///< as the control believes it to be
  kinematics::Chain actual;   ///< as built: tool and clamping as they really are, before any error
  std::optional<int> workpiece_spindle;  ///< joint that turns the workpiece under a turning tool
};

/// @throws BadInput naming the scene if the description makes no chain
Machine compile(const Scene& scene);

/// Whether a joint is a spindle, of the tool or of the workpiece: it turns without limits and is no
/// axis that is positioned.
bool is_spindle(const Machine& machine, int joint);

/// The joint that turns the tool or the workpiece, if there is one.
std::optional<int> spindle_of(const Machine& machine);

/// Whether two chains bring the tool to the same place for the same commands, bit for bit.
bool same(const kinematics::Chain& a, const kinematics::Chain& b);

}  // namespace abbe::sim
