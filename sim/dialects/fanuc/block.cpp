#include "sim/dialects/fanuc/block.h"

#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::sim::dialects::fanuc {

namespace {

/// Returns zero for a vacant variable.
double plain(double x) { return is_vacant(x) ? 0.0 : x; }

const char* not_zero(double, double b) {
  return plain(b) == 0 ? "a divisor that is not zero" : nullptr;
}

// AND, OR, XOR and MOD work on whole numbers of 32 bits.
const char* not_whole(double a, double b) {
  const auto whole = [](double x) { return x == std::floor(x) && std::abs(x) < 2147483648.0; };
  return whole(plain(a)) && whole(plain(b)) ? nullptr : "whole numbers of 32 bits on both sides";
}

const char* no_modulus(double a, double b) {
  const char* zero = not_zero(a, b);
  return zero != nullptr ? zero : not_whole(a, b);
}

long long bits(double x) { return (long long)(plain(x)); }

/// Vacant is EQ only to vacant.
bool equal(double a, double b) { return is_vacant(a) == is_vacant(b) && plain(a) == plain(b); }

// Levels of custom macro B: multiplication and AND first, then addition, OR and XOR, comparisons
// last.
constexpr Operator operators[] = {
    {"*", 3, [](double a, double b) { return plain(a) * plain(b); }},
    {"/", 3, [](double a, double b) { return plain(a) / plain(b); }, not_zero},
    {"MOD", 3, [](double a, double b) { return std::fmod(plain(a), plain(b)); }, no_modulus},
    {"AND", 3, [](double a, double b) { return double(bits(a) & bits(b)); }, not_whole},
    {"+", 2, [](double a, double b) { return plain(a) + plain(b); }},
    {"-", 2, [](double a, double b) { return plain(a) - plain(b); }},
    {"XOR", 2, [](double a, double b) { return double(bits(a) ^ bits(b)); }, not_whole},
    {"OR", 2, [](double a, double b) { return double(bits(a) | bits(b)); }, not_whole},
    {"EQ", 1, [](double a, double b) { return double(equal(a, b)); }},
    {"NE", 1, [](double a, double b) { return double(!equal(a, b)); }},
    {"GT", 1, [](double a, double b) { return double(plain(a) > plain(b)); }},
    {"GE", 1, [](double a, double b) { return double(plain(a) >= plain(b)); }},
    {"LT", 1, [](double a, double b) { return double(plain(a) < plain(b)); }},
    {"LE", 1, [](double a, double b) { return double(plain(a) <= plain(b)); }},
};

const char* beyond_one(double x) { return x < -1 || x > 1 ? "a number within -1 and 1" : nullptr; }

/// Arc sine from 270 over 0 to 90 degrees, as under parameter 6004.0 NAT = 0.
double arc_sine(double x) {
  const double angle = std::asin(plain(x)) / units::deg;
  return angle < 0 ? angle + 360.0 : angle;
}

// ROUND, ATAN and POW take several arguments or depend on the address: Flow::operand parses them.
constexpr Function functions[] = {
    {"ABS", [](double x) { return std::abs(plain(x)); }},
    {"ACOS", [](double x) { return std::acos(plain(x)) / units::deg; }, beyond_one},
    {"ASIN", arc_sine, beyond_one},
    {"COS", [](double x) { return std::cos(plain(x) * units::deg); }},
    {"EXP", [](double x) { return std::exp(plain(x)); }},
    {"FIX", [](double x) { return std::trunc(plain(x)); }},
    {"FUP", [](double x) { return plain(x) < 0 ? std::floor(x) : std::ceil(plain(x)); }},
    {"LN", [](double x) { return std::log(x); },
     [](double x) -> const char* { return plain(x) <= 0 ? "a number above zero" : nullptr; }},
    {"SIN", [](double x) { return std::sin(plain(x) * units::deg); }},
    {"SQRT", [](double x) { return std::sqrt(plain(x)); },
     [](double x) -> const char* {
       return plain(x) < 0 ? "a number that is not below zero" : nullptr;
     }},
    {"TAN", [](double x) { return std::tan(plain(x) * units::deg); }},
};

}  // namespace

const ExpressionGrammar& grammar() {
  static constexpr ExpressionGrammar all{operators, functions, '[', ']', false};
  return all;
}

namespace {

constexpr std::string_view known_letters = "ABCDFGHIJKLMNPQRSTUVWXYZ";
constexpr std::size_t max_words = 100;  // bounds the memory of a hostile line

std::string_view comment_at(Cursor& cursor) {
  const std::size_t open = cursor.at;
  for (++cursor.at; !cursor.at_end(); ++cursor.at)
    if (cursor.here() == ')') return cursor.text.substr(open + 1, cursor.at++ - open - 1);
  cursor.refuse(open, ") that ends the comment on its line", "none");
}

}  // namespace

void Block::clear() {
  words.clear();
  codes.clear();
  percent = false;
  skipped = wordless = {};
  arguments.clear();
  comments.clear();
}

int whole(const program::Canon& canon, const Word& word, int most) {
  const double near = std::round(word.value);
  // A literal must be whole as written; a computed value carries rounding and is rounded.
  const bool written = word.text.find_first_of("#[") == std::string_view::npos;
  if ((written && word.pointed) || near < 0 || near > most)
    canon.refuse(word, fmt::format("a whole number of 0 to {} without a decimal point", most));
  return int(near);
}

double min_increment(char letter, bool inch) {
  // IS-B in inches: rotary axes keep 0.001 degrees.
  return inch && !(letter >= 'A' && letter <= 'C') ? 1e-4 : 1e-3;
}

int skip_level(Cursor& cursor) {
  // /n is a level only if a digit follows directly; a plain / is level 1 on a Fanuc.
  const bool numbered = is_digit(cursor.next());
  const int level = numbered ? cursor.next() - '0' : 1;
  cursor.at += numbered ? 2 : 1;
  return level;
}

void pass_comments(Cursor& cursor, std::vector<std::string_view>& comments) {
  for (cursor.skip_blanks(); cursor.here() == '('; cursor.skip_blanks())
    comments.push_back(comment_at(cursor));
}

// Splits a block into words and codes.
class BlockReader {
 public:
  BlockReader(Cursor& cursor, ProgramRun& run, MacroOperands& operands, Block& block)
      : cursor_(cursor), run_(run), operands_(operands), block_(block) {}

  void fill();

 private:
  bool ends();
  void word();
  void put_code(const Word& word);
  void put_word(const Word& word);

  Cursor& cursor_;
  ProgramRun& run_;
  MacroOperands& operands_;
  Block& block_;
};

/// Returns true at the end of the block: the end of the line, ; with nothing behind it, or / whose
/// level is skipped.
bool BlockReader::ends() {
  pass_comments(cursor_, block_.comments);
  if (cursor_.at_end()) return true;
  if (cursor_.here() == ';') {
    ++cursor_.at;
    pass_comments(cursor_, block_.comments);
    // A second block on a line would be executed without a line number of its own.
    if (!cursor_.at_end()) cursor_.refuse(cursor_.at, "the next block on a line of its own");
    return true;
  }
  if (cursor_.here() != '/') return false;
  return run_.skips(skip_level(cursor_)) || ends();
}

void BlockReader::put_code(const Word& word) {
  // Tenths: G43.4 is 434. The tolerance allows computed codes such as G[#1].
  const double scaled = word.value * 10, tenths = std::round(scaled);
  const bool is_code = tenths >= 0 && tenths < 1e4 && std::abs(scaled - tenths) < 1e-3;
  const int code = is_code ? int(tenths) : -1;
  const CodeEntry& fact =
      run_.turning() ? find_lathe_entry(word.letter, code) : find_entry(word.letter, code);
  if (!fact.known) {
    run_.unknown(word, fmt::format("a {} code of Fanuc's {} controls", word.letter,
                                   run_.turning() ? "turning" : "milling"));
    block_.skipped = word;
    return;
  }
  if (fact.use == Use::Refused) run_.canon.refuse(word, std::string(fact.sentence));
  if (fact.group == Group::None) block_.wordless = word;
  if (fact.group == Group::None || fact.group == Group::Beside) return;
  const Code& place = block_[fact.group];
  // G codes of one modal group may be repeated, the last one counts; M codes may not.
  const bool one = word.letter == 'M' ? fact.group != Group::Coolant : fact.group == Group::OneShot;
  if (place && one)
    run_.canon.refuse(word, "one such code in a block",
                      fmt::format("{} after {}", shown(word.text), shown(place.word.text)));
  block_.codes.put(std::size_t(fact.group), {code, word});
}

void BlockReader::put_word(const Word& word) {
  const Word& place = block_[word.letter];
  if (place)
    run_.canon.refuse(word, std::string("one ") + word.letter + " in a block",
                      fmt::format("{} after {}", shown(word.text), shown(place.text)));
  block_.words.put(std::size_t(word.letter - 'A'), word);
}

void BlockReader::word() {
  const std::size_t from = cursor_.at;
  Word word;
  word.letter = upper(cursor_.here());
  // ,C and ,R insert chamfers and roundings between this block and the next one.
  if (word.letter == ',')
    cursor_.refuse(from, "lines and arcs as they are: ,C and ,R of corners are not expanded");
  if (!is_letter(word.letter))
    cursor_.refuse(from, "a word (letter and number)",
                   word.letter == ')' ? ") without (" : shown(cursor_.cell(from)));
  ++cursor_.at;
  word.column = int(from) + 1;
  cursor_.skip_blanks();
  if (cursor_.at_end())
    cursor_.refuse(from, std::string("a number after ") + word.letter, "the end of the line");
  // ROUND[] rounds to the increment of the address it is written behind.
  operands_.resolution = min_increment(word.letter, run_.canon.inch());
  word.value = value(cursor_, grammar(), operands_);
  word.text = cursor_.text.substr(from, cursor_.at - from);
  word.pointed = word.text.find_first_of(".#[") != std::string_view::npos;
  // An address with a vacant variable is ignored by the control.
  if (is_vacant(word.value)) return;
  const int macro = block_.tenths(Group::Macro);
  const bool calls = macro == 650 || macro == 660;
  if (word.letter == 'G') return put_code(word);
  if (word.letter == 'N') return run_.canon.refuse(word, "a sequence number first in its block");
  // Behind G65 and G66 letters are arguments, except L and P.
  if (calls && std::string_view("LP").find(word.letter) == std::string_view::npos) {
    if (block_.arguments.size() == max_words) cursor_.refuse(from, "at most 100 arguments");
    block_.arguments.push_back(word);
    return;
  }
  if (word.letter == 'M') return put_code(word);
  if (known_letters.find(word.letter) == std::string_view::npos)
    return run_.unknown(word, "a word of Fanuc's milling controls");
  put_word(word);
}

void BlockReader::fill() {
  cursor_.skip_blanks();
  if (cursor_.here() == '%') {
    block_.percent = true;  // what stands behind it is outside of the program
    return;
  }
  while (!ends()) word();
}

void read_block(Cursor cursor, ProgramRun& run, MacroOperands& operands, Block& block) {
  block.clear();
  // A NUL is not visible in messages, so it is reported by name.
  if (const std::size_t nul = cursor.text.find('\0'); nul != std::string_view::npos)
    cursor.refuse(nul, "text", "a NUL byte");
  BlockReader(cursor, run, operands, block).fill();
}

}  // namespace abbe::sim::dialects::fanuc
