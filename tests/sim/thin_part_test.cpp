// Parts thinner than the search band: a ray through one must not start beyond its far side.

#include <iostream>

#include <gtest/gtest.h>

#include "cutting/map/residual.h"
#include "sim/cut/judged_surface.h"
#include "tests/sim/small_scene.h"

namespace abbe::sim {
namespace {

/// A pin of 1.4 mm diameter turned by a round insert R 3, its band 2 mm.
TEST(ThinPart, IsCutAlikeAtItsVerticesAndBetweenThem) {
  const SceneFolder folder;
  const std::string scenes = packaged("").string();
  folder.write("pin.ngc", "G18 G21 G90 G94\nS2500 M3\nG0 X3.7 Z6\nG1 Z-1 F500\nG0 X25\nM5\nM30\n");
  const Job job = sampled(prepare(read_scene(folder.write(
      "pin.toml", "machine = \"" + scenes + "machines/lathe_zx.toml\"\ntool = \"" + scenes +
                      "tools/insert_r3_long.toml\"\n[part]\nsurface = \"cylinder\"\n"
                      "radius_mm = 0.7\nheight_mm = 2\nvertices = 500\n[program]\n"
                      "file = \"pin.ngc\"\n"))));
  const Cut cut = cut_error_free(job);
  const cutting::Statistics all = cutting::statistics(cut.surface, job.design_w);
  EXPECT_EQ(all.cut_vertices, all.vertices);
  ASSERT_TRUE(cut.interpolation);
  std::cout << "PV " << 1e3 * *all.pv << " um, " << cut.interpolation->places
            << " places between, worst " << 1e3 * cut.interpolation->worst << " um off\n";
  EXPECT_EQ(cut.interpolation->places, 2000);
  EXPECT_LT(cut.interpolation->worst, 1.1 * *all.pv);
}

}  // namespace
}  // namespace abbe::sim
