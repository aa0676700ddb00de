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
/// @throws BadInput as `job_bodies`, and if the motion leaves a table of the errors
Collisions collisions(const Job& job, const Commands& commands, const std::string& name,
                      const Progress& progress = {});

/// Two bodies that come near each other.
struct BodyProximity {
  std::string a, b;
  int line = 0;           ///< program line on which they first meet, otherwise are nearest
  double distance = 0.0;  ///< mm, between the bodies on that line
};

/// The pairs of machine, fixtures and tool that come within `collision.clearance_mm` on the
/// error-free machine. The check is for `run` and `compare` without a collision search and takes
/// some milliseconds; it stops before the end of the program if it would take a noticeable fraction
/// of the run. Between samples the axes move linearly, and the displacement of a body is bounded by
/// those of the axes, so that no approach is skipped. The part is left out, since the cut reports
/// contact with it.
struct Proximity {
  std::vector<BodyProximity> near;
  bool is_complete = true;  ///< false if there may be further pairs, as in a job in windows, whose
                            ///< samples are not held
};
/// Finds the bodies of a job that come near each other.
/// @throws BadInput as `machine_bodies` and `fixture_bodies`
Proximity find_near_bodies(const Job& job);

/// Returns the warning for a job whose collisions are not searched; empty if nothing comes near.
/// @throws BadInput as `find_near_bodies`
std::string not_searched_text(const Job& job);

}  // namespace abbe::sim
