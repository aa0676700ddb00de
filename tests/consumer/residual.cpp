// The residual of a part under the errors of its scene: residual SCENE
#include <cstdio>

#include "sim/cut/workpiece.h"

int main(int, char** arguments) {
  using namespace abbe;
  const auto job = sim::prepare_scene(arguments[1], {{"part.vertices", "2000"}});
  const sim::Workpiece part = sim::cut_workpiece(*job);
  const cutting::Statistics residual = cutting::statistics(part.surface, sim::judged_design(*job));
  std::printf("PV %.4f um, RMS %.4f um\n", 1e3 * residual.pv.value(), 1e3 * residual.rms.value());
}
