#include "kinematics/text.h"
#include "kinematics/hash.h"
#include "tests/test.h"

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
  SeededRandom random(20261122);
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
  const auto folder = fs::temp_directory_path() / ("abbe-text-" + std::to_string(::getpid()));
  fs::create_directories(folder);
  const auto file = folder / "t.txt";
  std::ofstream(file, std::ios::binary) << std::string("a\0b", 3);
  EXPECT_EQ(read_text(file, 3), std::string("a\0b", 3));
  const auto refusal = [](const fs::path& path, std::size_t most) {
    return thrown_text<BadInput>([&] { read_text(path, most); });
  };
  EXPECT_HAS(refusal(file, 2), "t.txt: expected at most 2 bytes, seen 3");
  EXPECT_HAS(refusal(folder / "none", 9), "seen none");
  EXPECT_HAS(refusal(folder, 9), "seen something that is not a file");
  EXPECT_HAS(refusal("/dev/zero", 9), "seen something that is not a file") << "a device has no end";
  fs::remove_all(folder);
}

TEST(Escape, LettersStayAndWhatActsOnATerminalIsSpeltOut) {
  for (const char* plain : {"", "part 7", "µm, Prüfstück, 部品, ± 5 °", "e\u0301", "\\x1b", "日本"})
    EXPECT_EQ(escaped(plain), plain);
  EXPECT_EQ(escaped("\x1b[31mred"), "\\x1b[31mred");
  EXPECT_EQ(escaped("a\r\n\tb"), "a\\x0d\\x0a\\x09b");
  EXPECT_EQ(escape_keeping_lines("a\r\n\tb\x07"), "a\\x0d\n\tb\\x07");
  EXPECT_EQ(escaped("\x7f"), "\\u007f");
  EXPECT_EQ(escaped("\u0085\u009b31m"), "\\u0085\\u009b31m");
  EXPECT_EQ(escaped("abc\u202Egnp.exe"), "abc\\u202egnp.exe");
  EXPECT_EQ(escaped("\u2066\u2069\u200f\u061c\ufeff"), "\\u2066\\u2069\\u200f\\u061c\\ufeff");
  EXPECT_EQ(escaped("\U000E0041"), "\\udb40\\udc41");
  EXPECT_EQ(escaped(std::string("a\0b", 3)), "a\\x00b");
}

TEST(Escape, BytesThatAreNotUtf8AreSpeltOutOneByOne) {
  EXPECT_EQ(escaped("\x9b"
                    "31m"),
            "\\x9b31m");                                  // C1 as a byte of its own
  EXPECT_EQ(escaped("\xc0\x9b"), "\\xc0\\x9b");           // too long for U+001B
  EXPECT_EQ(escaped("\xe0\x80\x9b"), "\\xe0\\x80\\x9b");  // the same
  EXPECT_EQ(escaped("\xed\xa0\x80"), "\\xed\\xa0\\x80");  // half a pair of UTF-16
  EXPECT_EQ(escaped("\xf5\x80\x80\x80"), "\\xf5\\x80\\x80\\x80");
  EXPECT_EQ(escaped("ab\xe2\x82"), "ab\\xe2\\x82");  // cut off
}

/// Whether a terminal would be moved by a text, by a decoder that shares nothing with the escaping.
bool is_calm(const std::string& text) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    if (c < 0x20 || c == 0x7f) return false;
    const auto next = i + 1 < text.size() ? static_cast<unsigned char>(text[i + 1]) : 0u;
    if (c == 0xc2 && next < 0xa0) return false;  // U+0080 to U+009F
    if (c >= 0x80 && c < 0xc0 && i == 0) return false;
    const std::string three = text.substr(i, 3);
    for (const char* mark : {"\u202a", "\u202b", "\u202c", "\u202d", "\u202e", "\u2066", "\u2067",
                             "\u2068", "\u2069", "\u200e", "\u200f"})
      if (three == mark) return false;
  }
  return true;
}

TEST(Escape, OfAnyBytesIsCalmAndStaysAsItIsWhenEscapedAgain) {
  SeededRandom random(20261122);
  const std::string pieces[] = {"\x1b[2J", "\u202e", "\u0090", "\xc2", "\xe2", "\x80",
                                "\xae",    "\x07",   "a",      "µ",    "部",   "\xf0",
                                "\\",      "\xff",   "\n",     "\x9b"};
  for (int i = 0; i < 20000; ++i) {
    std::string text;
    for (unsigned k = random() % 12; k > 0; --k) text += pieces[random() % std::size(pieces)];
    const std::string shown = escaped(text);
    ASSERT_TRUE(is_calm(shown)) << i;
    ASSERT_EQ(escaped(shown), shown) << i;
  }
}

TEST(Escape, ARefusalIsOneCalmLineAndItsMembersAreAsTheyCame) {
  const BadInput fault("a\x1b[1m.toml", 3, 4, "a \u202e name", "x\nabbe: all is well");
  EXPECT_STREQ(fault.what(),
               "a\\x1b[1m.toml:3:4: expected a \\u202e name, seen x\\x0aabbe: all is well");
  EXPECT_EQ(fault.file, "a\x1b[1m.toml");
}

TEST(BadInput, SaysWhereWhatWasExpectedAndWhatWasSeen) {
  EXPECT_STREQ(BadInput("a.toml", 3, 7, "a number", "\"x\"").what(),
               "a.toml:3:7: expected a number, seen \"x\"");
}

TEST(BadInput, LeavesOutAPlaceThatIsNotKnown) {
  EXPECT_STREQ(BadInput("a.stl", 0, 0, "84 bytes", "12").what(),
               "a.stl: expected 84 bytes, seen 12");
  EXPECT_STREQ(BadInput("a.ngc", 5, 0, "a word", "nothing").what(),
               "a.ngc:5: expected a word, seen nothing");
}

TEST(BadInput, KeepsItsParts) {
  const BadInput refused("a.ngc", 5, 2, "G0 to G3", "G99");
  EXPECT_EQ(refused.file, "a.ngc");
  EXPECT_EQ(refused.line, 5);
  EXPECT_EQ(refused.column, 2);
  EXPECT_EQ(refused.expected, "G0 to G3");
  EXPECT_EQ(refused.seen, "G99");
}

// vectors of the authors' test suite, test_fnv.c
TEST(Hash, Fnv1aHasItsPublishedValues) {
  EXPECT_EQ(fnv_1a(""), 0xcbf29ce484222325u);
  EXPECT_EQ(fnv_1a("a"), 0xaf63dc4c8601ec8cu);
  EXPECT_EQ(fnv_1a("b"), 0xaf63df4c8601f1a5u);
  EXPECT_EQ(fnv_1a("foobar"), 0x85944171f73967e8u);
}

TEST(Hash, Fnv1aTakesBytesPieceByPiece) {
  EXPECT_EQ(fnv_1a("bar", fnv_1a("foo")), fnv_1a("foobar"));
  EXPECT_NE(fnv_1a("\xff"), fnv_1a("\x7f")) << "a byte is no signed number";
}

// first values of Vigna's splitmix64.c for the seed 1234567
TEST(Hash, SplitMixHasItsPublishedValues) {
  std::uint64_t state = 1234567;
  for (const std::uint64_t expected :
       {6457827717110365317u, 3203168211198807973u, 9817491932198370423u, 4593380528125082431u,
        16408922859458223821u})
    EXPECT_EQ(split_mix::mixed(state += split_mix::golden), expected);
}

TEST(Hash, StreamsOfASeedDiffer) {
  EXPECT_NE(split_mix::stream(1, 0), split_mix::stream(1, 1));
  EXPECT_NE(split_mix::stream(1, 0), split_mix::stream(2, 0));
}

}  // namespace
}  // namespace abbe
