#include "sim/dialects/read_program.h"

#include <gtest/gtest.h>

#include <fmt/format.h>

namespace abbe::sim::dialects {
namespace {

std::string words_text(std::string_view text, Dialect dialect) {
  std::string all;
  for (const UsedWord& word : used_words(text, dialect))
    all += fmt::format("{} {} {} line {}; ", word.word, name_of(word.use), word.count, word.line);
  return all;
}

TEST(UsedWords, AreCountedAsTheTableNamesThemWithoutComments) {
  EXPECT_EQ(
      words_text("G01 X1.5 (G38.2 X1) F100 ; M66\ng1x2\nG43.4H1 M8\nG64 P0.1\n", Dialect::LinuxCnc),
      "G1 read 2 line 1; X read 2 line 1; F read 1 line 1; G43.4 read 1 line 3; "
      "M8 without effect 1 line 3; G64 without effect 1 line 4; ");
  EXPECT_EQ(words_text("PARTNO GOTO/1\n  goto /1,2,3\nGOTO/1,2,3 $$ RAPID\nTRACUT/1\n$$ RAPID\n",
                       Dialect::Cl),
            "PARTNO without effect 1 line 1; GOTO read 2 line 2; TRACUT refused 1 line 4; ");
  EXPECT_EQ(words_text("x,y,z\n1,2,3\n", Dialect::Cl), "");
  EXPECT_EQ(words_text("", Dialect::LinuxCnc), "");
}

}  // namespace
}  // namespace abbe::sim::dialects
