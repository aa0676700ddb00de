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
/// too (stock_replay.h).
/// @throws BadInput as `bodies_of`, and where a table of the errors is left
Collisions collisions(const Job& job, const Commands& commands, const std::string& name,
                      const Progress& progress = {});

/// Two bodies that come near each other.
struct BodyProximity {
  std::string a, b;
  int line = 0;           ///< of the program, on which they first meet, else are nearest
  double distance = 0.0;  ///< mm, between the bodies then
};

/// The pairs of machine, fixtures and tool that come within `collision.clearance_mm` on the
/// error-free machine, each with its line: a check of some milliseconds for `run` and
/// `compare`, which follow no bodies. Between samples the axes move linearly; the way of a body is
/// bounded by those of the axes, so that nothing is passed over. The part is left out: the cut
/// tells of it. A check that would cost a measurable part of a run ends before the program does.
struct Proximity {
  std::vector<BodyProximity> near;
  bool is_complete = true;  ///< else there may be others; so of a job in windows, which is not held
};
/// @throws BadInput as `machine_bodies` and `fixture_bodies`
Proximity find_near_bodies(const Job& job);

/// Returns the warning of a job whose collisions are not searched; empty if nothing comes near.
/// @throws BadInput as `find_near_bodies`
std::string not_searched_text(const Job& job);

}  // namespace abbe::sim
