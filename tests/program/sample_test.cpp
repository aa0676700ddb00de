#include "sim/program/sample.h"

#include <gtest/gtest.h>

#include <chrono>
#include <iostream>
#include <random>

#include "kinematics/bad_input.h"
#include "kinematics/pose.h"
#include "machines.h"
#include "sim/program/program_writers.h"

namespace abbe::sim::program {
namespace {

using Eigen::Vector3d;
using test::AxisVector;

/// Tool of the gantry in the workpiece, written out: the head turns the tool by A about X 250 mm
/// above the tip, the table turns the workpiece by -C.
struct Tool {
  Vector3d tip, direction;
};
Tool gantry_tool(const AxisVector& q) {
  const double c = q[0], a = q[4];
  const Vector3d direction_b(0, -std::sin(a), std::cos(a));
  const Vector3d tip_b = Vector3d(q[1], q[2], q[3] + 250) - 250 * direction_b;
  const Eigen::AngleAxisd turned(c, Vector3d::UnitZ());
  return {turned * tip_b, turned * direction_b};
}

Vector3d great_circle(const Vector3d& a, const Vector3d& b, double part) {
  const Eigen::Quaterniond whole = kinematics::rotation_between(a, b);
  return Eigen::Quaterniond::Identity().slerp(part, whole) * a;
}

/// Largest distance of the tool axis, true to the program at 11 instants between samples, from line
/// and great circle.
double worst_off(const Path& path, const Samples& samples, double reach) {
  double worst = 0.0;
  for (std::size_t i = 1; i < samples.states.size(); ++i) {
    const auto& from = samples.states[i - 1];
    const auto& to = samples.states[i];
    if (to.time_s == from.time_s) continue;
    const Block& block = path.blocks[std::size_t(samples.block[i])];
    const Tool a = gantry_tool(from.q), b = gantry_tool(to.q);
    for (int k = 0; k <= 10; ++k) {
      const double part = k / 10.0;
      const double t = from.time_s + part * (to.time_s - from.time_s);
      const AxisVector programmed =
          position(path, block, (t - block.start_s) / (block.end_s - block.start_s));
      Tool tool = gantry_tool(programmed);
      if (block.coordinates == Coordinates::Tip)
        tool.tip = {programmed[1], programmed[2], programmed[3]};
      const Vector3d tip_off = tool.tip - ((1 - part) * a.tip + part * b.tip);
      const Vector3d axis_off = tool.direction - great_circle(a.direction, b.direction, part);
      worst = std::max({worst, tip_off.norm(), (tip_off + reach * axis_off).norm()});
    }
  }
  return worst;
}

void holds_the_tolerance(const std::string& text, double at_least_used) {
  SCOPED_TRACE(text);
  const Path path = read_nc(text, "t", test::options_for(test::gantry()));
  SampleOptions options;
  options.chord_tolerance = 1e-5;
  options.reach = 25.0;
  options.max_step = 5.0;
  options.max_axis_step = 5.0;
  options.max_turn = 0.1;
  const Samples samples = sample(path, test::gantry(), options);
  const double worst = worst_off(path, samples, options.reach);
  std::cout << samples.states.size() << " samples, off by " << worst / options.chord_tolerance
            << " of the tolerance\n";
  EXPECT_LE(worst, options.chord_tolerance);
  EXPECT_GE(worst, at_least_used * options.chord_tolerance);  // not so fine that it is for nothing
}

TEST(Sample, ToolAxisStaysWithinTheChordToleranceUnderTipProgramming) {
  holds_the_tolerance("G43.4 H1\nG0 X10 Y5 Z20 A20\nG1 X12 C30 A25 F600\n", 0.2);
  holds_the_tolerance("G43.4 H1\nG0 X10 A0.01\nG1 X10.1 C180 F600\n", 0.0);  // almost singular
  holds_the_tolerance("G43.4 H1\nG0 X10 A-10\nG1 X20 A10 C5 F600\n", 0.1);   // through the pole
  holds_the_tolerance("G43.4 H1\nG17 G0 X30\nG3 X0 Y30 I-30 A40 C-60 F600\n", 0.2);
}

TEST(Sample, ToolAxisStaysWithinTheChordToleranceInAxisCoordinates) {
  holds_the_tolerance("G0 X50 Y20\nG1 X60 C40 F600\n", 0.2);
  holds_the_tolerance("G0 X50 A30\nG1 C360 F6000\n", 0.2);
  holds_the_tolerance("G17 G0 X30\nG2 X0 Y-30 I-30 Z4 F600\n", 0.2);
  holds_the_tolerance("G17 G0 X30\nG3 I-30 A30 C90 F600\n", 0.2);
  holds_the_tolerance("G19 G0 Y30\nG3 Y0 Z30 J-30 C300 F600\n", 0.2);
}

TEST(Sample, RandomBlocksStayWithinTheChordTolerance) {
  const unsigned seed = 99;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::string text = "G1 F1000\n";
  for (int i = 0; i < 60; ++i) {
    if (i == 30) text += "G43.4 H1\n";
    const double turn = std::pow(10.0, -3 + 2.5 * std::abs(unit(random)));
    text += fmt::format("X{:.6f} Y{:.6f} Z{:.6f} A{:.6f} C{:.6f}\n", 20 * unit(random),
                        20 * unit(random), 20 * unit(random), 10 * turn * unit(random),
                        20 * turn * unit(random));
  }
  holds_the_tolerance(text, 0.2);
}

TEST(Sample, PvtCubicsStayWithinTheChordTolerance) {
  const Path path = read_pvt(
      "time_s,X_mm,A_deg,C_deg,X_mm_per_s,A_deg_per_s,C_deg_per_s\n0,0,0,0,30,0,40\n1,10,20,40,-20,"
      "-30,10\n"
      "2,0,3,0,0,0,100\n",
      "t", test::options_for(test::gantry()));
  SampleOptions options;
  options.chord_tolerance = 1e-5;
  options.max_turn = 1.0;
  options.max_axis_step = options.max_step = 10.0;
  const Samples samples = sample(path, test::gantry(), options);
  const double worst = worst_off(path, samples, options.reach);
  std::cout << samples.states.size() << " samples, off by " << worst << " mm\n";
  EXPECT_LE(worst, options.chord_tolerance);
  EXPECT_GE(worst, 0.2 * options.chord_tolerance);
}

TEST(Sample, SagittaOfAnArcIsTheClosedForm) {
  const Path path =
      read_nc("G17 G0 X40\nG3 I-40 F600\n", "t", test::options_for(test::three_axis()));
  SampleOptions options;
  options.chord_tolerance = 1e-4;
  options.max_step = options.max_axis_step = 100.0;
  const Samples samples = sample(path, test::three_axis(), options);
  std::size_t last = 0;
  double worst = 0.0;
  for (std::size_t i = 1; i < samples.states.size(); ++i) {
    if (path.blocks[std::size_t(samples.block[i])].interpolation != Interpolation::Arc) last = i;
    const double chord = (samples.states[i].q - samples.states[i - 1].q).norm();
    if (i > last) worst = std::max(worst, 40.0 - std::sqrt(1600.0 - chord * chord / 4));
  }
  std::cout << "sagitta " << worst << " of " << options.chord_tolerance << " mm\n";
  EXPECT_LE(worst, options.chord_tolerance);
  EXPECT_GE(worst, 0.5 * options.chord_tolerance);
}

TEST(Sample, StepsKeepTheirLimits) {
  const Path path =
      read_nc("G0 X100 C30\nG43.4 H1\nG1 X20 Y5 A40 C250 F600\nG49\nS100 M3 G1 X0 F60\n", "t",
              test::options_for(test::gantry()));
  SampleOptions options;
  options.chord_tolerance = 1.0;
  options.max_step = 0.7;
  options.max_turn = 0.015;
  options.max_axis_step = 0.9;
  const Samples samples = sample(path, test::gantry(), options);
  double step = 0, turn = 0, axis = 0;
  for (std::size_t i = 1; i < samples.states.size(); ++i) {
    const Tool a = gantry_tool(samples.states[i - 1].q), b = gantry_tool(samples.states[i].q);
    step = std::max(step, (b.tip - a.tip).norm());
    turn = std::max(
        turn, std::atan2(a.direction.cross(b.direction).norm(), a.direction.dot(b.direction)));
    axis = std::max(axis,
                    (samples.states[i].q - samples.states[i - 1].q).head(5).cwiseAbs().maxCoeff());
    EXPECT_GE(samples.states[i].time_s, samples.states[i - 1].time_s);
  }
  std::cout << step << " mm, " << turn << " rad, " << axis << " mm of an axis\n";
  EXPECT_GE(turn, 0.5 * options.max_turn);
  EXPECT_LE(step, options.max_step * (1 + 1e-9));
  EXPECT_LE(turn, options.max_turn * (1 + 1e-9));
  EXPECT_LE(axis, options.max_axis_step * (1 + 1e-9));
}

TEST(Sample, WorkpieceSpindleIsLeftOutOfTheChordButKeepsItsOwnLimit) {
  const Path path = read_nc("S600 M3\nG1 X1 F60\n", "t", test::options_for(test::platform()));
  SampleOptions options;
  options.workpiece_spindle = 0;
  options.max_spindle_turn = 2 * pi;
  const Samples samples = sample(path, test::platform(), options);
  // 1 s at 10 revolutions a second; start, its double where X sets off, 10 steps
  ASSERT_EQ(samples.states.size(), 12u);
  EXPECT_NEAR(samples.states.back().q[0], 20 * pi, 1e-12);
  for (const auto& state : samples.states) EXPECT_EQ(state.stroke[0], 0);
}

TEST(Sample, ReversalIsSampledBeforeAndAfter) {
  const Path path = read_nc("G1 F60\nX1\nX0\nY1\nX1\n", "t", test::options_for(test::gantry()));
  SampleOptions options;
  options.max_step = options.max_axis_step = 10.0;
  const Samples s = sample(path, test::gantry(), options);
  // 0, 0 doubled (X sets off), X1, X1 doubled (back), X0, X0 doubled (Y sets off), Y1, Y1 doubled,
  // X1
  ASSERT_EQ(s.states.size(), 9u);
  const auto row = [&](std::size_t i) {
    const auto& x = s.states[i];
    return std::array<double, 5>{x.q[1], x.q[2], x.time_s, double(x.direction[1]),
                                 double(x.stroke[1])};
  };
  EXPECT_EQ(row(0), (std::array<double, 5>{0, 0, 0, 0, 0}));
  EXPECT_EQ(row(1), (std::array<double, 5>{0, 0, 0, 1, 0}));
  EXPECT_EQ(row(2), (std::array<double, 5>{1, 0, 1, 1, 0}));
  EXPECT_EQ(row(3), (std::array<double, 5>{1, 0, 1, -1, 1}));
  EXPECT_EQ(row(4), (std::array<double, 5>{0, 0, 2, -1, 1}));
  EXPECT_EQ(s.states[5].direction[2], 1);
  EXPECT_EQ(row(6), (std::array<double, 5>{0, 1, 3, -1, 1}));
  EXPECT_EQ(row(7), (std::array<double, 5>{0, 1, 3, 1, 2}));
  EXPECT_EQ(row(8), (std::array<double, 5>{1, 1, 4, 1, 2}));
  EXPECT_EQ(s.line, (std::vector<int>{2, 2, 2, 3, 3, 4, 4, 5, 5}));
}

TEST(Sample, ArcsAndCubicsAreMetWhereTheirAxesTurnBack) {
  const Path arc =
      read_nc("G17 G0 X10\nG3 I-10 F600\n", "t", test::options_for(test::three_axis()));
  const Samples round = sample(arc, test::three_axis());
  std::vector<double> turns;
  for (std::size_t i = 1; i < round.states.size(); ++i)
    if (round.states[i].time_s == round.states[i - 1].time_s && round.block[i] == 1)
      turns.push_back((round.states[i].time_s - arc.blocks[1].start_s) /
                      (arc.blocks[1].end_s - arc.blocks[1].start_s));
  // X turns back where the arc sets off, after half a turn; Y sets off, and turns back at the
  // quarters
  ASSERT_EQ(turns.size(), 4u);
  const double expected[] = {0, 0.25, 0.5, 0.75};
  for (int k = 0; k < 4; ++k) EXPECT_NEAR(turns[std::size_t(k)], expected[k], 1e-12);

  const Path cubic = read_pvt("time_s,X_mm,X_mm_per_s\n0,0,4\n1,0,-4\n", "t",
                              test::options_for(test::three_axis()));
  const Samples wave = sample(cubic, test::three_axis());
  double highest = 0.0;
  for (const auto& state : wave.states) highest = std::max(highest, state.q[0]);
  EXPECT_NEAR(highest, 1.0, 1e-14);  // 4u(1-u) at u = 1/2
}

TEST(Sample, RoundingOfTheControlIsNoReversal) {
  // The tip rests in X while the head swings: X of the machine is 10 up to rounding.
  const Path path =
      read_nc("G0 X10\nG43.4 H1\nG1 A30 F3000\nA-30\nA0\n", "t", test::options_for(test::gantry()));
  const Samples samples = sample(path, test::gantry());
  EXPECT_EQ(samples.states.back().stroke[1], 0);
  EXPECT_EQ(samples.states.back().direction[1], 1);
  EXPECT_EQ(samples.states.back().stroke[4], 2);
}

TEST(Sample, DwellKeepsThePoseThroughItsTime) {
  const Path path = read_nc("G0 X1\nG4 P2\nG0 X2\n", "t", test::options_for(test::gantry()));
  const Samples samples = sample(path, test::gantry());
  int during = 0;
  for (std::size_t i = 0; i < samples.states.size(); ++i)
    if (samples.block[i] == 1) {
      ++during;
      EXPECT_EQ(samples.states[i].q[1], 1.0);
    }
  EXPECT_EQ(during, 1);
  EXPECT_NEAR(samples.states.back().time_s, 2.02, 1e-12);
}

TEST(Sample, TooManySamplesAreRefusedBeforeTheyTakeMemory) {
  const auto refused = [](const std::string& text, const test::Chain& chain,
                          SampleOptions options) {
    const Path path = read_nc(text, "big.ngc", test::options_for(chain));
    EXPECT_THROW(sample(path, chain, options), BadInput);
  };
  SampleOptions options;
  options.max_samples = 1000;
  refused("G1 X2000 F60\n", test::three_axis(), options);
  options.max_samples = 50'000'000;
  options.max_step = 1e-9;
  refused("G1 X2000 F60\n", test::three_axis(), options);
  SampleOptions spindle;
  spindle.workpiece_spindle = 0;
  refused("S10000000 M3\nG1 X1 F0.00001\n", test::platform(), spindle);
  SampleOptions fine;
  fine.chord_tolerance = 1e-300;
  refused("G43.4 H1\nG1 X100 A30 C50 F60\n", test::gantry(), fine);
}

TEST(Sample, TwoRunsGiveTheSameBits) {
  const Path path = read_nc("G43.4 H1\nG1 X20 Y5 A40 C250 F600\nG17 G3 X0 Y5 R15\n", "t",
                            test::options_for(test::gantry()));
  const Samples a = sample(path, test::gantry()), b = sample(path, test::gantry());
  ASSERT_EQ(a.states.size(), b.states.size());
  for (std::size_t i = 0; i < a.states.size(); ++i) ASSERT_EQ(a.states[i].q, b.states[i].q);
}

TEST(Sample, SpeedUnderTipProgramming) {
  std::string text = "G43.4 H1\nG0 A10\nG1 F1000\n";
  for (int i = 0; i < 5000; ++i)
    text += fmt::format("X{:.3f} A{:.6f} C{:.6f}\n", i * 0.3, 10 + i * 0.002, i * 0.01);
  const Path path = read_nc(text, "t", test::options_for(test::gantry()));
  SampleOptions options;
  options.chord_tolerance = 1e-8;
  const auto start = std::chrono::steady_clock::now();
  const Samples samples = sample(path, test::gantry(), options);
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::cout << double(samples.states.size()) / seconds << " samples/s (" << samples.states.size()
            << ")\n";
  EXPECT_GT(double(samples.states.size()) / seconds, 1e4);
}

}  // namespace
}  // namespace abbe::sim::program
