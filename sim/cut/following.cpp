#include "sim/cut/following.h"

#include <algorithm>

#include "sim/cut/bodies.h"

namespace abbe::sim {

kinematics::AxisState Following::state(const cutting::Moment& moment) const {
  kinematics::AxisState state = samples.states[moment.instant];
  if (moment.u > 0.0 && moment.instant + 1 < samples.states.size()) {
    const kinematics::AxisState& next = samples.states[moment.instant + 1];
    const kinematics::AxisState before = state;
    state = next;
    state.q = before.q + moment.u * (next.q - before.q);
    state.time_s = before.time_s + moment.u * (next.time_s - before.time_s);
  }
  if (const auto& spindle = part.machine.workpiece_spindle) state.q[*spindle] = 0.0;
  return state;
}

std::vector<kinematics::Pose> Following::carriers(const cutting::Moment& moment) const {
  const kinematics::AxisState at = state(moment);
  return carrier_poses(part.truth.actual, at.q, deviations(part.truth, at).joints);
}

std::size_t Following::running(const cutting::Moment& moment) const {
  return std::min(moment.instant + (moment.u > 0.0 ? 1u : 0u), samples.states.size() - 1);
}

ProgramPlace Following::place(const cutting::Moment& moment) const {
  const std::size_t i = running(moment);
  return {samples.line[i], path.blocks[std::size_t(samples.block[i])].file, state(moment).time_s};
}

bool Following::is_rapid(const cutting::Moment& moment) const {
  const auto block = std::size_t(samples.block[running(moment)]);
  return path.blocks[block].interpolation == program::Interpolation::Rapid;
}

Collision event_at(const Following& following, const cutting::Moment& moment,
                   const Eigen::Vector3d& place_b) {
  const Carriers carriers{following.part.truth.actual.size()};
  const std::vector<kinematics::Pose> T = following.carriers(moment);
  Collision event;
  event.first = event.worst = event.last = following.place(moment);
  event.place_b = place_b;
  event.place_w = T[std::size_t(carriers.workpiece())].inverse() * place_b;
  event.state = following.state(moment);
  event.rapid = following.is_rapid(moment);
  return event;
}

}  // namespace abbe::sim
