#include "sim/program/nc_block.h"

#include <charconv>
#include <cmath>
#include <utility>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"

namespace abbe::sim::program {

void refuse(const NcLocation& place, const Cause& cause, std::string expected,
            std::optional<std::string> seen) {
  throw BadInput(place.file, place.line, cause.column, std::move(expected),
                 seen ? *std::move(seen) : shown(cause.text));
}

namespace {

// Beyond any position, feed or line number, yet small enough to be converted to int.
constexpr double largest_number = 1e9;
// Bounds the memory of a malicious line. A valid block has at most one code of each of the 14 modal
// groups.
constexpr std::size_t max_codes = 16;

// Unlike std::isdigit these do not depend on the locale.
bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_blank(char c) { return c == ' ' || c == '\t'; }
char upper(char c) { return c >= 'a' && c <= 'z' ? char(c - 'a' + 'A') : c; }

/// Splits one line into tokens.
class Scanner {
 public:
  Scanner(std::string_view text, const NcLocation& place) : text_(text), place_(place) {}

  void fill(NcBlock& block);

 private:
  bool at_end() const { return i_ >= text_.size(); }
  char here() const { return text_[i_]; }
  void skip_blanks();
  void skip_blanks_and_comments(NcBlock& block);
  std::string_view comment();
  NcWord word();
  double number(std::size_t letter_at);
  void put(NcBlock& block, const NcWord& word);
  void refuse_no_word() const;
  std::string_view cell(std::size_t from) const;

  [[noreturn]] void refuse(std::size_t at, std::string expected, std::string seen) const {
    throw BadInput(place_.file, place_.line, int(at) + 1, std::move(expected), std::move(seen));
  }

  std::string_view text_;
  const NcLocation& place_;
  std::size_t i_ = 0;
};

/// Returns the text up to the next blank or comment, for messages.
std::string_view Scanner::cell(std::size_t from) const {
  std::size_t end = from;
  while (end < text_.size() && !is_blank(text_[end]) && text_[end] != '(' && text_[end] != ';')
    ++end;
  return text_.substr(from, end - from);
}

void Scanner::skip_blanks() {
  while (!at_end() && is_blank(here())) ++i_;
}

std::string_view Scanner::comment() {
  const std::size_t open = i_;
  for (++i_; !at_end(); ++i_) {
    if (here() == ')') return text_.substr(open + 1, i_++ - open - 1);
    // A nested parenthesis usually means that a closing one is missing. LinuxCNC rejects it too.
    if (here() == '(') refuse(i_, ") before another ( in a comment", "(");
  }
  refuse(open, ") that ends the comment on its line", "none");
}

void Scanner::skip_blanks_and_comments(NcBlock& block) {
  for (skip_blanks(); !at_end(); skip_blanks()) {
    if (here() == '(') {
      block.comments.push_back(comment());
    } else if (here() == ';') {
      block.comments.push_back(text_.substr(i_ + 1));
      i_ = text_.size();
    } else {
      return;
    }
  }
}

// Parameters, expressions and exponents are detected before the number is parsed, so that each gets
// its own message.
double Scanner::number(std::size_t letter_at) {
  const std::size_t from = i_;
  bool negative = false;
  if (!at_end() && (here() == '+' || here() == '-')) negative = text_[i_++] == '-';
  const std::size_t digits = i_;
  int n_digits = 0, n_points = 0;
  for (; !at_end() && (is_digit(here()) || here() == '.'); ++i_)
    ++(here() == '.' ? n_points : n_digits);
  const std::string letter(1, upper(text_[letter_at]));
  // Parameters and expressions are read by the dialects, not by this strict reader.
  if (!at_end() && (here() == '#' || here() == '['))
    refuse(i_, "a plain number after " + letter,
           here() == '#' ? "a parameter (#)" : "an expression ([)");
  if (n_digits == 0 || n_points > 1)
    refuse(letter_at, "a number after " + letter,
           from == text_.size() ? "the end of the line" : shown(cell(letter_at)));
  // E before a digit or sign is an exponent; otherwise it begins the next token.
  if (!at_end() && upper(here()) == 'E' && i_ + 1 < text_.size() &&
      (is_digit(text_[i_ + 1]) || text_[i_ + 1] == '+' || text_[i_ + 1] == '-'))
    refuse(letter_at, "a number without exponent", shown(cell(letter_at)));
  double value = 0.0;
  // from_chars does not depend on the locale and rounds correctly.
  const auto read =
      std::from_chars(text_.data() + digits, text_.data() + i_, value, std::chars_format::fixed);
  if (read.ec != std::errc() || read.ptr != text_.data() + i_ || !(value <= largest_number))
    refuse(letter_at, "a number of at most 1e9", shown(cell(letter_at)));
  return negative ? -value : value;
}

// Reports a character that starts no token, with a specific message for common mistakes.
void Scanner::refuse_no_word() const {
  const char c = here();
  const std::string expected = "a word (letter and number)";
  if (c == '#') refuse(i_, expected, "a parameter (#)");
  if (c == '[' || c == ']') refuse(i_, expected, "an expression ([)");
  // A decimal comma would otherwise split one number into two tokens.
  if (c == ',') refuse(i_, "a decimal point, as in 10.5", shown(cell(i_)));
  if (c == '\0') refuse(i_, "text", "a NUL byte");
  if (c == ')') refuse(i_, expected, ") without (");
  refuse(i_, expected, shown(cell(i_)));
}

NcWord Scanner::word() {
  const std::size_t at = i_;
  const char letter = upper(here());
  if (letter < 'A' || letter > 'Z') refuse_no_word();
  if (letter == 'O') refuse(at, "a word of this control", "O word " + shown(cell(at)));
  ++i_;
  skip_blanks();
  NcWord word;
  word.value = number(at);
  word.column = int(at) + 1;
  word.text = text_.substr(at, i_ - at);
  return word;
}

void Scanner::put(NcBlock& block, const NcWord& word) {
  const char letter = upper(word.text.front());
  if (letter == 'G' || letter == 'M') {
    std::vector<NcWord>& codes = letter == 'G' ? block.g : block.m;
    if (codes.size() == max_codes)
      refuse(std::size_t(word.column - 1),
             std::string("at most 16 words ") + letter + " in a block", shown(word.text));
    codes.push_back(word);
  } else {
    NcWord& place = block.words[std::size_t(letter - 'A')];
    if (place)
      refuse(std::size_t(word.column - 1), std::string("one ") + letter + " in a block",
             shown(word.text) + " after " + shown(place.text));
    place = word;
  }
}

// A line number is optional, but must come first (RS274/NGC).
void Scanner::fill(NcBlock& block) {
  skip_blanks();
  if (!at_end() && here() == '%') {
    ++i_;
    skip_blanks_and_comments(block);
    if (!at_end()) refuse(i_, "nothing after %", shown(cell(i_)));
    block.percent = true;
    return;
  }
  if (!at_end() && here() == '/') {
    ++i_;
    block.deleted = true;
  }
  skip_blanks_and_comments(block);
  bool first = true;
  for (; !at_end(); skip_blanks_and_comments(block)) {
    const NcWord word = this->word();
    if (upper(word.text.front()) == 'N') {
      if (!first)
        refuse(std::size_t(word.column - 1), "a line number first in its block", shown(word.text));
      if (word.value < 0 || word.value != std::floor(word.value))
        refuse(std::size_t(word.column - 1), "a whole line number", shown(word.text));
    }
    put(block, word);
    first = false;
  }
}

}  // namespace

bool NcBlock::empty() const {
  if (!g.empty() || !m.empty()) return false;
  for (const NcWord& word : words)
    if (word) return false;
  return true;
}

NcBlock parse_block(std::string_view text, const NcLocation& place, NcBlock reused) {
  NcBlock block = std::move(reused);
  block.line = place.line;
  block.percent = block.deleted = false;
  block.words.fill({});
  block.g.clear();
  block.m.clear();
  block.comments.clear();
  // Checked before scanning, because a NUL inside a comment would go unnoticed.
  if (const std::size_t nul = text.find('\0'); nul != std::string_view::npos)
    throw BadInput(place.file, place.line, int(nul) + 1, "text", "a NUL byte");
  Scanner(text, place).fill(block);
  return block;
}

}  // namespace abbe::sim::program
