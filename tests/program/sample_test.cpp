#include "sim/program/sample.h"
#include "kinematics/pose.h"
#include "machines.h"
#include "sim/program/canon.h"
#include "sim/program/nc_reader.h"
#include "sim/program/program_writers.h"
#include "sim/program/rewrite.h"
#include "tests/test.h"

namespace abbe::sim::program {
namespace {

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
  SeededRandom random(99);
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

// A program in windows has the samples of the whole, to the bit.

/// Blocks of every kind, tips and axes, with reversals, dwells and moves of nothing.
std::string any_program(std::mt19937& random, int blocks) {
  std::uniform_real_distribution<double> place(-80.0, 80.0), turn(-40.0, 40.0), radius(2.0, 30.0);
  std::uniform_int_distribution<int> kind(0, 7);
  std::string text = "G21 G90 G94 G17\nM3 S6000\nG0 X0 Y0 Z50 A0 C0\n";
  bool tip = false;
  for (int i = 0; i < blocks; ++i) {
    switch (kind(random)) {
      case 0:
        text += fmt::format("G0 X{:.3f} Z{:.3f}\n", place(random), 60 + place(random));
        break;
      case 1:
        text += "G4 P0.3\n";
        break;
      case 2: {
        const double r = radius(random);
        text += fmt::format("G91 G2 X{0:.4f} Y0 I{1:.4f} J0 F400\nG90\n", 2 * r, r);
        break;
      }
      case 3:
        text += fmt::format("G1 X{:.3f} F700\nG1 X{:.3f}\n", place(random), place(random));
        break;
      case 4:
        text += "G91 G1 X0 F100\nG90\n";
        break;
      case 5:
        tip = !tip;
        text += tip ? "G43.4 H1\n" : "G49\n";
        break;
      default:
        text += fmt::format("G1 X{:.3f} Y{:.3f} Z{:.3f} A{:.3f} C{:.3f} F900\n", place(random),
                            place(random), 60 + place(random), turn(random), turn(random));
    }
  }
  return text;
}

bool same(const kinematics::AxisState& a, const kinematics::AxisState& b) {
  return a.q == b.q && a.time_s == b.time_s && a.direction == b.direction && a.stroke == b.stroke &&
         a.spindle_speed == b.spindle_speed;
}

/// Holds the windows of a path one after the other against its samples.
void joins(const Path& path, const SampleOptions& options, std::size_t most) {
  SCOPED_TRACE(most);
  const Samples whole = sample(path, test::gantry(), options);
  const std::vector<SampleWindow> all = windows(path, test::gantry(), options, most);
  std::size_t at = 0;  // sample of the whole that comes next
  std::size_t block = 0;
  for (const SampleWindow& window : all) {
    ASSERT_EQ(window.first, block);
    block = window.last;
    SampleOptions own = options;
    own.continued_from = window.continued_from;
    const Path part = path_of(path, window);
    const Samples samples = sample(part, test::gantry(), own);
    const std::size_t from = window.continued_from ? 1 : 0;
    const std::size_t blocks_before = window.first - from;
    if (window.continued_from) {
      ASSERT_TRUE(same(samples.states.front(), whole.states[at - 1]));
      ASSERT_EQ(samples.line.front(), whole.line[at - 1]);
    }
    for (std::size_t i = from; i < samples.states.size(); ++i, ++at) {
      ASSERT_LT(at, whole.states.size());
      ASSERT_TRUE(same(samples.states[i], whole.states[at])) << at;
      ASSERT_EQ(samples.line[i], whole.line[at]);
      ASSERT_EQ(std::size_t(samples.block[i]) + blocks_before, std::size_t(whole.block[at]));
    }
    if (window.last < path.blocks.size()) {
      ASSERT_GE(samples.states.size(), most);
    }
  }
  EXPECT_EQ(at, whole.states.size());
  EXPECT_EQ(block, path.blocks.size());
}

TEST(Windows, HaveTheSamplesOfTheWholeToTheBit) {
  const unsigned seed = 20261127;
  std::cout << "seed " << seed << '\n';
  std::mt19937 random(seed);
  SampleOptions options;
  options.max_step = 2.0;
  options.max_axis_step = 2.0;
  for (int round = 0; round < 8; ++round) {
    NcOptions nc = test::options_for(test::gantry());
    const std::string text = any_program(random, 60);
    SCOPED_TRACE(text);
    const Path path = read_nc(text, "any.ngc", nc);
    for (const std::size_t most : {1u, 2u, 7u, 40u, 500u, 1000000u}) joins(path, options, most);
  }
}

TEST(Windows, StartWithTheWaysOfWhatWasBefore) {
  const Path path = read_nc("G21 G90 G94\nG1 X5 F600\nG1 X0\nG1 X3\n", "t.ngc",
                            test::options_for(test::gantry()));
  SampleOptions options;
  options.before.direction[1] = 1;
  options.before.stroke[1] = 4;
  joins(path, options, 1);
}

TEST(Windows, RefuseMoreSamplesThanAWindowMayHave) {
  const Path path =
      read_nc("G21 G90 G94\nG1 X5 F600\nG1 X900\n", "t.ngc", test::options_for(test::gantry()));
  SampleOptions options;
  options.max_samples = 100;
  EXPECT_THROW(windows(path, test::gantry(), options, 10), TooManySamples);
}

TEST(Windows, AnEmptyPathIsOneWindowOfNothing) {
  const std::vector<SampleWindow> all = windows({}, test::gantry(), {}, 10);
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all.front().last, 0u);
}

// Arcs in planes that no two joints span, as a coordinate system that is turned makes them.

/// A helix of more than a turn in a frame that is turned any way, by its centre or its radius.
struct Turned {
  Matrix3d R;
  Path path;
  double radius = 0.0, sweep = 0.0, across = 0.0;
  Vector3d start;  ///< in the frame
};

Turned turned_helix(unsigned seed, const NcOptions& options) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  Turned one;
  one.R = Eigen::AngleAxisd(3 * unit(random),
                            Vector3d(unit(random), unit(random), unit(random)).normalized())
              .toRotationMatrix();
  Canon canon("t", options);
  canon.set_feed(Feed{600.0, 1.0});
  Frame frame;
  frame.shift = AxisVector(Vector3d(5 * unit(random), 7, -3));
  frame.rotation = one.R;
  canon.set_frame(0, frame);
  one.radius = 10 + 5 * unit(random);
  one.sweep = 2 * pi + 1.5 + unit(random);
  one.across = 8 * unit(random);
  one.start = Vector3d(1, 2, 3);
  const Vector3d centre = one.start - Vector3d(one.radius, 0, 0);
  const Vector3d end = centre + Vector3d(one.radius * std::cos(one.sweep),
                                         one.radius * std::sin(one.sweep), one.across);
  canon.traverse({.end = canon.placed(AxisVector(one.start))});
  ArcMove move{.first = 0, .second = 1, .end = canon.placed(AxisVector(end)), .turns = 2};
  move.centre_with_offsets = canon.placed(AxisVector(centre));
  canon.arc(std::move(move));
  one.path = canon.take();
  return one;
}

Vector3d expected(const Turned& one, const NcOptions&, const Vector3d& shift, double u) {
  const double a = u * one.sweep;
  return one.R * (one.start + Vector3d(one.radius * (std::cos(a) - 1), one.radius * std::sin(a),
                                       u * one.across)) +
         shift;
}

TEST(TurnedArc, IsTheHelixOfItsFrame) {
  const NcOptions options = test::options_for(test::three_axis());
  double off = 0.0, rate_off = 0.0, time_off = 0.0;
  for (unsigned seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE(seed);
    const Turned one = turned_helix(seed, options);
    const Block& block = one.path.blocks.back();
    ASSERT_EQ(one.path.arcs.size(), 1u);
    const Vector3d shift = block.start - one.R * one.start;
    const double seconds = block.end_s - block.start_s;
    time_off =
        std::max(time_off, std::abs(seconds - std::hypot(one.radius * one.sweep, one.across) / 10));
    for (double u = 0.0; u <= 1.0; u += 0.05) {
      off = std::max(off, (position(one.path, block, u) - expected(one, options, shift, u)).norm());
      const double h = 1e-5;
      if (u < 0.01 || u > 0.99) continue;
      const Vector3d rate =
          (expected(one, options, shift, u + h) - expected(one, options, shift, u - h)) /
          (2 * h * seconds);
      rate_off = std::max(rate_off, (velocity(one.path, block, u) - rate).norm());
    }
  }
  std::cout << "position within " << off << " mm, velocity within " << rate_off
            << " mm/s of differences, time within " << time_off << " s\n";
  EXPECT_LE(off, 1e-12);  // mm: rounding at 30 mm
  EXPECT_LE(rate_off, 1e-6);
  EXPECT_LE(time_off, 1e-11);
}

TEST(TurnedArc, IsSampledWhereItsAxesTurnBackWithinTheChordTolerance) {
  const test::Chain machine = test::three_axis();
  const NcOptions options = test::options_for(machine);
  SampleOptions sampling;
  sampling.chord_tolerance = 1e-3;
  double chord = 0.0, beyond = 0.0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    const Turned one = turned_helix(seed, options);
    const Samples samples = sample(one.path, machine, sampling);
    const Block& block = one.path.blocks.back();
    const Vector3d shift = block.start - one.R * one.start;
    Vector3d most = Vector3d::Constant(-1e9), seen = block.start;
    for (double u = 0.0; u <= 1.0; u += 1e-4)
      most = most.cwiseMax(expected(one, options, shift, u));
    for (std::size_t i = 0; i < samples.states.size(); ++i) {
      if (samples.block[i] != 1) continue;
      seen = seen.cwiseMax(Vector3d(samples.states[i].q));
      if (i == 0 || samples.block[i - 1] != 1) continue;
      const auto u_of = [&](std::size_t k) {
        return (samples.states[k].time_s - block.start_s) / (block.end_s - block.start_s);
      };
      const Vector3d middle = expected(one, options, shift, 0.5 * (u_of(i - 1) + u_of(i)));
      chord = std::max(
          chord, (middle - 0.5 * Vector3d(samples.states[i - 1].q + samples.states[i].q)).norm());
    }
    beyond = std::max(beyond, (most - seen).maxCoeff());
  }
  std::cout << "chords within " << chord << " of 0.001 mm, extremes met within " << beyond
            << " mm\n";
  EXPECT_LE(chord, 1e-3);
  EXPECT_LE(beyond, 1e-7);
}

TEST(TurnedArc, IsRewrittenAsChordsWithinItsWords) {
  const NcOptions options = test::options_for(test::three_axis());
  const Turned one = turned_helix(7, options);
  RewriteOptions words;
  words.word_mm = 1e-4;
  const RewrittenProgram program =
      rewrite_program(one.path, CorrectedPath(one.path.blocks.size()), options, words);
  const Path again = read_nc(program.text, "again", options);
  const Block& block = one.path.blocks.back();
  const Vector3d shift = block.start - one.R * one.start;
  double off = 0.0;
  for (const Block& line : again.blocks) {
    if (line.interpolation != Interpolation::Line) continue;
    const double u = (line.end_s - block.start_s) / (block.end_s - block.start_s);
    off = std::max(off, (Vector3d(line.end) - expected(one, options, shift, u)).norm());
  }
  std::cout << again.blocks.size() << " blocks, ends within " << off << " mm\n";
  EXPECT_NEAR(again.blocks.back().end_s, one.path.blocks.back().end_s, 1e-3);
  EXPECT_LE(off, 3e-4);
}

}  // namespace
}  // namespace abbe::sim::program
