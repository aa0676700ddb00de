// The machines are scenes, not code: chains of every kind cut the same part.

#include <iostream>
#include <random>

#include <gtest/gtest.h>

#include "kinematics/units.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/small_scene.h"

namespace abbe::sim {
namespace {

using namespace abbe::literals;

struct MachineKind {
  const char* machine;
  const char* slides;
  const char* turns;
  double lead;  ///< deg
};

const MachineKind gantry_kind{"gantry_cxyza", "XYZ", "CA", 25.0};
const MachineKind other_machines[] = {{"trunnion_ca", "XYZ", "CA", 25.0},
                                      {"head_head", "XYZ", "CA", 25.0},
                                      {"three_axis_table", "XYZ", "", 0.0}};

/// A small dome whose chords (0.1 nm) and turns between points are too short to tell machines
/// apart.
BallRaster dome_on(const MachineKind& kind, const std::string& errors = {}) {
  return {.part =
              "surface = \"sphere_cap\"\nradius_mm = 100.0\nrim_radius_mm = 2.0\n"
              "at_mm = [40, 25, 80]\nvertices = 4000",
          .step_over = 0.4,
          .step = 0.01,
          .lead = kind.lead,
          .machine = kind.machine,
          .more = errors};
}

/// Every element that the machine can have: 20 um and 30 urad, error motions as cubics.
std::string random_errors(const MachineKind& kind, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const std::string linear = "XYZ", all = "XYZABC";
  std::string constants = "[errors]\n", curves;
  const auto size = [&](char direction) { return linear.find(direction) < 3 ? 20.0 : 30.0; };
  const auto suffix = [&](char direction) { return linear.find(direction) < 3 ? "um" : "urad"; };
  const auto constant = [&](const std::string& name) {
    constants +=
        fmt::format("{}_{} = {:.6f}\n", name, suffix(name[1]), size(name[1]) * unit(random));
  };
  for (const char axis : std::string(kind.slides) + kind.turns)
    for (const char direction : all) {
      const double s = size(direction) / 2;
      curves += fmt::format(
          "[errors.E{0}{1}]\nkind = \"polynomial\"\ncoefficients_{2} = "
          "[{3:.6f}, {4:.6f}, {5:.6f}, {6:.6f}]\nhalf_range_{7}\n",
          direction, axis, suffix(direction), s * unit(random), s * unit(random), s * unit(random),
          s * unit(random), linear.find(axis) < 3 ? "mm = 300" : "deg = 180");
    }
  for (const char* name : {"EXS", "EYS", "EZS", "EAS", "EBS", "EC0Y", "EB0Z", "EA0Z"})
    constant(name);
  if (kind.turns[0] != '\0')
    for (const char* name : {"EB0A", "EC0A", "EA0C", "EB0C", "EY0A", "EZ0A", "EX0C", "EY0C"})
      constant(name);
  return constants + curves;
}

TEST(ChainScenes, EveryMachineCutsTheMapOfTheGantry) {
  const Cut reference = cut_error_free(job_of(dome_on(gantry_kind)));
  for (const MachineKind& kind : other_machines) {
    const Job job = job_of(dome_on(kind));
    const Apart d = apart(cut_error_free(job).surface, reference.surface);
    std::cout << kind.machine << " against the gantry: rms " << d.rms / units::nm << " nm, max "
              << d.max / units::nm << " nm over " << d.vertices << " vertices, "
              << job.path.motion_blocks << " moves\n";
    EXPECT_GT(d.vertices, 3000) << kind.machine;
    EXPECT_EQ(d.unlike, 0) << kind.machine;
    EXPECT_LT(d.max, 1.0_nm) << kind.machine;
  }
}

TEST(ChainScenes, PerfectIteratedIdealMendsEveryMachine) {
  for (const MachineKind& kind :
       {gantry_kind, other_machines[0], other_machines[1], other_machines[2]}) {
    for (const unsigned seed : {20260401u, 20260402u}) {
      SCOPED_TRACE(testing::Message() << kind.machine << " seed " << seed);
      BallRaster scene = dome_on(kind, random_errors(kind, seed));
      scene.step = 0.2;
      // at home Z stands at the end of its travel, where no correction has room
      const Job job = job_of(scene, {{"machine.home.Z_mm", "280"}});
      const Cut error_free = cut_error_free(job);
      const Apart before = apart(cut(job).surface, error_free.surface);
      const Cut compensated_commands = cut(job, parse_case("perfect-iterated-ideal"));
      const Apart after = apart(compensated_commands.surface, error_free.surface);
      std::cout << kind.machine << ", seed " << seed << ": uncompensated rms "
                << before.rms / units::um << " um, iterated " << after.rms / units::nm
                << " nm, worst direction left "
                << compensated_commands.remaining_direction_error / units::urad << " urad\n";
      EXPECT_TRUE(compensated_commands.warnings.empty());
      EXPECT_GT(before.rms, 1.0_um);
      EXPECT_GT(after.vertices, 3000);
      EXPECT_EQ(after.unlike, 0);
      EXPECT_LT(after.rms, 1.0_nm);
    }
  }
}

}  // namespace
}  // namespace abbe::sim
