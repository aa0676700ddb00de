#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

#include "kinematics/units.h"
#include "sim/dialects/siemens_block.h"

namespace abbe::sim::dialects::siemens {
namespace {

constexpr double equal = 1e-12;  // relative: numbers this near are ==

bool same(double a, double b) {
  return std::abs(a - b) <= equal * std::max(std::abs(a), std::abs(b));
}

const char* not_zero(double, double b) { return b == 0 ? "a divisor that is not zero" : nullptr; }

const char* bits_fault(double a, double b) {
  constexpr double most = 2147483648.0;
  return std::abs(a) < most && std::abs(b) < most ? nullptr : "whole numbers of 32 bits";
}

std::int64_t bits(double x) { return std::int64_t(std::trunc(x)); }

// Comparisons bind least, below AND and OR.
constexpr Operator operators[] = {
    {"*", 9, [](double a, double b) { return a * b; }},
    {"/", 9, [](double a, double b) { return a / b; }, not_zero},
    {"DIV", 9, [](double a, double b) { return std::trunc(a / b); }, not_zero},
    {"MOD", 9, [](double a, double b) { return std::fmod(a, b); }, not_zero},
    {"+", 8, [](double a, double b) { return a + b; }},
    {"-", 8, [](double a, double b) { return a - b; }},
    {"B_AND", 7, [](double a, double b) { return double(bits(a) & bits(b)); }, bits_fault},
    {"B_XOR", 6, [](double a, double b) { return double(bits(a) ^ bits(b)); }, bits_fault},
    {"B_OR", 5, [](double a, double b) { return double(bits(a) | bits(b)); }, bits_fault},
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

// The functions of two numbers are read by the operands.
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

/// Where a word of letters begins that only looks as if it began with an operator.
bool is_longer_word(std::string_view text, std::size_t at) {
  static const std::string nowhere;
  for (const std::string_view op : {"DIV", "MOD", "AND", "XOR", "OR"}) {
    Cursor cursor{text, {nowhere, 0}, at};
    if (!cursor.take(op)) continue;
    return is_letter(cursor.here()) || cursor.here() == '_';
  }
  return false;
}

}  // namespace

const ExpressionGrammar& grammar() {
  static constexpr ExpressionGrammar all{operators, functions, '(', ')', false};
  return all;
}

double number_at(Cursor& cursor, Names& names) {
  std::size_t end = cursor.text.size();
  for (std::size_t at = cursor.at + 1; at < end; ++at)
    if (is_blank(cursor.text[at - 1]) && is_letter(cursor.text[at]) &&
        is_longer_word(cursor.text, at))
      end = at;
  Cursor part{cursor.text.substr(0, end), cursor.place, cursor.at};
  const double value = expression(part, grammar(), names);
  while (part.at > cursor.at && is_blank(part.text[part.at - 1])) --part.at;
  cursor.at = part.at;
  return value;
}

}  // namespace abbe::sim::dialects::siemens
