// A part before and after a compensator of one's own: compensator SCENE
// It believes one number, the mean error of the tip as a first part shows it along Z.
#include <cstdio>

#include "cutting/map/residual.h"
#include "sim/cut/cut.h"
#include "sim/scene/read_scene.h"

int main(int, char** arguments) {
  using namespace abbe;
  const sim::Scene scene = sim::read_scene(arguments[1], {{"part.vertices", "2000"}});
  const sim::Job job = sim::prepare(scene);
  sim::Commands commands = sim::uncompensated_commands(job);
  const auto residual = [&] {
    return cutting::statistics(sim::cut(job, commands).surface, job.design_w);
  };
  const cutting::Statistics before = residual();
  const int z = job.machine.control.find('Z').value();
  for (kinematics::AxisState& state : commands.samples.states) state.q[z] -= before.mean.value();
  const cutting::Statistics after = residual();
  std::printf("mean %.4f um -> %.4f um, RMS %.4f um -> %.4f um\n", 1e3 * before.mean.value(),
              1e3 * after.mean.value(), 1e3 * before.rms.value(), 1e3 * after.rms.value());
}
