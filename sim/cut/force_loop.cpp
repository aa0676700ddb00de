#include "sim/cut/force_loop.h"

#include <algorithm>
#include <cmath>

namespace abbe::sim {
namespace {

using errors::Load;
using kinematics::Pose;

/// Force and deflection of one step, brought to agree.
class Loop {
 public:
  Loop(const CuttingDescription& description, const PoseUnderLoad& pose, std::size_t sample,
       const std::function<Look(const Pose&)>& force)
      : description_(description), pose_(pose), sample_(sample), force_(force) {}

  ProcessStep close(const Load& guess);

 private:
  bool repeat(Load load);
  bool bracket();
  bool look_at(const Load& load);

  const CuttingDescription& description_;
  const PoseUnderLoad& pose_;
  std::size_t sample_;
  const std::function<Look(const Pose&)>& force_;
  ProcessStep step_;
  Look look_;              // at the last load
  Pose T_wt_, T_wt_next_;  // under the last load, and under what it makes of itself
};

/// Looks at the cut under a load. @return true if that load is what the cut gives, to the tolerance
bool Loop::look_at(const Load& load) {
  ++step_.iterations;
  T_wt_ = pose_(sample_, load);
  look_ = force_(T_wt_);
  T_wt_next_ = pose_(sample_, look_.load);
  const Eigen::Vector3d contact_t =
      look_.load.on_tool_t.isZero(0.0) ? load.contact_t : look_.load.contact_t;
  step_.disagreement = (T_wt_next_ * contact_t - T_wt_ * contact_t).norm();
  step_.load = look_.load;
  return step_.disagreement <= description_.tolerance;
}

/// Repetition, and the secant of the last two (Aitken) where it is slow or swings.
bool Loop::repeat(Load load) {
  double relaxation = 1.0, last_change = 0.0;
  kinematics::Wrench last_difference = kinematics::Wrench::Zero();
  while (step_.iterations < description_.most_iterations) {
    if (look_at(load)) return true;
    const double change = step_.disagreement;
    const kinematics::Wrench difference = look_.load.on_tool_t - load.on_tool_t;
    // below a hundred tolerances the ends of arcs on the grid of the stock show, not the loop
    if (last_change > 100 * description_.tolerance && relaxation == 1.0)
      step_.contraction = std::max(step_.contraction, change / last_change);
    const kinematics::Wrench bend = difference - last_difference;
    const bool slow = last_change > 0.0 && change > 0.3 * last_change;
    if (slow && bend.head<3>().squaredNorm() > 0.0)
      relaxation = std::clamp(-relaxation * last_difference.head<3>().dot(bend.head<3>()) /
                                  bend.head<3>().squaredNorm(),
                              0.05, 2.0);
    load.on_tool_t += relaxation * difference;
    if (!look_.load.on_tool_t.isZero(0.0)) load.contact_t = look_.load.contact_t;
    last_difference = difference;
    last_change = change;
  }
  return false;
}

/// Force falls as the tool gives way, so the load lies between none and that of the rigid tool: its
/// share of that is bisected, then its direction and place are taken from what was found there.
bool Loop::bracket() {
  constexpr int most_directions = 8, most_halvings = 60;
  look_at({});
  Load rigid = look_.load;
  if (rigid.on_tool_t.isZero(0.0)) return true;
  for (int turn = 0; turn < most_directions; ++turn) {
    double low = 0.0, high = 1.0;  // the cut gives more than `low`, less than `high`
    Load load = rigid, firm = rigid;
    for (int i = 0; i < most_halvings; ++i) {
      const double share = 0.5 * (low + high);
      load = rigid;
      load.on_tool_t *= share;
      if (look_at(load)) return true;
      const bool gives_more = look_.load.on_tool_t.head<3>().dot(rigid.on_tool_t.head<3>()) >
                              share * rigid.on_tool_t.head<3>().squaredNorm();
      if (gives_more) firm = look_.load;
      (gives_more ? low : high) = share;
      const Pose other = pose_(sample_, [&] {
        Load end = rigid;
        end.on_tool_t *= gives_more ? high : low;
        return end;
      }());
      if ((other * rigid.contact_t - T_wt_ * rigid.contact_t).norm() <= description_.tolerance)
        break;
    }
    // along the direction tried the deflection is known; the cut may push another way there
    const double amount = load.on_tool_t.head<3>().norm();
    const kinematics::Wrench along = firm.on_tool_t * (amount / firm.on_tool_t.head<3>().norm());
    Load next = firm;
    next.on_tool_t = along;
    const Pose turned = pose_(sample_, next);
    const double moved = (turned * rigid.contact_t - T_wt_ * rigid.contact_t).norm();
    step_.load = load;
    step_.disagreement = moved;
    if (moved <= description_.tolerance) return true;
    // the rigid amount in the new direction, for the next bracket
    const double whole = rigid.on_tool_t.head<3>().norm();
    rigid = next;
    rigid.on_tool_t = along * (whole / amount);
  }
  return false;
}

ProcessStep Loop::close(const Load& guess) {
  step_.converged = repeat(guess) || bracket();
  step_.torque = look_.cut.torque;
  step_.engaged = look_.engaged;
  step_.beyond_edge = look_.beyond_edge;
  step_.chip = look_.chip;
  if (!step_.load.on_tool_t.allFinite()) {
    step_.load = {};
    step_.converged = false;
  }
  return step_;
}

}  // namespace

ProcessStep closed_step(const CuttingDescription& description, const PoseUnderLoad& pose,
                        std::size_t sample, const std::function<Look(const Pose&)>& force,
                        const Load& guess) {
  return Loop(description, pose, sample, force).close(guess);
}

}  // namespace abbe::sim
