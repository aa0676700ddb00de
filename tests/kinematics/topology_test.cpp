#include "kinematics/axes.h"

#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

namespace abbe::kinematics {
namespace {

std::string refusal(std::string_view code) {
  try {
    parse_structural_code(code);
  } catch (const std::invalid_argument& refused) {
    return refused.what();
  }
  return "accepted";
}

TEST(StructuralCode, OfTheGantryHasItsAxesInOrder) {
  const Topology expected = {{'C', Side::Workpiece}, {'X', Side::Tool}, {'Y', Side::Tool},
                             {'Z', Side::Tool},      {'A', Side::Tool}, {'s', Side::Tool}};
  EXPECT_EQ(parse_structural_code("w C' b X Y Z A s t"), expected);
  EXPECT_EQ(parse_structural_code("wC'bXYZAst"), expected);
  EXPECT_EQ(parse_structural_code("  w\tC 'bX YZ A s t "), expected);
}

TEST(StructuralCode, IsWrittenAsItIsRead) {
  for (const char* code : {"w C' b X Y Z A s t", "w S' X' b Z t", "w C' A' b X Y Z s t",
                           "w b X Y Z C A s t", "w X' Y' b Z s t", "w X' Y' Z' b t", "w b t",
                           "w U' V' W' b X Y Z A s t", "w C' b X Y Z W A s t"}) {
    const Topology topology = parse_structural_code(code);
    EXPECT_EQ(to_string(topology), code);
    EXPECT_EQ(parse_structural_code(to_string(topology)), topology);
  }
}

TEST(StructuralCode, RefusalsSayWhatWasExpectedAndSeen) {
  const std::string head = "structural code: expected ";
  EXPECT_EQ(refusal(""), head + "w as the first letter, seen nothing");
  EXPECT_EQ(refusal("  "), head + "w as the first letter, seen nothing");
  EXPECT_EQ(refusal("b X t"), head + "w as the first letter, seen 'b'");
  EXPECT_EQ(refusal("w"), head + "t as the last letter, seen 'w'");
  EXPECT_EQ(refusal("w b X"), head + "t as the last letter, seen 'X'");
  EXPECT_EQ(refusal("w b X b t"), head + "only one b, seen a second b");
  EXPECT_EQ(refusal("w t"), head + "b for the bed, seen no b");
  EXPECT_EQ(refusal("w X' t"), head + "b for the bed, seen no b");
  EXPECT_EQ(refusal("w X b t"),
            head + "a prime after 'X', which carries the workpiece, seen no prime");
  EXPECT_EQ(refusal("w b X' t"), head + "no prime after 'X', which carries the tool, seen a prime");
  EXPECT_EQ(refusal("w X' b X t"), head + "each letter only once, seen 'X' twice");
  EXPECT_EQ(refusal("w b s X t"), head + "s directly before t, seen s elsewhere");
  EXPECT_EQ(refusal("w s' b X t"), head + "s directly before t, seen s elsewhere");
  EXPECT_EQ(refusal("w b X s' t"), head + "s directly before t, seen s elsewhere");
  EXPECT_EQ(refusal("w b x t"), head + "an axis letter of XYZUVWABCS, b or s, seen 'x'");
  EXPECT_EQ(refusal("w ' b X t"), head + "an axis letter of XYZUVWABCS, b or s, seen '''");
  EXPECT_EQ(refusal(std::string("w b \n t")),
            head + "an axis letter of XYZUVWABCS, b or s, seen a character of code 10");
  EXPECT_EQ(refusal("w C\xc3\xa2 b t"),
            head + "a prime after 'C', which carries the workpiece, seen no prime");
  EXPECT_EQ(refusal(std::string("w b \0 t", 7)),
            head + "an axis letter of XYZUVWABCS, b or s, seen a character of code 0");
  EXPECT_EQ(refusal("w X' Y' Z' b U V W A B C t"), head + "at most 8 joints, seen 9");
}

TEST(StructuralCode, OfAMillionLettersIsRefusedAtTheFirstRepetition) {
  EXPECT_EQ(refusal("w b" + std::string(1000000, 'X') + "t"),
            "structural code: expected each letter only once, seen 'X' twice");
}

TEST(BodyArray, OfThePlatformIsPengs) {
  const BodyArray array = low_order_body_array(parse_structural_code("w S' X' b Z s t"));
  EXPECT_EQ(array.parent, (std::vector<int>{0, 1, 2, 0, 4, 5}));
  EXPECT_EQ(array.body, (std::vector<std::string>{"X", "S", "workpiece", "Z", "s", "tool"}));
}

TEST(BodyArray, OfTheGantryHasTwoBranchesAtTheBed) {
  const BodyArray array = low_order_body_array(parse_structural_code("w C' b X Y Z A s t"));
  EXPECT_EQ(array.parent, (std::vector<int>{0, 1, 0, 3, 4, 5, 6, 7}));
  EXPECT_EQ(array.body,
            (std::vector<std::string>{"C", "workpiece", "X", "Y", "Z", "A", "s", "tool"}));
}

TEST(BodyArray, OfAMachineWithoutAxesIsWorkpieceAndTool) {
  const BodyArray array = low_order_body_array({});
  EXPECT_EQ(array.parent, (std::vector<int>{0, 0}));
}

}  // namespace
}  // namespace abbe::kinematics
