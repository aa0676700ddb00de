// A part before and after a compensator of one's own: compensator SCENE
// It believes one number, the mean error of the tip as a first part shows it along Z.
#include <cstdio>

#include "sim/cut/workpiece.h"

int main(int, char** arguments) {
  using namespace abbe;
  const auto job = sim::prepare_scene(arguments[1], {{"part.vertices", "2000"}});
  const auto residual = [&](const sim::CommandFilter& compensator) {
    return cutting::statistics(sim::cut_workpiece(*job, compensator).surface,
                               sim::judged_design(*job));
  };
  const cutting::Statistics before = residual({});
  const int z = sim::control_chain(*job).find('Z').value();
  const cutting::Statistics after = residual([&](std::vector<kinematics::AxisState> commands) {
    for (kinematics::AxisState& state : commands) state.q[z] -= before.mean.value();
    return commands;
  });
  std::printf("mean %.4f um -> %.4f um, RMS %.4f um -> %.4f um\n", 1e3 * before.mean.value(),
              1e3 * after.mean.value(), 1e3 * before.rms.value(), 1e3 * after.rms.value());
}
