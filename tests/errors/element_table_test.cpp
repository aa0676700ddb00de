#include "errors/element_table.h"
#include "errors/element.h"
#include "tests/test.h"

namespace abbe::errors {
namespace {

ElementTable read_table(std::string_view text) { return read_element_table(text, "x.csv"); }

std::vector<std::string> names(const ElementTable& table) {
  std::vector<std::string> result;
  for (const ElementName& name : table.elements) result.push_back(to_string(name));
  return result;
}

TEST(ElementTable, AVendorsTableIsReadInEverySeparator) {
  MatrixXd expected(3, 6);
  expected << 0, 0.001, -0.002, 1e-6, -2e-6, 3e-6,  //
      0.004, 0.002, -0.001, 2e-6, -1e-6, 0,         //
      0.0045, 0, 0, 0, 0, 1.5e-5;
  for (const std::string s : {",", ";", " ", "\t", ", ", " ; ", "  \t "}) {
    std::string text =
        "X,EXX,EYX,EZX,EAX,EBX,ECX\n"
        "-100,0,0.001,-0.002,1e-6,-2e-6,3e-6\n"
        "0,.004,+2e-3,-0.001,2E-6,-1e-6,0\n"
        "250.5,0.0045,0,0.0,0,-0,15e-6\n";
    for (std::size_t i = 0; (i = text.find(',', i)) != std::string::npos; i += s.size())
      text.replace(i, 1, s);
    const ElementTable table = read_table(text);
    EXPECT_EQ(table.axis, 'X');
    EXPECT_EQ(names(table), (std::vector<std::string>{"EXX", "EYX", "EZX", "EAX", "EBX", "ECX"}));
    EXPECT_EQ(table.q, (VectorXd(3) << -100, 0, 250.5).finished());
    EXPECT_EQ(table.values, expected);
  }
}

TEST(ElementTable, RotaryPositionsAreDegrees) {
  for (const std::string axis : {"A", "B", "C", "S"}) {
    const ElementTable table = read_table(axis + " EX" + axis + "\n0 0.001\n90 0.002\n360 0.001\n");
    EXPECT_NEAR(table.q[1], 90.0_deg, 1e-16);
    EXPECT_NEAR(table.q[2], 360.0_deg, 1e-15);
    EXPECT_EQ(table.values(1, 0), 0.002);
  }
}

TEST(ElementTable, UnitsInTheHeadAreConverted) {
  const ElementTable slide =
      read_table("Y_mm;EXY_um;EYY_mm;ECY_urad;EAY_rad\n0;1;1;1;1\n1;2.5;2.5;2.5;2.5\n");
  EXPECT_EQ(slide.q[1], 1.0);
  EXPECT_DOUBLE_EQ(slide.values(1, 0), 2.5_um);
  EXPECT_DOUBLE_EQ(slide.values(1, 1), 2.5);
  EXPECT_DOUBLE_EQ(slide.values(1, 2), 2.5_urad);
  EXPECT_DOUBLE_EQ(slide.values(1, 3), 2.5);
  EXPECT_DOUBLE_EQ(read_table("C_deg EXC\n0 0\n180 0\n").q[1], 180.0_deg);
  EXPECT_DOUBLE_EQ(read_table("C_rad EXC\n0 0\n3 0\n").q[1], 3.0);
}

TEST(ElementTable, MarksCommentsAndLineEndsOfOtherSystemsArePassedOver) {
  const ElementTable plain = read_table("X EXX\n0 0.001\n1 0.002\n");
  for (const std::string_view text : {"\xef\xbb\xbfX EXX\r\n0 0.001\r\n1 0.002\r\n",
                                      "# laser, 20.1 \xc2\xb0"
                                      "C\nX EXX\n\n0 0.001\n  # half\n1 0.002",
                                      "\r\n\r\n  X  EXX \r\n 0\t0.001 \r\n\t1 0.002\t"}) {
    const ElementTable table = read_table(text);
    EXPECT_EQ(table.q, plain.q) << text;
    EXPECT_EQ(table.values, plain.values) << text;
  }
}

// ---- refusals

struct Refused {
  std::string text;
  int line;
  int column;
  std::string seen;
};

TEST(ElementTable, EveryFaultIsRefusedAtItsPlace) {
  using namespace std::string_literals;
  const Refused cases[] = {
      {"", 1, 1, "an empty table"},
      {"\n\n# only this\n", 3, 1, "an empty table"},
      {"\xef\xbb\xbf", 1, 1, "an empty table"},
      // heads
      {"EXX EYX\n0 1\n1 2\n", 1, 1, "'EXX'"},
      {"0 1\n1 2\n", 1, 1, "'0'"},
      {"x EXX\n0 1\n1 2\n", 1, 1, "'x'"},
      {"s EXS\n0 1\n1 2\n", 1, 1, "'s'"},
      {"X\n0\n1\n", 1, 2, "none"},
      {"X,\n0,\n1,\n", 1, 3, "nothing"},
      {"X EXX FOO\n0 1 2\n1 2 3\n", 1, 7, "'FOO'"},
      {"X EXX EXY\n0 1 2\n1 2 3\n", 1, 7, "'EXY'"},
      {"X EX0X\n0 1\n1 2\n", 1, 3, "'EX0X'"},
      {"X EXX EYX EXX\n0 1 2 3\n1 2 3 4\n", 1, 11, "'EXX'"},
      {"X EXX,EYX\n0,1\n1,2\n", 1, 1, "'X EXX'"},
      {"X,EXX,EYX,EZX,EAX,EBX,ECX,EXX\n", 1, 27, "'EXX'"},
      {"X_m EXX\n0 1\n1 2\n", 1, 1, "'X_m'"},
      {"X_deg EXX\n0 1\n1 2\n", 1, 1, "'X_deg'"},
      {"C_mm EXC\n0 1\n1 2\n", 1, 1, "'C_mm'"},
      {"X EXX_urad\n0 1\n1 2\n", 1, 3, "'EXX_urad'"},
      {"X EAX_um\n0 1\n1 2\n", 1, 3, "'EAX_um'"},
      {"X EXX_\n0 1\n1 2\n", 1, 3, "'EXX_'"},
      {"X EXX_um_um\n0 1\n1 2\n", 1, 3, "'EXX_um_um'"},
      // cells
      {"X EXX\n0 1\n1\n", 3, 2, "1"},
      {"X EXX\n0 1 2\n1 2\n", 2, 5, "more"},
      {"X,EXX\n0,1,\n1,2\n", 2, 5, "more"},
      {"X;EXX\n0;0,001\n1;2\n", 2, 3, "'0,001'"},
      {"X EXX\n0 1\n1 2e\n", 3, 3, "'2e'"},
      {"X EXX\n0 1\none 2\n", 3, 1, "'one'"},
      {"X EXX\n0 ++1\n1 2\n", 2, 3, "'++1'"},
      {"X EXX\n0 +\n1 2\n", 2, 3, "'+'"},
      {"X EXX\n0 1 # laser\n1 2\n", 2, 5, "more"},
      {"X EXX\n0 1e10\n1 2\n", 2, 3, "'1e10'"},
      // rows
      {"X EXX\n0 1\n -1 2\n", 3, 2, "'-1'"},
      {"X EXX\n0 1\n1 2\n0.5 3\n", 4, 1, "'0.5'"},
      // bytes
      {"X EXX\n0 1\n1 \0 2\n"s, 3, 3, "a byte 0x00"},
      {"# \0\nX EXX\n0 1\n1 2\n"s, 1, 3, "a byte 0x00"},
      {"X EXX\r0 1\r1 2\r", 1, 6, "a lone CR"},
      {"X\xc2\xa0"
       "EXX\n0 1\n1 2\n",
       1, 1, "'X\\xC2\\xA0EXX'"},
      {"\xff\xfeX\0"s, 1, 1, "UTF-16, little endian"},
  };
  for (const Refused& c : cases) {
    try {
      read_table(c.text);
      ADD_FAILURE() << "accepted: " << c.text;
    } catch (const BadInput& fault) {
      EXPECT_EQ(fault.file, "x.csv");
      EXPECT_EQ(fault.line, c.line) << c.text << fault.what();
      EXPECT_EQ(fault.column, c.column) << c.text << fault.what();
      EXPECT_EQ(fault.seen, c.seen) << c.text << fault.what();
    }
  }
}

TEST(ElementTable, ATextOverTheCapIsRefusedUnread) {
  const std::string text = "X EXX\n0 1\n1 2\n";
  EXPECT_NO_THROW(read_element_table(text, "x.csv", text.size()));
  EXPECT_THROW(read_element_table(text, "x.csv", text.size() - 1), BadInput);
}

// Every text, however spoilt, is either refused as bad input or gives a table that keeps its
// promises.
TEST(ElementTable, SpoiltTextsAreRefusedOrGiveASoundTable) {
  SeededRandom random(99);
  const std::string good =
      "# a table\nX,EXX,EYX_um,EAX\n-10,0.001,2,1e-6\n0,0.002,3,2e-6\n10,0,0,0\n";
  int accepted = 0;
  for (int i = 0; i < 20000; ++i) {
    std::string text = good.substr(0, i % 5 == 0 ? random() % good.size() : good.size());
    for (unsigned k = random() % 4; k > 0 && !text.empty(); --k) {
      const auto at = random() % text.size();
      switch (random() % 3) {
        case 0:
          text[at] = char(random());
          break;
        case 1:
          text.erase(at, 1 + random() % 5);
          break;
        case 2:
          text.insert(at, 1, good[random() % good.size()]);
          break;
      }
    }
    if (i % 7 == 0)
      for (char& c : text) c = char(random());
    try {
      const ElementTable table = read_table(text);
      ++accepted;
      ASSERT_GE(table.q.size(), 2);
      ASSERT_EQ(table.values.rows(), table.q.size());
      ASSERT_EQ(table.values.cols(), Index(table.elements.size()));
      ASSERT_NO_THROW(to_elements(table)) << text;
    } catch (const BadInput& fault) {
      ASSERT_EQ(fault.file, "x.csv");
    }
  }
  std::cout << accepted << " of 20000 spoilt texts were still tables\n";
  EXPECT_GT(accepted, 0);
  EXPECT_LT(accepted, 20000);
}

// ---- files

class ElementTableFile : public testing::Test {
 protected:
  fs::path folder_ =
      fs::path(testing::TempDir()) /
      (std::string("abbe_") + testing::UnitTest::GetInstance()->current_test_info()->name());
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }
};

TEST_F(ElementTableFile, AFileIsReadAsItsText) {
  const auto file = folder_ / "x.csv";
  std::ofstream(file) << "X EXX\n0 0.001\n1 0.002\n";
  EXPECT_EQ(read_element_table_file(file).values(1, 0), 0.002);
  EXPECT_THROW(read_element_table_file(file, 5), BadInput);
  std::ofstream(file) << "X EXX\n0 0.001\n1 O.002\n";
  const std::string said = thrown_text<BadInput>([&] { read_element_table_file(file); });
  EXPECT_EQ(said, file.string() + ":3:3: expected a number within +-1e9, seen 'O.002'");
}

TEST_F(ElementTableFile, WhatIsNoFileIsRefused) {
  EXPECT_THROW(read_element_table_file(folder_ / "none.csv"), BadInput);
  EXPECT_THROW(read_element_table_file(folder_), BadInput);
  EXPECT_THROW(read_element_table_file("/dev/zero"), BadInput);
  std::ofstream(folder_ / "empty.csv");
  EXPECT_THROW(read_element_table_file(folder_ / "empty.csv"), BadInput);
}

// ---- writing

TEST(ElementTable, WhatIsWrittenIsTheVendorsForm) {
  EXPECT_EQ(write_element_table(read_table("X EXX EAX_urad\n-0.5 0.001 2\n1e3 -0.25 -0\n")),
            "X,EXX,EAX\n-0.5,0.001,2e-06\n1000,-0.25,-0\n");
  EXPECT_EQ(write_element_table(read_table("C EXC\n0 0.001\n90 0\n359.9 1\n"), ';'),
            "C;EXC\n0;0.001\n90;0\n359.9;1\n");
  EXPECT_THROW(write_element_table({'X', VectorXd(2), {{'X', 'X'}}, MatrixXd(3, 1)}),
               std::invalid_argument);
}

TEST(ElementTable, WrittenAndReadBackItIsTheSameBits) {
  SeededRandom random(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  double worst_ulp = 0.0;
  for (const char axis : {'X', 'C'}) {
    const ElementName translation{'X', axis};
    const ElementName rotation{'B', axis};
    ElementTable table{axis, VectorXd(2000), {translation, rotation}, MatrixXd(2000, 2)};
    double q = -3;
    for (int i = 0; i < 2000; ++i) {
      table.q[i] = q += 0.003 * (1.01 + unit(random));
      table.values.row(i) << 0.02 * unit(random), 1e-4 * unit(random);
    }
    const ElementTable back = read_table(write_element_table(table));
    EXPECT_EQ(back.elements, table.elements);
    EXPECT_EQ(back.values, table.values);
    EXPECT_TRUE(axis == 'C' || back.q == table.q);
    for (int i = 0; i < 2000; ++i) {
      const double ulp = std::nextafter(std::abs(table.q[i]), 1e9) - std::abs(table.q[i]);
      worst_ulp = std::max(worst_ulp, std::abs(back.q[i] - table.q[i]) / ulp);
    }
    // what once came from a file is exact, degrees too
    EXPECT_EQ(read_table(write_element_table(back)).q, back.q);
  }
  std::cout << "rotary positions read back within " << worst_ulp << " ulp\n";
  EXPECT_LE(worst_ulp, 1.0);
}

// ---- use

TEST(ElementTable, ItsColumnsBecomeElements) {
  const ElementTable table = read_table("Y EYY EXY\n0 0.001 0.01\n10 0.003 0.02\n");
  const std::vector<Element> elements = to_elements(table, {.between = TableInterpolation::Spline,
                                                            .outside = TableExtrapolation::Hold,
                                                            .argument = Argument::Carriage,
                                                            .negate = true,
                                                            .name = "laser run 3"});
  ASSERT_EQ(elements.size(), 2u);
  EXPECT_EQ(to_string(elements[1].name), "EXY");
  ASSERT_EQ(elements[0].curves.size(), 1u);
  EXPECT_EQ(elements[0].curves[0].name, "laser run 3");
  const CurveState state{-5, 5, 0, 0, true};
  EXPECT_NEAR(value(elements[0].curves[0], state), -0.002, 1e-18);
  EXPECT_NEAR(value(elements[1].curves[0], state), -0.015, 1e-17);
}

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
    EXPECT_HAS(fault.what(), "seen 'E?X'");
  }
}

}  // namespace
}  // namespace abbe::errors
