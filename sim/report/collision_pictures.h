#pragma once

#include "render/machine.h"
#include "render/plot.h"
#include "sim/cut/collision_events.h"

namespace abbe::sim {

/// The first contact, or else the pair that comes nearest of the near misses; null where there is
/// neither.
const Collision* first_of(const Collisions& collisions);

/// The machine with all its bodies at the moment of an event, the two in red, beside the part and
/// the two alone.
render::MachinePicture collision_picture(const Job& job, const Collisions& collisions,
                                         const Collision& event);

/// The smallest clearance of every block over time, of the pairs that meet and of those that have
/// it most; no series where no pair was looked at.
render::Panel clearance_panel(const Collisions& collisions);

/// Of what that is a lower bound, and which pairs it leaves out.
std::vector<std::string> clearance_caption(const Collisions& collisions);

}  // namespace abbe::sim
