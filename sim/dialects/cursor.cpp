#include "sim/dialects/cursor.h"

#include <charconv>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"

namespace abbe::sim::dialects {

namespace {
// The same limit as that of the strict reader (nc_block.cpp): beyond any position or feed.
constexpr double largest_number = 1e9;
// A number needs no more; a hostile line could otherwise hold megabytes of digits.
constexpr std::size_t max_digits = 200;
}  // namespace

char upper(char c) { return c >= 'a' && c <= 'z' ? char(c - 'a' + 'A') : c; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_letter(char c) { return upper(c) >= 'A' && upper(c) <= 'Z'; }
bool is_blank(char c) { return c == ' ' || c == '\t'; }

std::vector<std::string_view> lines_of_text(std::string_view text) {
  std::vector<std::string_view> lines;
  Lines all(text);
  while (const auto line = all.next()) lines.push_back(*line);
  return lines;
}

bool Cursor::take(std::string_view wanted) {
  const std::size_t before = at;
  skip_blanks();
  for (const char c : wanted) {
    if (upper(here()) != c || at_end()) {
      at = before;
      return false;
    }
    ++at;
  }
  return true;
}

// The whole word, so that "IF" does not match the beginning of "IFX".
bool Cursor::take_word(std::string_view wanted) {
  const std::size_t before = at;
  if (take(wanted) && !is_letter(here()) && !is_digit(here()) && here() != '_') return true;
  at = before;
  return false;
}

std::string_view Cursor::cell(std::size_t from) const {
  std::size_t end = from;
  while (end < text.size() && !is_blank(text[end])) ++end;
  return text.substr(from, end - from);
}

void Cursor::refuse(std::size_t from, std::string expected, std::string seen) const {
  throw BadInput(place.file, place.line, int(from) + 1, std::move(expected), std::move(seen));
}

void Cursor::refuse(std::size_t from, std::string expected) const {
  refuse(from, std::move(expected),
         from < text.size() ? shown(cell(from)) : std::string("the end of the line"));
}

std::optional<double> Cursor::number(bool sign, bool blanks_within) {
  const std::size_t before = at;
  skip_blanks();
  const std::size_t from = at;
  bool negative = false;
  if (sign && (here() == '+' || here() == '-')) negative = text[at++] == '-';
  if (blanks_within) skip_blanks();
  const std::size_t digits = at;
  int n_digits = 0, n_points = 0;
  bool blanks = false;
  // A second point ends the number: "1.2.3" is left to the caller to reject.
  for (; !at_end(); ++at) {
    const char c = here();
    if (is_digit(c)) {
      ++n_digits;
    } else if (c == '.' && n_points == 0) {
      ++n_points;
    } else if (blanks_within && is_blank(c) && (is_digit(next()) || next() == '.')) {
      blanks = true;
    } else {
      break;
    }
  }
  // Nothing is consumed, so that the caller can try something else at the same position.
  if (n_digits == 0) {
    at = before;
    return std::nullopt;
  }
  std::string together;
  std::string_view all = text.substr(digits, at - digits);
  if (all.size() > max_digits) refuse(from, "a number of at most 200 digits");
  // std::from_chars takes no blanks; the copy is made only if there are some.
  if (blanks) {
    for (const char c : all)
      if (!is_blank(c)) together += c;
    all = together;
  }
  // from_chars is independent of the locale: no decimal comma, no thousands separators.
  double value = 0.0;
  const auto read =
      std::from_chars(all.data(), all.data() + all.size(), value, std::chars_format::fixed);
  if (read.ec != std::errc() || read.ptr != all.data() + all.size() || !(value <= largest_number))
    refuse(from, "a number of at most 1e9");
  return negative ? -value : value;
}

std::string_view name_of(Use use) {
  switch (use) {
    case Use::Read:
      return "read";
    case Use::WithoutEffect:
      return "without effect";
    case Use::Refused:
      return "refused";
  }
  return "";
}

// Linear search over at most a few hundred words.
const WordTableEntry* find_word(std::span<const WordTableEntry> table, std::string_view word) {
  for (const WordTableEntry& line : table) {
    bool has = false;
    each_word(line.word, [&](std::string_view one) { has = has || one == word; });
    if (has) return &line;
  }
  return nullptr;
}

std::string markdown_table(std::span<const WordTableEntry> table) {
  std::string text = "| word | | what it means |\n|---|---|---|\n";
  for (const WordTableEntry& line : table)
    text += fmt::format("| `{}` | {} | {} |\n", line.word, name_of(line.use), line.sentence);
  return text;
}

int parse_tenths(std::string_view word) {
  double number = 0.0;
  std::from_chars(word.data() + 1, word.data() + word.size(), number);
  return int(std::lround(number * 10));
}

}  // namespace abbe::sim::dialects
