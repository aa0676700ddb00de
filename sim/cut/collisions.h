#pragma once

#include <string>

#include "sim/cut/collision_events.h"
#include "sim/cut/job.h"

/// The search for collisions along a program, and the quick proximity check of runs without it.
namespace abbe::sim {

/// Searches the bodies of a job for collisions along its commands on the machine with errors.
/// It includes the errors of the axes and of heat, but not the deflection under the cutting force.
/// Between two samples the axes move linearly. Cutter and shank may enter the part by
/// `collision.gouge_mm`; any other pair within the resolution is a collision. With [cutting] the
/// bodies are also searched against the stock at each moment (stock_replay.h).
/// @throws BadInput as `segment_bodies`, and if the motion leaves a table of the errors
Collisions collisions(const Job& job, const Commands& commands, const std::string& name,
                      const Progress& progress = {});

/// Returns the same of a job in windows, of which up to three are in memory. The search needs 8
/// bytes for each sample of the program besides, and the steps of the stock.
/// @throws BadInput as above, and if a commanded axis leaves its travel
Collisions collisions(const Job& job, const WindowedProgram& program, const std::string& name,
                      const Progress& progress = {});

/// Returns the warning for a job whose collisions are not searched; empty if nothing comes near.
/// @throws BadInput as `machine_bodies` and `fixture_bodies`
std::string proximity_warning(const Job& job);

}  // namespace abbe::sim
