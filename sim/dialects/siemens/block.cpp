#include "sim/dialects/siemens/siemens.h"

namespace abbe::sim::dialects::siemens {

namespace {

// Relative tolerance of == and other comparisons.
constexpr double equality_tolerance = 1e-12;

bool are_equal(double a, double b) {
  return std::abs(a - b) <= equality_tolerance * std::max(std::abs(a), std::abs(b));
}

// Bitwise operators work on 32 bit integers.
const char* require_32_bits(double a, double b) {
  constexpr double limit = 2147483648.0;
  return std::abs(a) < limit && std::abs(b) < limit ? nullptr : "32-bit integers";
}

std::int64_t to_integer(double x) { return std::int64_t(std::trunc(x)); }

// Comparisons bind least tightly, below AND and OR: as on the control, IF A==1 AND B==2 needs
// brackets.
constexpr Operator operators[] = {
    {"*", 9, [](double a, double b) { return a * b; }},
    {"/", 9, [](double a, double b) { return a / b; }, require_nonzero_divisor},
    {"DIV", 9, [](double a, double b) { return std::trunc(a / b); }, require_nonzero_divisor},
    {"MOD", 9, [](double a, double b) { return std::fmod(a, b); }, require_nonzero_divisor},
    {"+", 8, [](double a, double b) { return a + b; }},
    {"-", 8, [](double a, double b) { return a - b; }},
    {"B_AND", 7, [](double a, double b) { return double(to_integer(a) & to_integer(b)); },
     require_32_bits},
    {"B_XOR", 6, [](double a, double b) { return double(to_integer(a) ^ to_integer(b)); },
     require_32_bits},
    {"B_OR", 5, [](double a, double b) { return double(to_integer(a) | to_integer(b)); },
     require_32_bits},
    {"AND", 4, [](double a, double b) { return double(a != 0 && b != 0); }},
    {"XOR", 3, [](double a, double b) { return double((a != 0) != (b != 0)); }},
    {"OR", 2, [](double a, double b) { return double(a != 0 || b != 0); }},
    {"==", 1, [](double a, double b) { return double(are_equal(a, b)); }},
    {"<>", 1, [](double a, double b) { return double(!are_equal(a, b)); }},
    {"<=", 1, [](double a, double b) { return double(a <= b || are_equal(a, b)); }},
    {">=", 1, [](double a, double b) { return double(a >= b || are_equal(a, b)); }},
    {"<", 1, [](double a, double b) { return double(a < b && !are_equal(a, b)); }},
    {">", 1, [](double a, double b) { return double(a > b && !are_equal(a, b)); }},
};

// `Flow::parse_multi_argument_function` handles functions of several numbers.
constexpr Function functions[] = {
    {"POT", [](double x) { return x * x; }},
    {"TRUNC", [](double x) { return std::trunc(x); }},
    {"ROUND", [](double x) { return double(std::round(x)); }},
    {"ROUNDUP", [](double x) { return std::ceil(x); }},
};

/// Returns true if the word at `at` begins like an operator but is longer.
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
  static const ExpressionGrammar siemens_grammar{operators, functions, '(',
                                                 ')',       false,     common_functions()};
  return siemens_grammar;
}

double parse_number(Cursor& cursor, VariableParser& variables) {
  // Operators need no blank after them (DIV2), so the parser would read ORIWKS as OR. Therefore
  // the text is cut before such a word.
  std::size_t end = cursor.text.size();
  for (std::size_t at = cursor.at + 1; at < end; ++at)
    if (is_blank(cursor.text[at - 1]) && is_letter(cursor.text[at]) &&
        is_longer_word(cursor.text, at))
      end = at;
  Cursor expression{cursor.text.substr(0, end), cursor.location, cursor.at};
  const double value = parse_expression(expression, grammar(), variables);
  // Messages quote the expression without the blanks after it.
  while (expression.at > cursor.at && is_blank(expression.text[expression.at - 1])) --expression.at;
  cursor.at = expression.at;
  return value;
}

namespace {

// Bounds the memory of a hostile line.
constexpr std::size_t max_name_bytes = 100;
constexpr std::size_t max_block_bytes = 4096;
constexpr std::size_t max_arguments = 100;

std::optional<Address> find_address(std::string_view name) {
  using enum Address;
  static const std::unordered_map<std::string_view, Address> addresses = {
      {"X", X},   {"Y", Y},       {"Z", Z},      {"A", A},   {"B", B},   {"C", C},   {"U", U},
      {"V", V},   {"W", W},       {"I", I},      {"J", J},   {"K", K},   {"I1", I1}, {"J1", J1},
      {"K1", K1}, {"A3", A3},     {"B3", B3},    {"C3", C3}, {"CR", CR}, {"AR", AR}, {"AP", AP},
      {"RP", RP}, {"TURN", TURN}, {"RPL", RPL},  {"F", F},   {"S", S},   {"T", T},   {"D", D},
      {"P", P},   {"OFFN", OFFN}, {"LIMS", LIMS}};
  const auto entry = addresses.find(name);
  return entry == addresses.end() ? std::nullopt : std::optional(entry->second);
}

/// Advances past a bracket, its content and the closing bracket. Brackets in quoted text do not
/// count.
void skip_brackets(Cursor& cursor, char open, char close) {
  const std::size_t from = cursor.at;
  int depth = 0;
  for (bool is_quoted = false; !cursor.at_end(); ++cursor.at) {
    const char c = cursor.current();
    if (c == '"') is_quoted = !is_quoted;
    if (is_quoted) continue;
    if (c == open) ++depth;
    if (c == close && --depth == 0) {
      ++cursor.at;
      return;
    }
  }
  cursor.throw_input_error(from, fmt::format("{} after {}", close, open), "the end of the line");
}

}  // namespace

bool is_name_char(char c) { return is_letter(c) || is_digit(c) || c == '_'; }

bool is_before_assignment(const Cursor& cursor) {
  Cursor ahead = cursor;
  ahead.skip_blanks();
  return ahead.current() == '=' && ahead.peek() != '=';
}

void Block::clear() {
  values.fill({});
  codes.fill({});
  coolant.clear();
  tool_name.reset();
  spindles.clear();
  code_forbidding_axis_words = {};
  call.reset();
  is_modal = false;
}

std::string parse_name(Cursor& cursor) {
  std::string name;
  const std::size_t from = cursor.at;
  if (!is_letter(cursor.current()) && cursor.current() != '_') return name;
  for (; is_name_char(cursor.current()); ++cursor.at) name += upper(cursor.current());
  if (name.size() > max_name_bytes)
    cursor.throw_input_error(from, "a name of at most 100 letters", "a longer one");
  return name;
}

std::string parse_quoted_text(Cursor& cursor) {
  const std::size_t from = cursor.at++;
  std::string text;
  for (; cursor.current() != '"'; ++cursor.at) {
    if (cursor.at_end())
      cursor.throw_input_error(from, "\" that ends the string on its line", "none");
    text += cursor.current();
  }
  ++cursor.at;
  return text;
}

std::vector<Argument> parse_arguments(Cursor& cursor, VariableParser& variables) {
  std::vector<Argument> arguments;
  const std::size_t open = cursor.at++;
  cursor.skip_blanks();
  if (cursor.current() == ')') {
    ++cursor.at;
    return arguments;
  }
  while (true) {
    const std::size_t from = skip_blanks(cursor);
    Argument argument;
    if (cursor.current() == '"')
      argument.text = parse_quoted_text(cursor);
    else if (auto text = variables.parse_text_variable(cursor))
      argument.text = std::move(text);
    // An empty argument, as in CYCLE83(10,,2), keeps its position.
    else if (cursor.current() != ',' && cursor.current() != ')')
      argument.number = parse_number(cursor, variables);
    argument.cause = cursor.cause(from);
    arguments.push_back(std::move(argument));
    if (arguments.size() > max_arguments)
      cursor.throw_input_error(open, "at most 100 parameters", "more");
    cursor.skip_blanks();
    if (cursor.current() == ')') break;
    if (cursor.current() != ',') cursor.throw_input_error(cursor.at, ", or ) after a parameter");
    ++cursor.at;
  }
  ++cursor.at;
  return arguments;
}

CommentSplit split_comment(std::string_view line) {
  bool is_quoted = false;
  for (std::size_t at = 0; at < line.size(); ++at) {
    // A semicolon inside quotes begins no comment.
    if (line[at] == '"') is_quoted = !is_quoted;
    if (line[at] == ';' && !is_quoted) return {line.substr(0, at), line.substr(at + 1)};
  }
  return {line, std::nullopt};
}

namespace {

// Parser that splits a block into its words.
class SiemensBlockReader {
 public:
  SiemensBlockReader(Cursor& cursor, ProgramRun& run, VariableParser& variables, Block& block)
      : cursor_(cursor), run_(run), variables_(variables), block_(block) {}

  void read() {
    for (cursor_.skip_blanks(); !cursor_.at_end(); cursor_.skip_blanks()) read_word();
  }

 private:
  void read_word() {
    const std::size_t from = cursor_.at;
    if (cursor_.current() == '$')
      cursor_.throw_input_error(from,
                                "words and variables of the program: system data are not writable");
    // Assignments come first, because R1=5 and COUNT=3 are no addresses.
    if (variables_.assign_variable(cursor_)) return;
    const char first = cursor_.current(), second = cursor_.peek();
    if (!is_letter(first) && first != '_')
      cursor_.throw_input_error(from, "a word (letter and number)");
    Cursor ahead = cursor_;
    const std::string name = parse_name(ahead);
    // Before = or [ the whole name is the address; otherwise it may be a letter with a number.
    if (is_before_assignment(ahead) || (name.size() == 1 && ahead.current() == '[')) {
      const std::size_t start = std::exchange(cursor_.at, ahead.at);
      if (read_extended_address(from, name)) return;
      if (is_before_assignment(cursor_)) return read_assigned_word(from, name);
      cursor_.at = start;
    }
    const bool has_number =
        is_digit(second) || second == '+' || second == '-' || second == '.' || is_blank(second);
    // A letter followed by a digit, a sign, a point or a blank is an address with its number.
    if (name.size() == 1 || (first != '_' && is_digit(second))) {
      if (has_number) return read_short_word(from);
      cursor_.throw_input_error(from, fmt::format("a number or = after {}", upper(first)));
    }
    cursor_.at = ahead.at;
    read_long_word(from, name);
  }

  /// Parses a letter and its number without =, for example X10.5 or G1.
  void read_short_word(std::size_t from) {
    const char letter = upper(cursor_.current());
    ++cursor_.at;
    if (letter == 'G' || letter == 'M') return read_code(from, letter);
    // L and a number is the name of a subprogram.
    if (letter == 'L') {
      std::string name = "L";
      for (; is_digit(cursor_.current()); ++cursor_.at) name += cursor_.current();
      if (name.size() > max_name_bytes)
        cursor_.throw_input_error(from, "a name of at most 100 letters", "longer");
      return read_call(from, name);
    }
    const auto number = cursor_.number();
    if (!number) cursor_.throw_input_error(from, fmt::format("a number after {}", letter));
    const auto address = find_address(std::string_view(&letter, 1));
    // H passes a value to the PLC and causes no motion.
    if (letter == 'H') return;
    if (!address) return run_.handle_unknown_word(cursor_.cause(from), "a word of Siemens");
    put_value(from, *address, *number, PositionMode::Modal);
  }

  /// Parses G or M and a number.
  void read_code(std::size_t from, char letter) {
    const auto number = cursor_.number(false);
    if (!number) cursor_.throw_input_error(from, fmt::format("a number after {}", letter));
    const Cause cause = cursor_.cause(from);
    const bool is_code = *number == std::floor(*number) && *number < 10000;
    const WordEntry* entry =
        is_code ? find_entry(fmt::format("{}{}", letter, int(*number))) : nullptr;
    if (entry == nullptr)
      return run_.handle_unknown_word(cause, fmt::format("a {} code of Siemens", letter));
    put_entry(*entry, cause);
  }

  void put_value(std::size_t from, Address address, double value, PositionMode mode) {
    Value& slot = block_.values[std::size_t(address)];
    const Cause cause = cursor_.cause(from);
    if (slot)
      run_.canon.throw_input_error(
          cause, "only one word per address in a block",
          fmt::format("{} after {}", shown(cause.text), shown(slot.cause.text)));
    slot = {value, cause, mode, true};
  }

  void put_entry(const WordEntry& entry, const Cause& cause) {
    if (entry.use == WordTreatment::Refused)
      run_.canon.throw_input_error(cause, std::string(entry.sentence));
    if (entry.word == "MCALL") {
      block_.is_modal = true;
      block_.modal_cause = cause;
      return;
    }
    if (entry.group == Group::None) {
      block_.code_forbidding_axis_words = {entry.word, cause};
      return;
    }
    if (entry.group == Group::WithMotion) {
      // Coolant has no group because M7 and M8 may be in one block.
      if (entry.word == "M7" || entry.word == "M8" || entry.word == "M9")
        block_.coolant.push_back(entry.word);
      return;
    }
    Code& slot = block_.codes[std::size_t(entry.group)];
    if (slot)
      run_.canon.throw_input_error(
          cause, "only one word of a modal group per block",
          fmt::format("{} after {}", shown(cause.text), shown(slot.cause.text)));
    slot = {entry.word, cause};
  }

  /// Parses a word with = after its address.
  void read_assigned_word(std::size_t from, const std::string& name) {
    const auto address = find_address(name);
    const WordEntry* entry = find_entry(name);
    // The value of a word without effect is skipped with the word.
    if (!address && entry != nullptr && entry->use != WordTreatment::Read) {
      skip_value();
      return put_entry(*entry, cursor_.cause(from));
    }
    cursor_.accept("=");
    cursor_.skip_blanks();
    if (name == "M") return put_m_code(from, parse_number(cursor_, variables_));
    if (name == "T") return read_tool(from);
    const auto mode = position_mode();
    const double value =
        mode ? parse_bracketed(cursor_, grammar(), variables_) : parse_number(cursor_, variables_);
    if (name == "H") return;
    // A variable whose definition has an error must not be reported as an unknown address.
    run_.require_certain(name, cursor_.cause(from));
    if (!address) return run_.handle_unknown_word(cursor_.cause(from), "an address or a variable");
    put_value(from, *address, value, mode.value_or(PositionMode::Modal));
  }

  void put_m_code(std::size_t from, double value) {
    const WordEntry* code = find_entry(fmt::format("M{}", value));
    if (code == nullptr)
      return run_.handle_unknown_word(cursor_.cause(from), "an M code of Siemens");
    put_entry(*code, cursor_.cause(from));
  }

  void read_tool(std::size_t from) {
    // T and T="..." are one address.
    if (block_.tool_name || block_[Address::T])
      cursor_.throw_input_error(from, "only one word per address in a block");
    if (cursor_.current() == '"')
      block_.tool_name = parse_quoted_text(cursor_);
    else
      block_.tool_name = variables_.parse_text_variable(cursor_);
    if (block_.tool_name)
      block_.values[std::size_t(Address::T)] = {0.0, cursor_.cause(from), PositionMode::Modal,
                                                true};
    else
      put_value(from, Address::T, parse_number(cursor_, variables_), PositionMode::Modal);
  }

  /// Parses an address with an extension, M1=3 or S[2]=500, from after its name or letter on.
  /// Returns false if it is no such address.
  bool read_extended_address(std::size_t from, const std::string& name) {
    static constexpr std::string_view letters = "MSTHFD";
    if (letters.find(name.front()) == std::string_view::npos) return false;
    const bool has_digits =
        name.size() > 1 && name.size() < 5 && std::all_of(name.begin() + 1, name.end(), is_digit);
    const bool has_index = name.size() == 1 && cursor_.current() == '[';
    if (!has_digits && !has_index) return false;
    double number = 0.0;
    if (has_digits) {
      number = std::stoi(name.substr(1));
    } else {
      const std::size_t open = cursor_.at++;
      number = parse_number(cursor_, variables_);
      if (!cursor_.accept("]")) cursor_.throw_input_error(cursor_.at, "] after a spindle number");
      if (!(number >= 0 && number <= 9999 && number == std::floor(number)))
        cursor_.throw_input_error(open, "an integer from 0 to 9999 as the address extension");
      if (!is_before_assignment(cursor_))
        cursor_.throw_input_error(cursor_.at, "= after an address with an extension");
    }
    cursor_.accept("=");
    cursor_.skip_blanks();
    put_extended_value(from, name.front(), int(number));
    return true;
  }

  /// Handles the value of an address with an extension. Extension 0 is the address without one.
  void put_extended_value(std::size_t from, char letter, int number) {
    if (letter == 'D')
      cursor_.throw_input_error(from, "D without an extension: this control has none");
    if (letter == 'T') {
      if (number > 1)
        cursor_.throw_input_error(from, "T or T1=: there is one tool holder, that of spindle 1");
      return read_tool(from);
    }
    const double value = parse_number(cursor_, variables_);
    const Cause cause = cursor_.cause(from);
    if (letter == 'H') return;
    if (letter == 'F') {
      if (number != 0)
        cursor_.throw_input_error(from,
                                  "F or F0=, the path feed: axes have no feed of their own here");
      return put_value(from, Address::F, value, PositionMode::Modal);
    }
    if (number == 0)
      return letter == 'M' ? put_m_code(from, value)
                           : put_value(from, Address::S, value, PositionMode::Modal);
    if (letter == 'S') return block_.spindles.push_back({number, value, {}, cause});
    // Stops and ends concern the whole program and have no spindle.
    const WordEntry* code = find_entry(fmt::format("M{}", value));
    if (code != nullptr && code->group == Group::Stop)
      cursor_.throw_input_error(
          from,
          fmt::format("{} without an extension: program ends and stops have none", code->word));
    if (code != nullptr && code->group == Group::Spindle)
      return block_.spindles.push_back({number, {}, code->word, cause});
    if (number != 1 && (code == nullptr || code->use != WordTreatment::WithoutEffect))
      cursor_.throw_input_error(from, "only M3, M4 or M5 for a spindle other than 1");
    put_m_code(from, value);
  }

  /// Parses SETMS or SETMS(2).
  void read_setms(std::size_t from) {
    block_.master_spindle = 1;
    cursor_.skip_blanks();
    if (cursor_.current() != '(') return;
    const std::vector<Argument> arguments = parse_arguments(cursor_, variables_);
    if (arguments.empty()) return;
    const double number = arguments[0].number.value_or(0.0);
    if (arguments.size() > 1 || !(number >= 1 && number <= 99 && number == std::floor(number)))
      cursor_.throw_input_error(from, "SETMS or SETMS with a spindle number, 1 to 99");
    block_.master_spindle = int(number);
  }

  /// Parses a word of several letters.
  void read_long_word(std::size_t from, const std::string& name) {
    const WordEntry* entry = find_entry(name);
    if (entry == nullptr) {
      // A bracket [ shows a variable; any other unknown word may be a subprogram.
      if (cursor_.current() == '[') return handle_unknown(from, "a defined variable");
      return read_call(from, name);
    }
    if (entry->use == WordTreatment::Read) {
      // TRAORI may state the number of its transformation; the machine has one.
      if (name == "TRAORI" && cursor_.accept("(")) {
        --cursor_.at;
        const std::vector<Argument> arguments = parse_arguments(cursor_, variables_);
        if (arguments.size() > 1 || (arguments.size() == 1 && arguments[0].number != 1.0))
          cursor_.throw_input_error(from,
                                    "TRAORI or TRAORI(1): the machine has one transformation");
      }
      if (name == "SETMS") read_setms(from);
      return put_entry(*entry, cursor_.cause(from));
    }
    skip_value();
    put_entry(*entry, cursor_.cause(from));
  }

  void read_call(std::size_t from, const std::string& name) {
    ProgramCall call{name, {}, cursor_.cause(from)};
    cursor_.skip_blanks();
    if (cursor_.current() == '(') call.arguments = parse_arguments(cursor_, variables_);
    if (block_.call)
      run_.canon.throw_input_error(call.cause, "only one cycle or subprogram per block");
    block_.call = std::move(call);
  }

  /// Skips what may follow a skipped word: [...], (...), and = with a value.
  void skip_value() {
    if (cursor_.current() == '[') skip_brackets(cursor_, '[', ']');
    cursor_.skip_blanks();
    if (cursor_.current() == '(') skip_brackets(cursor_, '(', ')');
    if (!is_before_assignment(cursor_)) return;
    cursor_.accept("=");
    cursor_.skip_blanks();
    if (cursor_.current() == '"')
      parse_quoted_text(cursor_);
    else if (position_mode())
      skip_brackets(cursor_, '(', ')');
    else
      parse_number(cursor_, variables_);
  }

  /// Handles an unknown word together with everything that belongs to it.
  void handle_unknown(std::size_t from, const std::string& expected) {
    skip_value();
    run_.handle_unknown_word(cursor_.cause(from), expected);
  }

  /// Parses AC, IC, DC, ACP or ACN up to the bracket that follows. Returns nothing if there is
  /// none.
  std::optional<PositionMode> position_mode() {
    static constexpr std::pair<std::string_view, PositionMode> modes[] = {
        {"ACP", PositionMode::Positive},
        {"ACN", PositionMode::Negative},
        {"AC", PositionMode::Absolute},
        {"IC", PositionMode::Incremental},
        {"DC", PositionMode::Shortest}};
    for (const auto& [name, mode] : modes) {
      const std::size_t start = cursor_.at;
      if (!cursor_.accept_word(name)) continue;
      cursor_.skip_blanks();
      if (cursor_.current() == '(') return mode;
      cursor_.at = start;
    }
    return std::nullopt;
  }

  Cursor& cursor_;
  ProgramRun& run_;
  VariableParser& variables_;
  Block& block_;
};

}  // namespace

void read_block(Cursor cursor, ProgramRun& run, VariableParser& variables, Block& block) {
  block.clear();
  if (cursor.text.size() > max_block_bytes)
    cursor.throw_input_error(0, fmt::format("a block of at most {} characters", max_block_bytes),
                             fmt::format("{}", cursor.text.size()));
  // A NUL is not visible in messages, so its name is reported.
  if (const std::size_t nul = cursor.text.find('\0'); nul != std::string_view::npos)
    cursor.throw_input_error(nul, "text", "a NUL byte");
  SiemensBlockReader(cursor, run, variables, block).read();
}

}  // namespace abbe::sim::dialects::siemens
