#include "sim/study/study_text.h"

#include <sstream>

#include <gtest/gtest.h>

namespace abbe::sim::study {
namespace {

TEST(TextStyle, ColumnsCountWhatATerminalShows) {
  EXPECT_EQ(columns_of("PV, µm"), 6u);
  EXPECT_EQ(columns_of("误差"), 4u);
  EXPECT_EQ(columns_of("e\u0301"), 1u);
  EXPECT_EQ(columns_of("Πι"), 2u);
  EXPECT_EQ(columns_of(""), 0u);
  EXPECT_EQ(columns_of("\xff\xc3"), columns_of("\xff\xc3")) << "what is no UTF-8 ends";
}

TEST(TextStyle, ATableOfATerminalStandsInColumns) {
  const TextTable rows{{"input", "empty", "share"}, {{"误差 EXX", "", "41 %"}, {"x", "", "8.2 %"}}};
  EXPECT_EQ(table(TextStyle::Terminal, rows),
            "input     share\n"
            "--------  -----\n"
            "误差 EXX   41 %\n"
            "x         8.2 %\n\n");
  EXPECT_EQ(table(TextStyle::Markdown, rows),
            "| input | share |\n|---|---:|\n| 误差 EXX | 41 % |\n| x | 8.2 % |\n\n");
}

TEST(TextStyle, MarkUpIsForFiles) {
  EXPECT_EQ(plain(TextStyle::Markdown, "a|b*"), "a\\|b\\*");
  EXPECT_EQ(plain(TextStyle::Terminal, "a|b*"), "a|b*");
  EXPECT_EQ(strong(TextStyle::Terminal, "a"), "a");
  EXPECT_EQ(heading(TextStyle::Terminal, 1, "dome"), "dome\n====\n\n");
  EXPECT_EQ(heading(TextStyle::Markdown, 2, "dome"), "## dome\n\n");
  EXPECT_EQ(notice(TextStyle::Terminal, "take care"), "warning: take care\n\n");
}

}  // namespace
}  // namespace abbe::sim::study
