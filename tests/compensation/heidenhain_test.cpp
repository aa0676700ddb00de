#include <iostream>

#include <gtest/gtest.h>

#include "kinematics/units.h"
#include "sim/compensation/control_files.h"
#include "tests/compensation/control_cases.h"

namespace abbe::sim::compensation {
namespace {

using namespace cases;

ParameterTables heidenhain_tables(const std::vector<ControlFile>& files) {
  return read_control_tables(files, gantry(), ControlFormat::Heidenhain);
}

const std::string com =
    "BEGIN Y.COM MM\n"
    "NR    AXISPOS   Y         BACKLASH  Z\n"
    "0     -90       0.01      0.02      0\n"
    "1     10.5      -0.03     0         0.04\n"
    "[END]\n";

const std::string cma =
    "BEGIN CONFIG.CMA MM\n"
    "NR    X         Y         ACTIVE\n"
    "0     other.com\n"
    "1               y.com     *\n"
    "[END]\n";

TEST(Heidenhain, ColumnsHoldErrorsThatTheControlTakesOff) {
  const ParameterTables tables = heidenhain_tables({{"Y.COM", com}, {"CONFIG.CMA", cma}});
  ASSERT_EQ(tables.tables.size(), 2u);
  const AxisTable& own = tables.tables[0];
  EXPECT_EQ(own.argument_joint, Y);
  EXPECT_EQ(own.corrected_joint, Y);
  EXPECT_EQ(own.position, Eigen::Vector2d(-90, 10.5));
  EXPECT_EQ(own.upward, Eigen::Vector2d(-0.01, 0.03));
  EXPECT_EQ(own.downward, Eigen::Vector2d(-0.02, 0));
  const AxisTable& sag = tables.tables[1];
  EXPECT_EQ(sag.argument_joint, Y);
  EXPECT_EQ(sag.corrected_joint, Z);
  EXPECT_EQ(sag.upward, Eigen::Vector2d(0, -0.04));
  EXPECT_EQ(sag.downward, sag.upward);
}

TEST(Heidenhain, WritesATableForEachAxisThatIsLookedUpAndTheLineInForce) {
  ParameterTables tables = none();
  const Eigen::Vector2d p(-90, 10), v(-1e-3, 2e-3), w(-3e-3, 0);
  tables.tables = {
      {Y, Y, p, v, w}, {Y, Z, p, v, w}, {A, A, p * units::deg, v * units::deg, v * units::deg}};
  const ControlExport made = to_control(tables, gantry(), ControlFormat::Heidenhain);
  EXPECT_EQ(file(made, "Y.COM").text,
            "BEGIN Y.COM MM\n"
            "NR            AXISPOS       Y             Z             BACKLASH\n"
            "0             -90.0000      0.0010        0.0020        0.0030\n"
            "1             10.0000       -0.0020       -0.0010       0.0000\n"
            "[END]\n");
  EXPECT_EQ(file(made, "CONFIG.CMA").text,
            "BEGIN CONFIG.CMA MM\n"
            "NR            Y             A             ACTIVE\n"
            "0             Y.COM         A.COM         *\n"
            "[END]\n");
  EXPECT_TRUE(says({file(made, "A.COM").text}, "-90.0000      0.0010"));
  EXPECT_TRUE(says(made.omissions, "Z over Y: dependence on direction"));
  EXPECT_EQ(made.omissions.size(), 1u);
  EXPECT_TRUE(says(made.notes, "assumed"));
}

TEST(Heidenhain, RandomTablesComeBackToItsDigits) {
  const unsigned seed = 20250704;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  const Chain chain = gantry();
  Difference largest;
  for (int run = 0; run < 100; ++run) {
    ParameterTables tables = any_tables(chain, random, {run % 2 == 0, true, run % 2 == 0, 15});
    for (AxisTable& table : tables.tables)
      if (table.argument_joint != table.corrected_joint) table.downward = table.upward;
    const ControlExport made = to_control(tables, chain, ControlFormat::Heidenhain);
    EXPECT_TRUE(made.omissions.empty());
    const Difference d = difference(tables, heidenhain_tables(made.files), chain, random);
    largest.mm = std::max(largest.mm, d.mm);
    largest.rad = std::max(largest.rad, d.rad);
  }
  std::cout << largest.mm << " mm, " << largest.rad << " rad\n";
  // four tables an axis, half a digit each, and half a digit of position on a steep piece
  EXPECT_LT(largest.mm, 4 * 0.6e-4);
  EXPECT_LT(largest.rad, 4 * 0.6e-4 * units::deg);
}

TEST(Heidenhain, MoreThan256RowsAreReadOffAndSaid) {
  ParameterTables tables = none();
  AxisTable table{X, X, Eigen::VectorXd::LinSpaced(300, -300, 300), {}, {}};
  table.upward = table.downward = table.position.array().sin() * 1e-3;
  tables.tables = {table};
  const ControlExport made = to_control(tables, gantry(), ControlFormat::Heidenhain);
  EXPECT_TRUE(says(made.omissions, "X: 300 points, but the control holds only 256"));
  EXPECT_EQ(heidenhain_tables(made.files).tables.at(0).position.size(), 256);
}

TEST(Heidenhain, RefusesByLineAndColumn) {
  const auto of_com = [](const std::string& from, const std::string& to) {
    return refusal([&] { heidenhain_tables({{"Y.COM", with(com, from, to)}}); });
  };
  EXPECT_EQ(of_com("NR", "NR"), Place{});
  EXPECT_EQ(of_com("BEGIN", "START"), (Place{1, 1}));
  EXPECT_EQ(of_com(" MM", " INCH"), (Place{1, 13}));
  EXPECT_EQ(of_com("NR", "N "), (Place{2, 1}));
  EXPECT_EQ(of_com("BACKLASH", "BOCKLASH"), (Place{2, 27}));
  EXPECT_EQ(of_com("AXISPOS", "X      "), (Place{2, 1}));
  EXPECT_EQ(of_com("AXISPOS   Y", "AXISPOS   X"), (Place{2, 27})) << "BACKLASH of what?";
  EXPECT_EQ(of_com("BACKLASH  Z", "BACKLASH  Y"), (Place{2, 37}));
  EXPECT_EQ(of_com("-0.03", "-O.03"), (Place{4, 17}));
  EXPECT_EQ(of_com("1     10.5", "2     10.5"), (Place{4, 1}));
  EXPECT_EQ(of_com("1     10.5", "1     -99 "), (Place{4, 7}));
  EXPECT_EQ(of_com("0.02      0", "0.02"), (Place{3, 37}));
  EXPECT_EQ(of_com("[END]\n", "").line, 4);
  EXPECT_EQ(of_com("[END]\n", "[END]\nx"), (Place{6, 1}));
  EXPECT_EQ(of_com("1     10.5      -0.03     0         0.04\n", "").line, 4) << "one row";
  EXPECT_EQ(refusal([] { heidenhain_tables({{"pitch.com", com}}); }), (Place{0, 0}));
  EXPECT_EQ(refusal([] { heidenhain_tables({{"Y.COM", ""}}); }).line, 0);
  const auto of_cma = [](const std::string& from, const std::string& to) {
    return refusal([&] { heidenhain_tables({{"Y.COM", com}, {"C.CMA", with(cma, from, to)}}); });
  };
  EXPECT_EQ(of_cma("NR", "NR"), Place{});
  EXPECT_EQ(of_cma("y.com", "z.com"), (Place{4, 17}));
  EXPECT_EQ(of_cma("other.com\n", "other.com           *\n"), (Place{4, 27}));
  EXPECT_EQ(of_cma("*", "+"), (Place{4, 27}));
  EXPECT_EQ(of_cma("*", "").line, 5);
  EXPECT_EQ(of_cma("ACTIVE", "ACTIVO"), (Place{2, 27}));
  EXPECT_EQ(of_cma("     ACTIVE", ""), (Place{2, 1}));
  EXPECT_EQ(of_cma("X  ", "s  "), (Place{2, 7}));
}

}  // namespace
}  // namespace abbe::sim::compensation
