#include <stdexcept>

#include <gtest/gtest.h>

#include "errors/element.h"

namespace abbe::errors {
namespace {

TEST(ElementName, EveryNameIsReadAndWrittenBack) {
  for (const char direction : std::string("XYZABC")) {
    for (const char axis : std::string("XYZUVWABCS")) {
      const std::string motion = std::string("E") + direction + axis;
      const std::string location = std::string("E") + direction + "0" + axis;
      EXPECT_EQ(to_string(parse_element_name(motion)), motion);
      EXPECT_EQ(to_string(parse_element_name(location)), location);
      EXPECT_EQ(parse_element_name(location.substr(1)), parse_element_name(location));
      EXPECT_FALSE(parse_element_name(motion).location);
      EXPECT_TRUE(parse_element_name(location).location);
    }
  }
}

TEST(ElementName, TheDirectionLetterIsThePlaceInADeviation) {
  EXPECT_EQ(parse_element_name("EXZ").component(), 0);
  EXPECT_EQ(parse_element_name("EZX").component(), 2);
  EXPECT_EQ(parse_element_name("EAX").component(), 3);
  EXPECT_EQ(parse_element_name("C0Y").component(), 5);
  EXPECT_EQ(parse_element_name("C0Y").axis, 'Y');
  EXPECT_TRUE(parse_element_name("ECX").is_angle());
  EXPECT_FALSE(parse_element_name("EXC").is_angle());
}

TEST(ElementName, AnythingElseIsRefused) {
  for (const std::string text :
       {"",     "E",     "EX", "XX", "EXXX", "exx",  "EXx",  "EUX", "ESX", "EXs",  "EX1X",
        "E0XX", "EC00Y", "C0", "0Y", "C0y",  "EXX ", " EXX", "E X", "EX-", "EC0T", "EXXEXX"}) {
    EXPECT_THROW(parse_element_name(text), std::invalid_argument) << text;
  }
  EXPECT_THROW(parse_element_name(std::string_view("EX\0", 3)), std::invalid_argument);
  try {
    parse_element_name("E\nX");
  } catch (const std::invalid_argument& fault) {
    EXPECT_NE(std::string(fault.what()).find("seen 'E?X'"), std::string::npos) << fault.what();
  }
}

}  // namespace
}  // namespace abbe::errors
