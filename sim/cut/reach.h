#pragma once

#include <optional>

#include "kinematics/bad_input.h"
#include "sim/cut/cut.h"

namespace abbe::sim {

/// The fault of a program that cannot cut the part: none that moves, or one whose tool, on the
/// error-free machine, keeps further from the box around the design than the scene's band. It names
/// the line that comes nearest, and how far away that runs; empty for a program that can.
std::optional<BadInput> missed_part(const Job& job);

/// Refuses a program that cannot cut the part, before anything is searched.
/// @throws BadInput, the fault of missed_part
void check_reaches_part(const Job& job);

/// Refuses a map on which nothing is cut or gouged, saying where the program cuts instead.
/// @throws BadInput
void check_cuts_part(const Job& job, const Cut& cut);

}  // namespace abbe::sim
