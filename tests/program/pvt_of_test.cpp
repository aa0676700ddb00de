#include "sim/program/program_writers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <iostream>

#include "kinematics/bad_input.h"
#include "machines.h"
#include "sim/program/block_motion.h"
#include "sim/program/nc_reader.h"

namespace abbe::sim::program {
namespace {

using test::AxisVector;

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
