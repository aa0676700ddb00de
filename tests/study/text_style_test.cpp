#include "sim/study/study_text.h"

#include <sstream>

#include <gtest/gtest.h>

namespace abbe::sim::study {
namespace {

TEST(TextStyle, ColumnsCountWhatATerminalShows) {
  EXPECT_EQ(terminal_width("PV, µm"), 6u);
  EXPECT_EQ(terminal_width("误差"), 4u);
  EXPECT_EQ(terminal_width("e\u0301"), 1u);
  EXPECT_EQ(terminal_width("Πι"), 2u);
  EXPECT_EQ(terminal_width(""), 0u);
  EXPECT_EQ(terminal_width("\xff\xc3"), terminal_width("\xff\xc3")) << "what is no UTF-8 ends";
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
  EXPECT_EQ(user_text(TextStyle::Markdown, "a|b*"), "a\\|b\\*");
  EXPECT_EQ(user_text(TextStyle::Terminal, "a|b*"), "a|b*");
  EXPECT_EQ(bold_text(TextStyle::Terminal, "a"), "a");
  EXPECT_EQ(heading(TextStyle::Terminal, 1, "dome"), "dome\n====\n\n");
  EXPECT_EQ(heading(TextStyle::Markdown, 2, "dome"), "## dome\n\n");
  EXPECT_EQ(warning_paragraph(TextStyle::Terminal, "take care"), "warning: take care\n\n");
}

}  // namespace
}  // namespace abbe::sim::study
