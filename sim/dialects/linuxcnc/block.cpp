#include "sim/dialects/linuxcnc/block.h"

#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::sim::dialects::linuxcnc {

namespace {

constexpr double equality_tolerance = 1e-4;  // of EQ and NE, TOLERANCE_EQUAL of LinuxCNC

// MOD of RS274 is never negative, unlike std::fmod.
double modulo(double a, double b) {
  const double remainder = std::fmod(a, b);
  return remainder < 0 ? remainder + std::abs(b) : remainder;
}

// Functions that return the expectation which operands do not meet, or null.

const char* require_nonzero(double, double b) { return b == 0 ? "a nonzero divisor" : nullptr; }

const char* require_real_power(double a, double b) {
  if (a < 0 && std::floor(b) != b) return "an integer exponent for a negative number";
  return a == 0 && b < 0 ? "a non-negative exponent for zero" : nullptr;
}

// Levels of RS274/NGC as the README lists them: ** binds most tightly, logical operators least.
constexpr Operator operators[] = {
    {"**", 6, [](double a, double b) { return std::pow(a, b); }, require_real_power},
    {"*", 5, [](double a, double b) { return a * b; }},
    {"/", 5, [](double a, double b) { return a / b; }, require_nonzero},
    {"MOD", 5, modulo, require_nonzero},
    {"+", 4, [](double a, double b) { return a + b; }},
    {"-", 4, [](double a, double b) { return a - b; }},
    {"EQ", 3, [](double a, double b) { return double(std::abs(a - b) < equality_tolerance); }},
    {"NE", 3, [](double a, double b) { return double(std::abs(a - b) >= equality_tolerance); }},
    {"GT", 3, [](double a, double b) { return double(a > b); }},
    {"GE", 3, [](double a, double b) { return double(a >= b); }},
    {"LT", 3, [](double a, double b) { return double(a < b); }},
    {"LE", 3, [](double a, double b) { return double(a <= b); }},
    {"AND", 2, [](double a, double b) { return double(a != 0 && b != 0); }},
    {"XOR", 2, [](double a, double b) { return double((a != 0) != (b != 0)); }},
    {"OR", 2, [](double a, double b) { return double(a != 0 || b != 0); }},
};

const char* require_unit_range(double x) {
  return x < -1 || x > 1 ? "a number from -1 to 1" : nullptr;
}

// `Flow::parse_operand` handles ATAN, which takes two arguments.
constexpr Function functions[] = {
    {"ABS", [](double x) { return std::abs(x); }},
    {"ACOS", [](double x) { return std::acos(x) / units::deg; }, require_unit_range},
    {"ASIN", [](double x) { return std::asin(x) / units::deg; }, require_unit_range},
    {"COS", [](double x) { return std::cos(x * units::deg); }},
    {"EXP", [](double x) { return std::exp(x); }},
    {"FIX", [](double x) { return std::floor(x); }},
    {"FUP", [](double x) { return std::ceil(x); }},
    {"LN", [](double x) { return std::log(x); },
     [](double x) -> const char* { return x <= 0 ? "a number greater than zero" : nullptr; }},
    {"ROUND", [](double x) { return double(std::round(x)); }},  // half away from zero
    {"SIN", [](double x) { return std::sin(x * units::deg); }},
    {"SQRT", [](double x) { return std::sqrt(x); },
     [](double x) -> const char* { return x < 0 ? "a non-negative number" : nullptr; }},
    {"TAN", [](double x) { return std::tan(x * units::deg); }},
};

}  // namespace

const ExpressionGrammar& grammar() {
  static constexpr ExpressionGrammar ngc_grammar{operators, functions, '[', ']', true};
  return ngc_grammar;
}

namespace {

// Both limits bound the memory of a hostile line; LinuxCNC too allows 50 assignments in a block.
constexpr std::size_t max_name_bytes = 100;
constexpr std::size_t max_assignments = 50;

std::string_view read_comment(Cursor& cursor) {
  const std::size_t open = cursor.at;
  for (++cursor.at; !cursor.at_end(); ++cursor.at) {
    if (cursor.current() == ')') return cursor.text.substr(open + 1, cursor.at++ - open - 1);
    if (cursor.current() == '(')
      cursor.throw_input_error(cursor.at, ") before another ( in a comment", "(");
  }
  cursor.throw_input_error(open, ") that ends the comment on its line", "none");
}

}  // namespace

bool Block::empty() const { return words.empty() && codes.empty(); }

void Block::clear() {
  words.clear();
  codes.clear();
  deleted = is_percent_line = false;
  skipped_code = code_forbidding_axis_words = {};
  comments.clear();
  number_assignments.clear();
  name_assignments.clear();
}

int whole_number(const Cursor& cursor, std::size_t from, double value, int max) {
  const double rounded = std::round(value);
  // rs274 accepts a computed index within 1e-4 of an integer.
  if (!(std::abs(value - rounded) < 1e-4) || rounded < 0 || rounded > max)
    cursor.throw_input_error(from, fmt::format("an integer from 0 to {}", max),
                             fmt::format("{}", value));
  return int(rounded);
}

std::string parse_name(Cursor& cursor) {
  const std::size_t from = cursor.at;
  std::string name;
  for (++cursor.at; cursor.current() != '>'; ++cursor.at) {
    if (cursor.at_end()) cursor.throw_input_error(from, "> after a name", "the end of the line");
    const char c = cursor.current();
    // Blanks and case do not matter, as in every line that rs274 reads.
    if (!is_blank(c)) name += c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c;
    if (name.size() > max_name_bytes)
      cursor.throw_input_error(from, "a name of at most 100 letters");
  }
  ++cursor.at;
  if (name.empty()) cursor.throw_input_error(from, "a name between < and >");
  return name;
}

// Parser that splits a block into words, codes and assignments.
class BlockReader {
 public:
  BlockReader(Cursor& cursor, ProgramRun& run, OperandParser& operands, Block& block)
      : cursor_(cursor), run_(run), operands_(operands), block_(block) {}

  void read();

 private:
  void skip_blanks_and_comments();
  void read_assignment();
  void read_word(bool is_first);
  void put_code(char letter, const NcWord& word);

  Cursor& cursor_;
  ProgramRun& run_;
  OperandParser& operands_;
  Block& block_;
};

// A comment after ; extends to the end of the line.
void BlockReader::skip_blanks_and_comments() {
  for (cursor_.skip_blanks(); !cursor_.at_end(); cursor_.skip_blanks()) {
    if (cursor_.current() == '(') {
      block_.comments.push_back(read_comment(cursor_));
    } else if (cursor_.current() == ';') {
      block_.comments.push_back(cursor_.text.substr(cursor_.at + 1));
      cursor_.at = cursor_.text.size();
    } else {
      return;
    }
  }
}

// The flow executes the assignments after the whole block has been read, so that the block uses the
// old values.
void BlockReader::read_assignment() {
  const std::size_t from = cursor_.at++;
  cursor_.skip_blanks();
  std::string name;
  int number = 0;
  if (cursor_.current() == '<')
    name = parse_name(cursor_);
  else
    number = whole_number(cursor_, from, parse_value(cursor_, grammar(), operands_), 5601);
  double result = 0.0;
  run_.define(name.empty() ? fmt::format("#{}", number) : fmt::format("#<{}>", name), [&] {
    if (!cursor_.accept("="))
      cursor_.throw_input_error(cursor_.at, "= after a parameter that starts a word");
    result = parse_value(cursor_, grammar(), operands_);
  });
  if (block_.number_assignments.size() + block_.name_assignments.size() == max_assignments)
    cursor_.throw_input_error(from, "at most 50 parameters set in a block");
  if (name.empty())
    block_.number_assignments.emplace_back(number, result);
  else
    block_.name_assignments.emplace_back(std::move(name), result);
}

// Puts a code into its group. Codes are identified by their tenths: G59.1 is 591.
void BlockReader::put_code(char letter, const NcWord& word) {
  const double scaled = word.value * 10;
  const double tenths = std::round(scaled);
  const bool is_code = tenths >= 0 && tenths < 1e4 && std::abs(scaled - tenths) < 1e-3;
  const int code = is_code ? int(tenths) : -1;
  const CodeProperties& properties = find_entry(letter, code);
  if (!properties.known) {
    run_.handle_unknown_word(word, fmt::format("a {} code of LinuxCNC", letter));
    block_.skipped_code = word;
    return;
  }
  if (properties.use == WordTreatment::Refused)
    run_.canon.throw_input_error(word, std::string(properties.sentence));
  const Group group = properties.group;
  if (group == Group::None) {
    block_.code_forbidding_axis_words = word;
    return;
  }
  const Code& previous = block_[group];
  // rs274 accepts G80 with another motion code and executes the other one.
  const bool ends_cycle =
      group == Group::Motion && previous && (code == 800) != (previous.tenths == 800);
  if (ends_cycle && code == 800) return;
  if (previous && !ends_cycle)
    run_.canon.throw_input_error(
        word, "only one code of a modal group per block",
        fmt::format("{} after {}", shown(word.text), shown(previous.word.text)));
  block_.codes.put(std::size_t(group), {code, word});
}

void BlockReader::read_word(bool is_first) {
  const std::size_t from = cursor_.at;
  const char letter = upper(cursor_.current());
  const bool is_sign = letter == '@' || letter == '^' || letter == '$';
  if (!is_letter(letter) && !is_sign) {
    const char c = cursor_.current();
    cursor_.throw_input_error(from, "a word (letter and number)",
                              c == ')'   ? ") without ("
                              : c == '[' ? "an expression ([)"
                                         : shown(cursor_.text_until_blank(from)));
  }
  ++cursor_.at;
  NcWord word;
  word.column = int(from) + 1;
  cursor_.skip_blanks();
  if (cursor_.at_end())
    cursor_.throw_input_error(from, std::string("a number after ") + letter, "the end of the line");
  word.value = parse_value(cursor_, grammar(), operands_);
  word.text = cursor_.text.substr(from, cursor_.at - from);
  // A line number must be digits, not an expression.
  const std::size_t digits = word.text.find_first_not_of(" \t", 1);
  if (letter == 'N' && (digits == std::string_view::npos || !is_digit(word.text[digits])))
    run_.canon.throw_input_error(word, "a line number in digits");
  if (letter == 'G' || letter == 'M') return put_code(letter, word);
  if (letter == 'N' && !is_first)
    run_.canon.throw_input_error(word, "a line number at the start of the block");
  const std::size_t index = letter == '@'   ? 26
                            : letter == '^' ? 27
                            : letter == '$' ? 28
                                            : std::size_t(letter - 'A');
  const NcWord& previous = block_.words[index];
  if (previous)
    run_.canon.throw_input_error(
        word, std::string("only one ") + letter + " per block",
        fmt::format("{} after {}", shown(word.text), shown(previous.text)));
  static constexpr std::string_view addresses = "ABCDEFHIJKLNPQRSTUVWXYZ@^$";
  if (addresses.find(letter) == std::string_view::npos)
    return run_.handle_unknown_word(word, "a word of LinuxCNC");
  if (letter == 'N') return;
  block_.words.put(index, word);
}

void BlockReader::read() {
  cursor_.skip_blanks();
  if (cursor_.current() == '%') {
    ++cursor_.at;
    skip_blanks_and_comments();
    if (!cursor_.at_end()) cursor_.throw_input_error(cursor_.at, "nothing after %");
    block_.is_percent_line = true;
    return;
  }
  if (cursor_.current() == '/') {
    ++cursor_.at;
    block_.deleted = true;
    // A skipped block is not parsed, so that its errors do not matter.
    if (run_.canon.options().block_skip.test(0)) return;
  }
  bool is_first = true;
  for (skip_blanks_and_comments(); !cursor_.at_end(); skip_blanks_and_comments()) {
    if (cursor_.current() == '#')
      read_assignment();
    else
      read_word(is_first);
    is_first = false;
  }
}

void read_block(Cursor cursor, ProgramRun& run, OperandParser& operands, Block& block) {
  block.clear();
  // A NUL is not visible in messages, so its name is reported.
  if (const std::size_t nul = cursor.text.find('\0'); nul != std::string_view::npos)
    cursor.throw_input_error(nul, "text", "a NUL byte");
  BlockReader(cursor, run, operands, block).read();
}

}  // namespace abbe::sim::dialects::linuxcnc
