#include "sim/cut/unreached_text.h"

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::sim {

std::string unreached_text(const program::Unreached& unreached) {
  if (unreached.points == 0) return {};
  return fmt::format(
      "the machine does not reach {} of {} points of the program ({:.3g} %), which leaves out {} "
      "of "
      "{} passes and parts of {}; first in pass {}, at ({:.3f}, {:.3f}, {:.3f}) mm of the "
      "workpiece: "
      "{}",
      unreached.points, unreached.all_points, 100.0 * unreached.points / unreached.all_points,
      unreached.passes, unreached.all_passes, unreached.broken_passes, unreached.first_pass,
      unreached.tip_w.x(), unreached.tip_w.y(), unreached.tip_w.z(),
      unreached.why == kinematics::Reach::OutOfLimits
          ? "an axis would leave its travel"
          : "no position of its axes gives the direction");
}

}  // namespace abbe::sim
