#include "sim/dialects/siemens/block.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::sim::dialects::siemens {

namespace {

constexpr double equal = 1e-12;  // relative tolerance of == and other comparisons

bool same(double a, double b) {
  return std::abs(a - b) <= equal * std::max(std::abs(a), std::abs(b));
}

const char* not_zero(double, double b) { return b == 0 ? "a divisor that is not zero" : nullptr; }

// Bitwise operators work on 32 bit integers.
const char* integer_bits_error(double a, double b) {
  constexpr double most = 2147483648.0;
  return std::abs(a) < most && std::abs(b) < most ? nullptr : "whole numbers of 32 bits";
}

std::int64_t bits(double x) { return std::int64_t(std::trunc(x)); }

// Comparisons bind least, below AND and OR, so that IF A==1 AND B==2 needs brackets on the control
// as well.
constexpr Operator operators[] = {
    {"*", 9, [](double a, double b) { return a * b; }},
    {"/", 9, [](double a, double b) { return a / b; }, not_zero},
    {"DIV", 9, [](double a, double b) { return std::trunc(a / b); }, not_zero},
    {"MOD", 9, [](double a, double b) { return std::fmod(a, b); }, not_zero},
    {"+", 8, [](double a, double b) { return a + b; }},
    {"-", 8, [](double a, double b) { return a - b; }},
    {"B_AND", 7, [](double a, double b) { return double(bits(a) & bits(b)); }, integer_bits_error},
    {"B_XOR", 6, [](double a, double b) { return double(bits(a) ^ bits(b)); }, integer_bits_error},
    {"B_OR", 5, [](double a, double b) { return double(bits(a) | bits(b)); }, integer_bits_error},
    {"AND", 4, [](double a, double b) { return double(a != 0 && b != 0); }},
    {"XOR", 3, [](double a, double b) { return double((a != 0) != (b != 0)); }},
    {"OR", 2, [](double a, double b) { return double(a != 0 || b != 0); }},
    {"==", 1, [](double a, double b) { return double(same(a, b)); }},
    {"<>", 1, [](double a, double b) { return double(!same(a, b)); }},
    {"<=", 1, [](double a, double b) { return double(a <= b || same(a, b)); }},
    {">=", 1, [](double a, double b) { return double(a >= b || same(a, b)); }},
    {"<", 1, [](double a, double b) { return double(a < b && !same(a, b)); }},
    {">", 1, [](double a, double b) { return double(a > b && !same(a, b)); }},
};

const char* beyond_unit(double x) { return x < -1 || x > 1 ? "a number within -1 and 1" : nullptr; }

// Functions of two numbers are parsed by Flow::function_of_several.
constexpr Function functions[] = {
    {"SIN", [](double x) { return std::sin(x * units::deg); }},
    {"COS", [](double x) { return std::cos(x * units::deg); }},
    {"TAN", [](double x) { return std::tan(x * units::deg); }},
    {"ASIN", [](double x) { return std::asin(x) / units::deg; }, beyond_unit},
    {"ACOS", [](double x) { return std::acos(x) / units::deg; }, beyond_unit},
    {"SQRT", [](double x) { return std::sqrt(x); },
     [](double x) -> const char* { return x < 0 ? "a number that is not below zero" : nullptr; }},
    {"ABS", [](double x) { return std::abs(x); }},
    {"POT", [](double x) { return x * x; }},
    {"TRUNC", [](double x) { return std::trunc(x); }},
    {"ROUND", [](double x) { return double(std::round(x)); }},
    {"ROUNDUP", [](double x) { return std::ceil(x); }},
    {"LN", [](double x) { return std::log(x); },
     [](double x) -> const char* { return x <= 0 ? "a number above zero" : nullptr; }},
    {"EXP", [](double x) { return std::exp(x); }},
};

/// Returns true if a word at `at` only begins like an operator.
bool is_longer_word(std::string_view text, std::size_t at) {
  static const std::string nowhere;
  for (const std::string_view op : {"DIV", "MOD", "AND", "XOR", "OR"}) {
    Cursor cursor{text, {nowhere, 0}, at};
    if (!cursor.accept(op)) continue;
    return is_letter(cursor.current()) || cursor.current() == '_';
  }
  return false;
}

}  // namespace

const ExpressionGrammar& grammar() {
  static constexpr ExpressionGrammar all{operators, functions, '(', ')', false};
  return all;
}

double number_at(Cursor& cursor, Names& names) {
  // An expression ends before a word such as ORIWKS, which begins like OR. The text is cut there,
  // since operators need no blank behind them (DIV2).
  std::size_t end = cursor.text.size();
  for (std::size_t at = cursor.at + 1; at < end; ++at)
    if (is_blank(cursor.text[at - 1]) && is_letter(cursor.text[at]) &&
        is_longer_word(cursor.text, at))
      end = at;
  Cursor part{cursor.text.substr(0, end), cursor.location, cursor.at};
  const double value = parse_expression(part, grammar(), names);
  // Trailing blanks do not belong to the expression, for messages.
  while (part.at > cursor.at && is_blank(part.text[part.at - 1])) --part.at;
  cursor.at = part.at;
  return value;
}

namespace {

// Limits bound the memory of a hostile line.
constexpr std::size_t longest_name = 100;
constexpr std::size_t longest_block = 4096;
constexpr std::size_t max_arguments = 100;

bool is_name_byte(char c) { return is_letter(c) || is_digit(c) || c == '_'; }

std::optional<Address> find_address(std::string_view name) {
  using enum Address;
  static const std::unordered_map<std::string_view, Address> all = {
      {"X", X},   {"Y", Y},       {"Z", Z},      {"A", A},   {"B", B},   {"C", C},   {"U", U},
      {"V", V},   {"W", W},       {"I", I},      {"J", J},   {"K", K},   {"I1", I1}, {"J1", J1},
      {"K1", K1}, {"A3", A3},     {"B3", B3},    {"C3", C3}, {"CR", CR}, {"AR", AR}, {"AP", AP},
      {"RP", RP}, {"TURN", TURN}, {"RPL", RPL},  {"F", F},   {"S", S},   {"T", T},   {"D", D},
      {"P", P},   {"OFFN", OFFN}, {"LIMS", LIMS}};
  const auto found = all.find(name);
  return found == all.end() ? std::nullopt : std::optional(found->second);
}

/// Advances past a bracket and its counterpart; quoted text is skipped.
void skip_brackets(Cursor& cursor, char open, char close) {
  const std::size_t from = cursor.at;
  int depth = 0;
  for (bool quoted = false; !cursor.at_end(); ++cursor.at) {
    const char c = cursor.current();
    if (c == '"') quoted = !quoted;
    if (quoted) continue;
    if (c == open) ++depth;
    if (c == close && --depth == 0) {
      ++cursor.at;
      return;
    }
  }
  cursor.refuse(from, fmt::format("{} behind {}", close, open), "the end of the line");
}

// A single =; == is a comparison.
bool at_assignment(const Cursor& cursor) {
  Cursor ahead = cursor;
  ahead.skip_blanks();
  return ahead.current() == '=' && ahead.peek() != '=';
}

}  // namespace

void Block::clear() {
  values.fill({});
  codes.fill({});
  coolant.clear();
  tool_name.reset();
  spindles.clear();
  wordless = {};
  call.reset();
  modal = false;
}

std::string name_at(Cursor& cursor) {
  std::string name;
  const std::size_t from = cursor.at;
  if (!is_letter(cursor.current()) && cursor.current() != '_') return name;
  for (; is_name_byte(cursor.current()); ++cursor.at) name += upper(cursor.current());
  if (name.size() > longest_name)
    cursor.refuse(from, "a name of at most 100 letters", "a longer one");
  return name;
}

std::string quoted_at(Cursor& cursor) {
  const std::size_t from = cursor.at++;
  std::string text;
  for (; cursor.current() != '"'; ++cursor.at) {
    if (cursor.at_end()) cursor.refuse(from, "\" that ends the text on its line", "none");
    text += cursor.current();
  }
  ++cursor.at;
  return text;
}

std::vector<Argument> arguments_at(Cursor& cursor, Names& names) {
  std::vector<Argument> all;
  const std::size_t open = cursor.at++;
  cursor.skip_blanks();
  if (cursor.current() == ')') {
    ++cursor.at;
    return all;
  }
  while (true) {
    cursor.skip_blanks();
    const std::size_t from = cursor.at;
    Argument one;
    if (cursor.current() == '"')
      one.text = quoted_at(cursor);
    else if (auto text = names.text_variable(cursor))
      one.text = std::move(text);
    // An empty argument, as in CYCLE83(10,,2), keeps its position.
    else if (cursor.current() != ',' && cursor.current() != ')')
      one.number = number_at(cursor, names);
    one.cause = cursor.cause(from);
    all.push_back(std::move(one));
    if (all.size() > max_arguments) cursor.refuse(open, "at most 100 parameters", "more");
    cursor.skip_blanks();
    if (cursor.current() == ')') break;
    if (cursor.current() != ',') cursor.refuse(cursor.at, ", or ) behind a parameter");
    ++cursor.at;
  }
  ++cursor.at;
  return all;
}

CommentSplit split_comment(std::string_view line) {
  bool quoted = false;
  for (std::size_t at = 0; at < line.size(); ++at) {
    // A ; inside quotes is no comment.
    if (line[at] == '"') quoted = !quoted;
    if (line[at] == ';' && !quoted) return {line.substr(0, at), line.substr(at + 1)};
  }
  return {line, std::nullopt};
}

namespace {

class SiemensBlockReader {
 public:
  SiemensBlockReader(Cursor& cursor, ProgramRun& run, Names& names, Block& block)
      : cursor_(cursor), run_(run), names_(names), block_(block) {}

  void fill() {
    for (cursor_.skip_blanks(); !cursor_.at_end(); cursor_.skip_blanks()) word();
  }

 private:
  void word();
  void short_word(std::size_t from);
  void code(std::size_t from, char letter);
  void put(std::size_t from, Address address, double value, Measure measure);
  void put_entry(const WordEntry& fact, const Cause& cause);
  void assigned(std::size_t from, const std::string& name);
  void m_code(std::size_t from, double value);
  void tool(std::size_t from);
  bool extended(std::size_t from, const std::string& name);
  void extended_value(std::size_t from, char letter, int number);
  void master(std::size_t from);
  void long_word(std::size_t from, const std::string& name);
  void call(std::size_t from, const std::string& name);
  void skip_value();
  void unknown(std::size_t from, const std::string& expected);
  std::optional<Measure> measure();

  Cursor& cursor_;
  ProgramRun& run_;
  Names& names_;
  Block& block_;
};

/// Skips an unknown word with everything that belongs to it.
void SiemensBlockReader::unknown(std::size_t from, const std::string& expected) {
  skip_value();
  run_.handle_unknown_word(cursor_.cause(from), expected);
}

/// Skips what may follow a skipped word: [...], (...), = and a value.
void SiemensBlockReader::skip_value() {
  if (cursor_.current() == '[') skip_brackets(cursor_, '[', ']');
  cursor_.skip_blanks();
  if (cursor_.current() == '(') skip_brackets(cursor_, '(', ')');
  if (!at_assignment(cursor_)) return;
  cursor_.accept("=");
  cursor_.skip_blanks();
  if (cursor_.current() == '"')
    quoted_at(cursor_);
  else if (measure())
    skip_brackets(cursor_, '(', ')');
  else
    number_at(cursor_, names_);
}

/// Returns AC, IC, DC, ACP or ACN if a bracket follows, at which the cursor then stands.
std::optional<Measure> SiemensBlockReader::measure() {
  static constexpr std::pair<std::string_view, Measure> all[] = {{"ACP", Measure::Upwards},
                                                                 {"ACN", Measure::Downwards},
                                                                 {"AC", Measure::Absolute},
                                                                 {"IC", Measure::Step},
                                                                 {"DC", Measure::Shortest}};
  for (const auto& [name, one] : all) {
    const std::size_t before = cursor_.at;
    if (!cursor_.accept_word(name)) continue;
    cursor_.skip_blanks();
    if (cursor_.current() == '(') return one;
    cursor_.at = before;
  }
  return std::nullopt;
}

void SiemensBlockReader::put(std::size_t from, Address address, double value, Measure measure) {
  Value& place = block_.values[std::size_t(address)];
  const Cause cause = cursor_.cause(from);
  if (place)
    run_.canon.refuse(cause, "one word of an address in a block",
                      fmt::format("{} after {}", shown(cause.text), shown(place.cause.text)));
  place = {value, cause, measure, true};
}

void SiemensBlockReader::put_entry(const WordEntry& fact, const Cause& cause) {
  if (fact.use == Use::Refused) run_.canon.refuse(cause, std::string(fact.sentence));
  if (fact.word == "MCALL") {
    block_.modal = true;
    block_.modal_cause = cause;
    return;
  }
  if (fact.group == Group::None) {
    block_.wordless = {fact.word, cause};
    return;
  }
  if (fact.group == Group::Beside) {
    // Coolant has no group: M7 and M8 may stand in one block.
    if (fact.word == "M7" || fact.word == "M8" || fact.word == "M9")
      block_.coolant.push_back(fact.word);
    return;
  }
  Code& place = block_.codes[std::size_t(fact.group)];
  if (place)
    run_.canon.refuse(cause, "one word of a modal group in a block",
                      fmt::format("{} after {}", shown(cause.text), shown(place.cause.text)));
  place = {fact.word, cause};
}

/// Parses G or M and a number.
void SiemensBlockReader::code(std::size_t from, char letter) {
  const auto number = cursor_.number(false);
  if (!number) cursor_.refuse(from, fmt::format("a number after {}", letter));
  const Cause cause = cursor_.cause(from);
  const bool is_code = *number == std::floor(*number) && *number < 10000;
  const WordEntry* fact = is_code ? find_entry(fmt::format("{}{}", letter, int(*number))) : nullptr;
  if (fact == nullptr) return run_.handle_unknown_word(cause, fmt::format("a {} code of Siemens", letter));
  put_entry(*fact, cause);
}

/// Parses a letter and its number without =, for example X10.5 or G1.
void SiemensBlockReader::short_word(std::size_t from) {
  const char letter = upper(cursor_.current());
  ++cursor_.at;
  if (letter == 'G' || letter == 'M') return code(from, letter);
  // L and a number is the name of a subprogram.
  if (letter == 'L') {
    std::string name = "L";
    for (; is_digit(cursor_.current()); ++cursor_.at) name += cursor_.current();
    if (name.size() > longest_name) cursor_.refuse(from, "a name of at most 100 letters", "longer");
    return call(from, name);
  }
  const auto number = cursor_.number();
  if (!number) cursor_.refuse(from, fmt::format("a number after {}", letter));
  const auto address = find_address(std::string_view(&letter, 1));
  // H passes values to the PLC and moves nothing.
  if (letter == 'H') return;
  if (!address) return run_.handle_unknown_word(cursor_.cause(from), "a word of Siemens");
  put(from, *address, *number, Measure::Modal);
}

void SiemensBlockReader::tool(std::size_t from) {
  // T and T="..." are one address.
  if (block_.tool_name || block_[Address::T])
    cursor_.refuse(from, "one word of an address in a block");
  if (cursor_.current() == '"')
    block_.tool_name = quoted_at(cursor_);
  else
    block_.tool_name = names_.text_variable(cursor_);
  if (block_.tool_name)
    block_.values[std::size_t(Address::T)] = {0.0, cursor_.cause(from), Measure::Modal, true};
  else
    put(from, Address::T, number_at(cursor_, names_), Measure::Modal);
}

void SiemensBlockReader::m_code(std::size_t from, double value) {
  const WordEntry* code = find_entry(fmt::format("M{}", value));
  if (code == nullptr) return run_.handle_unknown_word(cursor_.cause(from), "an M code of Siemens");
  put_entry(*code, cursor_.cause(from));
}

/// Parses an address with an extension, M1=3 or S[2]=500, whose name or letter has been read.
/// Returns false if there is none.
bool SiemensBlockReader::extended(std::size_t from, const std::string& name) {
  static constexpr std::string_view letters = "MSTHFD";
  if (letters.find(name.front()) == std::string_view::npos) return false;
  const bool digits =
      name.size() > 1 && name.size() < 5 && std::all_of(name.begin() + 1, name.end(), is_digit);
  const bool index = name.size() == 1 && cursor_.current() == '[';
  if (!digits && !index) return false;
  double number = 0.0;
  if (digits) {
    number = std::stoi(name.substr(1));
  } else {
    const std::size_t open = cursor_.at++;
    number = number_at(cursor_, names_);
    if (!cursor_.accept("]")) cursor_.refuse(cursor_.at, "] behind the number of a spindle");
    if (!(number >= 0 && number <= 9999 && number == std::floor(number)))
      cursor_.refuse(open, "a whole number of 0 to 9999 as the extension of an address");
    if (!at_assignment(cursor_))
      cursor_.refuse(cursor_.at, "= behind an address with an extension");
  }
  cursor_.accept("=");
  cursor_.skip_blanks();
  extended_value(from, name.front(), int(number));
  return true;
}

/// Handles the value of such an address. Extension 0 is the address without extension.
void SiemensBlockReader::extended_value(std::size_t from, char letter, int number) {
  if (letter == 'D') cursor_.refuse(from, "D without an extension: it has none on this control");
  if (letter == 'T') {
    if (number > 1) cursor_.refuse(from, "T or T1=: there is one tool holder, that of spindle 1");
    return tool(from);
  }
  const double value = number_at(cursor_, names_);
  const Cause cause = cursor_.cause(from);
  if (letter == 'H') return;
  if (letter == 'F') {
    if (number != 0)
      cursor_.refuse(from, "F or F0=, the feed of the path: axes have no feed of their own here");
    return put(from, Address::F, value, Measure::Modal);
  }
  if (number == 0)
    return letter == 'M' ? m_code(from, value) : put(from, Address::S, value, Measure::Modal);
  if (letter == 'S') return block_.spindles.push_back({number, value, {}, cause});
  // Stops and ends concern the whole program and have no spindle.
  const WordEntry* code = find_entry(fmt::format("M{}", value));
  if (code != nullptr && code->group == Group::Stop)
    cursor_.refuse(
        from, fmt::format("{} without an extension, which ends and stops have not", code->word));
  if (code != nullptr && code->group == Group::Spindle)
    return block_.spindles.push_back({number, {}, code->word, cause});
  if (number != 1 && (code == nullptr || code->use != Use::WithoutEffect))
    cursor_.refuse(from, "M3, M4 or M5 of another spindle");
  m_code(from, value);
}

/// Parses SETMS or SETMS(2).
void SiemensBlockReader::master(std::size_t from) {
  block_.master = 1;
  cursor_.skip_blanks();
  if (cursor_.current() != '(') return;
  const std::vector<Argument> which = arguments_at(cursor_, names_);
  if (which.empty()) return;
  const double number = which[0].number.value_or(0.0);
  if (which.size() > 1 || !(number >= 1 && number <= 99 && number == std::floor(number)))
    cursor_.refuse(from, "SETMS or SETMS with the number of a spindle, 1 to 99");
  block_.master = int(number);
}

/// Parses a word with = behind its address.
void SiemensBlockReader::assigned(std::size_t from, const std::string& name) {
  const auto address = find_address(name);
  const WordEntry* fact = find_entry(name);
  // A word without effect keeps its value to itself.
  if (!address && fact != nullptr && fact->use != Use::Read) {
    skip_value();
    return put_entry(*fact, cursor_.cause(from));
  }
  cursor_.accept("=");
  cursor_.skip_blanks();
  if (name == "M") return m_code(from, number_at(cursor_, names_));
  if (name == "T") return tool(from);
  const auto how = measure();
  const double value = how ? parse_bracketed(cursor_, grammar(), names_) : number_at(cursor_, names_);
  if (name == "H") return;
  // A variable whose definition has an error must not be reported as an unknown address.
  run_.require_certain(name, cursor_.cause(from));
  if (!address) return run_.handle_unknown_word(cursor_.cause(from), "an address or a variable");
  put(from, *address, value, how.value_or(Measure::Modal));
}

void SiemensBlockReader::call(std::size_t from, const std::string& name) {
  ProgramCall call{name, {}, false, cursor_.cause(from)};
  cursor_.skip_blanks();
  if (cursor_.current() == '(') {
    call.arguments = arguments_at(cursor_, names_);
    call.in_brackets = true;
  }
  if (block_.call) run_.canon.refuse(call.cause, "one cycle or subprogram in a block");
  block_.call = std::move(call);
}

/// Parses a word of several letters.
void SiemensBlockReader::long_word(std::size_t from, const std::string& name) {
  const WordEntry* fact = find_entry(name);
  if (fact == nullptr) {
    // A bracket [ shows a variable; any other unknown word may be a subprogram.
    if (cursor_.current() == '[') return unknown(from, "a variable that is defined");
    return call(from, name);
  }
  if (fact->use == Use::Read) {
    // TRAORI may state the number of its transformation; the machine has one.
    if (name == "TRAORI" && cursor_.accept("(")) {
      --cursor_.at;
      const std::vector<Argument> which = arguments_at(cursor_, names_);
      if (which.size() > 1 || (which.size() == 1 && which[0].number != 1.0))
        cursor_.refuse(from, "TRAORI or TRAORI(1): the machine has one transformation");
    }
    if (name == "SETMS") master(from);
    return put_entry(*fact, cursor_.cause(from));
  }
  skip_value();
  put_entry(*fact, cursor_.cause(from));
}

void SiemensBlockReader::word() {
  const std::size_t from = cursor_.at;
  if (cursor_.current() == '$')
    cursor_.refuse(from, "words and variables of the program: system data are not written");
  // Assignments come first: R1=5 and COUNT=3 are no addresses.
  if (names_.set_variable(cursor_)) return;
  const char first = cursor_.current(), second = cursor_.peek();
  if (!is_letter(first) && first != '_') cursor_.refuse(from, "a word (letter and number)");
  Cursor ahead = cursor_;
  const std::string name = name_at(ahead);
  // With = or [ the whole name is the address, without them a letter is enough.
  if (at_assignment(ahead) || (name.size() == 1 && ahead.current() == '[')) {
    const std::size_t before = std::exchange(cursor_.at, ahead.at);
    if (extended(from, name)) return;
    if (at_assignment(cursor_)) return assigned(from, name);
    cursor_.at = before;
  }
  const bool has_number =
      is_digit(second) || second == '+' || second == '-' || second == '.' || is_blank(second);
  // A letter followed by a digit, a sign, a point or a blank is an address with its number.
  if (name.size() == 1 || (first != '_' && is_digit(second))) {
    if (has_number) return short_word(from);
    cursor_.refuse(from, fmt::format("a number or = after {}", upper(first)));
  }
  cursor_.at = ahead.at;
  long_word(from, name);
}

}  // namespace

void read_block(Cursor cursor, ProgramRun& run, Names& names, Block& block) {
  block.clear();
  if (cursor.text.size() > longest_block)
    cursor.refuse(0, fmt::format("a block of at most {} characters", longest_block),
                  fmt::format("{}", cursor.text.size()));
  // A NUL is not visible in messages, so it is reported by name.
  if (const std::size_t nul = cursor.text.find('\0'); nul != std::string_view::npos)
    cursor.refuse(nul, "text", "a NUL byte");
  SiemensBlockReader(cursor, run, names, block).fill();
}

}  // namespace abbe::sim::dialects::siemens
