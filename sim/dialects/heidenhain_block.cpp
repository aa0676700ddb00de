#include "sim/dialects/heidenhain_block.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"

namespace abbe::sim::dialects::heidenhain {
namespace {

constexpr std::size_t most_joined = 1000;  // lines of one block

struct Taken {
  std::size_t from = 0, to = 0;  ///< bytes of the line without comment and ~
  std::size_t comment = std::string_view::npos;
  bool goes_on = false;
};

/// What of a line is words. A ~ at its end stands behind the comment.
Taken words_of(std::string_view line) {
  Taken taken;
  std::size_t end = line.size();
  while (end > 0 && is_blank(line[end - 1])) --end;
  taken.goes_on = end > 0 && line[end - 1] == '~';
  if (taken.goes_on) --end;
  bool quoted = false;
  for (std::size_t i = 0; i < end; ++i) {
    if (line[i] == '"') quoted = !quoted;
    if (line[i] != ';' || quoted) continue;
    taken.comment = i + 1;
    end = i;
    break;
  }
  taken.to = end;
  return taken;
}

/// Behind the number of the block, and / if it has one.
std::size_t behind_number(std::string_view line, bool& skipped) {
  std::size_t at = 0;
  const auto blanks = [&] {
    while (at < line.size() && is_blank(line[at])) ++at;
  };
  blanks();
  if (at < line.size() && line[at] == '/') skipped = true, ++at;
  blanks();
  const std::size_t digits = at;
  while (at < line.size() && is_digit(line[at])) ++at;
  if (at > digits && at < line.size() && !is_blank(line[at]) && line[at] != '/' &&
      line[at] != '*' && line[at] != ';')
    at = digits;  // no number of a block
  blanks();
  if (at < line.size() && line[at] == '/') skipped = true, ++at;
  return at;
}

double modulo(double a, double b) { return std::fmod(a, b); }

const char* zero_fault(double, double b) { return b == 0 ? "a divisor that is not zero" : nullptr; }

const char* power_fault(double a, double b) {
  if (a < 0 && std::floor(b) != b) return "a whole exponent of a number below zero";
  return a == 0 && b < 0 ? "an exponent of zero that is not below zero" : nullptr;
}

constexpr Operator operators[] = {
    {"^", 3, [](double a, double b) { return std::pow(a, b); }, power_fault},
    {"*", 2, [](double a, double b) { return a * b; }},
    {"/", 2, [](double a, double b) { return a / b; }, zero_fault},
    {"%", 2, modulo, zero_fault},
    {"+", 1, [](double a, double b) { return a + b; }},
    {"-", 1, [](double a, double b) { return a - b; }},
};

const char* beyond_one(double x) { return x < -1 || x > 1 ? "a number within -1 and 1" : nullptr; }
const char* not_positive(double x) { return x <= 0 ? "a number above zero" : nullptr; }

constexpr Function functions[] = {
    {"SQRT", [](double x) { return std::sqrt(x); },
     [](double x) -> const char* { return x < 0 ? "a number that is not below zero" : nullptr; }},
    {"SQ", [](double x) { return x * x; }},
    {"SIN", [](double x) { return std::sin(x * units::deg); }},
    {"COS", [](double x) { return std::cos(x * units::deg); }},
    {"TAN", [](double x) { return std::tan(x * units::deg); }},
    {"ASIN", [](double x) { return std::asin(x) / units::deg; }, beyond_one},
    {"ACOS", [](double x) { return std::acos(x) / units::deg; }, beyond_one},
    {"ATAN", [](double x) { return std::atan(x) / units::deg; }},
    {"EXP", [](double x) { return std::exp(x); }},
    {"LN", [](double x) { return std::log(x); }, not_positive},
    {"LOG", [](double x) { return std::log10(x); }, not_positive},
    {"NEG", [](double x) { return -x; }},
    {"INT", [](double x) { return std::trunc(x); }},
    {"ABS", [](double x) { return std::abs(x); }},
    {"FRAC", [](double x) { return x - std::trunc(x); }},
    {"SGN", [](double x) { return double((x > 0) - (x < 0)); }},
};

}  // namespace

const ExpressionGrammar& grammar() {
  static constexpr ExpressionGrammar all{operators, {}, '(', ')', false};
  return all;
}

std::optional<double> function_value(Cursor& cursor, Operands& parameters) {
  const std::size_t from = cursor.at;
  if (cursor.take_word("PI")) return pi;
  for (const Function& function : functions) {
    if (!cursor.take_word(function.name)) continue;
    const double argument = value(cursor, grammar(), parameters);
    if (function.fault != nullptr)
      if (const char* wanted = function.fault(argument)) cursor.refuse(from, wanted);
    const double result = function.apply(argument);
    if (!std::isfinite(result)) cursor.refuse(from, "a result that is a finite number");
    return result;
  }
  return std::nullopt;
}

void read_block(const std::vector<std::string_view>& lines, std::size_t at, Block& block) {
  block.skipped = false;
  block.comment = {};
  block.pieces.clear();
  block.lines = 1;
  const std::string_view line = lines[at];
  const std::size_t begin = behind_number(line, block.skipped);
  Taken taken = words_of(line);
  std::size_t first = begin;
  while (first < taken.to && is_blank(line[first])) ++first;
  if (first < line.size() && line[first] == '*') {
    block.comment = line.substr(first + 1);
    block.text = {};
    return;
  }
  if (first >= taken.to && taken.comment != std::string_view::npos)
    block.comment = line.substr(taken.comment);
  if (!taken.goes_on) {
    block.text = line.substr(0, std::max(taken.to, begin));
    block.pieces.push_back({begin, int(at) + 1, int(begin)});
    return;
  }
  block.joined.clear();
  std::size_t from = begin;
  for (std::size_t i = at;; ++i) {
    const std::string_view text = lines[i];
    block.pieces.push_back({block.joined.size(), int(i) + 1, int(from)});
    block.joined += text.substr(from, taken.to > from ? taken.to - from : 0);
    block.lines = i - at + 1;
    if (!taken.goes_on || i + 1 >= lines.size() || block.lines == most_joined) break;
    block.joined += ' ';
    taken = words_of(lines[i + 1]);
    from = 0;
  }
  block.text = block.joined;
}

BadInput placed_in(const Block& block, const BadInput& fault) {
  if (block.lines == 1 || fault.column < 1) return fault;
  const std::size_t offset = std::size_t(fault.column - 1);
  const Block::Piece* piece = &block.pieces.front();
  for (const Block::Piece& one : block.pieces)
    if (one.offset <= offset) piece = &one;
  return {fault.file, piece->line, int(offset - piece->offset) + piece->column + 1, fault.expected,
          fault.seen};
}

std::string Words::name() {
  cursor.skip_blanks();
  std::string letters;
  while (is_letter(cursor.here())) letters += upper(cursor.text[cursor.at++]);
  if (!is_digit(cursor.here())) return letters;
  for (const std::string_view parameter : {"Q", "QL", "QR", "QS"})
    if (letters.size() > parameter.size() && letters.ends_with(parameter)) {
      letters.resize(letters.size() - parameter.size());
      cursor.at -= parameter.size();
      break;
    }
  return letters;
}

bool Words::has_value() const {
  Cursor ahead = cursor;
  ahead.skip_blanks();
  while (ahead.here() == '+' || ahead.here() == '-') ++ahead.at;
  return is_digit(ahead.here()) || ahead.here() == '.' || upper(ahead.here()) == 'Q';
}

double Words::value() {
  cursor.skip_blanks();
  if (!has_value()) cursor.refuse(cursor.at, "a number or a Q parameter");
  return dialects::value(cursor, grammar(), parameters_);
}

int Words::whole(int most) {
  cursor.skip_blanks();
  const std::size_t from = cursor.at;
  const double number = value();
  if (number < 0 || number > most || number != std::floor(number))
    cursor.refuse(from, fmt::format("a whole number of 0 to {}", most));
  return int(number);
}

std::string Words::label() {
  cursor.skip_blanks();
  const std::size_t from = cursor.at;
  if (cursor.here() != '"') return fmt::format("{}", whole(65535));
  const std::size_t end = cursor.text.find('"', from + 1);
  if (end == std::string_view::npos || end == from + 1 || end - from > 33)
    cursor.refuse(from, "a name of 1 to 32 characters in quotes");
  cursor.at = end + 1;
  return std::string(cursor.text.substr(from, end + 1 - from));
}

void Words::ends() {
  if (!at_end()) cursor.refuse(cursor.at, "nothing more in the block");
}

}  // namespace abbe::sim::dialects::heidenhain
