// Compensated programs written by the program channel and by `abbe rewrite`, held against
// corrections made afresh at every sample of what was written.

#include <cmath>
#include <iostream>
#include <limits>

#include <gtest/gtest.h>

#include "kinematics/units.h"
#include "sim/commands/program_commands.h"
#include "sim/compensation/correct.h"
#include "sim/cut/part.h"
#include "sim/files/output.h"
#include "sim/loop/correction_channels.h"
#include "sim/program/program_writers.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/refusal.h"
#include "tests/sim/small_scene.h"

namespace abbe::sim {
namespace {

using namespace abbe::literals;
using kinematics::Pose;

/// A program of long lines and arcs on the gantry with its typical errors, just above the part.
std::filesystem::path long_moves(const SceneFolder& folder, const std::string& program) {
  const std::string scenes = packaged("").string();
  folder.write("long.ngc", program);
  return folder.write("long.toml", fmt::format("machine = \"{0}machines/gantry_cxyza.toml\"\n"
                                               "errors = \"{0}errors/gantry_typical.toml\"\n"
                                               "tool = \"{0}tools/ball_r5.toml\"\n"
                                               "[part]\nsurface = \"sphere_cap\"\nradius_mm = 100\n"
                                               "rim_radius_mm = 50\nat_mm = [0, 0, 119]\n"
                                               "vertices = 200\n"
                                               "[program]\nfile = \"long.ngc\"\n",
                                               scenes));
}

const std::string tip_program =
    "G21 G94 G43.4 H1\nS8000 M3\nG0 X-80 Y-40 Z120 A20 C0\nG1 X90 Y30 F2000\nG1 X-60 Z140 A35 "
    "C120\n"
    "G17 G3 X60 Y30 I60 J0 A20\nG1 X-60 Y30 F900\nM5\nM30\n";
const std::string axis_program =
    "G21 G94 G49\nG0 X-80 Y-40 Z60 A10\nG1 X90 Y30 F2000\nG93 G1 X-60 Z90 A15 C90 F6\nG94 G17 G2 "
    "X40 Y30 "
    "R70 F1500\nG18 G3 X-20 Z90 R50\nG1 X-120 F900\nM30\n";

const std::vector<Override> fine_words = {{"compensation.word_resolution_mm", "0.000001"},
                                          {"compensation.angle_resolution_deg", "0.000001"}};

std::vector<Override> with_tolerance(std::vector<Override> changes, double um) {
  changes.emplace_back("compensation.path_tolerance_um", fmt::format("{}", um));
  return changes;
}

/// Largest distance, tip or tool at `reach`, between what the axes are commanded and a perfect
/// iterated correction made at that sample, jumps and rapids left out.
double off_corrected(const Job& job, const Commands& commanded, double reach) {
  const Truth truth = without_random_errors(job.truth);
  compensation::CorrectOptions options;
  options.rotary_bound = job.scene.compensation.rotary_bound;
  if (const auto* cutter = std::get_if<cutting::Cutter>(&job.scene.tool.nominal))
    options.functional_height = cutter->corner_radius;
  if (const auto spindle = job.machine.workpiece_spindle)
    options.fixed_joints.set(std::size_t(*spindle));
  double most = 0.0;
  for (std::size_t i = 0; i < commanded.samples.states.size(); ++i) {
    const program::Block& block = commanded.path->blocks[std::size_t(commanded.samples.block[i])];
    if (block.interpolation == program::Interpolation::Rapid) continue;
    const kinematics::AxisState& state = commanded.samples.states[i];
    const auto ideal = compensation::correct(
        job.machine.control, [&](const auto& at) { return tool_in_workpiece(truth, at); },
        commanded.T_wt_nominal[i], state, options);
    const Pose a = job.machine.control.tool_in_workpiece(state.q);
    const Pose b = job.machine.control.tool_in_workpiece(ideal.q);
    const Eigen::Vector3d tip = a.translation() - b.translation();
    const Eigen::Vector3d turn = a.linear().col(2) - b.linear().col(2);
    most = std::max({most, tip.norm(), (tip + reach * turn).norm()});
  }
  return most;
}

TEST(RewrittenProgram, KeepsWithinItsToleranceOfTheCorrectedPath) {
  for (const std::string& program : {tip_program, axis_program}) {
    const SceneFolder folder;
    const std::filesystem::path file = long_moves(folder, program);
    int blocks = std::numeric_limits<int>::max();
    for (const double um : {0.05, 0.5, 5.0}) {
      const Job job = prepare(read_scene(file, with_tolerance(fine_words, um)));
      const Commands commanded = compensate(job, parse_case("perfect-iterated-program"));
      const double reach = sample_options(job.scene, job.machine).reach;
      const double off = off_corrected(job, commanded, reach);
      std::cout << job.path.motion_blocks << " blocks, tolerance " << um << " um: off by at most "
                << off / units::um << " um in " << commanded.path->motion_blocks << " blocks\n";
      // words of a nanometre and 1e-6 deg at 0.5 m, what the samples leave between them
      EXPECT_LE(off, um * units::um + 0.02_um);
      EXPECT_LT(commanded.path->motion_blocks, blocks);
      blocks = commanded.path->motion_blocks;
    }
  }
}

TEST(RewrittenProgram, WithNothingToCorrectIsTheOriginal) {
  for (const std::string& program : {tip_program, axis_program}) {
    const SceneFolder folder;
    std::vector<Override> changes = fine_words;
    changes.emplace_back("errors.scale", "0.0");
    const Job job = prepare(read_scene(long_moves(folder, program), changes));
    const Commands commanded = compensate(job, parse_case("perfect-iterated-program"));
    const ProgramChange change = program_change(job, commanded);
    std::cout << job.path.motion_blocks << " blocks became " << commanded.path->motion_blocks
              << ", tip off by " << change.tip.max / units::nm << " nm\n";
    EXPECT_LE(commanded.path->motion_blocks, job.path.motion_blocks + 1);
    EXPECT_LE(commanded.path->arcs.size(),
              job.path.arcs.size() + 1);        // half a circle becomes two arcs
    EXPECT_LE(change.tip.max, 1e-6 + 20.0_nm);  // the tolerance is a word, angles are words too
    EXPECT_EQ(commanded.rewritten_program.find("G43.4") != std::string::npos,
              program.find("G43.4") != std::string::npos);
  }
}

TEST(RewrittenProgram, PvtHasFewerRowsTheMoreItsPathMayDiffer) {
  const std::vector<Override> spiral = {{"program.feed_um_per_rev", "200"},
                                        {"part.vertices", "1000"}};
  std::size_t rows = 0;
  for (const double um : {1.0, 0.1, 0.01, 0.0}) {
    const Job job = job_of("platform_sphere.toml", with_tolerance(spiral, um));
    const Commands commanded = compensate(job, parse_case("perfect-iterated-program"));
    const double off = off_corrected(job, commanded, 0.0);
    std::cout << "tolerance " << um << " um: " << commanded.path->blocks.size() << " rows, "
              << commanded.rewritten_program.size() << " bytes, of " << job.path.blocks.size()
              << " rows and " << job.samples.states.size() << " samples, off by at most "
              << off / units::nm << " nm\n";
    EXPECT_LE(off, (um > 0.0 ? um * units::um : 1.0_nm) + 2.0_nm);  // 2 nm: the scene's chords
    EXPECT_GE(commanded.path->blocks.size(), rows);
    EXPECT_LT(10 * commanded.path->blocks.size(), job.samples.states.size());
    rows = commanded.path->blocks.size();
    if (um == 1.0) {
      EXPECT_EQ(rows, job.path.blocks.size());  // those that were there suffice
    }
  }
}

TEST(RewrittenProgram, OfAShaftTurnsNothingButWhereTheToolStands) {
  const Job job = job_of("stepped_shaft.toml", {{"part.vertices", "1000"}});
  const Commands commanded = compensate(job, parse_case("perfect-iterated-program"));
  const ProgramChange change = program_change(job, commanded);
  std::cout << job.path.motion_blocks << " blocks became " << commanded.path->motion_blocks
            << ", tip moved by " << change.tip.max / units::um << " um, tool axis by "
            << change.direction.max << " rad\n";
  EXPECT_GT(change.tip.max, 1.0_um);
  EXPECT_LT(change.tip.max, 60.0_um);
  EXPECT_LT(change.direction.max, 1e-9);
}

TEST(RewriteCommand, WritesAProgramThatItsReaderTakesAndSaysWhatItIs) {
  const SceneFolder folder;
  const std::filesystem::path file = long_moves(folder, tip_program);
  ProgramRewriteOptions options;
  options.case_name = "perfect-iterated-program";
  options.overrides = {{"compensation.path_tolerance_um", "0.5"}};
  options.out = folder.path() / "made" / "again.ngc";
  const RewriteOutcome done = rewrite(file, options);
  const Job job = prepare(read_scene(file, options.overrides));
  const program::Path path = program::read_nc_file(options.out, nc_options(job.scene, job.machine));
  EXPECT_EQ(int(done.blocks_before), job.path.motion_blocks);
  EXPECT_EQ(int(done.blocks_after), path.motion_blocks);
  EXPECT_EQ(done.bytes, std::filesystem::file_size(options.out));
  EXPECT_EQ(done.path_tolerance / units::um, 0.5);
  EXPECT_EQ(done.words->mm, 1e-4);
  const double most = done.correction.tip.max / units::um,
               rms = done.correction.tip.rms / units::um;
  EXPECT_GT(rms, 1.0);
  EXPECT_GT(most, rms);
  EXPECT_LT(most, 200.0);
  // the correction undoes what the uncompensated tool is off
  EXPECT_NEAR(most, cut(job).tip_error.max / units::um, 0.1 * most);
}

TEST(RewriteCommand, OfAProgramThatMissesThePartIsWrittenWithAWarning) {
  const SceneFolder folder;
  ProgramRewriteOptions options;
  options.case_name = "perfect-iterated-program";
  options.overrides = {{"part.at_mm", "[0, 0, 0]"}, {"part.vertices", "2000"}};
  options.out = folder.path() / "in_the_air.ngc";
  const RewriteOutcome done = rewrite(long_moves(folder, tip_program), options);
  ASSERT_EQ(done.warnings.size(), 1u);
  EXPECT_NE(done.warnings[0].find("nothing of the part is cut"), std::string::npos);
  EXPECT_TRUE(std::filesystem::exists(options.out));
}

TEST(RewriteCommand, RefusesWhatItCannotDo) {
  const SceneFolder folder;
  const std::filesystem::path file = long_moves(folder, tip_program);
  const auto refused = [&](const ProgramRewriteOptions& options) {
    return refusal_by([&] { rewrite(file, options); });
  };
  ProgramRewriteOptions options;
  options.out = folder.path() / "again.ngc";
  EXPECT_NE(refused(options).find("expected a case with channel program"), std::string::npos);
  for (const char* name : {"perfect-iterated-ideal", "perfect-iterated-pulses"}) {
    options.case_name = name;
    EXPECT_NE(refused(options).find("channel program"), std::string::npos) << name;
  }
  for (const char* name : {"perfect-iterated", "wrong-iterated-program", "-", "uncompensated"}) {
    options.case_name = name;
    EXPECT_NE(refused(options).find("expected a case"), std::string::npos) << name;
  }
  options.case_name = "perfect-iterated-program";
  for (const char* um : {"-1", "nan", "inf", "\"a\""}) {
    options.overrides = {{"compensation.path_tolerance_um", um}};
    EXPECT_NE(refused(options), "") << um;
  }
  for (const char* mm : {"0", "-1", "1e-30", "nan"}) {
    options.overrides = {{"compensation.word_resolution_mm", mm}};
    EXPECT_ANY_THROW(rewrite(file, options)) << mm;
  }
  options.overrides.clear();
  EXPECT_FALSE(std::filesystem::exists(options.out));
  for (const std::filesystem::path& out : {folder.path() / "long.ngc", folder.path() / "long.toml",
                                           folder.path() / "long.ngc" / "below.ngc"}) {
    options.out = out;
    EXPECT_THROW(rewrite(file, options), OutputFailure) << out;
  }
  std::ifstream source(folder.path() / "long.ngc");
  const std::string text{std::istreambuf_iterator<char>(source), {}};
  EXPECT_EQ(text, tip_program);
  options.out = folder.path();  // a folder takes the file
  rewrite(file, options);
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "rewritten.ngc"));
}

}  // namespace
}  // namespace abbe::sim
