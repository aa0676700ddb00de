#pragma once

#include "sim/study/case_plan.h"
#include "sim/study/influence.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

/// Studies of a few hundred vertices, each machine of them cut in some hundredths of a second.
namespace abbe::sim::study {

/// The larger one; what is no number is worse than any number, which no bound of a test lets pass.
inline double worst_of(double a, double b) {
  return std::isnan(a) || std::isnan(b) ? NAN : std::max(a, b);
}

/// Whether a map has rivals and every number of them is one: a least value passes over those that
/// are none.
inline bool is_finite(const InfluenceMap& map) {
  return map.slope.size() > 0 && map.slope.allFinite() && map.shift.allFinite() &&
         map.distance.allFinite() && map.half_curvature.allFinite();
}

/// A scene and what a study varies in it, as TOML.
struct SmallStudy {
  std::string scene;
  std::string inputs;    ///< [[input]] tables
  std::string top = {};  ///< keys of the study before them
  int checks = 0;
  std::string program = {};  ///< text of p.ngc
};

/// The same read and made ready, its first arm with its influence map.
struct MadeStudy {
  explicit MadeStudy(const SmallStudy& small)
      : study(read(small)),
        ready(prepare_configuration(study, study.configurations.front())),
        map(influence_map(study, ready)) {}

  Study read(const SmallStudy& small) const {
    folder.write("scene.toml", small.scene);
    if (!small.program.empty()) folder.write("p.ngc", small.program);
    return read_study(folder.write(
        "study.toml", fmt::format("scene = \"scene.toml\"\n{}\n{}\n[monte_carlo]\ncases = 64\n"
                                  "[influence]\nchecks = {}\n",
                                  small.top, small.inputs, small.checks)));
  }

  SceneFolder folder;
  Study study;
  PreparedConfiguration ready;
  InfluenceMap map;
};

/// An input that acts through paths. @param more  other keys of its table
inline std::string by_path(const std::string& path, double centre, double spread,
                           const std::string& more = {}) {
  return fmt::format("[[input]]\npath = \"{}\"\ncentre = {}\nspread = {}\n{}\n", path, centre,
                     spread, more);
}

inline std::string by_element(const std::string& element, double spread = 0.5,
                              const std::string& more = {}) {
  return fmt::format("[[input]]\nelement = \"{}\"\nspread = {}\n{}\n", element, spread, more);
}

inline std::string by_number(const std::string& number, double centre, double spread,
                             const std::string& more = {}) {
  return fmt::format("[[input]]\nnumber = \"{}\"\ncentre = {}\nspread = {}\n{}\n", number, centre,
                     spread, more);
}

/// All elements, or all their numbers, at random, the scene's own values being one spread.
inline std::string every(const std::string& what) {
  return fmt::format("[[inputs]]\nevery = \"{}\"\nlow = -3\nhigh = 3\n", what);
}

inline std::string file_of(const std::string& name) { return packaged(name).string(); }

/// A dome under a ball end mill R 5 on the gantry with its errors. @param more, top  sections after
/// all others, keys before them
inline std::string ball_dome(const std::string& more = {}, const std::string& top = {}) {
  BallRaster raster;
  raster.part =
      "name = \"dome\"\nsurface = \"sphere_cap\"\nradius_mm = 100.0\nrim_radius_mm = 10.0\n"
      "at_mm = [40, 25, 80]\nvertices = 400\ntolerance_um = 10";
  raster.step_over = 0.8;
  raster.step = 0.5;
  raster.more = more;
  return fmt::format("errors = \"{}\"\n{}\n", file_of("errors/gantry_typical.toml"), top) +
         to_toml(raster);
}

/// A tilted flat under a bull-nose cutter on the same machine.
inline std::string bull_flat() {
  return fmt::format(
      "machine = \"{0}\"\nerrors = \"{1}\"\ntool = \"{2}\"\n"
      "[part]\nname = \"flat\"\nsurface = \"rectangle\"\nlength_x_mm = 16\nlength_y_mm = 16\n"
      "at_mm = [30, -20, 90]\nturn_deg = [30, 0, 0]\nvertices = 400\n"
      "[program]\ngenerator = \"raster\"\nstep_over_mm = 0.9\nstep_mm = 1\nlead_deg = 5\n"
      "clearance_mm = 10\npattern = \"one_way\"\noverrun_mm = 2\n",
      file_of("machines/gantry_cxyza.toml"), file_of("errors/gantry_typical.toml"),
      file_of("tools/bull_r6_r1.toml"));
}

/// A cone milled by the flank of a flat end mill on the same machine.
inline std::string flank_cone() {
  return fmt::format(
      "machine = \"{0}\"\nerrors = \"{1}\"\ntool = \"{2}\"\n"
      "[part]\nname = \"cone\"\nsurface = \"cone\"\nbase_radius_mm = 20\nheight_mm = 12\n"
      "half_apex_deg = 15\nat_mm = [20, 30, 60]\nturn_deg = [10, 0, 0]\nvertices = 400\n"
      "[program]\ngenerator = \"flank\"\nstep_mm = 0.5\nclearance_mm = 10\ntip_below_mm = 2\n",
      file_of("machines/gantry_cxyza.toml"), file_of("errors/gantry_typical.toml"),
      file_of("tools/flat_r8.toml"));
}

/// A flat cone turned on the platform with its slides' and its spindle's errors and a diamond whose
/// nose is wavy.
inline std::string turned_cone(const std::string& more = {}) {
  return fmt::format(
      "machine = \"{0}\"\nerrors = [\"{1}\", \"{2}\"]\n"
      "[tool]\nname = \"diamond\"\nkind = \"nose\"\nradius_mm = 0.249\nlength_mm = 60\n"
      "[tool.actual]\nradius_mm = 0.2495\nlength_mm = 60\n"
      "[[tool.actual.wave]]\norder = 3\namplitude_um = 0.2\nphase_deg = 40\n"
      "[part]\nname = \"cone\"\nsurface = \"revolved\"\nstart_mm = [0, 0.2]\n"
      "profile = [{{ to_mm = [3, 0] }}]\nturn_deg = [0, 90, 0]\nvertices = 400\n"
      "[program]\ngenerator = \"spiral\"\nspeed_rpm = 150\nfeed_um_per_rev = 40\n"
      "start_beyond_rim_mm = 0.2\nend_radius_mm = 0\ninterval_s = 0.1\nformat = \"pvt\"\n"
      "[sampling]\nchord_tolerance_nm = 20\n{3}",
      file_of("machines/platform_xz.toml"), file_of("errors/platform_peng.toml"),
      file_of("errors/platform_spindle.toml"), more);
}

}  // namespace abbe::sim::study
