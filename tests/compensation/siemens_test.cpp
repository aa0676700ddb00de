#include <iostream>

#include <gtest/gtest.h>

#include "kinematics/units.h"
#include "sim/compensation/control_files.h"
#include "tests/compensation/control_cases.h"

namespace abbe::sim::compensation {
namespace {

using namespace cases;

ParameterTables siemens_tables(const std::string& text) {
  return read_control_tables(std::vector<ControlFile>{{"A.INI", text}}, gantry(),
                             ControlFormat::Siemens);
}

// laid out as the example of the function manual
const std::string encoder_ini =
    "%_N_AX_EEC_INI\n"
    "CHANDATA(1)\n"
    "$AA_ENC_COMP[0,0,X1]=0.003   ; 1st value: +3 um\n"
    "$AA_ENC_COMP[0,1,X1]=0.01\n"
    "$AA_ENC_COMP[0,2,X1]=-0.0\n"
    "$AA_ENC_COMP_STEP[0,X1]=100.0\n"
    "$AA_ENC_COMP_MIN[0,X1]=-50.0\n"
    "$AA_ENC_COMP_MAX[0,X1]=150.0\n"
    "$AA_ENC_COMP_IS_MODULO[0,X1]=0\n"
    "M17\n";

const std::string cross_ini =
    "%_N_NC_CEC_INI\r\n"
    "CHANDATA(1)\r\n"
    "$AN_CEC[3,0] = 0\r\n"
    "$AN_CEC[3,1] = 0.01\r\n"
    "$AN_CEC_INPUT_AXIS[3]=(Y1)\r\n"
    "$AN_CEC_OUTPUT_AXIS[3]=(Z1)\r\n"
    "$AN_CEC_STEP[3]=800.0\r\n"
    "$AN_CEC_MIN[3]=-400.0\r\n"
    "$AN_CEC_MAX[3]=400.0\r\n"
    "$AN_CEC_DIRECTION[3]=1\r\n"
    "$AN_CEC_MULT_BY_TABLE[3]=0\r\n"
    "$AN_CEC_IS_MODULO[3]=0\r\n"
    "M17\r\n";

TEST(Siemens, APositiveEncoderValueMovesTheAxisInTheNegativeDirection) {
  const ParameterTables tables = siemens_tables(encoder_ini);
  ASSERT_EQ(tables.tables.size(), 1u);
  const AxisTable& table = tables.tables[0];
  EXPECT_EQ(table.argument_joint, X);
  EXPECT_EQ(table.corrected_joint, X);
  EXPECT_EQ(table.position, Eigen::Vector3d(-50, 50, 150));
  EXPECT_EQ(table.upward, Eigen::Vector3d(-0.003, -0.01, 0.0));
  EXPECT_EQ(table.downward, table.upward);
  EXPECT_EQ(correction(table, -1000, 1), -0.003) << "the first value holds beyond";
}

TEST(Siemens, ATableOfOneDirectionIsForThatDirectionOnly) {
  const ParameterTables tables = siemens_tables(cross_ini);
  ASSERT_EQ(tables.tables.size(), 1u);
  EXPECT_EQ(tables.tables[0].argument_joint, Y);
  EXPECT_EQ(tables.tables[0].corrected_joint, Z);
  EXPECT_EQ(tables.tables[0].upward, Eigen::Vector2d(0, 0.01));
  EXPECT_EQ(tables.tables[0].downward, Eigen::Vector2d(0, 0));
}

TEST(Siemens, OwnTablesAlikeBothWaysGoToTheEncoderAllOthersToTheCrossTables) {
  ParameterTables tables = none();
  const Eigen::Vector3d p(-100, 0, 100), v(1e-3, 2e-3, -3e-3), w(0, 1e-3, 0);
  tables.tables = {{X, X, p, v, v}, {Y, Y, p, v, w}, {X, Z, p, v, v}};
  const ControlExport made = to_control(tables, gantry(), ControlFormat::Siemens);
  ASSERT_EQ(made.files.size(), 2u);
  EXPECT_EQ(file(made, "AX_EEC.INI").text,
            "%_N_AX_EEC_INI\nCHANDATA(1)\n"
            "$AA_ENC_COMP[0,0,X1]=-0.00100000\n"
            "$AA_ENC_COMP[0,1,X1]=-0.00200000\n"
            "$AA_ENC_COMP[0,2,X1]=0.00300000\n"
            "$AA_ENC_COMP_STEP[0,X1]=100.000000000000\n"
            "$AA_ENC_COMP_MIN[0,X1]=-100.00000000\n"
            "$AA_ENC_COMP_MAX[0,X1]=100.00000000\n"
            "$AA_ENC_COMP_IS_MODULO[0,X1]=0\n"
            "M17\n");
  const std::string& text = file(made, "NC_CEC.INI").text;
  for (const char* line :
       {"$AN_CEC_INPUT_AXIS[0]=(Y1)\n", "$AN_CEC_DIRECTION[0]=1\n", "$AN_CEC_DIRECTION[1]=-1\n",
        "$AN_CEC[0,2]=-0.00300000\n", "$AN_CEC[1,1]=0.00100000\n", "$AN_CEC_OUTPUT_AXIS[2]=(Z1)\n",
        "$AN_CEC_DIRECTION[2]=0\n"})
    EXPECT_TRUE(says({text}, line)) << line;
  EXPECT_TRUE(text.ends_with("M17\n"));
  EXPECT_TRUE(says(made.notes, "assumed"));
}

TEST(Siemens, PointsThatAreNotEquidistantAreReadOff) {
  ParameterTables tables = none();
  tables.offset[X] = 1e-3;
  const Eigen::Vector3d p(0, 10, 40), v(0, 4e-3, 4e-3);
  tables.tables = {{X, X, p, v, v}};
  const ControlExport made = to_control(tables, gantry(), ControlFormat::Siemens);
  for (const std::string& sentence : made.omissions) std::cout << sentence << "\n";
  EXPECT_TRUE(says(made.omissions,
                   "X: 3 points that are not equidistant; equidistant points deviate by 2 um"));
  EXPECT_TRUE(says(made.omissions, "offset of X, 1 um"));
  const ParameterTables back = read_control_tables(made.files, gantry(), ControlFormat::Siemens);
  EXPECT_EQ(back.tables.at(0).position, Eigen::Vector3d(0, 20, 40));
}

TEST(Siemens, RandomTablesComeBack) {
  const unsigned seed = 20250703;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  const Chain chain = gantry();
  Difference largest;
  for (int run = 0; run < 100; ++run) {
    const ParameterTables tables = any_tables(chain, random, {true, run % 2 == 0, true, 400});
    const ControlExport made = to_control(tables, chain, ControlFormat::Siemens);
    EXPECT_TRUE(made.omissions.empty());
    const ParameterTables back = read_control_tables(made.files, chain, ControlFormat::Siemens);
    EXPECT_EQ(back.tables.size(), tables.tables.size()) << "each pair of directions is one again";
    const Difference d = difference(tables, back, chain, random);
    largest.mm = std::max(largest.mm, d.mm);
    largest.rad = std::max(largest.rad, d.rad);
  }
  std::cout << largest.mm << " mm, " << largest.rad << " rad\n";
  // four tables move an axis; half a digit each, and the last points of a rotary axis
  EXPECT_LT(largest.mm, 4 * 0.55e-8);
  EXPECT_LT(largest.rad, 4 * 0.55e-8 * units::deg);
}

TEST(Siemens, ASecondProgramMayNotWriteTheSameTable) {
  const auto both = [](const std::string& one, const std::string& two) {
    return refusal([&] {
      read_control_tables(std::vector<ControlFile>{{"A.INI", one}, {"B.INI", two}}, gantry(),
                          ControlFormat::Siemens);
    });
  };
  EXPECT_EQ(both(encoder_ini, cross_ini), Place{});
  EXPECT_EQ(both(encoder_ini, encoder_ini), (Place{3, 1}));
  EXPECT_EQ(both(cross_ini, cross_ini), (Place{3, 1}));
}

TEST(Siemens, RefusesByLineAndColumn) {
  const auto of_encoder = [](const std::string& from, const std::string& to) {
    return refusal([&] { siemens_tables(with(encoder_ini, from, to)); });
  };
  EXPECT_EQ(of_encoder("M17", "M17"), Place{});
  EXPECT_EQ(of_encoder("M17", "M30"), (Place{10, 1}));
  EXPECT_EQ(of_encoder("M17\n", "").line, 9);
  EXPECT_EQ(of_encoder("M17\n", "M17\n\n R1=2"), (Place{12, 2}));
  EXPECT_EQ(of_encoder("CHANDATA(1)", "G0 X0"), (Place{2, 1}));
  EXPECT_EQ(of_encoder("0.003", "0,003"), (Place{3, 22}));
  EXPECT_EQ(of_encoder("[0,1,X1]", "[1,1,X1]"), (Place{4, 14}));
  EXPECT_EQ(of_encoder("[0,1,X1]", "[0,1]"), (Place{4, 14}));
  EXPECT_EQ(of_encoder("[0,1,X1]", "[]"), (Place{4, 14}));
  EXPECT_EQ(of_encoder("[0,1,X1]", "[0,5000,X1]"), (Place{4, 16}));
  EXPECT_EQ(of_encoder("[0,1,X1]", "[0,0,X1]"), (Place{4, 16}));
  EXPECT_EQ(of_encoder("[0,1,X1]", "[0,1,AX1]"), (Place{4, 18}));
  EXPECT_EQ(of_encoder("[0,1,X1]", "[0,1,B1]"), (Place{4, 18}));
  EXPECT_EQ(of_encoder("[0,1,X1]", "[0,1,X1"), (Place{4, 1}));
  EXPECT_EQ(of_encoder("[0,1,X1]=", "[0,1,X1] x ="), (Place{4, 22}));
  EXPECT_EQ(of_encoder("_COMP_MIN", "_COMP_MUN"), (Place{7, 1}));
  EXPECT_EQ(of_encoder("$AA_ENC_COMP_MIN", "$MN_MIN"), (Place{7, 1}));
  EXPECT_EQ(of_encoder("=150.0", "="), (Place{8, 24}));
  EXPECT_EQ(of_encoder("MODULO[0,X1]=0", "MODULO[0,X1]=1"), (Place{9, 30}));
  EXPECT_EQ(of_encoder("M17", "$AA_ENC_COMP_MIN[0,X1]=0\nM17"), (Place{10, 24}));
  for (const auto& [from, to] :
       std::vector<std::pair<std::string, std::string>>{{"=100.0", "=0"},
                                                        {"=100.0", "=-100"},
                                                        {"=100.0", "=90.0"},
                                                        {"=100.0", "=1e-5"},
                                                        {"=100.0", "=50"},
                                                        {"=-50.0", "=150.0"},
                                                        {"$AA_ENC_COMP_STEP[0,X1]=100.0\n", ""},
                                                        {"$AA_ENC_COMP[0,1,X1]=0.01\n", ""},
                                                        {"$AA_ENC_COMP[0,2,X1]=-0.0\n", ""}})
    EXPECT_EQ(of_encoder(from, to), (Place{3, 1})) << from << " -> " << to;
  const auto of_cross = [](const std::string& from, const std::string& to) {
    return refusal([&] { siemens_tables(with(cross_ini, from, to)); });
  };
  EXPECT_EQ(of_cross("[3,0]", "[3,0]"), Place{});
  EXPECT_EQ(of_cross("[3,0]", "[3.0]"), (Place{3, 9})) << "one index";
  EXPECT_EQ(of_cross("[3,0]", "[200,0]"), (Place{3, 9}));
  EXPECT_EQ(of_cross("(Y1)", "Y1"), (Place{5, 23}));
  EXPECT_EQ(of_cross("(Y1)", "(Y1"), (Place{5, 23}));
  EXPECT_EQ(of_cross("(Y1)", "(S1)"), (Place{5, 24}));
  EXPECT_EQ(of_cross("DIRECTION[3]=1", "DIRECTION[3]=2"), (Place{10, 22}));
  EXPECT_EQ(of_cross("TABLE[3]=0", "TABLE[3]=1"), (Place{11, 26})) << "products are not followed";
  EXPECT_EQ(of_cross("$AN_CEC_OUTPUT_AXIS[3]=(Z1)\r\n", ""), (Place{3, 1}));
  EXPECT_EQ(of_cross("STEP[3]=800", "STEP[3]=1e-9 ;"), (Place{3, 1}));
}

}  // namespace
}  // namespace abbe::sim::compensation
