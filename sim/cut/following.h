#pragma once

#include <cstddef>
#include <vector>

#include "cutting/encounters.h"
#include "sim/cut/collision_events.h"
#include "sim/cut/job.h"

namespace abbe::sim {

/// A part of a job as it is commanded, on the wrong machine. It refers to what it is made of.
struct Following {
  const Job& part;
  const Commands& commands;
  const program::Samples& samples = commands.samples;
  const program::Path& path = path_of(part, commands);

  /// Between two samples: axes and time in proportion, directions those of the way there; a
  /// workpiece spindle stands at 0.
  kinematics::AxisState state(const cutting::Moment& moment) const;
  /// Poses of all carriers, errors of axes and heat included.
  std::vector<kinematics::Pose> carriers(const cutting::Moment& moment) const;
  /// The sample to which the axes are on their way.
  std::size_t running(const cutting::Moment& moment) const;
  ProgramPlace place(const cutting::Moment& moment) const;
  bool is_rapid(const cutting::Moment& moment) const;
};

/// What is said of any collision at its first moment; its names are left open.
/// @param place_b  mm, in the bed
Collision event_at(const Following& following, const cutting::Moment& moment,
                   const Eigen::Vector3d& place_b);

}  // namespace abbe::sim
