#pragma once

#include "tests/study/farm_runs.h"
#include "tests/test.h"

/// A study whose machines are cut in a few milliseconds.
namespace abbe::sim::study {

/// A small dome under few and wide passes, on the typical gantry; two variants.
inline std::string small_scene() {
  const std::string scenes = (fs::path(ABBE_SOURCE_DIR) / "scenes").string();
  return "title = \"small dome\"\n"
         "machine = \"" +
         scenes +
         "/machines/gantry_cxyza.toml\"\n"
         "errors = \"" +
         scenes +
         "/errors/gantry_typical.toml\"\n"
         "tool = \"" +
         scenes +
         "/tools/ball_r5.toml\"\n"
         "[part]\nsurface = \"sphere_cap\"\nradius_mm = 20\nrim_radius_mm = 6\n"
         "at_mm = [40, 25, 80]\nvertices = 300\ntolerance_um = 20\n"
         "[program]\ngenerator = \"raster\"\nstep_over_mm = 0.8\nstep_mm = 2\nlead_deg = 36\n"
         "feed_mm_per_min = 1500\nclearance_mm = 10\npattern = \"one_way\"\noverrun_mm = 1.0\n"
         "[sampling]\nchord_tolerance_nm = 100\nmax_step_mm = 1000\n"
         "[[variant]]\nname = \"leaning\"\nset = { setup.EA_urad = 30 }\n"
         "[[variant]]\nname = \"high\"\nset = { part.at_mm = [40, 25, 90] }\n";
}

/// A folder with that scene as scene.toml.
class StudyFolder : public RunFolder {
 public:
  StudyFolder() { write("scene.toml", small_scene()); }
};

}  // namespace abbe::sim::study
