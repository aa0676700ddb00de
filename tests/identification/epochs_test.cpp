// Readings of several starts, taken apart by the names of their set-ups.

#include "errors/identification/thermal_epochs.h"

#include <stdexcept>

#include <gtest/gtest.h>

#include "tests/identification/measured.h"

namespace abbe::errors::identification {
namespace {

using metrology::Readings;

/// Set-ups a and b from two starts, read in turns; value and temperature are the number of the
/// look.
Readings two_starts() {
  Readings readings{{}, tool_side_axes(), {}, {}, {}};
  readings.plan.instrument = "laser";
  readings.plan.set_ups.resize(4);
  for (std::size_t s = 0; s < 4; ++s) readings.plan.set_ups[s].name = s % 2 == 0 ? "a" : "b";
  readings.sensors = {"room", "nut"};
  readings.plan.measurements.resize(8);
  for (std::size_t i = 0; i < 8; ++i) readings.plan.measurements[i].set_up = int(i) / 2;
  readings.value = Eigen::VectorXd::LinSpaced(8, 0.0, 7.0);
  readings.T_C.resize(8, 2);
  readings.T_C.col(0).setConstant(20.0);
  readings.T_C.col(1) = readings.value;
  return readings;
}

TEST(Epochs, AStartIsHowOftenTheNameOfItsSetUpCameBefore) {
  Readings readings = two_starts();
  EXPECT_EQ(start_indices(readings.plan), (std::vector<int>{0, 0, 1, 1}));
  EXPECT_EQ(day_log(readings).start_count, 2);
  readings.plan.set_ups[1].name = "c";
  EXPECT_EQ(start_indices(readings.plan), (std::vector<int>{0, 0, 1, 0}));
}

TEST(Epochs, EveryStartAloneHasItsOwnSetUpsReadingsAndTemperatures) {
  const std::vector<Readings> start_count = split_by_start(two_starts());
  ASSERT_EQ(start_count.size(), 2u);
  for (const Readings& one : start_count) {
    EXPECT_EQ(one.plan.instrument, "laser");
    ASSERT_EQ(one.plan.set_ups.size(), 2u);
    EXPECT_EQ(one.plan.set_ups[0].name, "a");
    EXPECT_EQ(one.plan.set_ups[1].name, "b");
    ASSERT_EQ(one.plan.measurements.size(), 4u);
    for (int i = 0; i < 4; ++i) EXPECT_EQ(one.plan.measurements[std::size_t(i)].set_up, i / 2);
  }
  EXPECT_EQ(start_count[0].value, Eigen::Vector4d(0, 1, 2, 3));
  EXPECT_EQ(start_count[1].value, Eigen::Vector4d(4, 5, 6, 7));
  EXPECT_EQ(start_count[1].T_C.col(1), start_count[1].value);
  const Eigen::MatrixXd dT_K = temperature_rise_K(start_count, {"nut"});
  EXPECT_EQ(dT_K, Eigen::Vector2d(0, 4));
}

TEST(Epochs, ASensorThatWasNotLoggedIsNamed) {
  EXPECT_EQ(sensor_columns({"nut", "room"}, {"room", "nut"}), (std::vector<Eigen::Index>{1, 0}));
  try {
    (void)sensor_columns({"oven"}, {"room"});
    FAIL();
  } catch (const std::invalid_argument& fault) {
    EXPECT_STREQ(fault.what(), "expected a logged sensor, seen oven");
  }
}

}  // namespace
}  // namespace abbe::errors::identification
