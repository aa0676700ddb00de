#include "sim/dialects/fanuc/fanuc.h"

namespace abbe::sim::dialects::fanuc {

namespace {

// Checks of operands. Each returns what it expected, for the error message, or null if the operands
// are valid.

const char* expect_nonzero_divisor(double, double b) {
  return zero_if_vacant(b) == 0 ? "a nonzero divisor" : nullptr;
}

// AND, OR, XOR and MOD work on whole numbers of 32 bits.
const char* expect_integers(double a, double b) {
  const auto is_integer = [](double x) { return x == std::floor(x) && std::abs(x) < 2147483648.0; };
  return is_integer(zero_if_vacant(a)) && is_integer(zero_if_vacant(b))
             ? nullptr
             : "32-bit integers on both sides";
}

const char* expect_modulus_operands(double a, double b) {
  const char* expected = expect_nonzero_divisor(a, b);
  return expected != nullptr ? expected : expect_integers(a, b);
}

long long to_bits(double x) { return (long long)(zero_if_vacant(x)); }

// A vacant variable is equal (EQ) only to another one.
bool are_equal(double a, double b) {
  return is_vacant(a) == is_vacant(b) && zero_if_vacant(a) == zero_if_vacant(b);
}

// Precedence levels of custom macro B: multiplication and AND bind most tightly, then addition, OR
// and XOR, then comparisons.
constexpr Operator operators[] = {
    {"*", 3, [](double a, double b) { return zero_if_vacant(a) * zero_if_vacant(b); }},
    {"/", 3, [](double a, double b) { return zero_if_vacant(a) / zero_if_vacant(b); },
     expect_nonzero_divisor},
    {"MOD", 3, [](double a, double b) { return std::fmod(zero_if_vacant(a), zero_if_vacant(b)); },
     expect_modulus_operands},
    {"AND", 3, [](double a, double b) { return double(to_bits(a) & to_bits(b)); }, expect_integers},
    {"+", 2, [](double a, double b) { return zero_if_vacant(a) + zero_if_vacant(b); }},
    {"-", 2, [](double a, double b) { return zero_if_vacant(a) - zero_if_vacant(b); }},
    {"XOR", 2, [](double a, double b) { return double(to_bits(a) ^ to_bits(b)); }, expect_integers},
    {"OR", 2, [](double a, double b) { return double(to_bits(a) | to_bits(b)); }, expect_integers},
    {"EQ", 1, [](double a, double b) { return double(are_equal(a, b)); }},
    {"NE", 1, [](double a, double b) { return double(!are_equal(a, b)); }},
    {"GT", 1, [](double a, double b) { return double(zero_if_vacant(a) > zero_if_vacant(b)); }},
    {"GE", 1, [](double a, double b) { return double(zero_if_vacant(a) >= zero_if_vacant(b)); }},
    {"LT", 1, [](double a, double b) { return double(zero_if_vacant(a) < zero_if_vacant(b)); }},
    {"LE", 1, [](double a, double b) { return double(zero_if_vacant(a) <= zero_if_vacant(b)); }},
};

/// Arc sine in degrees, 270 to 360 for negative arguments and 0 to 90 otherwise, as with parameter
/// 6004.0 (NAT) = 0.
double arc_sine(double x) {
  const double angle = std::asin(x) / units::deg;
  return angle < 0 ? angle + 360.0 : angle;
}

// `Flow::parse_operand` handles ROUND, ATAN and POW, which take several arguments or depend on the
// address.
constexpr Function functions[] = {
    {"ASIN", arc_sine,
     [](double x) { return x < -1 || x > 1 ? "a number from -1 to 1" : nullptr; }},
    {"FIX", [](double x) { return std::trunc(x); }},
    {"FUP", [](double x) { return x < 0 ? std::floor(x) : std::ceil(x); }},
};

}  // namespace

const ExpressionGrammar& grammar() {
  static const ExpressionGrammar macro_grammar{operators, functions,          '[',           ']',
                                               false,     common_functions(), zero_if_vacant};
  return macro_grammar;
}

namespace {

constexpr std::string_view address_letters = "ABCDFGHIJKLMNPQRSTUVWXYZ";
constexpr std::size_t max_arguments = 100;  // bounds the memory for a hostile line

// Splits a block into words and codes.
class BlockReader : public gcode::BlockReader {
 public:
  BlockReader(Cursor& cursor, ProgramRun& run, MacroOperands& operands, Block& block)
      : gcode::BlockReader(cursor, run, block), operands_(operands) {}

  void read() {
    cursor_.skip_blanks();
    // The rest of a line with % is outside of the program.
    block_.is_percent_line = cursor_.current() == '%';
    while (!block_.is_percent_line && skip_to_next_word()) read_word();
  }

 private:
  /// Advances past comments to the next word. Returns false at the end of the block: at the end of
  /// the line, at ; or at a / whose level is skipped. Throws an input error if another block
  /// follows a ;.
  bool skip_to_next_word() {
    collect_comments(cursor_, block_.comments);
    if (cursor_.at_end()) return false;
    if (cursor_.current() == ';') {
      ++cursor_.at;
      collect_comments(cursor_, block_.comments);
      // A second block on a line would have no line number of its own.
      if (!cursor_.at_end())
        cursor_.throw_input_error(cursor_.at, "the next block on a line of its own");
      return false;
    }
    if (cursor_.current() != '/') return true;
    return !run_.skips_block(read_skip_level(cursor_)) && skip_to_next_word();
  }

  void read_word() {
    // ,C and ,R would insert a chamfer or a rounding before the next block.
    if (cursor_.current() == ',')
      cursor_.throw_input_error(cursor_.at,
                                "plain lines and arcs: corners with ,C and ,R are not expanded");
    Word word = read_letter();
    // ROUND[] rounds to the least increment of the address that it follows.
    operands_.resolution = min_increment(word.letter, run_.canon.inch());
    read_number(word, grammar(), operands_);
    // A number with a point or an expression is in full units (mm, degrees); only a bare integer
    // counts increments.
    word.is_in_full_units = word.text.find_first_of(".#[") != std::string_view::npos;
    // The control ignores an address whose value is a vacant variable.
    if (is_vacant(word.value)) return;
    // In tenths: 650 is G65, 660 is G66.
    const int macro_code = block_.tenths(Group::Macro);
    const bool is_macro_call = macro_code == 650 || macro_code == 660;
    if (word.letter == 'G') return store_code(word);
    if (word.letter == 'N')
      return run_.canon.throw_input_error(word, "a sequence number at the start of the block");
    // After G65 and G66 all letters except L and P are arguments of the macro.
    if (is_macro_call && std::string_view("LP").find(word.letter) == std::string_view::npos) {
      if (block_.arguments.size() == max_arguments)
        cursor_.throw_input_error(std::size_t(word.column - 1), "at most 100 arguments");
      block_.arguments.push_back(word);
      return;
    }
    if (word.letter == 'M') return store_code(word);
    if (address_letters.find(word.letter) == std::string_view::npos)
      return run_.handle_unknown_word(word, "a word of Fanuc's milling controls");
    put_word(std::size_t(word.letter - 'A'), word);
  }

  void store_code(const Word& word) {
    const bool is_turning = run_.is_turning();
    const auto* properties =
        find_code(word, is_turning ? "Fanuc's turning controls" : "Fanuc's milling controls",
                  is_turning ? find_lathe_entry : find_entry);
    if (properties == nullptr) return;
    // The last of several G codes of a modal group is in force. Codes of group 00, and M codes
    // other than coolant, may appear only once in a block.
    const Group group = properties->group;
    const bool must_be_unique =
        word.letter == 'M' ? group != Group::Coolant : group == Group::OneShot;
    put_code(word, group, must_be_unique, "only one such code per block");
  }

  MacroOperands& operands_;
};

}  // namespace

int whole_number(const program::Canon& canon, const Word& word, int max) {
  const double rounded = std::round(word.value);
  // A literal must be an integer; a computed value carries rounding errors, so it is rounded.
  const bool is_literal = word.text.find_first_of("#[") == std::string_view::npos;
  if ((is_literal && word.is_in_full_units) || rounded < 0 || rounded > max)
    canon.throw_input_error(word,
                            fmt::format("an integer from 0 to {} without a decimal point", max));
  return int(rounded);
}

double min_increment(char letter, bool inch) {
  // Increment system IS-B. In inches too, rotary axes count in 0.001 degrees.
  return inch && !(letter >= 'A' && letter <= 'C') ? 1e-4 : 1e-3;
}

int read_skip_level(Cursor& cursor) {
  // The level follows directly; / alone is level 1.
  const bool has_level_digit = is_digit(cursor.peek());
  const int level = has_level_digit ? cursor.peek() - '0' : 1;
  cursor.at += has_level_digit ? 2 : 1;
  return level;
}

void collect_comments(Cursor& cursor, std::vector<std::string_view>& comments) {
  for (cursor.skip_blanks(); cursor.current() == '('; cursor.skip_blanks())
    comments.push_back(gcode::read_comment(cursor));
}

void read_block(Cursor cursor, ProgramRun& run, MacroOperands& operands, Block& block) {
  BlockReader(cursor, run, operands, block).read();
}

}  // namespace abbe::sim::dialects::fanuc
