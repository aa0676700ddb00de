#include "sim/dialects/linuxcnc/block.h"

#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::sim::dialects::linuxcnc {

namespace {

constexpr double equal = 1e-4;  // tolerance of EQ and NE, TOLERANCE_EQUAL of LinuxCNC

// MOD of RS274 is never negative, unlike std::fmod.
double modulo(double a, double b) {
  const double rest = std::fmod(a, b);
  return rest < 0 ? rest + std::abs(b) : rest;
}

const char* not_zero(double, double b) { return b == 0 ? "a divisor that is not zero" : nullptr; }

const char* power_range_error(double a, double b) {
  if (a < 0 && std::floor(b) != b) return "a whole exponent of a number below zero";
  return a == 0 && b < 0 ? "an exponent of zero that is not below zero" : nullptr;
}

// Levels of RS274/NGC as the README lists them: ** first, logical operators last.
constexpr Operator operators[] = {
    {"**", 6, [](double a, double b) { return std::pow(a, b); }, power_range_error},
    {"*", 5, [](double a, double b) { return a * b; }},
    {"/", 5, [](double a, double b) { return a / b; }, not_zero},
    {"MOD", 5, modulo, not_zero},
    {"+", 4, [](double a, double b) { return a + b; }},
    {"-", 4, [](double a, double b) { return a - b; }},
    {"EQ", 3, [](double a, double b) { return double(std::abs(a - b) < equal); }},
    {"NE", 3, [](double a, double b) { return double(std::abs(a - b) >= equal); }},
    {"GT", 3, [](double a, double b) { return double(a > b); }},
    {"GE", 3, [](double a, double b) { return double(a >= b); }},
    {"LT", 3, [](double a, double b) { return double(a < b); }},
    {"LE", 3, [](double a, double b) { return double(a <= b); }},
    {"AND", 2, [](double a, double b) { return double(a != 0 && b != 0); }},
    {"XOR", 2, [](double a, double b) { return double((a != 0) != (b != 0)); }},
    {"OR", 2, [](double a, double b) { return double(a != 0 || b != 0); }},
};

const char* beyond_one(double x) { return x < -1 || x > 1 ? "a number within -1 and 1" : nullptr; }

// ATAN takes two arguments and is parsed by Flow::operand.
constexpr Function functions[] = {
    {"ABS", [](double x) { return std::abs(x); }},
    {"ACOS", [](double x) { return std::acos(x) / units::deg; }, beyond_one},
    {"ASIN", [](double x) { return std::asin(x) / units::deg; }, beyond_one},
    {"COS", [](double x) { return std::cos(x * units::deg); }},
    {"EXP", [](double x) { return std::exp(x); }},
    {"FIX", [](double x) { return std::floor(x); }},
    {"FUP", [](double x) { return std::ceil(x); }},
    {"LN", [](double x) { return std::log(x); },
     [](double x) -> const char* { return x <= 0 ? "a number above zero" : nullptr; }},
    {"ROUND", [](double x) { return double(std::round(x)); }},  // half away from zero
    {"SIN", [](double x) { return std::sin(x * units::deg); }},
    {"SQRT", [](double x) { return std::sqrt(x); },
     [](double x) -> const char* { return x < 0 ? "a number that is not below zero" : nullptr; }},
    {"TAN", [](double x) { return std::tan(x * units::deg); }},
};

}  // namespace

const ExpressionGrammar& grammar() {
  static constexpr ExpressionGrammar all{operators, functions, '[', ']', true};
  return all;
}

namespace {

// Both limits bound the memory of a hostile line; LinuxCNC allows 50 settings in a block too.
constexpr std::size_t longest_name = 100;
constexpr std::size_t max_settings = 50;  // of parameters in a block

std::string_view comment_at(Cursor& cursor) {
  const std::size_t open = cursor.at;
  for (++cursor.at; !cursor.at_end(); ++cursor.at) {
    if (cursor.current() == ')') return cursor.text.substr(open + 1, cursor.at++ - open - 1);
    if (cursor.current() == '(') cursor.refuse(cursor.at, ") before another ( in a comment", "(");
  }
  cursor.refuse(open, ") that ends the comment on its line", "none");
}

}  // namespace

bool Block::empty() const { return words.empty() && codes.empty(); }

void Block::clear() {
  words.clear();
  codes.clear();
  deleted = percent = false;
  skipped = wordless = {};
  comments.clear();
  numbers.clear();
  names.clear();
}

int whole(const Cursor& cursor, std::size_t from, double value, int most) {
  const double near = std::round(value);
  // An index may be computed; rs274 accepts it within 1e-4 of a whole number.
  if (!(std::abs(value - near) < 1e-4) || near < 0 || near > most)
    cursor.refuse(from, fmt::format("a whole number of 0 to {}", most), fmt::format("{}", value));
  return int(near);
}

std::string name_in_brackets(Cursor& cursor) {
  const std::size_t from = cursor.at;
  std::string name;
  for (++cursor.at; cursor.current() != '>'; ++cursor.at) {
    if (cursor.at_end()) cursor.refuse(from, "> after a name", "the end of the line");
    const char c = cursor.current();
    // Names are compared without blanks and case, as rs274 reads every line.
    if (!is_blank(c)) name += c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c;
    if (name.size() > longest_name) cursor.refuse(from, "a name of at most 100 letters");
  }
  ++cursor.at;
  if (name.empty()) cursor.refuse(from, "a name between < and >");
  return name;
}

class BlockReader {
 public:
  BlockReader(Cursor& cursor, ProgramRun& run, OperandParser& operands, Block& block)
      : cursor_(cursor), run_(run), operands_(operands), block_(block) {}

  void fill();

 private:
  void skip_blanks_and_comments();
  void item(bool first);
  void setting();
  void word(bool first);
  void put_code(char letter, const NcWord& word);

  Cursor& cursor_;
  ProgramRun& run_;
  OperandParser& operands_;
  Block& block_;
};

// A comment behind ; extends to the end of the line.
void BlockReader::skip_blanks_and_comments() {
  for (cursor_.skip_blanks(); !cursor_.at_end(); cursor_.skip_blanks()) {
    if (cursor_.current() == '(') {
      block_.comments.push_back(comment_at(cursor_));
    } else if (cursor_.current() == ';') {
      block_.comments.push_back(cursor_.text.substr(cursor_.at + 1));
      cursor_.at = cursor_.text.size();
    } else {
      return;
    }
  }
}

// Parameters are assigned after the whole block has been read: a block sees the old values.
void BlockReader::setting() {
  const std::size_t from = cursor_.at++;
  cursor_.skip_blanks();
  std::string name;
  int number = 0;
  if (cursor_.current() == '<')
    name = name_in_brackets(cursor_);
  else
    // #1 to #5601 exist.
    number = whole(cursor_, from, parse_value(cursor_, grammar(), operands_), 5601);
  double result = 0.0;
  run_.define(name.empty() ? fmt::format("#{}", number) : fmt::format("#<{}>", name), [&] {
    if (!cursor_.accept("=")) cursor_.refuse(cursor_.at, "= after a parameter that begins a word");
    result = parse_value(cursor_, grammar(), operands_);
  });
  if (block_.numbers.size() + block_.names.size() == max_settings)
    cursor_.refuse(from, "at most 50 parameters set in a block");
  if (name.empty())
    block_.numbers.emplace_back(number, result);
  else
    block_.names.emplace_back(std::move(name), result);
}

// Classifies a code by its tenths: G59.1 is 591.
void BlockReader::put_code(char letter, const NcWord& word) {
  const double scaled = word.value * 10;
  const double tenths = std::round(scaled);
  const bool is_code = tenths >= 0 && tenths < 1e4 && std::abs(scaled - tenths) < 1e-3;
  const int code = is_code ? int(tenths) : -1;
  const CodeProperties& fact = find_entry(letter, code);
  if (!fact.known) {
    run_.handle_unknown_word(word, fmt::format("a {} code of LinuxCNC", letter));
    block_.skipped = word;
    return;
  }
  if (fact.use == Use::Refused) run_.canon.refuse(word, std::string(fact.sentence));
  const Group group = fact.group;
  if (group == Group::None) {
    block_.wordless = word;
    return;
  }
  const Code& place = block_[group];
  // rs274 accepts G80 beside another motion code, and obeys the other one.
  const bool ends_cycle = group == Group::Motion && place && (code == 800) != (place.tenths == 800);
  if (ends_cycle && code == 800) return;
  if (place && !ends_cycle)
    run_.canon.refuse(word, "one code of a modal group in a block",
                      fmt::format("{} after {}", shown(word.text), shown(place.word.text)));
  block_.codes.put(std::size_t(group), {code, word});
}

void BlockReader::word(bool first) {
  const std::size_t from = cursor_.at;
  const char letter = upper(cursor_.current());
  const bool sign = letter == '@' || letter == '^' || letter == '$';
  if (!is_letter(letter) && !sign) {
    const char c = cursor_.current();
    cursor_.refuse(from, "a word (letter and number)",
                   c == ')'   ? ") without ("
                   : c == '[' ? "an expression ([)"
                              : shown(cursor_.text_until_blank(from)));
  }
  ++cursor_.at;
  NcWord word;
  word.column = int(from) + 1;
  cursor_.skip_blanks();
  if (cursor_.at_end())
    cursor_.refuse(from, std::string("a number after ") + letter, "the end of the line");
  word.value = parse_value(cursor_, grammar(), operands_);
  word.text = cursor_.text.substr(from, cursor_.at - from);
  // A line number must be literal: it is not an expression.
  const std::size_t digits = word.text.find_first_not_of(" \t", 1);
  if (letter == 'N' && (digits == std::string_view::npos || !is_digit(word.text[digits])))
    run_.canon.refuse(word, "a line number in digits");
  if (letter == 'G' || letter == 'M') return put_code(letter, word);
  if (letter == 'N' && !first) run_.canon.refuse(word, "a line number first in its block");
  const std::size_t index = letter == '@'   ? 26
                            : letter == '^' ? 27
                            : letter == '$' ? 28
                                            : std::size_t(letter - 'A');
  const NcWord& place = block_.words[index];
  if (place)
    run_.canon.refuse(word, std::string("one ") + letter + " in a block",
                      fmt::format("{} after {}", shown(word.text), shown(place.text)));
  static constexpr std::string_view known = "ABCDEFHIJKLNPQRSTUVWXYZ@^$";
  if (known.find(letter) == std::string_view::npos) return run_.handle_unknown_word(word, "a word of LinuxCNC");
  if (letter == 'N') return;
  block_.words.put(index, word);
}

void BlockReader::fill() {
  cursor_.skip_blanks();
  if (cursor_.current() == '%') {
    ++cursor_.at;
    skip_blanks_and_comments();
    if (!cursor_.at_end()) cursor_.refuse(cursor_.at, "nothing after %");
    block_.percent = true;
    return;
  }
  if (cursor_.current() == '/') {
    ++cursor_.at;
    block_.deleted = true;
    // A skipped block is not parsed, so that errors in it do not matter.
    if (run_.canon.options().block_skip.test(0)) return;
  }
  bool first = true;
  for (skip_blanks_and_comments(); !cursor_.at_end(); skip_blanks_and_comments()) {
    if (cursor_.current() == '#')
      setting();
    else
      word(first);
    first = false;
  }
}

void read_block(Cursor cursor, ProgramRun& run, OperandParser& operands, Block& block) {
  block.clear();
  // A NUL is not visible in messages, so it is reported by name.
  if (const std::size_t nul = cursor.text.find('\0'); nul != std::string_view::npos)
    cursor.refuse(nul, "text", "a NUL byte");
  BlockReader(cursor, run, operands, block).fill();
}

}  // namespace abbe::sim::dialects::linuxcnc
