#include "kinematics/bad_input.h"

#include <gtest/gtest.h>

namespace abbe {
namespace {

TEST(BadInput, SaysWhereWhatWasExpectedAndWhatWasSeen) {
  EXPECT_STREQ(BadInput("a.toml", 3, 7, "a number", "\"x\"").what(),
               "a.toml:3:7: expected a number, seen \"x\"");
}

TEST(BadInput, LeavesOutAPlaceThatIsNotKnown) {
  EXPECT_STREQ(BadInput("a.stl", 0, 0, "84 bytes", "12").what(),
               "a.stl: expected 84 bytes, seen 12");
  EXPECT_STREQ(BadInput("a.ngc", 5, 0, "a word", "nothing").what(),
               "a.ngc:5: expected a word, seen nothing");
}

TEST(BadInput, KeepsItsParts) {
  const BadInput refused("a.ngc", 5, 2, "G0 to G3", "G99");
  EXPECT_EQ(refused.file, "a.ngc");
  EXPECT_EQ(refused.line, 5);
  EXPECT_EQ(refused.column, 2);
  EXPECT_EQ(refused.expected, "G0 to G3");
  EXPECT_EQ(refused.seen, "G99");
}

}  // namespace
}  // namespace abbe
