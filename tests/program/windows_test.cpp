// A program in windows has the samples of the whole, to the bit.
#include <iostream>
#include <random>

#include <gtest/gtest.h>

#include "machines.h"
#include "sim/program/sample.h"

namespace abbe::sim::program {
namespace {

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

}  // namespace
}  // namespace abbe::sim::program
