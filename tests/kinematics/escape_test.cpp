#include "kinematics/bad_input.h"

#include <random>
#include <string>

#include <gtest/gtest.h>

namespace abbe {
namespace {

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
  const unsigned seed = 20261122;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
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

}  // namespace
}  // namespace abbe
