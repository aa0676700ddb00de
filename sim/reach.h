#pragma once

#include "sim/loop.h"

namespace abbe::sim {

/// Refuses a program that cannot cut the part, before anything is searched: none that moves, or one
/// whose tool, on the error-free machine, keeps further from the box around the design than the
/// scene's band.
/// @throws BadInput with the line that comes nearest, and how far away that runs
void check_reaches_part(const Job& job);

/// Refuses a map on which nothing is cut or gouged, saying where the program cuts instead.
/// @throws BadInput
void check_cuts_part(const Job& job, const Cut& cut);

}  // namespace abbe::sim
