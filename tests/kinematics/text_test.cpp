#include "kinematics/text.h"

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <unistd.h>

#include "kinematics/bad_input.h"

namespace abbe {
namespace {

std::vector<std::string> texts(const std::vector<Cell>& cells) {
  std::vector<std::string> result;
  for (const Cell& cell : cells) result.emplace_back(cell.text);
  return result;
}

std::vector<int> columns(const std::vector<Cell>& cells) {
  std::vector<int> result;
  for (const Cell& cell : cells) result.push_back(cell.column);
  return result;
}

using Words = std::vector<std::string>;
using Columns = std::vector<int>;

std::vector<std::string> lines_of(std::string_view text) {
  std::vector<std::string> result;
  LineReader lines(text);
  while (const auto line = lines.next()) {
    result.emplace_back(*line);
    EXPECT_EQ(lines.number(), int(result.size()));
  }
  return result;
}

TEST(Text, LinesEndWithOrWithoutACarriageReturnAndTheLastNeedsNoEnd) {
  EXPECT_EQ(lines_of(""), Words{});
  EXPECT_EQ(lines_of("\n"), Words{""});
  EXPECT_EQ(lines_of("\n\n"), (Words{"", ""}));
  EXPECT_EQ(lines_of("a"), Words{"a"});
  EXPECT_EQ(lines_of("a\n"), Words{"a"});
  EXPECT_EQ(lines_of("a\r\nb\r"), (Words{"a", "b"}));
  EXPECT_EQ(lines_of("\r\n\r"), (Words{"", ""}));
  EXPECT_EQ(lines_of("a\rb\n"), Words{"a\rb"}) << "a lone CR ends no line";
  EXPECT_EQ(lines_of("\xEF\xBB\xBF"
                     "a\nb"),
            (Words{"a", "b"}));
  EXPECT_EQ(lines_of("\xEF\xBB\xBF"), Words{});
  EXPECT_EQ(lines_of("\xEF\xBB"), Words{"\xEF\xBB"}) << "half a byte order mark is text";
  EXPECT_EQ(lines_of("a\n\xEF\xBB\xBF"), (Words{"a", "\xEF\xBB\xBF"})) << "a mark begins a text";
  EXPECT_EQ(lines_of(std::string_view("a\0b\nc", 5)), (Words{std::string("a\0b", 3), "c"}));
}

TEST(Text, TheNumberBeforeTheFirstLineIsZeroAndStaysAtTheLast) {
  LineReader lines("a\nb");
  EXPECT_EQ(lines.number(), 0);
  lines.next();
  lines.next();
  EXPECT_FALSE(lines.next());
  EXPECT_FALSE(lines.next());
  EXPECT_EQ(lines.number(), 2);
}

TEST(Text, TheFirstSeparatorOfAPreferenceParts) {
  EXPECT_EQ(cell_separator(""), ' ');
  EXPECT_EQ(cell_separator("1 2\t3"), ' ');
  EXPECT_EQ(cell_separator("1,5 2"), ',');
  EXPECT_EQ(cell_separator("1,5;2"), ';')
      << "a decimal comma is not a separator beside a semicolon";
  EXPECT_EQ(cell_separator(",;"), ';');
}

TEST(Text, CellsKeepTheirColumnAndLoseTheirBlanks) {
  const auto cells = split_cells(" a ,\tb\t, c d ", ',', 10);
  EXPECT_EQ(texts(cells), (Words{"a", "b", "c d"}));
  EXPECT_EQ(columns(cells), (Columns{2, 6, 10}));
}

TEST(Text, EmptyCellsCountBetweenSeparatorsAndNotBetweenBlanks) {
  EXPECT_EQ(texts(split_cells("", ',', 10)), Words{""});
  EXPECT_EQ(texts(split_cells(",", ',', 10)), (Words{"", ""}));
  EXPECT_EQ(texts(split_cells("1,", ',', 10)), (Words{"1", ""}));
  EXPECT_EQ(texts(split_cells(",,1", ',', 10)), (Words{"", "", "1"}));
  EXPECT_EQ(texts(split_cells("", ' ', 10)), Words{});
  EXPECT_EQ(texts(split_cells(" \t ", ' ', 10)), Words{});
  const auto cells = split_cells("  1 \t 2  ", ' ', 10);
  EXPECT_EQ(texts(cells), (Words{"1", "2"}));
  EXPECT_EQ(columns(cells), (Columns{3, 7}));
}

TEST(Text, ALineOfNothingButSeparatorsCostsNoMoreThanOneCellBeyondTheMost) {
  EXPECT_EQ(split_cells("1,2,3", ',', 3).size(), 3u);
  EXPECT_EQ(split_cells("1,2,3,4,5", ',', 3).size(), 4u);
  EXPECT_EQ(split_cells("1", ',', 0).size(), 1u);
  const std::string long_line(20'000'000, ',');
  const auto start = std::chrono::steady_clock::now();
  EXPECT_EQ(split_cells(long_line, ',', 8).size(), 9u);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  std::cout << "20 MB of commas: " << took.count() * 1e3 << " ms\n";
  EXPECT_LT(took.count(), 0.1);
}

TEST(Text, NumbersAreTheWholeTextAndFinite) {
  EXPECT_EQ(number_of("0"), 0.0);
  EXPECT_TRUE(std::signbit(*number_of("-0")));
  EXPECT_EQ(number_of("1e-12"), 1e-12);
  EXPECT_EQ(number_of("-1e-12"), -1e-12);
  EXPECT_EQ(number_of("+2.5"), 2.5);
  EXPECT_EQ(number_of(".5"), 0.5);
  EXPECT_EQ(number_of("5."), 5.0);
  EXPECT_EQ(number_of("1e9"), 1e9);
  EXPECT_EQ(number_of("-1E9"), -1e9);
  EXPECT_EQ(number_of("5e-324"), 5e-324);
  for (const char* none : {"",      " ",     "+",   "-",    "+-1", "++1",  "-+1",
                           "1 ",    " 1",    "1,5", "1e",   "1e+", "0x10", "1.0000000001e9",
                           "-1e10", "1e999", "inf", "-inf", "nan", "NaN",  "1 2",
                           "one",   ".",     "e5",  "--1"})
    EXPECT_FALSE(number_of(none)) << "'" << none << "'";
  EXPECT_FALSE(number_of(std::string_view("1\0", 2)));
}

TEST(Text, WhatIsSeenIsShownInPrintAndShort) {
  EXPECT_EQ(quoted_excerpt(""), "nothing");
  EXPECT_EQ(quoted_excerpt("ab c"), "'ab c'");
  EXPECT_EQ(quoted_excerpt(std::string_view("\0\n\x7F\xFF", 4)), "'\\x00\\x0A\\x7F\\xFF'");
  EXPECT_EQ(shown(std::string(40, 'x')), std::string(40, 'x'));
  EXPECT_EQ(shown(std::string(41, 'x')), std::string(40, 'x') + "...");
}

TEST(Text, AnyBytesArePartedWithoutLossOfALetter) {
  const unsigned seed = 20261122;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  const std::string letters = "ab1.,; \t\r\n\0\xEF";
  for (int i = 0; i < 20000; ++i) {
    std::string text(random() % 30, ' ');
    for (char& c : text) c = letters[random() % 12];
    std::size_t read = 0;
    for (const std::string& line : lines_of(text)) {
      const char separator = cell_separator(line);
      for (const Cell& cell : split_cells(line, separator, 100)) {
        ASSERT_GE(cell.column, 1);
        ASSERT_EQ(line.substr(std::size_t(cell.column) - 1, cell.text.size()), cell.text);
        ASSERT_EQ(cell.text.find(separator == ' ' ? '\t' : separator), std::string_view::npos);
        for (const char c : cell.text) read += c == 'a' || c == 'b' || c == '1';
      }
    }
    std::size_t written = 0;
    for (const char c : text) written += c == 'a' || c == 'b' || c == '1';
    ASSERT_EQ(read, written);
  }
}

TEST(Text, AFileIsReadWholeOrRefusedByName) {
  const auto folder =
      std::filesystem::temp_directory_path() / ("abbe-text-" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  const auto file = folder / "t.txt";
  std::ofstream(file, std::ios::binary) << std::string("a\0b", 3);
  EXPECT_EQ(read_text(file, 3), std::string("a\0b", 3));
  const auto refusal = [](const std::filesystem::path& path, std::size_t most) {
    try {
      read_text(path, most);
      return std::string();
    } catch (const BadInput& fault) {
      return std::string(fault.what());
    }
  };
  EXPECT_NE(refusal(file, 2).find("t.txt: expected at most 2 bytes, seen 3"), std::string::npos)
      << refusal(file, 2);
  EXPECT_NE(refusal(folder / "none", 9).find("seen none"), std::string::npos);
  EXPECT_NE(refusal(folder, 9).find("seen something that is not a file"), std::string::npos);
  EXPECT_NE(refusal("/dev/zero", 9).find("seen something that is not a file"), std::string::npos)
      << "a device has no end";
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace abbe
