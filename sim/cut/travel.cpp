#include "sim/cut/travel.h"

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"

namespace abbe::sim {

void check_travel(const Machine& machine, const program::Path& path,
                  const program::Samples& samples) {
  constexpr double slack = 1e-6;  // mm or rad: words are rounded, limits are not exact
  for (std::size_t i = 0; i < samples.states.size(); ++i) {
    for (int k = 0; k < machine.nominal.size(); ++k) {
      const kinematics::Joint& joint = machine.nominal.joints()[std::size_t(k)];
      const double q = samples.states[i].q[k];
      if (is_spindle(machine, k)) continue;
      if (q >= joint.min - slack && q <= joint.max + slack) continue;
      const bool turns = joint.motion == kinematics::Motion::Rotary;
      const double unit = turns ? units::deg : 1.0;
      throw BadInput(path.file, samples.line[i], 0,
                     fmt::format("{} between {:.6g} and {:.6g} {}", joint.name, joint.min / unit,
                                 joint.max / unit, turns ? "deg" : "mm"),
                     fmt::format("{} = {:.9g} in this block", joint.name, q / unit));
    }
  }
}

}  // namespace abbe::sim
