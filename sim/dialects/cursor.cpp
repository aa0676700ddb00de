#include "sim/dialects/cursor.h"

#include <charconv>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"

namespace abbe::sim::dialects {

namespace {
// The limit of the strict reader (nc_block.cpp) too: far beyond any position or feed.
constexpr double max_number = 1e9;
// No number needs more digits; a hostile line could hold megabytes of them.
constexpr std::size_t max_digits = 200;
}  // namespace

char upper(char c) { return c >= 'a' && c <= 'z' ? char(c - 'a' + 'A') : c; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_letter(char c) { return upper(c) >= 'A' && upper(c) <= 'Z'; }
bool is_blank(char c) { return c == ' ' || c == '\t'; }

std::vector<std::string_view> lines_of_text(std::string_view text) {
  std::vector<std::string_view> lines;
  LineReader reader(text);
  while (const auto line = reader.next()) lines.push_back(*line);
  return lines;
}

bool Cursor::accept(std::string_view expected_text) {
  const std::size_t start = at;
  skip_blanks();
  for (const char c : expected_text) {
    if (upper(current()) != c || at_end()) {
      at = start;
      return false;
    }
    ++at;
  }
  return true;
}

// The whole word, so that "IF" does not match the beginning of "IFX".
bool Cursor::accept_word(std::string_view expected_text) {
  const std::size_t start = at;
  if (accept(expected_text) && !is_letter(current()) && !is_digit(current()) && current() != '_')
    return true;
  at = start;
  return false;
}

std::string_view Cursor::text_until_blank(std::size_t from) const {
  std::size_t end = from;
  while (end < text.size() && !is_blank(text[end])) ++end;
  return text.substr(from, end - from);
}

void Cursor::throw_input_error(std::size_t from, std::string expected, std::string seen) const {
  throw BadInput(location.file, location.line, int(from) + 1, std::move(expected), std::move(seen));
}

void Cursor::throw_input_error(std::size_t from, std::string expected) const {
  throw_input_error(
      from, std::move(expected),
      from < text.size() ? shown(text_until_blank(from)) : std::string("the end of the line"));
}

std::optional<double> Cursor::number(bool sign, bool blanks_within) {
  const std::size_t start = at;
  skip_blanks();
  const std::size_t from = at;
  bool is_negative = false;
  if (sign && (current() == '+' || current() == '-')) is_negative = text[at++] == '-';
  if (blanks_within) skip_blanks();
  const std::size_t digits_begin = at;
  int n_digits = 0, n_points = 0;
  bool has_blanks = false;
  // A second point ends the number: "1.2.3" is left to the caller to reject.
  for (; !at_end(); ++at) {
    const char c = current();
    if (is_digit(c)) {
      ++n_digits;
    } else if (c == '.' && n_points == 0) {
      ++n_points;
    } else if (blanks_within && is_blank(c) && (is_digit(peek()) || peek() == '.')) {
      has_blanks = true;
    } else {
      break;
    }
  }
  // Nothing is consumed, so that the caller can try something else at the same position.
  if (n_digits == 0) {
    at = start;
    return std::nullopt;
  }
  std::string digits_without_blanks;
  std::string_view digits = text.substr(digits_begin, at - digits_begin);
  if (digits.size() > max_digits) throw_input_error(from, "a number of at most 200 digits");
  // std::from_chars takes no blanks; the copy is made only if there are some.
  if (has_blanks) {
    for (const char c : digits)
      if (!is_blank(c)) digits_without_blanks += c;
    digits = digits_without_blanks;
  }
  // from_chars is independent of the locale: no decimal comma, no thousands separators.
  double value = 0.0;
  const auto result = std::from_chars(digits.data(), digits.data() + digits.size(), value,
                                      std::chars_format::fixed);
  if (result.ec != std::errc() || result.ptr != digits.data() + digits.size() ||
      !(value <= max_number))
    throw_input_error(from, "a number of at most 1e9");
  return is_negative ? -value : value;
}

std::string_view name_of(WordTreatment use) {
  static constexpr std::string_view names[] = {"read", "without effect", "refused"};
  return names[std::size_t(use)];
}

// A linear search is fast enough: tables have at most a few hundred words.
const WordTableEntry* find_word(std::span<const WordTableEntry> table, std::string_view word) {
  for (const WordTableEntry& line : table) {
    bool is_match = false;
    each_word(line.word, [&](std::string_view alias) { is_match = is_match || alias == word; });
    if (is_match) return &line;
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
