#include "sim/dialects/heidenhain/heidenhain.h"
#include "kinematics/inverse_kinematics.h"
#include "sim/dialects/read_options.h"
#include "sim/dialects/read_program.h"
#include "tests/program/machines.h"
#include "tests/test.h"

namespace abbe::sim::dialects::heidenhain_tests {
namespace {

namespace klartext_machines = program::test;
using Eigen::Quaterniond;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Side;

ReadOptions klartext_options(const Chain& chain = klartext_machines::gantry()) {
  ReadOptions options;
  options.control = klartext_machines::options_for(chain);
  options.control.tool_radius = {{1, 3.0}, {2, 0.5}};
  options.dialect = Dialect::Heidenhain;
  return options;
}

ParsedProgram klartext(const std::string& text, const ReadOptions& with = klartext_options()) {
  return read_program(text, "part.h", with);
}

std::string klartext_refusal(const std::string& text,
                             const ReadOptions& with = klartext_options()) {
  return thrown_text<BadInput>([&] { klartext(text, with); }, "accepted");
}

/// w C' A' b Y X Z t, the nose 200 mm above where the rotary axes meet, a tool of 80 mm.
Chain trunnion(double a_min = -200, double a_max = 200) {
  using klartext_machines::ex, klartext_machines::ey, klartext_machines::ez;
  using klartext_machines::joint, klartext_machines::Motion;
  std::vector<kinematics::Joint> joints = {
      joint('C', Side::Workpiece, Motion::Rotary, ez),
      joint('A', Side::Workpiece, Motion::Rotary, ex), joint('Y', Side::Tool, Motion::Linear, ey),
      joint('X', Side::Tool, Motion::Linear, ex), joint('Z', Side::Tool, Motion::Linear, ez)};
  joints[1].min = a_min * units::deg;
  joints[1].max = a_max * units::deg;
  kinematics::Pose T_bw = kinematics::Pose::Identity(), T_bt = kinematics::Pose::Identity();
  T_bw.translation() = Vector3d(0, 0, 50);
  T_bt.translation() = Vector3d(0, 0, 120);
  return {joints, T_bw, T_bt};
}

/// Where the tip stands in the workpiece at the end of a block.
kinematics::Pose pose_at(const Chain& chain, const program::Block& block) {
  AxisVector q = block.end;
  if (block.coordinates == program::Coordinates::Tip) {
    const auto at = [&](char letter) { return block.end[*chain.find(letter)]; };
    q = *kinematics::solve_slides(chain, block.end, {at('X'), at('Y'), at('Z')});
  }
  return chain.tool_in_workpiece(q);
}

Quaterniond turn(const Vector3d& about, double deg) {
  const double half = deg * units::deg / 2;
  const Vector3d v = std::sin(half) * about;
  return {std::cos(half), v.x(), v.y(), v.z()};
}

// iTNC 530 User's Manual DIN/ISO (2010), section 12.2, page 404: "Example for a machine with a
// rotary table C and a tilting table A. Programmed function: PLANE SPATIAL SPA+0 SPB+45 SPC+0".
TEST(Heidenhain, TiltedPlanesTakeTheSolutionsOfTheManual) {
  struct Row {
    double a_min, a_max, a, c;
    const char* sign;
    double a_end, c_end;
  };
  const Row rows[] = {{-200, 200, 0, 0, "", 45, 90},        {-200, 200, 0, 0, "SEQ+", 45, 90},
                      {-200, 200, 0, 0, "SEQ-", -45, -90},  {-200, 200, 0, -105, "", -45, -90},
                      {-200, 200, 0, -105, "SEQ+", 45, 90}, {-200, 200, 0, -105, "SEQ-", -45, -90},
                      {-90, 10, 0, 0, "", -45, -90},        {-200, 200, 0, -135, "SEQ+", 45, 90}};
  for (const Row& row : rows) {
    const Chain chain = trunnion(row.a_min, row.a_max);
    const std::string text =
        fmt::format("L A{:+} C{:+} FMAX\nPLANE SPATIAL SPA+0 SPB+45 SPC+0 TURN FMAX {}\n", row.a,
                    row.c, row.sign);
    SCOPED_TRACE(text);
    const program::Path path = klartext(text, klartext_options(chain)).path;
    const AxisVector& end = path.blocks.back().end;
    EXPECT_NEAR(end[1] / units::deg, row.a_end, 1e-9);
    EXPECT_NEAR(std::remainder(end[0] / units::deg - row.c_end, 360), 0, 1e-9);
  }
  EXPECT_HAS(klartext_refusal("PLANE SPATIAL SPA+0 SPB+45 SPC+0 TURN FMAX SEQ+\n",
                              klartext_options(trunnion(-90, 10))),
             "a solution with SEQ+");
}

TEST(Heidenhain, PlanesAreThoseOfQuaternions) {
  SeededRandom random(20261124);
  std::uniform_real_distribution<double> angle(-170, 170), mm(-100, 100);
  double worst = 0.0;
  for (int i = 0; i < 500; ++i) {
    const double a = angle(random), b = angle(random), c = angle(random);
    const Vector3d p(mm(random), mm(random), mm(random)), shift(mm(random), mm(random), mm(random));
    const bool euler = i % 2 == 1;
    const Vector3d x = Vector3d::UnitX(), y = Vector3d::UnitY(), z = Vector3d::UnitZ();
    const Quaterniond q =
        euler ? turn(z, a) * turn(x, b) * turn(z, c) : turn(z, c) * turn(y, b) * turn(x, a);
    const std::string plane =
        euler ? fmt::format("PLANE EULER EULPR{:+.12f} EULNU{:+.12f} EULROT{:+.12f}", a, b, c)
              : fmt::format("PLANE SPATIAL SPA{:+.12f} SPB{:+.12f} SPC{:+.12f}", a, b, c);
    const program::Path path =
        klartext(fmt::format("CYCL DEF 7.0 DATUM SHIFT\nCYCL DEF 7.1 X{:+.12f} Y{:+.12f} "
                             "Z{:+.12f}\n{} TURN FMAX\nL X{:+.12f} Y{:+.12f} Z{:+.12f} FMAX\n",
                             shift.x(), shift.y(), shift.z(), plane, p.x(), p.y(), p.z()))
            .path;
    const kinematics::Pose T = pose_at(klartext_machines::gantry(), path.blocks.back());
    worst = std::max(worst, (T.translation() - (q * p + shift)).norm());
    ASSERT_LT((T.linear().col(2) - q * z).norm(), 1e-11) << plane;
  }
  std::cout << "worst of 500 planes: " << worst << " mm\n";
  EXPECT_LT(worst, 1e-9);
}

TEST(Heidenhain, VectorsPointsAndRelativeAnglesAreTheSamePlane) {
  const auto tip = [](const std::string& plane) {
    const auto path = klartext(plane + " TURN FMAX\nL X+3 Y+5 Z+7 FMAX\n").path;
    return pose_at(klartext_machines::gantry(), path.blocks.back()).translation();
  };
  const Vector3d spatial = tip("PLANE SPATIAL SPA+20 SPB-30 SPC+40");
  const Quaterniond q =
      turn(Vector3d::UnitZ(), 40) * turn(Vector3d::UnitY(), -30) * turn(Vector3d::UnitX(), 20);
  const Vector3d x = q * Vector3d::UnitX(), y = q * Vector3d::UnitY(), z = q * Vector3d::UnitZ();
  const Vector3d base = 3 * x + 5 * z, end = 2 * x, third = -7 * x + 4 * y;
  EXPECT_LT((tip(fmt::format("PLANE VECTOR BX{:+.12f} BY{:+.12f} BZ{:+.12f} NX{:+.12f} "
                             "NY{:+.12f} NZ{:+.12f}",
                             base.x(), base.y(), base.z(), z.x(), z.y(), z.z())) -
             spatial)
                .norm(),
            1e-9);
  EXPECT_LT((tip(fmt::format("PLANE POINTS P1X+0 P1Y+0 P1Z+0 P2X{:+.12f} P2Y{:+.12f} "
                             "P2Z{:+.12f} P3X{:+.12f} P3Y{:+.12f} P3Z{:+.12f}",
                             end.x(), end.y(), end.z(), third.x(), third.y(), third.z())) -
             spatial)
                .norm(),
            1e-9);
  EXPECT_LT((tip("PLANE SPATIAL SPA+0 SPB+0 SPC+40 STAY\nPLANE RELATIV SPB-30 STAY\n"
                 "PLANE RELATIV SPA+20") -
             spatial)
                .norm(),
            1e-9);
}

TEST(Heidenhain, TheTipIsWhereTheProgramSays) {
  SeededRandom random(640);
  std::uniform_real_distribution<double> unit(-1, 1);
  const Chain chain = trunnion();
  ReadOptions with = klartext_options(chain);
  with.control.work_offset[0] = AxisVector::Zero(5);
  with.control.work_offset[0] << 0, 0, 7, -11, 13;  // C A Y X Z
  const Vector3d datum(-11, 7, 13);
  double worst = 0.0, worst_axis = 0.0;
  for (int i = 0; i < 300; ++i) {
    const Vector3d p = 100 * Vector3d(unit(random), unit(random), unit(random));
    const Vector3d t = Vector3d(unit(random), unit(random), 1.2 + unit(random)).normalized();
    const double a = 90 * unit(random), c = 300 * unit(random);
    const std::string place = fmt::format("X{:+.12f} Y{:+.12f} Z{:+.12f}", p.x(), p.y(), p.z());
    const auto last = [&](const std::string& text) {
      return pose_at(chain, klartext(text, with).path.blocks.back());
    };
    const auto without = last("TOOL CALL 1 Z S100\nL " + place + " FMAX\n");
    const auto tip = last(fmt::format("L {} A{:+.12f} C{:+.12f} F500 M128\n", place, a, c));
    const auto vector =
        last(fmt::format("L A{:+.12f} C+0 FMAX M128\nLN {} NX+0 NY+0 NZ+1 "
                         "TX{:+.12f} TY{:+.12f} TZ{:+.12f} F500\n",
                         a, place, t.x(), t.y(), t.z()));
    for (const auto& pose : {without, tip, vector})
      worst = std::max(worst, (pose.translation() - p - datum).norm());
    worst_axis = std::max(worst_axis, (vector.linear().col(2) - t).norm());
  }
  std::cout << "tip within " << worst << " mm, axis within " << worst_axis << " rad\n";
  EXPECT_LT(worst, 1e-9);
  EXPECT_LT(worst_axis, 1e-11);
}

TEST(Heidenhain, MoveKeepsAPointInFrontOfTheTipAndTurnTheSlides) {
  const Chain chain = klartext_machines::gantry();
  const std::string begin = "L X+10 Y+20 Z+30 FMAX\nPLANE SPATIAL SPA+25 SPB+0 SPC+15 ";
  const auto moved = klartext(begin + "MOVE DIST40 F1000\n").path.blocks.back();
  const auto T = pose_at(chain, moved);
  EXPECT_LT((T * Vector3d(0, 0, -40) - Vector3d(10, 20, -10)).norm(), 1e-9);
  const auto turned = klartext(begin + "TURN F1000\n").path.blocks.back();
  EXPECT_EQ(turned.coordinates, program::Coordinates::Axis);
  EXPECT_EQ(Vector3d(turned.end[1], turned.end[2], turned.end[3]), Vector3d(10, 20, 30));
  const auto retracted = klartext(begin + "TURN MB7 FMAX\n").path;
  ASSERT_EQ(retracted.blocks.size(), 3u);
  EXPECT_NEAR(retracted.blocks[1].end[3], 37, 1e-12);
}

TEST(Heidenhain, LongerToolsLieAlongTheToolAxis) {
  ReadOptions with = klartext_options();
  const Chain chain = klartext_machines::gantry();
  // a tool that the control believes 0.25 mm longer leaves the tip 0.25 mm short along its axis
  const auto last = [&](const std::string& text) {
    return pose_at(chain, klartext(text, with).path.blocks.back());
  };
  const auto upright = last("TOOL CALL 1 Z S100 DL+0.25\nL X+1 Y+2 Z+3 FMAX\n");
  EXPECT_LT((upright.translation() - Vector3d(1, 2, 3.25)).norm(), 1e-12);
  const auto tilted = last(
      "TOOL CALL 1 Z S100 DL+0.25\nPLANE SPATIAL SPA+30 SPB+0 SPC+0 TURN FMAX\n"
      "L X+1 Y+2 Z+3 FMAX\n");
  const Quaterniond q = turn(Vector3d::UnitX(), 30);
  EXPECT_LT((tilted.translation() - q * Vector3d(1, 2, 3.25)).norm(), 1e-9);
  EXPECT_EQ(klartext_refusal("TOOL CALL 1 Z S100 DL+0.25\nL X+1 FMAX M128\n"),
            "part.h:2:12: expected a tool with the length stated in the scene, without DL, under "
            "M128, seen a tool 0.25 mm longer");
  const auto other = last("TOOL CALL 2 Z S100\nL Z+0 X+1 FMAX\n");
  EXPECT_LT((other.translation() - Vector3d(1, 0, -50)).norm(), 1e-12) << "50 mm instead of 100";
}

TEST(Heidenhain, RoundedCornersTouchBothLines) {
  SeededRandom random(7);
  std::uniform_real_distribution<double> mm(-50, 50), radius(0.1, 4);
  int rounded = 0;
  double worst = 0.0;
  for (int i = 0; i < 300; ++i) {
    const Vector2d a(mm(random), mm(random)), b(mm(random), mm(random));
    const Vector2d c(mm(random), mm(random));
    const double r = radius(random);
    const Vector2d u = (a - b).normalized(), v = (c - b).normalized();
    const double half = std::acos(std::clamp(u.dot(v), -1.0, 1.0)) / 2;
    const double cut = r / std::tan(half);
    const std::string text = fmt::format(
        "L X{:+.12f} Y{:+.12f} FMAX\nL X{:+.12f} Y{:+.12f} F500\nRND R{:.12f}\nL X{:+.12f} "
        "Y{:+.12f}\n",
        a.x(), a.y(), b.x(), b.y(), r, c.x(), c.y());
    if (cut > (a - b).norm() - 1e-3 || cut > (c - b).norm() - 1e-3) {
      if (cut > (a - b).norm() + 1e-3) {
        EXPECT_HAS(klartext_refusal(text), "moves at least as long as the corner");
      }
      continue;
    }
    ++rounded;
    const program::Path path = klartext(text).path;
    ASSERT_EQ(path.arcs.size(), 1u);
    // closed form: the centre lies on the line that halves the angle
    const Vector2d centre = b + r / std::sin(half) * (u + v).normalized();
    worst = std::max(worst, (path.arcs[0].centre - centre).norm());
    worst = std::max(worst, std::abs(path.arcs[0].radius - r));
    EXPECT_NEAR(std::abs(path.arcs[0].sweep), pi - 2 * half, 1e-8);
  }
  std::cout << rounded << " corners, within " << worst << " mm\n";
  EXPECT_GT(rounded, 200);
  EXPECT_LT(worst, 1e-9);
}

TEST(Heidenhain, TangentArcsGoOnInTheDirectionOfTheLastMove) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> mm(-50, 50);
  for (int i = 0; i < 200; ++i) {
    const Vector2d a(mm(random), mm(random)), b(mm(random), mm(random));
    const Vector2d c(mm(random), mm(random)), d(mm(random), mm(random));
    const program::Path path =
        klartext(fmt::format("L X{:+.9f} Y{:+.9f} FMAX\nL X{:+.9f} Y{:+.9f} F500\nCT X{:+.9f} "
                             "Y{:+.9f}\nCT X{:+.9f} Y{:+.9f}\n",
                             a.x(), a.y(), b.x(), b.y(), c.x(), c.y(), d.x(), d.y()))
            .path;
    ASSERT_EQ(path.arcs.size(), 2u);
    Vector2d way = (b - a).normalized();
    for (const program::Arc& arc : path.arcs) {
      const double h = 1e-6;
      const Vector2d out = (position(arc, h) - position(arc, 0)).normalized();
      EXPECT_LT((out - way).norm(), 1e-4);
      way = (position(arc, 1) - position(arc, 1 - h)).normalized();
    }
  }
}

TEST(Heidenhain, ToolsAreCalledByTheirNames) {
  ReadOptions options = klartext_options();
  options.control.tool_number = {{"BALL 10", 1}, {"mill", 2}};
  const auto reads = [&](const std::string& call) {
    return klartext(call + " Z S100\nL X+1 Y+2 Z+3 F100\n", options).path;
  };
  for (const auto& [by_name, by_number] : {std::pair("\"BALL 10\"", "1"), {"\"mill\"", "2"}}) {
    const program::Path named = reads(std::string("TOOL CALL ") + by_name);
    const program::Path numbered = reads(std::string("TOOL CALL ") + by_number);
    EXPECT_EQ(named.blocks.back().end, numbered.blocks.back().end);
    EXPECT_EQ(named.tool_calls.back().number, std::stoi(by_number));
  }
  EXPECT_NE(reads("TOOL CALL \"mill\"").blocks.back().end,
            reads("TOOL CALL \"BALL 10\"").blocks.back().end);
  for (const char* unknown : {"TOOL CALL \"MILL\" Z", "TOOL CALL \"\" Z", "TOOL CALL \"mill Z"})
    EXPECT_HAS(klartext_refusal(std::string(unknown) + "\n", options),
               "part.h:1:11: expected a tool number: the scene has no tool with this name");
}

TEST(Heidenhain, FaultsAreNamedAtTheirPlace) {
  EXPECT_EQ(
      klartext_refusal("0 BEGIN PGM A MM\n1 L X+10 W+5 FMAX\n2 CYCL DEF 200 DRILLING ~\n"
                       "  Q200=+2 ;CLEARANCE ~\n  Q999=+2 ;NONE ~\n  Q201=-5\n3 FN 18: SYSREAD "
                       "Q1 = ID1\n4 L X+Q7 FMAX\n5 DEP LT LEN5\n6 M92\n7 GOTO 5\n"),
      "part.h:2:10: expected an axis of this machine (C X Y Z A), seen W+5\npart.h:5:3: expected a "
      "parameter of cycle 200, seen Q999=+2\npart.h:7:6: expected FN 0 to FN 13: messages and data "
      "of the control do not exist here, seen 18:\npart.h:8:7: expected a parameter that has been "
      "set, seen Q7\npart.h:9:3: expected L with RL, RR or R0: APPR and DEP are not supported, "
      "seen DEP\npart.h:10:3: expected M91: the zero point of the machine manufacturer is unknown, "
      "seen M92\npart.h:11:3: expected a Klartext block, seen GOTO");
  EXPECT_EQ(klartext_refusal("L X+1 FMAX\nRND R1\nTOOL CALL 1 Z\n"),
            "part.h:3:1: expected a move immediately after RND or CHF, seen TOOL");
  EXPECT_EQ(klartext_refusal("TOOL CALL 9 Z S100\n"),
            "part.h:1:11: expected a tool with a known length (1 2), seen 9");
  EXPECT_EQ(klartext_refusal("L X+1 RL F100\n"), "accepted");
  EXPECT_EQ(klartext_refusal("TOOL CALL 1 Z DR+0.1\nLN X+1 Y+1 Z+1 NX+0 NY+0 NZ+1 F100\n"),
            "part.h:2:1: expected DL 0 and DR 0 with LN: no compensation along the normal, seen "
            "other values");
  EXPECT_EQ(klartext_refusal("CALL LBL 5\n"),
            "part.h:1:10: expected a label of this program, seen LBL 5");
  EXPECT_EQ(klartext_refusal("LBL 1\nLBL 1\nCALL LBL 1\n"),
            "part.h:3:10: expected a label that occurs only once, seen LBL 1 on lines 1 and 2");
  EXPECT_EQ(
      klartext_refusal("CALL PGM ../x\n"),
      "part.h:1:10: expected the name of a program next to this one, without a path, seen ../x");
}

TEST(Heidenhain, WordsThatAreRefusedSayWhatToDo) {
  int m_words = 0;
  for (const WordTableEntry& line : heidenhain_words()) {
    std::istringstream all{std::string(line.word)};
    for (std::string word; all >> word;) {
      std::string text = word;
      for (std::size_t at; (at = text.find("\u00a0")) != std::string::npos;)
        text.replace(at, 2, " ");
      const bool m = word[0] == 'M' && word.size() > 1 && word[1] >= '0' && word[1] <= '9';
      const bool fn = word.starts_with("FN\u00a0"), cycle = word.starts_with("CYCL\u00a0DEF");
      if (!m && !fn && !cycle) continue;
      ++m_words;
      const std::string seen = klartext_refusal("7 " + text + (fn ? ": " : "") + "\n");
      SCOPED_TRACE(text + ": " + seen);
      if (line.use == WordTreatment::Refused) {
        EXPECT_HAS(seen, "part.h:1:");
        EXPECT_HAS(seen, line.sentence);
      } else {
        EXPECT_EQ(seen.find("a TNC"), std::string::npos) << "it is in the table";
      }
    }
  }
  EXPECT_GT(m_words, 100);
}

TEST(Heidenhain, AWordTwiceAndHalfOfACycleAreInputErrors) {
  const std::string begin = "TOOL CALL 1 Z S100 F100\nCC X+5 Y+0\n";
  for (const char* block :
       {"L X+1 R0 RL", "L X+1 RL RR", "L X+1 R0 R0", "L X+1 F100 FMAX", "L X+1 FMAX F200",
        "C X+10 Y+0 DR- DR+", "CP IPA+90 DR+ DR+", "LP PR+1 PR+2 PA+0", "LP PR+1 PA+0 IPA+5",
        "CR X+10 Y+0 R+5 R+6 DR-", "CR X+10 Y+0 DR- R+5 DR-"}) {
    const std::string said = klartext_refusal(begin + block + "\n");
    EXPECT_TRUE(said.find("once in a block") != std::string::npos ||
                said.find("only one of R0, RL and RR") != std::string::npos)
        << block << ": " << said;
  }
  const std::string move = "L X+1 FMAX\n";
  EXPECT_HAS(klartext_refusal(begin + "CYCL DEF 7.1 X+5\n" + move), "CYCL DEF 7.0 in the block");
  EXPECT_HAS(klartext_refusal(begin + "CYCL DEF 10.0 ROTATION\n" + move),
             "CYCL DEF 10.1 after CYCL DEF 10.0");
  EXPECT_HAS(klartext_refusal(begin + "CYCL DEF 9.0 DWELL TIME\nCYCL DEF 7.0 DATUM SHIFT\n"
                                      "CYCL DEF 7.1 X+5\n"),
             "CYCL DEF 9.1 after CYCL DEF 9.0");
  EXPECT_HAS(klartext_refusal(begin + "CYCL DEF 7.0 DATUM SHIFT\n" + move + "CYCL DEF 7.1 X+5\n"),
             "CYCL DEF 7.1 after");
  EXPECT_EQ(klartext_refusal(
                begin + "CYCL DEF 7.0 DATUM SHIFT\nCYCL DEF 7.1 X+5\nCYCL DEF 7.2 Y+5\n" + move),
            "accepted");
  EXPECT_HAS(klartext_refusal("BEGIN PGM A MM\n" + begin + move + "BEGIN PGM B INCH\n" + move),
             "END PGM before BEGIN PGM");
}

TEST(Heidenhain, WhatNeverEndsIsRefusedInBoundedTime) {
  ReadOptions with = klartext_options();
  with.limits.blocks = 100000;
  EXPECT_HAS(
      klartext_refusal("LBL 1\nCALL LBL 1 REP 65534\nLBL 2\nIF +1 EQU +1 GOTO LBL 2\n", with),
      "100000 blocks");
  EXPECT_HAS(klartext_refusal("LBL 1\nCALL LBL 1\nLBL 0\n", with), "50 nested calls");
  EXPECT_HAS(klartext_refusal("Q1 = " + std::string(100000, '(') + "\n"), "100 nested brackets");
  std::string functions = "Q1 = ";
  for (int i = 0; i < 50000; ++i) functions += "SIN ";
  EXPECT_HAS(klartext_refusal(functions + "\n"), "100 nested brackets");
  EXPECT_HAS(klartext_refusal("CYCL DEF 200 D Q200=1 Q201=-10 Q206=1 Q202=0.00001 Q203=0 Q204=1\n"
                              "L X+0 FMAX M99\n"),
             "1e5 infeeds");
  with.limits.variables = 10;
  std::string many;
  for (int i = 0; i < 20; ++i) many += fmt::format("Q{} = 1\n", i);
  EXPECT_HAS(klartext_refusal(many, with), "at most 10 parameters");
}

TEST(Heidenhain, CalledProgramsStandBesideTheProgram) {
  const fs::path folder = fs::temp_directory_path() / "abbe_heidenhain_calls";
  fs::create_directories(folder);
  std::ofstream(folder / "hole.h")
      << "BEGIN PGM hole INCH\nL X+1 FMAX\nQL1 = 5\nEND PGM hole INCH\n";
  ReadOptions with = klartext_options();
  with.subprogram_folder = folder;
  const program::Path path =
      klartext("BEGIN PGM A MM\nCALL PGM hole\nL Y+1 FMAX\nEND PGM A MM\n", with).path;
  ASSERT_EQ(path.blocks.size(), 2u);
  EXPECT_EQ(path.blocks[0].end[1], 25.4);
  EXPECT_EQ(path.blocks[0].file, 1);
  EXPECT_EQ(path.blocks[0].line, 2);
  EXPECT_EQ(path.blocks[1].end[2], 1.0);
  EXPECT_HAS(klartext_refusal("CALL PGM hole.h\nQ1 = QL1\n", with), "part.h:2:6");
  EXPECT_HAS(klartext_refusal("CALL PGM other\n", with), "other.h next to this one");
  fs::remove_all(folder);
}

/// Goldens with bytes changed, lines doubled, cut and mixed: they are read or refused with a place.
TEST(Heidenhain, SurvivesWhatIsNoProgram) {
  std::vector<std::string> texts;
  for (const auto& entry : fs::directory_iterator(ABBE_SOURCE_DIR "/tests/golden"))
    if (entry.path().filename().string().starts_with("heidenhain_"))
      texts.push_back(klartext_machines::file_text((entry.path() / "program.nc").string()));
  ASSERT_GE(texts.size(), 5u);
  SeededRandom random(20640);
  const auto below = [&](std::size_t n) { return n == 0 ? 0 : std::size_t(random() % n); };
  ReadOptions with = klartext_options();
  with.limits.blocks = 2000;
  with.control.tool_length[9] = 30;
  static constexpr std::string_view bits[] = {"X+1",  "R0",    "RL",     "RR",  "FMAX",     "M128",
                                              "M129", "+",     "Q1",     "=",   "(",        "~\n",
                                              "\n",   "LBL 1", "\"",     "M99", "RND R1\n", "1e9",
                                              "-",    "IX",    "PLANE ", "C ",  "99999999"};
  int read_well = 0, refused = 0;
  const int rounds = std::getenv("ABBE_LONG") != nullptr ? 200000 : 4000;
  for (int i = 0; i < rounds; ++i) {
    std::string text = texts[below(texts.size())];
    const int changes = 1 + int(below(8));
    for (int k = 0; k < changes; ++k) {
      const std::size_t at = below(text.size() + 1);
      switch (below(5)) {
        case 0:
          if (at < text.size()) text[at] = char(random());
          break;
        case 1:
          text.insert(at, bits[below(std::size(bits))]);
          break;
        case 2:
          text.erase(at, below(12));
          break;
        case 3: {
          const std::string& other = texts[below(texts.size())];
          text.insert(at, other.substr(below(other.size()), below(80)));
          break;
        }
        default:
          text.resize(at);
      }
    }
    try {
      for (const program::Block& block : klartext(text, with).path.blocks)
        ASSERT_TRUE(block.end.allFinite()) << text;
      ++read_well;
    } catch (const BadProgram& bad) {
      ++refused;
      for (const BadInput& fault : bad.input_errors)
        ASSERT_GE(fault.line, 1) << fault.what() << text;
    }
  }
  std::cout << read_well << " read, " << refused << " refused\n";
  EXPECT_GT(read_well, 50);
  EXPECT_GT(refused, 500);
}

TEST(Heidenhain, FeedsOfCyclesAreReadAsATncWritesThem) {
  const auto program = [](const std::string& in, const std::string& out) {
    return "TOOL CALL 1 Z S5000 F300\nL X+10 Y+10 R0 FMAX M3\nL Z+15 R0 FMAX\nCYCL DEF 203 "
           "UNIVERSAL DRILLING ~\nQ200=+5 ;A ~\nQ201=-25 ;B ~\nQ206= " +
           in + " ;C ~\nQ202=+50 ;D ~\nQ210=+0 ;E ~\nQ203=-8 ;F ~\nQ204=+13 ;G ~\nQ208= " + out +
           " ;L\nL FMAX M99\nL Z+50 R0 FMAX\n";
  };
  struct Feed {
    std::string text;
    std::optional<double> mm_per_min;  ///< none: rapid
  };
  const int z = *klartext_machines::gantry().find('Z');
  const std::vector<Feed> feeds = {{"MAX", {}},       {"FMAX", {}},       {"F MAX", {}},
                                   {"99999", {}},     {"AUTO", 300.0},    {"FAUTO", 300.0},
                                   {"F AUTO", 300.0}, {"+200", 200.0},    {"F200", 200.0},
                                   {"FU0.1", 500.0},  {"FU +0.1", 500.0}, {"U0.1", 500.0}};
  for (const Feed& in : feeds)
    for (const Feed& out : feeds) {
      SCOPED_TRACE(in.text + " and " + out.text);
      const auto blocks = klartext(program(in.text, out.text)).path.blocks;
      ASSERT_EQ(blocks.size(), 7u);
      for (const auto& [block, feed] : {std::pair(blocks[3], in), {blocks[4], out}}) {
        EXPECT_EQ(block.interpolation == program::Interpolation::Rapid, !feed.mm_per_min);
        if (feed.mm_per_min) {
          EXPECT_NEAR(
              std::abs(block.end[z] - block.start[z]) / (block.end_s - block.start_s) * 60.0,
              *feed.mm_per_min, 1e-9);
        }
      }
    }
  EXPECT_HAS(klartext_refusal(program("FZ0.1", "MAX")), "number of teeth");
  EXPECT_HAS(klartext_refusal("CYCL DEF 201 Q200=+2 Q201=MAX\n"), "a number")
      << "a depth is no feed";
}

TEST(Heidenhain, AShiftThatEndsInThePlaneIsCertainOnceThePlaneHasEnded) {
  const Chain machine = trunnion();
  const auto options = klartext_options(machine);
  const std::string tilt =
      "CYCL DEF 7.0\nCYCL DEF 7.1 X5\nCYCL DEF 7.2 Y55\nCYCL DEF 7.3 Z-25\nPLANE SPATIAL SPA+30 "
      "SPB+0 SPC+0 MOVE F1000\n";
  const std::string zero = "CYCL DEF 7.0\nCYCL DEF 7.1 X0\nCYCL DEF 7.2 Y0\nCYCL DEF 7.3 Z0\n";
  const std::string reset = "PLANE RESET STAY\n", home = "L A0 C0 FMAX\nL X10 Y20 Z30 FMAX\n";
  const auto end = [&](const std::string& text) {
    const auto blocks = klartext(text, options).path.blocks;
    return pose_at(machine, blocks.back()).translation();
  };
  const Vector3d plain = end(home);
  const std::string inner = "CYCL DEF 7.0\nCYCL DEF 7.1 X3\n",
                    turn = "CYCL DEF 10.0\nCYCL DEF 10.1 ROT+20\n",
                    unturn = "CYCL DEF 10.0\nCYCL DEF 10.1 ROT+0\n";
  for (const std::string& order :
       {tilt + zero + reset, tilt + reset + zero, tilt + "TRANS DATUM RESET\n" + reset,
        tilt + reset + "TRANS DATUM RESET\n",
        tilt + "CYCL DEF 7.0\nCYCL DEF 7.2 Y0\n" + reset + zero, reset + zero,
        zero + tilt + zero + reset,
        "PLANE SPATIAL SPA+30 SPB+0 SPC+0 MOVE F1000\n" + inner + reset + zero,
        tilt + turn + reset + zero + unturn, tilt + turn + unturn + zero + reset}) {
    SCOPED_TRACE(order);
    ASSERT_EQ(klartext_refusal(order + home, options), "accepted");
    EXPECT_LT((end(order + home) - plain).norm(), 1e-9);
  }
  // what stays uncertain is refused, at the move
  for (const std::string& order :
       {tilt + zero, tilt + inner, "PLANE SPATIAL SPA+30 SPB+0 SPC+0 MOVE F1000\n" + inner + reset,
        tilt + turn + reset + zero})
    EXPECT_NE(klartext_refusal(order + "L X10 FMAX\n", options), "accepted") << order;
  EXPECT_EQ(klartext_refusal(tilt + zero + "L Z0 R0 FMAX M91\n", options), "accepted")
      << "axis positions";
}

}  // namespace
}  // namespace abbe::sim::dialects::heidenhain_tests
