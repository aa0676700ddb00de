#include "sim/dialects/linuxcnc/linuxcnc.h"

namespace abbe::sim::dialects::linuxcnc {

namespace {

constexpr double equality_tolerance = 1e-4;  // of EQ and NE, TOLERANCE_EQUAL of LinuxCNC

// MOD of RS274 is never negative, unlike std::fmod.
double modulo(double a, double b) {
  const double remainder = std::fmod(a, b);
  return remainder < 0 ? remainder + std::abs(b) : remainder;
}

// Levels of RS274/NGC as the README lists them: ** binds most tightly, logical operators least.
constexpr Operator operators[] = {
    {"**", 6, [](double a, double b) { return std::pow(a, b); }, require_real_power},
    {"*", 5, [](double a, double b) { return a * b; }},
    {"/", 5, [](double a, double b) { return a / b; }, require_nonzero_divisor},
    {"MOD", 5, modulo, require_nonzero_divisor},
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

// `Flow::parse_operand` handles ATAN, which takes two arguments.
constexpr Function functions[] = {
    {"FIX", [](double x) { return std::floor(x); }},
    {"FUP", [](double x) { return std::ceil(x); }},
    {"ROUND", [](double x) { return double(std::round(x)); }},  // half away from zero
};

}  // namespace

const ExpressionGrammar& grammar() {
  static const ExpressionGrammar ngc_grammar{operators, functions, '[',
                                             ']',       true,      common_functions()};
  return ngc_grammar;
}

namespace {

// Both limits bound the memory of a hostile line; LinuxCNC too allows 50 assignments in a block.
constexpr std::size_t max_name_bytes = 100;
constexpr std::size_t max_assignments = 50;

}  // namespace

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

namespace {

// Splits a block into words, codes and assignments.
class BlockReader : public gcode::BlockReader {
 public:
  BlockReader(Cursor& cursor, ProgramRun& run, OperandParser& operands, Block& block)
      : gcode::BlockReader(cursor, run, block), operands_(operands) {}

  void read() {
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
      block_.is_deleted = true;
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

 private:
  // A comment after ; extends to the end of the line.
  void skip_blanks_and_comments() {
    for (cursor_.skip_blanks(); !cursor_.at_end(); cursor_.skip_blanks()) {
      if (cursor_.current() == '(') {
        const std::size_t bracket = cursor_.text.find_first_of("()", cursor_.at + 1);
        if (bracket != std::string_view::npos && cursor_.text[bracket] == '(')
          cursor_.throw_input_error(bracket, ") before another ( in a comment", "(");
        block_.comments.push_back(gcode::read_comment(cursor_));
      } else if (cursor_.current() == ';') {
        block_.comments.push_back(cursor_.text.substr(cursor_.at + 1));
        cursor_.at = cursor_.text.size();
      } else {
        return;
      }
    }
  }

  // The flow executes the assignments after the whole block has been read, so that the block uses
  // the old values.
  void read_assignment() {
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

  void read_word(bool is_first) {
    if (cursor_.current() == '[')
      cursor_.throw_input_error(cursor_.at, "a word (letter and number)", "an expression ([)");
    constexpr std::string_view signs = "@^$";
    Word word = read_letter(signs);
    read_number(word, grammar(), operands_);
    // A line number must be digits, not an expression.
    const std::size_t digits = word.text.find_first_not_of(" \t", 1);
    if (word.letter == 'N' && (digits == std::string_view::npos || !is_digit(word.text[digits])))
      run_.canon.throw_input_error(word, "a line number in digits");
    if (word.letter == 'G' || word.letter == 'M') return store_code(word);
    if (word.letter == 'N' && !is_first)
      run_.canon.throw_input_error(word, "a line number at the start of the block");
    if (word.letter == 'O') return run_.handle_unknown_word(word, "a word of LinuxCNC");
    if (word.letter == 'N') return;
    const std::size_t sign = signs.find(word.letter);
    put_word(sign == std::string_view::npos ? std::size_t(word.letter - 'A') : 26 + sign, word);
  }

  void store_code(const Word& word) {
    const auto* properties = find_code(word, "LinuxCNC", find_entry);
    if (properties == nullptr) return;
    // rs274 accepts G80 with another motion code and executes the other one.
    const Code& previous = block_[properties->group];
    const bool is_end = tenths_of(word) == 800;
    const bool ends_cycle =
        properties->group == Group::Motion && previous && is_end != (previous.tenths == 800);
    if (!ends_cycle || !is_end)
      put_code(word, properties->group, !ends_cycle, "only one code of a modal group per block");
  }

  OperandParser& operands_;
};

}  // namespace

void read_block(Cursor cursor, ProgramRun& run, OperandParser& operands, Block& block) {
  BlockReader(cursor, run, operands, block).read();
}

}  // namespace abbe::sim::dialects::linuxcnc
