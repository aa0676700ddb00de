#include "sim/compensation/time_series.h"

#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "kinematics/units.h"

namespace abbe::sim::compensation {
namespace {

ControlLog log_of_two() {
  ControlLog log;
  log.names = {"nut_C", "current_A"};
  log.time_s = Eigen::Vector3d(-10.0, 0.0, 5.0);
  log.values.resize(3, 2);
  log.values << 20.0, 1.0, 21.0, 2.0, 22.0, 3.0;
  return log;
}

TEST(ControlLog, ColumnIsFoundByItsName) {
  EXPECT_EQ(column(log_of_two(), "current_A"), Eigen::Vector3d(1.0, 2.0, 3.0));
}

TEST(ControlLog, AColumnThatIsNotThereIsNamedWithThoseThatAre) {
  try {
    column(log_of_two(), "screw_C");
    FAIL() << "accepted";
  } catch (const std::invalid_argument& refusal) {
    const std::string text = refusal.what();
    for (const char* part : {"screw_C", "nut_C", "current_A"})
      EXPECT_NE(text.find(part), std::string::npos) << text;
  }
  EXPECT_THROW(column(ControlLog{}, "nut_C"), std::invalid_argument);
  ControlLog narrow = log_of_two();
  narrow.values.conservativeResize(3, 1);
  EXPECT_THROW(column(narrow, "current_A"), std::invalid_argument);
}

TEST(ControlLog, TheControlKnowsTheLastRowThatWasRead) {
  const ControlLog log = log_of_two();
  EXPECT_EQ(row_at(log, -infinity), 0);
  EXPECT_EQ(row_at(log, -11.0), 0);
  EXPECT_EQ(row_at(log, -10.0), 0);
  EXPECT_EQ(row_at(log, -1e-12), 0);
  EXPECT_EQ(row_at(log, 0.0), 1);
  EXPECT_EQ(row_at(log, 4.999), 1);
  EXPECT_EQ(row_at(log, 5.0), 2);
  EXPECT_EQ(row_at(log, infinity), 2);
}

TEST(ControlLog, WithoutRowsOrAtNoInstantIsRefused) {
  EXPECT_THROW(row_at(ControlLog{}, 0.0), std::invalid_argument);
  EXPECT_THROW(row_at(log_of_two(), std::numeric_limits<double>::quiet_NaN()),
               std::invalid_argument);
}

}  // namespace
}  // namespace abbe::sim::compensation
