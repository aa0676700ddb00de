#pragma once

#include <string>

#include "sim/cut/collision_events.h"
#include "sim/cut/job.h"

/// What meets what while a program runs.
namespace abbe::sim {

/// Follows the bodies of a job along its commands on the wrong machine, errors of axes and heat
/// included, the bending under the cutting force left out. Between two samples the axes move
/// linearly. Cutter and shank may be in the part as deep as `collision.gouge_mm`; all else that
/// comes as near as the resolution is a collision. With [cutting] the stock of that moment is met
/// too (stock_collisions.h).
/// @throws BadInput as `bodies_of`, and where a table of the errors is left
Collisions collisions(const Job& job, const Commands& commands, const std::string& name,
                      const Progress& progress = {});

}  // namespace abbe::sim
