// The rules of controls for vectors of the tool and near a pole (`pole` of [program]).

#include "kinematics/inverse_kinematics.h"
#include "sim/dialects/read_options.h"
#include "sim/dialects/read_program.h"
#include "sim/dialects/tool_vectors.h"
#include "tests/program/machines.h"
#include "tests/test.h"

namespace abbe::sim::dialects::pole_tests {
namespace {

namespace pole_machines = program::test;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Motion;
using kinematics::Pose;
using kinematics::Side;
using program::Block;
using program::Coordinates;

constexpr int c = 0, a = 4;  // joints of the gantry `w C' b X Y Z A s t`
constexpr double deg = units::deg;

PoleOptions by_fanuc(double near_deg, double change_deg) {
  return {PoleRule::Fanuc, near_deg * deg, change_deg * deg};
}

ReadOptions pole_options(Dialect dialect, const PoleOptions& pole,
                         const Chain& chain = pole_machines::gantry()) {
  ReadOptions options;
  options.control = pole_machines::options_for(chain);
  options.dialect = dialect;
  options.pole = pole;
  return options;
}

std::string pole_refusal(const std::string& text, const ReadOptions& options) {
  return thrown_text<BadInput>([&] { read_program(text, "part.nc", options); }, "accepted");
}

Vector3d tool(const Chain& chain, const AxisVector& q) {
  return chain.tool_in_workpiece(q).linear().col(2).normalized();
}

double between(const Vector3d& u, const Vector3d& v) {
  return std::atan2(u.cross(v).norm(), u.dot(v));
}

AxisVector rotary(double c_deg, double a_deg) {
  AxisVector q = AxisVector::Zero(6);
  q[c] = c_deg * deg;
  q[a] = a_deg * deg;
  return q;
}

/// Unit vectors evenly along the great circle, by the sine rule of interpolation.
std::vector<Vector3d> great_circle(const Vector3d& from, const Vector3d& to, int pieces) {
  const double angle = between(from, to);
  std::vector<Vector3d> all;
  for (int i = 0; i <= pieces; ++i) {
    const double t = double(i) / pieces;
    all.push_back((std::sin((1 - t) * angle) * from + std::sin(t * angle) * to) / std::sin(angle));
  }
  return all;
}

// ---- the rule itself

// FANUC A-79294E: a tool side axis that ends at 60 with its singular position at 20 goes to -20, a
// workpiece side axis that began at -150 and ends at 30 stays at -150.
TEST(FanucPosture, IsTheExampleOfTheManual) {
  const Chain gantry = pole_machines::gantry();
  Pose T_bt = gantry.T_bt_home();
  T_bt.linear() = Eigen::AngleAxisd(-20 * deg, Vector3d::UnitX()).toRotationMatrix();
  const Chain leaning(gantry.joints(), gantry.T_bw_home(), T_bt);
  const auto passage =
      fanuc::pole_passage(leaning, rotary(-150, 50), rotary(30, 60), by_fanuc(1, 1));
  ASSERT_TRUE(passage);
  EXPECT_NEAR(passage->end[a] / deg, -20.0, 1e-9);
  EXPECT_NEAR(passage->end[c] / deg, -150.0, 1e-9);
  EXPECT_NEAR(passage->pole_distance, 0.0, 1e-12);
  EXPECT_NEAR(passage->end_rotation, 0.0, 1e-9);
}

TEST(FanucPosture, LeadsABlockThroughThePoleThatItPassesCloseBy) {
  const Chain gantry = pole_machines::gantry();
  const AxisVector from = rotary(20, 10), to = rotary(20 + 175, 8);
  const auto passage = fanuc::pole_passage(gantry, from, to, by_fanuc(2, 10));
  ASSERT_TRUE(passage);
  EXPECT_EQ(passage->end[c], from[c]) << "the axis that is free at the pole stays";
  EXPECT_NEAR(passage->end[a] / deg, -8.0, 1e-9);
  EXPECT_NEAR(passage->end_rotation / deg, 5.0, 1e-9);
  // two vectors that lean by 8 degrees, 5 degrees apart about the pole
  EXPECT_NEAR(passage->vector_error, 2 * std::asin(std::sin(8 * deg) * std::sin(2.5 * deg)), 1e-12);
  double nearest = pi;
  for (const Vector3d& v : great_circle(tool(gantry, from), tool(gantry, to), 100'000))
    nearest = std::min(nearest, between(v, Vector3d::UnitZ()));
  EXPECT_NEAR(passage->pole_distance, nearest, 1e-7) << "by walking along the great circle";
  std::cout << "passed by " << passage->pole_distance / deg << " deg, end off by "
            << passage->vector_error / deg << " deg\n";
}

TEST(FanucPosture, ChangesNothingWhereItShouldNot) {
  const Chain gantry = pole_machines::gantry();
  const auto changed = [&](const AxisVector& from, const AxisVector& to, double near, double most) {
    return fanuc::pole_passage(gantry, from, to, by_fanuc(near, most)).has_value();
  };
  EXPECT_TRUE(changed(rotary(0, 10), rotary(175, 8), 2, 10));
  EXPECT_FALSE(changed(rotary(0, 10), rotary(175, 8), 0.1, 10)) << "not close";
  EXPECT_FALSE(changed(rotary(0, 10), rotary(175, 8), 2, 4)) << "beyond parameter 19739";
  EXPECT_FALSE(changed(rotary(0, 0), rotary(175, 8), 2, 10)) << "begins in the pole";
  EXPECT_FALSE(changed(rotary(0, 10), rotary(175, 0), 2, 10)) << "ends in the pole";
  EXPECT_FALSE(changed(rotary(0, 10), rotary(3, 1), 2, 10)) << "ends near it and does not pass";
  EXPECT_FALSE(changed(rotary(0, 10), rotary(0, 10), 2, 10)) << "does not turn";
}

TEST(FanucPosture, RandomBlocksPassThePoleAndKeepTheLean) {
  const unsigned seed = 20261125;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(-1, 1);
  const Chain gantry = pole_machines::gantry();
  int passed = 0;
  double lean = 0.0;
  for (int i = 0; i < 20'000; ++i) {
    const AxisVector from = rotary(180 * any(random), 30 * any(random)),
                     to = rotary(180 * any(random), 30 * any(random));
    const auto passage = fanuc::pole_passage(gantry, from, to, by_fanuc(3, 15));
    if (!passage) continue;
    double nearest = pi;
    for (const Vector3d& v : great_circle(tool(gantry, from), tool(gantry, to), 300))
      nearest = std::min(nearest, between(v, Vector3d::UnitZ()));
    ++passed;
    EXPECT_LT(passage->pole_distance, 3 * deg) << "seed " << seed;
    EXPECT_NEAR(passage->pole_distance, nearest, 0.2 * deg);
    EXPECT_LE(passage->end[a] * from[a], 0.0) << "beyond the pole";
    lean = std::max(lean, std::abs(std::abs(passage->end[a]) - std::abs(to[a])));
    EXPECT_LE(passage->end_rotation, 15 * deg);
  }
  std::cout << "seed " << seed << ": " << passed << " of 20000 led through\n";
  EXPECT_GT(passed, 200);
  EXPECT_LT(lean, 1e-12);
}

// ---- programs

std::string vector_words(const Vector3d& v) {
  return fmt::format("I{:.9f} J{:.9f} K{:.9f}", v.x(), v.y(), v.z());
}

/// G43.5 from one direction to another, at feed.
std::string fanuc_program(const Vector3d& from, const Vector3d& to) {
  return "O1\nG21 G90 G94 G17\nG54\nG43.5 H1\nG0 X0. Y0. Z50. " + vector_words(from) +
         "\nG1 X10. Y5. Z40. " + vector_words(to) + " F1000.\nM30\n";
}

/// The angle of the tool to z in the middle of the block and between, the least.
double min_lean(const Chain& chain, const program::Path& path, std::size_t block) {
  double least = pi;
  for (int i = 0; i <= 1000; ++i)
    least = std::min(
        least, between(tool(chain, program::position(path, path.blocks[block], double(i) / 1000)),
                       Vector3d::UnitZ()));
  return least;
}

TEST(PoleOfPrograms, FanucLeadsG435ThroughThePoleAndSaysBy) {
  const Chain gantry = pole_machines::gantry();
  const Vector3d from = tool(gantry, rotary(20, 10)), to = tool(gantry, rotary(195, 8));
  const ParsedProgram read = read_program(fanuc_program(from, to), "part.nc",
                                          pole_options(Dialect::Fanuc, by_fanuc(2, 10)));
  ASSERT_EQ(read.path.blocks.size(), 2u);
  const Block& line = read.path.blocks[1];
  EXPECT_EQ(line.coordinates, Coordinates::Tip);
  EXPECT_EQ(line.end[c], line.start[c]) << "C stays";
  EXPECT_NEAR(line.end[a], -line.start[a] * 8 / 10, 1e-8);
  EXPECT_LT(min_lean(gantry, read.path, 1), 0.02 * deg);
  ASSERT_EQ(read.warnings.size(), 1u) << fmt::format("{}", fmt::join(read.warnings, "\n"));
  EXPECT_EQ(read.warnings[0],
            "1 blocks would pass a pole closer than 2 deg and are led through it (tool posture "
            "control, parameters 19738 and 19739): their ends are rotated about it by up to 5 deg, "
            "and the tool deviates from its vector by up to 0.696 deg (line 6)");
  // without the rule C turns
  const auto plain =
      read_program(fanuc_program(from, to), "part.nc", pole_options(Dialect::Fanuc, {}));
  const Block& before = plain.path.blocks[1];
  EXPECT_GT(std::abs(before.end[c] - before.start[c]) + std::abs(before.end[a] - before.start[a]),
            1 * deg);
}

/// How far the tool is from the great circle of two directions anywhere on blocks from `first` on.
double off_great_circle(const Chain& chain, const program::Path& path, std::size_t first,
                        const Vector3d& from, const Vector3d& to) {
  const Vector3d normal = from.cross(to).normalized();
  double worst = 0.0;
  for (std::size_t i = first; i < path.blocks.size(); ++i)
    for (int k = 0; k <= 10; ++k)
      worst = std::max(
          worst, std::abs(std::asin(
                     tool(chain, program::position(path, path.blocks[i], k / 10.0)).dot(normal))));
  return worst;
}

TEST(PoleOfPrograms, FanucTurnsOtherLinesInThePlaneOfTheirVectors) {
  const Chain gantry = pole_machines::gantry();
  const Vector3d from = tool(gantry, rotary(20, 10)), to = tool(gantry, rotary(110, 25));
  const ParsedProgram read = read_program(fanuc_program(from, to), "part.nc",
                                          pole_options(Dialect::Fanuc, by_fanuc(2, 10)));
  EXPECT_TRUE(read.warnings.empty());
  EXPECT_GT(read.path.blocks.size(), 10u);
  const double off = off_great_circle(gantry, read.path, 1, from, to);
  std::cout << read.path.blocks.size() - 1 << " pieces, " << off * 1e6 << " urad off\n";
  EXPECT_LT(off, 1.1e-6);
  EXPECT_LT(between(tool(gantry, read.path.blocks.back().end), to), 1e-8);
}

std::string cl_program(const Vector3d& from, const Vector3d& to) {
  const auto words = [](const Vector3d& v) {
    return fmt::format("{:.9f},{:.9f},{:.9f}", v.x(), v.y(), v.z());
  };
  return "UNITS/MM\nMULTAX/ON\nFEDRAT/1000\nRAPID\nGOTO/0,0,50," + words(from) + "\nGOTO/10,5,40," +
         words(to) + "\nFINI\n";
}

TEST(PoleOfPrograms, CutterLocationsRunAsG435WouldRun) {
  const Chain gantry = pole_machines::gantry();
  const Vector3d from = tool(gantry, rotary(20, 10));
  for (const double turn : {175.0, 90.0}) {
    const Vector3d to = tool(gantry, rotary(20 + turn, 8));
    const auto fanuc = read_program(fanuc_program(from, to), "part.nc",
                                    pole_options(Dialect::Fanuc, by_fanuc(2, 10)));
    const auto cl =
        read_program(cl_program(from, to), "part.cl", pole_options(Dialect::Cl, by_fanuc(2, 10)));
    ASSERT_EQ(fanuc.path.blocks.size(), cl.path.blocks.size()) << turn;
    for (std::size_t i = 1; i < cl.path.blocks.size(); ++i)
      EXPECT_LT((fanuc.path.blocks[i].end - cl.path.blocks[i].end).norm(), 1e-7) << i;
  }
}

// The next point turns the rotary axes again, even with the vector that was not reached.
TEST(PoleOfPrograms, AfterAChangedEndThePointBehindItIsReached) {
  const Chain gantry = pole_machines::gantry();
  const Vector3d from = tool(gantry, rotary(20, 10)), to = tool(gantry, rotary(195, 8));
  std::string text = cl_program(from, to);
  text.replace(text.find("FINI"), 4,
               fmt::format("GOTO/20,5,40,{:.9f},{:.9f},{:.9f}\nFINI", to.x(), to.y(), to.z()));
  const auto read = read_program(text, "part.cl", pole_options(Dialect::Cl, by_fanuc(2, 10)));
  EXPECT_GT(between(tool(gantry, read.path.blocks[1].end), to), 0.5 * deg);
  EXPECT_LT(between(tool(gantry, read.path.blocks.back().end), to), 1e-8);
}

TEST(PoleOfPrograms, SiemensTurnsCutterLocationsAsItsOwnPrograms) {
  const Chain gantry = pole_machines::gantry();
  const Vector3d from = tool(gantry, rotary(20, 10)), to = tool(gantry, rotary(80, 25));
  const auto words = [](const Vector3d& v) {
    return fmt::format("A3={:.9f} B3={:.9f} C3={:.9f}", v.x(), v.y(), v.z());
  };
  const auto siemens =
      read_program("T1 D1 G90 G54\nTRAORI\nORIWKS\nG0 X0 Y0 Z50 " + words(from) +
                       "\nG1 X10 Y5 Z40 " + words(to) + " F1000\nM30\n",
                   "part.mpf", pole_options(Dialect::Siemens, {PoleRule::Siemens}));
  const auto cl =
      read_program(cl_program(from, to), "part.cl", pole_options(Dialect::Cl, {PoleRule::Siemens}));
  ASSERT_EQ(siemens.path.blocks.size(), cl.path.blocks.size());
  EXPECT_GT(cl.path.blocks.size(), 10u);
  for (std::size_t i = 1; i < cl.path.blocks.size(); ++i)
    EXPECT_LT((siemens.path.blocks[i].end - cl.path.blocks[i].end).norm(), 1e-7) << i;
  EXPECT_TRUE(cl.warnings.empty()) << "no arc of the tool axis beside its great circle";
}

TEST(PoleOfPrograms, LinuxCncGoesAsItIsWritten) {
  const std::string text =
      "G21 G90 G94 G17\nG54\nG43.4 H1\nG0 X0 Y0 Z50 A10 C20\nG1 X10 Y5 Z40 A8 C195 F1000\nM2\n";
  const auto with =
      read_program(text, "part.ngc", pole_options(Dialect::LinuxCnc, {PoleRule::LinuxCnc}));
  const auto without = read_program(text, "part.ngc", pole_options(Dialect::LinuxCnc, {}));
  ASSERT_EQ(with.path.blocks.size(), without.path.blocks.size());
  for (std::size_t i = 0; i < with.path.blocks.size(); ++i)
    EXPECT_EQ(with.path.blocks[i].end, without.path.blocks[i].end);
}

TEST(PoleOfPrograms, TheRuleOfOneControlIsRefusedForProgramsOfAnother) {
  const std::string ngc = "G21 G90\nG0 X1\nM2\n", cl = "UNITS/MM\nRAPID\nGOTO/0,0,50\nFINI\n";
  EXPECT_EQ(pole_refusal(cl, pole_options(Dialect::Cl, {PoleRule::LinuxCnc})),
            "part.nc: expected a LinuxCNC program, which has no tool vectors, with pole = "
            "\"linuxcnc\", seen a cl program");
  EXPECT_EQ(
      pole_refusal(ngc, pole_options(Dialect::LinuxCnc, by_fanuc(1, 1))),
      "part.nc: expected a Fanuc or CL program, with pole = \"fanuc\", seen a linuxcnc program");
  EXPECT_EQ(pole_refusal(ngc, pole_options(Dialect::LinuxCnc, {PoleRule::Siemens})),
            "part.nc: expected a Siemens or CL program, with pole = \"siemens\", seen a linuxcnc "
            "program");
}

TEST(PoleOfPrograms, FanucAsksForAxesAtRightAngles) {
  std::vector<kinematics::Joint> joints = pole_machines::gantry().joints();
  joints[a].direction_b = Vector3d(1, 0, 1).normalized();
  const Chain inclined(joints, pole_machines::gantry().T_bw_home(),
                       pole_machines::gantry().T_bt_home());
  const std::string text =
      cl_program(tool(inclined, rotary(20, 10)), tool(inclined, rotary(80, 20)));
  const std::string said = pole_refusal(text, pole_options(Dialect::Cl, by_fanuc(2, 10), inclined));
  EXPECT_HAS(said,
             "expected a machine with two rotary axes perpendicular to each other and to "
             "the tool, with pole = \"fanuc\"");
}

TEST(PoleOfPrograms, ABlockThatFollowsNoGreatCircleIsRefused) {
  const Chain gantry = pole_machines::gantry();
  // so close by the pole that C would have to turn by half a turn in next to no way
  const Vector3d from = tool(gantry, rotary(0, 10)), to = tool(gantry, rotary(179.99, 8));
  const std::string said =
      pole_refusal(cl_program(from, to), pole_options(Dialect::Cl, {PoleRule::Siemens}));
  EXPECT_HAS(said,
             "part.nc:6:1: expected a tool rotation on a great circle that the rotary "
             "axes can follow");
}

// ---- G43.4 with the table turned

std::string turned_table(const std::string& code, const std::string& words) {
  return "O1\nG21 G90 G94 G17\nG54\nG0 " + words + "\n" + code + " H1\nG1 X1. Y0 Z40. F500.\nM30\n";
}

TEST(TurnedTable, IsWarnedOfWhereG434Begins) {
  const auto warnings = [](const std::string& text) {
    return read_program(text, "part.nc", pole_options(Dialect::Fanuc, {})).warnings;
  };
  const auto said = warnings(turned_table("G43.4", "C45. A10."));
  ASSERT_EQ(said.size(), 1u);
  EXPECT_EQ(said[0],
            "G43.4 on line 5 starts with the table rotated (C45): X Y Z are counted in the "
            "workpiece with its table at zero; a control with parameter 19696.5 WKP = 0 counts in "
            "the coordinate system as it is on the table at that moment");
  EXPECT_HAS(warnings(turned_table("G43.5", "C-30."))[0],
             "G43.5 on line 5 starts with the table "
             "rotated (C-30)");
  EXPECT_TRUE(warnings(turned_table("G43.4", "C0 A10.")).empty()) << "the head is no table";
  EXPECT_TRUE(warnings(turned_table("G43.4", "C360.")).empty()) << "a whole turn";
}

}  // namespace
}  // namespace abbe::sim::dialects::pole_tests
