#include "errors/metrology/position_file.h"
#include "tests/injured.h"
#include "tests/test.h"

namespace abbe::errors::metrology {
namespace {

const std::string long_form =
    "target_mm,direction,run,deviation_um\n"
    "0,up,1,1.0\n"
    "100,up,1,2.5\n"
    "100,down,1,-1.5\n"
    "0,down,1,-2\n";

const std::string wide_form =
    "# two sets\n"
    "set;pos;target_mm;dir;j1;j2\r\n"
    "X;1;-20.0;up;-20.001;-20.002\r\n"
    "X;2;30;up;30.003;30.004\r\n"
    "\r\n"
    "Y;1;0;down;0.001;0\r\n"
    "Y;2;5;down;5;5.0\r\n";

const std::string rtl =
    "HEADER::\r\n"
    "File type  : rtl\r\n"
    "Owner      : Linear\r\n"
    "Version no : V20.02.02\r\n"
    "\r\n"
    "TARGET DATA::\r\n"
    "Filetype  : ISO\r\n"
    "Target-count: 6\r\n"
    "Targets :\r\n"
    "0.000000  10.000000  20.000000  30.000000  40.000000 \r\n"
    "50.000000 \r\n"
    "Flags: 0 0 2 0\r\n"
    "\r\n"
    "USER-TEXT::\r\n"
    "Machine: number five\r\n"
    "Axis:X\r\n"
    "\r\n"
    "RUNS::\r\n"
    "Run-count:2\r\n"
    "\r\n"
    "DEVIATIONS::\r\n"
    "Run Target Data:\r\n"
    "1   1      0.0\r\n1   2      0.5\r\n1   3      1.0\r\n"
    "1   4      1.5\r\n1   5      2.0\r\n1   6      2.5\r\n"
    "2   6      1.5\r\n2   5      1.0\r\n2   4      0.5\r\n"
    "2   3      0.0\r\n2   2      -0.5\r\n2   1      -1.0\r\n"
    "\r\n"
    "ENVIRONMENT::\r\n"
    "Air temp   : 20.1\r\n"
    "\r\n"
    "EOF::\r\n";

std::string with(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(PositionCsv, OneReadingARowIsRead) {
  const auto sets = read_position_csv(long_form, "a.csv");
  ASSERT_EQ(sets.size(), 1u);
  EXPECT_FALSE(sets[0].rotary);
  EXPECT_EQ(sets[0].runs.target, Vector2d(0, 100));
  EXPECT_DOUBLE_EQ(sets[0].runs.up(1, 0), 2.5e-3);
  EXPECT_DOUBLE_EQ(sets[0].runs.down(0, 0), -2e-3);
  EXPECT_DOUBLE_EQ(sets[0].runs.down(1, 0), -1.5e-3);
}

TEST(PositionCsv, OneRowATargetIsRead) {
  const auto sets = read_position_csv(wide_form, "a.csv");
  ASSERT_EQ(sets.size(), 2u);
  EXPECT_EQ(sets[0].name, "X");
  EXPECT_NEAR(sets[0].runs.up(0, 1), -2e-3, 1e-14);
  EXPECT_NEAR(sets[0].runs.up(1, 0), 3e-3, 1e-14);
  EXPECT_EQ(sets[0].runs.down.cols(), 0);
  EXPECT_NEAR(sets[1].runs.down(0, 0), 1e-3, 1e-16);
}

TEST(PositionCsv, AnglesAreReadInTheirUnits) {
  const auto sets = read_position_csv(
      "direction,run,target_deg,deviation_arcsec\n+,1,0,0\n+,1,90,3.6\n-,1,90,-3.6\n-,1,0,1\n",
      "a.csv");
  ASSERT_TRUE(sets[0].rotary);
  EXPECT_DOUBLE_EQ(sets[0].runs.target[1], 0.5 * pi);
  EXPECT_NEAR(sets[0].runs.up(1, 0), 0.001 * pi / 180.0, 1e-18);
  const auto positions =
      read_position_csv("run,dir,target_deg,position_deg\n1,up,10,10.001\n1,up,20,20\n", "a.csv");
  EXPECT_NEAR(positions[0].runs.up(0, 0), 0.001 * pi / 180.0, 1e-15);
}

/// Line and column of the refusal; -1 where there is none.
struct Place {
  int line = -1;
  int column = -1;
  friend bool operator==(const Place&, const Place&) = default;
};
std::ostream& operator<<(std::ostream& out, const Place& p) {
  return out << p.line << ":" << p.column;
}

template <typename Read>
Place refusal(const Read& read, const std::string& text) {
  try {
    read(text, "a.txt", PositionFileOptions{});
  } catch (const BadInput& bad) {
    EXPECT_EQ(bad.file, "a.txt");
    EXPECT_FALSE(bad.expected.empty() || bad.seen.empty());
    return {bad.line, bad.column};
  }
  return {};
}

TEST(PositionCsv, RefusesByLineAndColumn) {
  const auto at = [](const std::string& from, const std::string& to) {
    return refusal(read_position_csv, with(long_form, from, to));
  };
  EXPECT_EQ(at("target_mm", "target"), (Place{1, 1}));
  EXPECT_EQ(at("target_mm", "target_inch"), (Place{1, 1}));
  EXPECT_EQ(at("deviation_um", "deviation_arcsec"), (Place{1, 25}));  // a length needs a length
  EXPECT_EQ(at("deviation_um", "temperature_C"), (Place{1, 25}));
  EXPECT_EQ(at("direction", "run"), (Place{1, 15}));
  EXPECT_EQ(at(",deviation_um", ""), (Place{1, 24}));
  EXPECT_EQ(at("0,up,1,1.0", "0,up,1,1.0.0"), (Place{2, 8}));
  EXPECT_EQ(at("0,up,1,1.0", "0,sideways,1,1.0"), (Place{2, 3}));
  EXPECT_EQ(at("0,up,1,1.0", "0,up,0,1.0"), (Place{2, 6}));
  EXPECT_EQ(at("0,up,1,1.0", "0,up,1,1,0"), (Place{2, 10}));    // a decimal comma
  EXPECT_EQ(at("100,up,1,2.5", "0,up,1,2.5"), (Place{3, 1}));   // twice
  EXPECT_EQ(at("100,up,1,2.5", "50,up,1,2.5"), (Place{3, 1}));  // 100 is missing in run 1 up
  EXPECT_EQ(at("100,up,1,2.5", "100,up,2,2.5").line, 3);
  EXPECT_EQ(refusal(read_position_csv, with(wide_form, "j2", "j3")), (Place{2, 26}));
  EXPECT_EQ(refusal(read_position_csv, with(wide_form, "pos", "run")), (Place{2, 5}));
  EXPECT_EQ(refusal(read_position_csv, "target_mm,direction,run,deviation_um\n0,up,1,0\n").line, 2);
}

TEST(Rtl, BothDirectionsOfALinearMeasurementAreRead) {
  const PositionSet set = read_position_rtl(rtl, "a.rtl");
  EXPECT_EQ(set.name, "X");
  ASSERT_EQ(set.runs.target.size(), 6);
  EXPECT_EQ(set.runs.target[5], 50.0);
  ASSERT_EQ(set.runs.up.cols(), 1);
  ASSERT_EQ(set.runs.down.cols(), 1);
  EXPECT_DOUBLE_EQ(set.runs.up(5, 0), 2.5e-3);
  EXPECT_DOUBLE_EQ(set.runs.down(0, 0), -1e-3);
  const Positioning p = positioning(set.runs);
  EXPECT_NEAR(*p.B, 1e-3, 1e-15);
  EXPECT_FALSE(p.R);
}

TEST(Rtl, RunsBackThatAreOnlyFilledAreLeftOut) {
  std::string one_way = with(rtl, "Flags: 0 0 2 0", "Flags: 0 1 2 0");
  EXPECT_EQ(read_position_rtl(one_way, "a.rtl").runs.down.cols(), 1) << "these runs were measured";
  for (const char* value : {"1.5", "1.0", "0.5", "0.0", "-0.5", "-1.0"}) {
    const std::size_t at = one_way.find(value, one_way.find("2   6"));
    one_way.replace(at, std::string(value).size(), "0");
  }
  EXPECT_EQ(read_position_rtl(one_way, "a.rtl").runs.down.cols(), 0);
  EXPECT_EQ(read_position_rtl(with(one_way, "0 1 2 0", "0 0 2 0"), "a.rtl").runs.down.cols(), 1);
}

TEST(Rtl, RefusesByLineAndColumn) {
  const auto at = [](const std::string& from, const std::string& to) {
    return refusal(read_position_rtl, with(rtl, from, to));
  };
  EXPECT_EQ(at("HEADER::", "header"), (Place{1, 1}));
  EXPECT_EQ(at(": Linear", ": Angular"), (Place{3, 14}));
  EXPECT_EQ(at("Owner      : Linear\r\n", "").line, 5);
  EXPECT_EQ(at("File type  : rtl", "File type  : rtx"), (Place{2, 14}));
  EXPECT_EQ(at("Target-count: 6", "Target-count: 7").line, 12);
  EXPECT_EQ(at("Target-count: 6", "Target-count: 5"), (Place{11, 1}));
  EXPECT_EQ(at("Target-count: 6", "Target-count: 1000000000"), (Place{8, 15}));
  EXPECT_EQ(at("20.000000", "2O.000000"), (Place{10, 22}));
  EXPECT_EQ(at("Run-count:2", "Run-count:3").line, 36);
  EXPECT_EQ(at("Run-count:2", "Run-count:1"), (Place{29, 1}));
  EXPECT_EQ(at("Run-count:2", "Run-count:x"), (Place{19, 11}));
  EXPECT_EQ(at("1   2      0.5", "1   1      0.5"), (Place{24, 5}));
  EXPECT_EQ(at("1   2      0.5", "1   7      0.5"), (Place{24, 5}));
  EXPECT_EQ(at("1   2      0.5", "3   2      0.5"), (Place{24, 1}));
  EXPECT_EQ(at("1   2      0.5", "1   2      0,5"), (Place{24, 12}));
  EXPECT_EQ(at("1   2      0.5", "1   2"), (Place{24, 1}));
  EXPECT_EQ(at("RUNS::", "RUN::").line, 22);
  EXPECT_EQ(refusal(read_position_rtl, rtl.substr(0, rtl.find("DEVIATIONS"))).line, 20);
  EXPECT_EQ(refusal(read_position_rtl, rtl.substr(0, rtl.find("2   3"))).line, 31);
}

TEST(PositionFile, IsToldApartByItsFirstLine) {
  EXPECT_EQ(read_positions("\xef\xbb\xbf" + std::string(rtl), "a").size(), 1u);
  EXPECT_EQ(read_positions(wide_form, "b").size(), 2u);
  EXPECT_THROW(read_positions(wide_form, "b", {.max_bytes = 10}), BadInput);
}

TEST(PositionFile, TooMuchIsRefusedBeforeItIsHeld) {
  std::string text = "target_mm,direction,run,deviation_um\n";
  for (int i = 0; i < 1000; ++i) text += std::to_string(i) + ",up,1,0\n";
  EXPECT_NO_THROW(read_position_csv(text, "a"));
  EXPECT_THROW(read_position_csv(text, "a", {.max_readings = 999}), BadInput);
  EXPECT_THROW(read_position_csv(text, "a", {.max_bytes = 100}), BadInput);
  std::string wide = "target_mm,dir";
  for (int i = 1; i <= 10010; ++i) wide += ",j" + std::to_string(i);
  EXPECT_THROW(read_position_csv(wide + "\n", "a"), BadInput);
}

TEST(PositionFile, InjuredFilesAreReadOrRefused) {
  SeededRandom random(20250613);
  int read = 0, refused = 0;
  const auto start = std::chrono::steady_clock::now();
  for (int k = 0; k < 30000; ++k) {
    const std::string& origin = k % 3 == 0 ? long_form : (k % 3 == 1 ? wide_form : rtl);
    const std::string text = injured(origin, "0159.-+eE,;: \t\n\r\"#jHEADER::_um", 5, random);
    try {
      const auto sets = k % 3 == 2 ? std::vector<PositionSet>{read_position_rtl(text, "a")}
                                   : read_position_csv(text, "a");
      for (const PositionSet& set : sets) {
        const Positioning p = positioning(set.runs);  // whatever was accepted can be evaluated
        EXPECT_TRUE(p.up || p.down);
      }
      ++read;
    } catch (const BadInput& bad) {
      EXPECT_GE(bad.line, 0);
      ++refused;
    }
  }
  const double s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::cout << read << " read, " << refused << " refused, " << s << " s\n";
  EXPECT_GT(read, 1000);
  EXPECT_GT(refused, 10000);
}

}  // namespace
}  // namespace abbe::errors::metrology
