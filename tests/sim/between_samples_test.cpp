// What errors do between the samples of a program, against a closed form and denser samples.
#include "sim/cut/tool_poses.h"

#include <cmath>
#include <iostream>
#include <numbers>

#include <gtest/gtest.h>

#include "kinematics/units.h"
#include "sim/loop/compensate.h"
#include "tests/sim/small_scene.h"

namespace abbe::sim {
namespace {

using namespace abbe::literals;

/// A flat part under straight passes along X, three axes, with errors.
Job passes(const std::string& errors, const std::string& sampling = "") {
  return job_of(BallRaster{.part = "surface = \"rectangle\"\nlength_x_mm = 40.0\n"
                                   "length_y_mm = 10.0\nat_mm = [40, 25, 80]\nvertices = 500",
                           .step_over = 1.0,
                           .step = 1.0,
                           .lead = 0.0,
                           .machine = "three_axis_table",
                           .more = "[errors]\n" + errors + "\n[sampling]\n" + sampling});
}

ChordError looked(const Job& job) { return chord_error(job, uncompensated_commands(job)); }

TEST(ChordError, AWaveIsBentAsItsClosedFormSays) {
  // a wave less the mean of it half a step before and behind: amplitude (1 - cos(pi step / length))
  const double amplitude = 0.8_um;
  for (const double length : {40.0, 10.0, 5.0, 1.7}) {
    for (const double step : {1.0, 0.25}) {
      const Job job = passes(
          fmt::format("EZX = {{ kind = \"fourier\", period_mm = {}, b_um = [0.8] }}", length),
          fmt::format("max_step_mm = {}", step));
      const ChordError found = looked(job);
      const double most = amplitude * std::abs(1.0 - std::cos(std::numbers::pi * step / length));
      std::cout << "wave of " << length << " mm in steps of " << step
                << " mm: " << found.max / units::nm << " nm of " << most / units::nm << " nm\n";
      ASSERT_GT(found.interval_count, 100u);
      EXPECT_LE(found.max, most * (1 + 1e-6) + 1e-3 * units::nm);
      EXPECT_GE(found.max, 0.95 * most);
      EXPECT_NEAR(found.step, step, 1e-3);
      // over all phases
      EXPECT_NEAR(found.rms, most / std::numbers::sqrt2, 0.1 * most);
    }
  }
}

TEST(ChordError, NothingIsBentWithoutWaves) {
  for (const char* errors :
       {"", "EXX = { kind = \"polynomial\", half_range_mm = 400.0, coefficients_um = [3.0, 0.02] }",
        "EZX = { kind = \"backlash\", half_um = 4.0 }"}) {
    const ChordError found = looked(passes(errors));
    EXPECT_GT(found.interval_count, 100u) << errors;
    EXPECT_LT(found.max, 1e-3 * units::nm) << errors;
    EXPECT_TRUE(chord_error_warnings(found, 0.0).empty()) << errors;
  }
}

TEST(ChordError, AWaveThatDividesTheStepsIsSeen) {
  for (const double length : {1.0, 0.5, 0.25, 0.1}) {
    const ChordError found = looked(passes(
        fmt::format("EZX = {{ kind = \"fourier\", period_mm = {}, a_um = [0.8] }}", length)));
    double most = 0.0;
    for (const double share : {0.5, 0.3819660112501051})
      most = std::max(most, 0.8_um * (1.0 - std::cos(2 * pi * share / length)));
    EXPECT_NEAR(found.max, most, 1e-3 * units::nm) << "nothing of it is at the samples";
    EXPECT_GT(found.max, 0.4_um);
    EXPECT_EQ(chord_error_warnings(found, 0.8_um).size(), 1u);
  }
}

TEST(ChordError, TheStepThatIsProposedFollowsThem) {
  const std::string wave = "EZX = { kind = \"fourier\", period_mm = 5.0, b_um = [0.8] }";
  const ChordError coarse = looked(passes(wave));
  ASSERT_GT(coarse.max, 100.0_nm);
  const auto warned = chord_error_warnings(coarse, 1.0_um);
  ASSERT_EQ(warned.size(), 1u);
  const std::string key = "sampling.max_step_mm = ";
  const auto at = warned.front().find(key);
  ASSERT_NE(at, std::string::npos) << warned.front();
  const double step = std::stod(warned.front().substr(at + key.size()));
  const ChordError fine = looked(passes(wave, fmt::format("max_step_mm = {}", step)));
  EXPECT_LT(fine.max, 1.1 * coarse.tolerance);
  ChordError in_place = coarse;
  in_place.step = 0.0;
  const auto without = chord_error_warnings(in_place, 1.0_um);
  ASSERT_EQ(without.size(), 1u);
  EXPECT_EQ(without.front().find(key), std::string::npos) << "no step helps where the tip rests";
  // of a machine that is off by far more it is no matter
  EXPECT_TRUE(chord_error_warnings(coarse, 100.0_um).empty());
}

TEST(ChordError, APerfectBeliefIsWarnedOfWhatItCannotSee) {
  const Job job = passes(
      "EZX = { kind = \"fourier\", period_mm = 5.0, b_um = [0.8] }\n"
      "EXX = { kind = \"polynomial\", half_range_mm = 400.0, coefficients_um = [60.0] }");
  const auto bends = [](const Cut& cut) {
    return std::ranges::any_of(cut.warnings, [](const std::string& text) {
      return text.find("bend the path between the samples") != std::string::npos;
    });
  };
  const Cut wrong = cut(job);
  EXPECT_FALSE(bends(wrong)) << "0.15 um of 60 um";
  EXPECT_GT(wrong.chord_error.max, 100.0_nm);
  const Cut corrected = cut(job, compensate(job, parse_case("perfect-iterated-ideal")));
  EXPECT_TRUE(bends(corrected));
  // other intervals are looked at where corrections turn an axis about
  EXPECT_NEAR(corrected.chord_error.max, wrong.chord_error.max, 10.0_nm);
  EXPECT_EQ(cut_error_free(job).chord_error.interval_count, 0u);
}

/// A part that turns carries the errors of its bed round: that is no bend.
TEST(ChordError, APartThatTurnsBendsNothing) {
  const Job job = job_of("platform_plane.toml", {{"part.vertices", "300"}});
  const ChordError found = looked(job);
  std::cout << "platform: " << found.max / units::nm << " nm, RMS " << found.rms / units::nm
            << " nm, line " << found.line << "\n";
  EXPECT_GT(found.interval_count, 100u);
  EXPECT_LT(found.max, 50.0_nm);
}

}  // namespace
}  // namespace abbe::sim
