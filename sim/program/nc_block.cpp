#include "sim/program/nc_block.h"

#include <charconv>
#include <cmath>
#include <utility>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"

namespace abbe::sim::program {

void throw_input_error(const NcLocation& location, const Cause& cause, std::string expected,
                       std::optional<std::string> seen) {
  throw BadInput(location.file, location.line, cause.column, std::move(expected),
                 seen ? *std::move(seen) : shown(cause.text));
}

namespace {

// Larger than any position, feed or line number, and small enough to be converted to int.
constexpr double max_number = 1e9;
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
  Scanner(std::string_view text, const NcLocation& location) : text_(text), location_(location) {}

  void parse(NcBlock& block);

 private:
  bool is_at_end() const { return position_ >= text_.size(); }
  char current() const { return text_[position_]; }
  void skip_blanks();
  void skip_blanks_and_comments(NcBlock& block);
  std::string_view comment();
  NcWord word();
  double number(std::size_t letter_position);
  void put(NcBlock& block, const NcWord& word);
  void throw_no_word() const;
  std::string_view cell(std::size_t from) const;

  [[noreturn]] void throw_error(std::size_t position, std::string expected,
                                std::string seen) const {
    throw BadInput(location_.file, location_.line, int(position) + 1, std::move(expected),
                   std::move(seen));
  }

  std::string_view text_;
  const NcLocation& location_;
  std::size_t position_ = 0;
};

/// Returns the text up to the next blank or comment, for messages.
std::string_view Scanner::cell(std::size_t from) const {
  std::size_t end = from;
  while (end < text_.size() && !is_blank(text_[end]) && text_[end] != '(' && text_[end] != ';')
    ++end;
  return text_.substr(from, end - from);
}

void Scanner::skip_blanks() {
  while (!is_at_end() && is_blank(current())) ++position_;
}

std::string_view Scanner::comment() {
  const std::size_t open = position_;
  for (++position_; !is_at_end(); ++position_) {
    if (current() == ')') return text_.substr(open + 1, position_++ - open - 1);
    // A nested parenthesis usually means that a closing one is missing. LinuxCNC rejects it too.
    if (current() == '(') throw_error(position_, ") before another ( in a comment", "(");
  }
  throw_error(open, ") that ends the comment on its line", "none");
}

void Scanner::skip_blanks_and_comments(NcBlock& block) {
  for (skip_blanks(); !is_at_end(); skip_blanks()) {
    if (current() == '(') {
      block.comments.push_back(comment());
    } else if (current() == ';') {
      block.comments.push_back(text_.substr(position_ + 1));
      position_ = text_.size();
    } else {
      return;
    }
  }
}

// Parameters, expressions and exponents are detected before the number is parsed, so that each has
// its own message.
double Scanner::number(std::size_t letter_position) {
  const std::size_t number_start = position_;
  bool is_negative = false;
  if (!is_at_end() && (current() == '+' || current() == '-'))
    is_negative = text_[position_++] == '-';
  const std::size_t digits_start = position_;
  int digit_count = 0, point_count = 0;
  for (; !is_at_end() && (is_digit(current()) || current() == '.'); ++position_)
    ++(current() == '.' ? point_count : digit_count);
  const std::string letter(1, upper(text_[letter_position]));
  // Only the readers of dialects evaluate parameters and expressions.
  if (!is_at_end() && (current() == '#' || current() == '['))
    throw_error(position_, "a plain number after " + letter,
                current() == '#' ? "a parameter (#)" : "an expression ([)");
  if (digit_count == 0 || point_count > 1)
    throw_error(
        letter_position, "a number after " + letter,
        number_start == text_.size() ? "the end of the line" : shown(cell(letter_position)));
  // E before a digit or sign is an exponent; otherwise it begins the next token.
  if (!is_at_end() && upper(current()) == 'E' && position_ + 1 < text_.size() &&
      (is_digit(text_[position_ + 1]) || text_[position_ + 1] == '+' ||
       text_[position_ + 1] == '-'))
    throw_error(letter_position, "a number without an exponent", shown(cell(letter_position)));
  double value = 0.0;
  // from_chars does not depend on the locale and rounds correctly.
  const auto read = std::from_chars(text_.data() + digits_start, text_.data() + position_, value,
                                    std::chars_format::fixed);
  if (read.ec != std::errc() || read.ptr != text_.data() + position_ || !(value <= max_number))
    throw_error(letter_position, "a number of at most 1e9", shown(cell(letter_position)));
  return is_negative ? -value : value;
}

// Common mistakes have messages of their own.
void Scanner::throw_no_word() const {
  const char c = current();
  const std::string expected = "a word (letter and number)";
  if (c == '#') throw_error(position_, expected, "a parameter (#)");
  if (c == '[' || c == ']') throw_error(position_, expected, "an expression ([)");
  // A decimal comma would otherwise split one number into two tokens.
  if (c == ',') throw_error(position_, "a decimal point, such as 10.5", shown(cell(position_)));
  if (c == '\0') throw_error(position_, "text", "a NUL byte");
  if (c == ')') throw_error(position_, expected, ") without (");
  throw_error(position_, expected, shown(cell(position_)));
}

NcWord Scanner::word() {
  const std::size_t start = position_;
  const char letter = upper(current());
  if (letter < 'A' || letter > 'Z') throw_no_word();
  if (letter == 'O') throw_error(start, "a word of this control", "O word " + shown(cell(start)));
  ++position_;
  skip_blanks();
  NcWord word;
  word.value = number(start);
  word.column = int(start) + 1;
  word.text = text_.substr(start, position_ - start);
  return word;
}

// G and M may occur several times in a block, any other letter only once.
void Scanner::put(NcBlock& block, const NcWord& word) {
  const char letter = upper(word.text.front());
  if (letter == 'G' || letter == 'M') {
    std::vector<NcWord>& codes = letter == 'G' ? block.g : block.m;
    if (codes.size() == max_codes)
      throw_error(std::size_t(word.column - 1),
                  std::string("at most 16 words ") + letter + " in a block", shown(word.text));
    codes.push_back(word);
  } else {
    NcWord& entry = block.words[std::size_t(letter - 'A')];
    if (entry)
      throw_error(std::size_t(word.column - 1), std::string("only one ") + letter + " per block",
                  shown(word.text) + " after " + shown(entry.text));
    entry = word;
  }
}

// A line number is optional, but must come first (RS274/NGC).
void Scanner::parse(NcBlock& block) {
  skip_blanks();
  if (!is_at_end() && current() == '%') {
    ++position_;
    skip_blanks_and_comments(block);
    if (!is_at_end()) throw_error(position_, "nothing after %", shown(cell(position_)));
    block.is_percent_line = true;
    return;
  }
  if (!is_at_end() && current() == '/') {
    ++position_;
    block.deleted = true;
  }
  skip_blanks_and_comments(block);
  bool is_first = true;
  for (; !is_at_end(); skip_blanks_and_comments(block)) {
    const NcWord word = this->word();
    if (upper(word.text.front()) == 'N') {
      if (!is_first)
        throw_error(std::size_t(word.column - 1), "a line number at the start of the block",
                    shown(word.text));
      if (word.value < 0 || word.value != std::floor(word.value))
        throw_error(std::size_t(word.column - 1), "an integer line number", shown(word.text));
    }
    put(block, word);
    is_first = false;
  }
}

}  // namespace

bool NcBlock::empty() const {
  if (!g.empty() || !m.empty()) return false;
  for (const NcWord& word : words)
    if (word) return false;
  return true;
}

NcBlock parse_block(std::string_view text, const NcLocation& location, NcBlock reused) {
  NcBlock block = std::move(reused);
  block.line = location.line;
  block.is_percent_line = block.deleted = false;
  block.words.fill({});
  block.g.clear();
  block.m.clear();
  block.comments.clear();
  // The scanner would not notice a NUL inside a comment.
  if (const std::size_t nul = text.find('\0'); nul != std::string_view::npos)
    throw BadInput(location.file, location.line, int(nul) + 1, "text", "a NUL byte");
  Scanner(text, location).parse(block);
  return block;
}

}  // namespace abbe::sim::program
