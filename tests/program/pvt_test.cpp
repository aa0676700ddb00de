#include "machines.h"
#include "sim/program/block_motion.h"
#include "sim/program/nc_reader.h"
#include "sim/program/program_writers.h"
#include "tests/test.h"

namespace abbe::sim::program {
namespace {

using test::AxisVector;

NcOptions options() { return test::options_for(test::platform()); }

TEST(Pvt, CubicIsTheHermiteCubicOfItsRows) {
  const Path path = read_pvt("time_s,X_mm,X_mm_per_s\n1,0,1\n3,4,-1\n", "t", options());
  ASSERT_EQ(path.blocks.size(), 1u);
  const Block& block = path.blocks.front();
  EXPECT_EQ(block.start_s, 1.0);
  EXPECT_EQ(block.end_s, 3.0);
  EXPECT_EQ(block.line, 3);
  for (const double u : {0.0, 0.2, 0.5, 0.9, 1.0}) {
    // by hand: x = 0 with slope 2 per u at u = 0, x = 4 with slope -2 at u = 1
    const double x = 2 * u + 10 * u * u - 8 * u * u * u;
    EXPECT_NEAR(position(path, block, u)[1], x, 1e-14);
    EXPECT_NEAR(velocity(path, block, u)[1], (2 + 20 * u - 24 * u * u) / 2, 1e-14);
  }
}

TEST(Pvt, ConstantSpeedStaysALineToTheLastBits) {
  std::string text = "time_s,X_mm,X_mm_per_s\n";
  for (int k = 0; k <= 20; ++k)
    text += fmt::format("{},{},-0.05\n", k * 0.1, 10.0 - 0.05 * (k * 0.1));
  const Path path = read_pvt(text, "t", options());
  double worst = 0.0;
  for (const Block& block : path.blocks)
    for (int k = 0; k <= 50; ++k) {
      const double t = block.start_s + k / 50.0 * (block.end_s - block.start_s);
      worst = std::max(worst, std::abs(position(path, block, k / 50.0)[1] - (10.0 - 0.05 * t)));
    }
  std::cout << "off the line by " << worst << " mm\n";
  EXPECT_LT(worst, 5e-15);
}

TEST(Pvt, AxesLeftOutKeepTheirStart) {
  NcOptions with_start = options();
  with_start.start << 0.5, 1.5, 2.5;
  const Path path = read_pvt("time_s,X_mm,X_mm_per_s\n0,0,0\n1,1,0\n", "t", with_start);
  EXPECT_EQ(path.blocks[0].start[0], 0.5);
  EXPECT_EQ(path.blocks[0].end[2], 2.5);
}

TEST(Pvt, DegreesAndMarksAreRead) {
  const Path path = read_pvt(
      "\xEF\xBB\xBF# a comment\r\ntime_s, S_deg, S_deg_per_s\r\n\r\n0, 0, 360\r\n1, 360, 360\r\n",
      "t", options());
  EXPECT_NEAR(path.blocks[0].end[0], 2 * pi, 1e-15);
  EXPECT_NEAR(path.cubics[0].end_velocity[0], 2 * pi, 1e-15);
}

TEST(Pvt, WhatIsWrittenReadsBackBitForBit) {
  const unsigned seed = 4711;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1), exponent(-12, 4);
  std::vector<PvtRow> rows;
  const auto any = [&] { return unit(random) * std::pow(10.0, exponent(random)); };
  for (int k = 0; k < 2000; ++k) {
    PvtRow row{k * 0.1 + 0.05 * unit(random), AxisVector(3), AxisVector(3)};
    for (int j = 0; j < 3; ++j) row.position[j] = any(), row.velocity[j] = any();
    rows.push_back(row);
  }
  rows[3].position[1] = -0.0;
  rows[4].velocity[2] = 5e-324;
  const int columns[] = {0, 1, 2};
  const std::string text = write_pvt(rows, options().axes, columns);
  const std::vector<PvtRow> back = pvt_rows(read_pvt(text, "t", options()));
  ASSERT_EQ(back.size(), rows.size());
  for (std::size_t k = 0; k < rows.size(); ++k) {
    ASSERT_EQ(std::bit_cast<std::uint64_t>(back[k].time_s),
              std::bit_cast<std::uint64_t>(rows[k].time_s));
    for (int j = 0; j < 3; ++j) {
      ASSERT_EQ(std::bit_cast<std::uint64_t>(back[k].position[j]),
                std::bit_cast<std::uint64_t>(rows[k].position[j]));
      ASSERT_EQ(std::bit_cast<std::uint64_t>(back[k].velocity[j]),
                std::bit_cast<std::uint64_t>(rows[k].velocity[j]));
    }
  }
  EXPECT_EQ(write_pvt(back, options().axes, columns), text);
}

TEST(PvtConversion, WhatIsWrittenAndReadAgainFollowsThePathAtEveryInstant) {
  const NcOptions options = test::options_for(test::gantry());
  const Path path = read_nc(
      "G21 G90 G94 G17\nG0 X50 Y20\nG1 Z-10 F1200\nX80\nY60\nG2 X100 Y60 I10 J0\nG4 P.3\n"
      "G43.4 H1\nG1 X120 Y40 A20 C45 F900\nX121 A-10 C44\nG49\nG1 X0 Y0 A0 F2000\n",
      "part.ngc", options);
  for (const double within : {0.01, 0.001, 0.0001}) {
    const PvtConversion made = convert_to_pvt(path, *options.control, {.within = within});
    const std::vector<int> columns{0, 1, 2, 3, 4};
    const Path again = read_pvt(write_pvt(made.rows, options.axes, columns), "t.pvt", options);
    EXPECT_EQ(again.blocks.front().start_s, path.blocks.front().start_s);
    EXPECT_NEAR(again.blocks.back().end_s, path.blocks.back().end_s, 1e-9);
    double worst = 0.0;
    std::size_t at = 0;
    for (const Block& block : path.blocks)
      for (int k = 0; k <= 400; ++k) {
        const double t = block.start_s + k / 400.0 * (block.end_s - block.start_s);
        while (at + 1 < again.blocks.size() && again.blocks[at].end_s < t) ++at;
        const Block& cubic = again.blocks[at];
        const double u = (t - cubic.start_s) / (cubic.end_s - cubic.start_s);
        AxisVector max_deviation =
            position(again, cubic, u) - axes_at(path, block, *options.control, k / 400.0);
        max_deviation[0] *= 100.0;  // mm per rad
        max_deviation[4] *= 100.0;
        worst = std::max(worst, max_deviation.head(5).norm());
      }
    std::cout << made.rows.size() << " rows for " << within << " mm: off by " << worst
              << " mm, reported " << made.max_deviation << "\n";
    EXPECT_LT(worst, 1.5 * within);
    EXPECT_LT(made.max_deviation, 1.5 * within);
    EXPECT_LT(worst, 1.5 * made.max_deviation + 1e-9) << "what is reported is what is there";
  }
}

TEST(PvtConversion, AProgramThatDoesNotMoveIsRefused) {
  const NcOptions options = test::options_for(test::gantry());
  EXPECT_THROW(convert_to_pvt(read_nc("G21\n", "t", options), *options.control), BadInput);
  EXPECT_THROW(
      convert_to_pvt(read_nc("G1 X100 F1\nX0\n", "t", options), *options.control, {.max_rows = 3}),
      BadInput);
}

}  // namespace
}  // namespace abbe::sim::program
