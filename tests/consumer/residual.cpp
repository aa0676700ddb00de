// The residual of a part under the errors of its scene: residual SCENE
#include <cstdio>

#include "cutting/map/residual.h"
#include "sim/cut/cut.h"
#include "sim/cut/judged_surface.h"
#include "sim/scene/read_scene.h"

int main(int, char** arguments) {
  using namespace abbe;
  const sim::Scene scene = sim::read_scene(arguments[1], {{"part.vertices", "2000"}});
  const sim::Job job = sim::sampled(sim::prepare(scene));
  const sim::Cut made = sim::cut(job);
  const cutting::Statistics residual = cutting::statistics(made.surface, job.design_w);
  std::printf("PV %.4f um, RMS %.4f um\n", 1e3 * residual.pv.value(), 1e3 * residual.rms.value());
}
