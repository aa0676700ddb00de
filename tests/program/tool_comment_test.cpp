#include "sim/program/path.h"

#include <gtest/gtest.h>

#include "sim/program/nc_reader.h"
#include "tests/program/machines.h"

namespace abbe::sim::program {
namespace {

using End = CutterData::End;

struct Said {
  const char* comment;
  std::optional<int> number;
  double diameter;  // 0: none is said
  std::optional<double> corner_radius = {};
  End end = End::Unspecified;
  std::optional<double> unit_mm = {};
};

TEST(ToolComment, CamSystemsSayDiametersInManyWays) {
  const Said all[] = {
      {"T1 D=10. CR=0. - ZMIN=-4.2 - FLAT END MILL", 1, 10.0, 0.0, End::Flat},
      {"T12  D=6 CR=3. - ZMIN=-26. - ball end mill", 12, 6.0, 3.0, End::Ball},
      {"T6  Spiral O Metal 3.175*12mm  D=3.175 CR=0. - ZMIN=-26. - flat end mill", 6, 3.175, 0.0,
       End::Flat},
      {"T2 D=0.25 CR=0.03 TAPER=118deg - ZMIN=-0.5 - bull nose end mill", 2, 0.25, 0.03},
      {"T4 D=6. - drill", 4, 6.0},
      {"TOOL - 1 DIA. OFF. - 1 LEN. - 1 DIA. - 10.", 1, 10.0},
      {" 1/16 FLAT ENDMILL TOOL - 1 DIA. OFF. - 21 LEN. - 2 DIA. - .0625",
       1,
       0.0625,
       {},
       End::Flat},
      {" TOOL - 6 2\"  FACE MILL    DIA. OFF. - 6  LEN. - 6  DIA. - 2. ", 6, 2.0},
      {"TOOL - 14 DIA. OFF. - 14 LEN. - 14 TOOL DIA. - .125", 14, 0.125},
      {"T1 | 10. FLAT ENDMILL | H1", 1, 10.0, {}, End::Flat},
      {"T3 | 1/2 BALL ENDMILL | H3 | D3", 3, 0.5, {}, End::Ball},
      {"T3 | 1-1/4 FLAT ENDMILL | H3", 3, 1.25, {}, End::Flat},
      {"TOOL DIAMETER: 3.0", {}, 3.0},
      {"Tool diameter   6.00", {}, 6.0},
      {"TOOL DIA = 12", {}, 12.0},
      {"TOOL -2- MILL DIA 10.0 R1. MM", 2, 10.0, 1.0},
      {"D10R1", {}, 10.0, 1.0},
      {"T5 D16 R0.8", 5, 16.0, 0.8},
      {"TOOL NAME : D6.5R3.25", {}, 6.5, 3.25},
      {"T2 D6", 2, 6.0},
      {"5mm Endmill", {}, 5.0, {}, End::Unspecified, 1.0},
      {"T2 10 mm 4 flute end mill", 2, 10.0, {}, End::Unspecified, 1.0},
      {"T7 1/4 inch flat end mill", 7, 0.25, {}, End::Flat, 25.4},
      {"Tool: 1  End Mill {6.35 mm}", 1, 6.35, {}, End::Unspecified, 1.0},
      {"T1 \xC3\x98 8", 1, 8.0},
  };
  for (const Said& said : all) {
    const auto words = parse_cutter_comment(said.comment);
    ASSERT_TRUE(words) << said.comment;
    EXPECT_EQ(words->number, said.number) << said.comment;
    EXPECT_DOUBLE_EQ(words->diameter, said.diameter) << said.comment;
    EXPECT_EQ(words->corner_radius, said.corner_radius) << said.comment;
    EXPECT_EQ(words->end, said.end) << said.comment;
    EXPECT_EQ(words->unit_mm, said.unit_mm) << said.comment;
  }
}

TEST(ToolComment, RegistersPlacesAndTitlesAreNoDiameters) {
  for (const char* comment :
       {"", "roughing", "T1", "T1 H1 D1", "T1 D1", "TOOL - 1 DIA. OFF. - 1 LEN. - 1", "G43 H1 D2",
        "PART 4711 D", "MACHINE GROUP-1", "2D ADAPTIVE1", "ZMIN=-4.2", "FEED 100",
        "DATE=22-11-26 TIME=10:15", "STEP 5 FACE", "OFFSET D12", "D=0 - nothing", "DIAL 3",
        "RETRACT 5mm", "STOCK 100 x 50 x 20 mm"})
    EXPECT_FALSE(parse_cutter_comment(comment)) << comment;
  EXPECT_FALSE(parse_cutter_comment("T1 D=10. " + std::string(300, 'x')));  // no name of a tool
}

TEST(ToolComment, ItsUnitIsThatOfTheProgramThatFollows) {
  NcOptions options;
  options.axes = {{'X', kinematics::Motion::Linear}};
  const Path path = read_nc(
      "(T1 D=.5 CR=0. - flat end mill)\nG20 G90\nT1 M6\n(T2 D=.25)\n(6mm endmill)\nG21\n(T3 "
      "D=8.)\n",
      "p.ngc", options);
  ASSERT_EQ(path.tool_comments.size(), 4u);
  const double mm[] = {12.7, 6.35, 6.0, 8.0};
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_DOUBLE_EQ(path.tool_comments[i].words.diameter, mm[i]) << i;
  EXPECT_EQ(path.tool_comments[0].words.corner_radius, 0.0);
  EXPECT_EQ(path.tool_comments[3].line, 7);
  ASSERT_EQ(path.unit_words.size(), 2u);
  EXPECT_TRUE(path.unit_words[0].inch);
  EXPECT_EQ(path.unit_words[1].line, 6);
}

}  // namespace
}  // namespace abbe::sim::program
