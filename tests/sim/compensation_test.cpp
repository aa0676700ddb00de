// Compensators in the loop on small versions of the packaged scenes.

#include <algorithm>
#include <cmath>
#include <iostream>
#include <iterator>
#include <limits>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "kinematics/units.h"
#include "sim/cut/part.h"
#include "sim/program/program_writers.h"
#include "sim/report/verdict.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/small_scene.h"

namespace abbe::sim {
namespace {

using namespace abbe::literals;
using Eigen::Vector3d;
using kinematics::Pose;

struct SmallScene {
  const char* file;
  std::vector<Override> changes;
};

const std::vector<Override> coarse_raster = {
    {"program.step_over_mm", "2.0"}, {"program.step_mm", "1.5"}, {"part.vertices", "4000"}};
const std::vector<Override> coarse_flank = {{"program.step_mm", "1.0"}, {"part.vertices", "4000"}};
const std::vector<Override> coarse_mesh = {{"program.step_over_mm", "2.0"},
                                           {"program.step_mm", "1.5"}};
const std::vector<Override> coarse_spiral = {{"program.feed_um_per_rev", "60"},
                                             {"part.vertices", "4000"}};

std::vector<Override> and_more(std::vector<Override> changes, const std::vector<Override>& more) {
  changes.insert(changes.end(), more.begin(), more.end());
  return changes;
}

double weighted_rms(const cutting::Surface& a, const cutting::Surface& b, const Job& job) {
  return cutting::statistics(cutting::minus(a, b), job.design_w).rms.value();
}

void print_apart(const std::string& what, const Apart& d) {
  std::cout << what << ": rms " << d.rms / units::nm << " nm, max " << d.max / units::nm
            << " nm over " << d.vertices << " vertices, cut in one only: " << d.unlike << "\n";
}

class GantryScene : public testing::TestWithParam<SmallScene> {};

TEST_P(GantryScene, PerfectIteratedIdealGivesTheErrorFreeMapBack) {
  const Job job = job_of(GetParam().file, GetParam().changes);
  const Cut error_free = cut_error_free(job);
  const Cut wrong = cut(job);
  const Cut compensated_commands = cut(job, parse_case("perfect-iterated-ideal"));
  const Apart before = apart(wrong.surface, error_free.surface);
  const Apart after = apart(compensated_commands.surface, error_free.surface);
  print_apart(std::string(GetParam().file) + " uncompensated", before);
  print_apart(std::string(GetParam().file) + " iterated", after);
  std::cout << "  weighted by area "
            << weighted_rms(compensated_commands.surface, error_free.surface, job) / units::nm
            << " nm; tip left " << compensated_commands.tip_error.max / units::nm << " nm\n";
  EXPECT_TRUE(compensated_commands.warnings.empty());
  EXPECT_GT(before.rms, 1.0_um);
  EXPECT_GT(after.vertices, 1000);
  EXPECT_EQ(after.unlike, 0);
  EXPECT_LT(after.rms, 1.0_nm);
  EXPECT_LT(weighted_rms(compensated_commands.surface, error_free.surface, job), 1.0_nm);
}

INSTANTIATE_TEST_SUITE_P(Compensation, GantryScene,
                         testing::Values(SmallScene{"gantry_dome.toml", coarse_raster},
                                         SmallScene{"gantry_tilted_flat.toml", coarse_raster},
                                         SmallScene{"cone_frustum.toml", coarse_flank},
                                         SmallScene{"gantry_mesh.toml", coarse_mesh}),
                         [](const auto& scene) {
                           const std::string name = scene.param.file;
                           return name.substr(0, name.find('.'));
                         });

/// What no motion of X and Z can mend, on its own: the slides run without error, but the tip leaves
/// the X-Z plane by the true deviation's y, it moves in that plane by what of the truth is chance
/// and known to nobody, and the tool turns as the truth turns it. The workpiece frame of the
/// platform is that of the bed with all axes at zero.
cutting::Surface uncorrectable(const Job& job) {
  const Truth known = without_random_errors(job.truth);
  const int S = *job.machine.workpiece_spindle;
  cutting::NoseMotion motion;
  motion.spindle_point = Vector3d::Zero();
  motion.spindle_direction = Vector3d::UnitX();
  std::vector<double> spindle, time;
  for (std::size_t i = 0; i < job.samples.states.size(); ++i) {
    const kinematics::AxisState& state = job.samples.states[i];
    if (!time.empty() && state.time_s <= time.back()) continue;
    const double turn = state.q[S], c = std::cos(turn), s = std::sin(turn);
    Eigen::Matrix3d back;  // by -turn about x
    back << 1, 0, 0, 0, c, s, 0, -s, c;
    const Pose truth = tool_in_workpiece(job.truth, state);
    const Vector3d chance = truth.translation() - tool_in_workpiece(known, state).translation();
    Pose slow = Pose::Identity();
    slow.translation() = back * (job.T_wt_nominal[i].translation() + chance);
    slow.translation().y() +=
        (back * (truth.translation() - job.T_wt_nominal[i].translation() - chance)).y();
    slow.linear() = back * truth.linear();
    motion.T_without_spindle.push_back(slow);
    motion.line.push_back(job.samples.line[i]);
    spindle.push_back(turn);
    time.push_back(state.time_s);
  }
  motion.spindle = Eigen::Map<Eigen::VectorXd>(spindle.data(), Eigen::Index(spindle.size()));
  motion.time_s = Eigen::Map<Eigen::VectorXd>(time.data(), Eigen::Index(time.size()));
  return cutting::turned_surface(job.design_w, std::get<cutting::Nose>(job.scene.tool.actual),
                                 motion, {job.scene.band, {}});
}

class PlatformScene : public testing::TestWithParam<const char*> {};

TEST_P(PlatformScene, PerfectIteratedIdealLeavesWhatItsTwoSlidesCannotCorrect) {
  const Job job = job_of(GetParam(), coarse_spiral);
  ASSERT_TRUE(job.machine.nominal.T_bw_home().isApprox(Pose::Identity()));
  const Cut error_free = cut_error_free(job);
  const Cut wrong = cut(job);
  const Cut compensated_commands = cut(job, parse_case("perfect-iterated-ideal"));
  const cutting::Surface apart_from_it = uncorrectable(job);
  const std::string name = GetParam();
  print_apart(name + " uncompensated", apart(wrong.surface, error_free.surface));
  print_apart(name + " left over", apart(compensated_commands.surface, error_free.surface));
  print_apart(name + " uncorrectable, computed apart", apart(apart_from_it, error_free.surface));
  const Apart d = apart(compensated_commands.surface, apart_from_it);
  print_apart(name + " left over less uncorrectable", d);
  EXPECT_TRUE(compensated_commands.warnings.empty());
  EXPECT_GT(apart(wrong.surface, error_free.surface).rms, 0.3_um);
  EXPECT_GT(d.vertices, 2000);
  EXPECT_EQ(d.unlike, 0);
  EXPECT_LT(d.rms, 1.0_nm);
  EXPECT_LT(weighted_rms(compensated_commands.surface, apart_from_it, job), 1.0_nm);
}

INSTANTIATE_TEST_SUITE_P(Compensation, PlatformScene,
                         testing::Values("platform_plane.toml", "platform_cone.toml",
                                         "platform_sphere.toml"),
                         [](const auto& scene) {
                           const std::string name = scene.param;
                           return name.substr(0, name.find('.'));
                         });

TEST(Compensation, PositionOnlyLeavesTenTimesWhatDecoupledLeavesOnTheTiltedFlat) {
  const Job job = job_of("gantry_tilted_flat.toml", coarse_raster);
  const Cut error_free = cut_error_free(job);
  const double wrong = weighted_rms(cut(job).surface, error_free.surface, job);
  const double position =
      weighted_rms(cut(job, parse_case("perfect-position-ideal")).surface, error_free.surface, job);
  const double decoupled = weighted_rms(cut(job, parse_case("perfect-decoupled-ideal")).surface,
                                        error_free.surface, job);
  std::cout << "tilted flat, machine part rms: uncompensated " << wrong / units::um
            << " um, position only " << position / units::nm << " nm, decoupled "
            << decoupled / units::nm << " nm, ratio " << position / decoupled << "\n";
  EXPECT_LT(position, wrong);
  EXPECT_GE(position, 10.0 * decoupled);
}

/// Tip error along the program after one decoupled step, where A is above 5 degrees.
double decoupled_tip_rms(const Job& job) {
  const int A = job.machine.nominal.find('A').value();
  const Commands commanded = compensate(job, parse_case("perfect-decoupled-ideal"));
  double sum = 0.0;
  int n = 0;
  for (std::size_t i = 0; i < commanded.samples.states.size(); ++i) {
    if (std::abs(job.samples.states[i].q[A]) < 5.0 * units::deg) continue;
    const Pose reached = tool_in_workpiece(job.truth, commanded.samples.states[i]);
    sum += (reached.translation() - job.T_wt_nominal[i].translation()).squaredNorm();
    ++n;
  }
  EXPECT_GT(n, int(0.9 * double(commanded.samples.states.size())));
  return std::sqrt(sum / n);
}

TEST(Compensation, OneDecoupledStepLeavesATipErrorOfSecondOrder) {
  for (const char* file : {"gantry_dome.toml", "gantry_mesh.toml", "cone_frustum.toml"}) {
    const bool flank = std::string(file) == "cone_frustum.toml";
    double left[3] = {0, 0, 0};
    const char* scale[3] = {"4.0", "2.0", "1.0"};
    for (int k = 0; k < 3; ++k) {
      const std::vector<Override>& coarse = flank ? coarse_flank
                                            : std::string(file) == "gantry_mesh.toml"
                                                ? coarse_mesh
                                                : coarse_raster;
      left[k] = decoupled_tip_rms(job_of(file, and_more(coarse, {{"errors.scale", scale[k]}})));
    }
    const double first = std::log2(left[0] / left[1]), second = std::log2(left[1] / left[2]);
    std::cout << file
              << ": tip error after one decoupled step, errors x 4, 2, 1: " << left[0] / units::nm
              << " " << left[1] / units::nm << " " << left[2] / units::nm << " nm rms; exponents "
              << first << " " << second << "\n";
    EXPECT_NEAR(first, 2.0, 0.1) << file;
    EXPECT_NEAR(second, 2.0, 0.1) << file;
  }
}

TEST(Compensation, RewrittenProgramDiffersFromTheIdealChannelByItsWords) {
  for (const double q : {1e-3, 1e-4, 1e-5}) {
    // as many degrees as millimetres, like the defaults (1e-4 of both)
    const std::string words = fmt::format("{:.9f}", q);
    const Job job = job_of("gantry_dome.toml",
                           and_more(coarse_raster, {{"compensation.word_resolution_mm", words},
                                                    {"compensation.angle_resolution_deg", words}}));
    const Cut ideal = cut(job, parse_case("perfect-iterated-ideal"));
    const Cut program = cut(job, parse_case("perfect-iterated-program"));
    const Apart d = apart(program.surface, ideal.surface);
    print_apart(fmt::format("words of {0} mm and {0} deg", q), d);
    EXPECT_EQ(d.unlike, 0);
    EXPECT_LE(d.rms, q);
    EXPECT_GT(d.rms, 0.01 * q);  // it is rounded
  }
}

/// How far the words of a block are from a corrected command, in words.
double words_off(const Job& job, const program::Block& block, const kinematics::AxisVector& q) {
  const auto& control = job.machine.control;
  const CompensationDescription& words = job.scene.compensation;
  const Vector3d tip_w = control.tool_in_workpiece(q).translation();
  double off = 0.0;
  for (const auto& [letter, k] : {std::pair{'X', 0}, std::pair{'Y', 1}, std::pair{'Z', 2}})
    off = std::max(
        off, std::abs(block.end[control.find(letter).value()] - tip_w[k]) / words.word_resolution);
  for (const char letter : {'A', 'C'}) {
    const int k = control.find(letter).value();
    off = std::max(off, std::abs(block.end[k] - q[k]) / words.angle_resolution);
  }
  return off;
}

TEST(Compensation, RewrittenNcIsAcceptedAndKeepsToTheCorrectedPointsWithinAWord) {
  const Job job = job_of("gantry_dome.toml", and_more(coarse_raster, {{"part.vertices", "200"}}));
  const Commands ideal = compensate(job, parse_case("perfect-iterated-ideal"));
  const Commands commanded = compensate(job, parse_case("perfect-iterated-program"));
  const program::Path path = program::read_nc(commanded.rewritten_program, "again.ngc",
                                              nc_options(job.scene, job.machine));
  EXPECT_GE(path.motion_blocks, job.path.motion_blocks);
  const auto cuts = [](const program::Block& block) {
    return block.coordinates == program::Coordinates::Tip &&
           block.interpolation == program::Interpolation::Line;
  };
  std::vector<program::Block> rewritten;
  std::copy_if(path.blocks.begin(), path.blocks.end(), std::back_inserter(rewritten), cuts);
  // A block may have been cut up: its end is the one of the next 20 that fits best.
  double worst = 0.0;
  int points = 0;
  std::size_t from = 0;
  for (std::size_t i = 0; i + 1 < ideal.samples.states.size(); ++i) {
    const int at = ideal.samples.block[i];
    if (at == ideal.samples.block[i + 1] || !cuts(job.path.blocks[std::size_t(at)])) continue;
    double best = std::numeric_limits<double>::infinity();
    std::size_t found = from;
    for (std::size_t k = from; k < std::min(from + 20, rewritten.size()); ++k) {
      const double off = words_off(job, rewritten[k], ideal.samples.states[i].q);
      if (off < best) {
        best = off;
        found = k;
      }
    }
    from = found + 1;
    worst = std::max(worst, best);
    ++points;
  }
  std::cout << points << " corrected points in " << rewritten.size() << " blocks: off by at most "
            << worst << " of a word\n";
  EXPECT_GT(points, 1000);
  EXPECT_LE(worst, 0.5 * (1 + 1e-6));
}

TEST(Compensation, RewrittenPvtReadsBackAndFollowsTheIdealChannel) {
  const Job job = job_of("platform_sphere.toml", coarse_spiral);
  const Cut ideal = cut(job, parse_case("perfect-iterated-ideal"));
  const Cut program = cut(job, parse_case("perfect-iterated-program"));
  const program::NcOptions control = nc_options(job.scene, job.machine);
  const program::Path path = program::read_pvt(program.rewritten_program, "again.csv", control);
  const auto rows = program::pvt_rows(path);
  const std::vector<int> columns = {0, 1, 2};
  EXPECT_EQ(program::write_pvt(rows, control.axes, columns), program.rewritten_program);
  EXPECT_GE(rows.size(), job.path.blocks.size());
  const Apart d = apart(program.surface, ideal.surface);
  print_apart(fmt::format("PVT of {} rows", rows.size()), d);
  EXPECT_EQ(d.unlike, 0);
  EXPECT_LT(d.rms, 1.0_nm);  // its words are not rounded
}

}  // namespace
}  // namespace abbe::sim
