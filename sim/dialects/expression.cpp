#include "sim/dialects/expression.h"

#include <cmath>
#include <string>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::sim::dialects {

// Variables of a finished call no longer count towards the limit.
void Variables::leave() {
  count_ -= calls_.back().numbers.size() + calls_.back().names.size();
  calls_.pop_back();
}

std::optional<double> Variables::number(int number, Scope scope) const {
  const auto& numbers = table(scope).numbers;
  const auto entry = numbers.find(number);
  return entry == numbers.end() ? std::nullopt : std::optional(entry->second);
}

std::optional<double> Variables::named(std::string_view name, Scope scope) const {
  const auto& names = table(scope).names;
  const auto entry = names.find(name);
  return entry == names.end() ? std::nullopt : std::optional(entry->second);
}

bool Variables::set(int number, double value, Scope scope) {
  auto& numbers = table(scope).numbers;
  const auto entry = numbers.find(number);
  if (entry != numbers.end()) {
    entry->second = value;
    return true;
  }
  // Only a new variable can exceed the limit; setting an existing one always succeeds.
  if (count_ == max_variables_) return false;
  numbers.emplace(number, value);
  ++count_;
  return true;
}

bool Variables::set(std::string_view name, double value, Scope scope) {
  auto& names = table(scope).names;
  const auto entry = names.find(name);
  if (entry != names.end()) {
    entry->second = value;
    return true;
  }
  if (count_ == max_variables_) return false;
  names.emplace(std::string(name), value);
  ++count_;
  return true;
}

void Variables::unset(int number, Scope scope) { count_ -= table(scope).numbers.erase(number); }

const char* require_nonzero_divisor(double, double right) {
  return right == 0 ? "a nonzero divisor" : nullptr;
}

const char* require_real_power(double base, double exponent) {
  if (base < 0 && std::floor(exponent) != exponent)
    return "an integer exponent for a negative number";
  return base == 0 && exponent < 0 ? "a non-negative exponent for zero" : nullptr;
}

const char* require_positive(double x) { return x <= 0 ? "a number greater than zero" : nullptr; }

namespace {

const char* require_unit_range(double x) {
  return x < -1 || x > 1 ? "a number from -1 to 1" : nullptr;
}

constexpr Function shared_functions[] = {
    {"ABS", [](double x) { return std::abs(x); }},
    {"ACOS", [](double x) { return std::acos(x) / units::deg; }, require_unit_range},
    {"ASIN", [](double x) { return std::asin(x) / units::deg; }, require_unit_range},
    {"COS", [](double x) { return std::cos(x * units::deg); }},
    {"EXP", [](double x) { return std::exp(x); }},
    {"LN", [](double x) { return std::log(x); }, require_positive},
    {"SIN", [](double x) { return std::sin(x * units::deg); }},
    {"SQRT", [](double x) { return std::sqrt(x); },
     [](double x) -> const char* { return x < 0 ? "a non-negative number" : nullptr; }},
    {"TAN", [](double x) { return std::tan(x * units::deg); }},
};

// Returns the operator at the cursor and advances past it, if its level is at least `min_level`.
const Operator* operator_at(Cursor& cursor, const ExpressionGrammar& grammar, int min_level) {
  for (const Operator& binary_operator : grammar.operators) {
    const std::size_t start = cursor.at;
    if (!cursor.accept(binary_operator.text)) continue;
    // An operator of a lower level belongs to an outer call of `parse_operators`; the cursor stays
    // before it.
    if (binary_operator.level >= min_level) return &binary_operator;
    cursor.at = start;
    return nullptr;
  }
  return nullptr;
}

// Returns the result. Throws for infinity and NaN, because no axis can be there.
double require_finite(double result, const Cursor& cursor, std::size_t from) {
  if (!std::isfinite(result)) cursor.throw_input_error(from, "a finite result");
  return result;
}

// Precedence climbing. The right operand is parsed with level + 1, so that operators of equal level
// are evaluated from the left.
double parse_operators(Cursor& cursor, const ExpressionGrammar& grammar, OperandParser& operands,
                       int min_level) {
  double left = parse_value(cursor, grammar, operands);
  while (true) {
    const std::size_t from = skip_blanks(cursor);
    const Operator* binary_operator = operator_at(cursor, grammar, min_level);
    if (binary_operator == nullptr) return left;
    const double right = parse_operators(cursor, grammar, operands, binary_operator->level + 1);
    if (binary_operator->operand_error != nullptr)
      if (const char* expected = binary_operator->operand_error(left, right))
        cursor.throw_input_error(from, expected);
    left = require_finite(binary_operator->apply(left, right), cursor, from);
  }
}

}  // namespace

double apply_function(const Function& function, double argument, const ExpressionGrammar& grammar,
                      const Cursor& cursor, std::size_t from) {
  if (grammar.argument != nullptr) argument = grammar.argument(argument);
  if (function.operand_error != nullptr)
    if (const char* expected = function.operand_error(argument))
      cursor.throw_input_error(from, expected);
  return require_finite(function.apply(argument), cursor, from);
}

std::span<const Function> common_functions() { return shared_functions; }

double parse_value(Cursor& cursor, const ExpressionGrammar& grammar, OperandParser& operands) {
  cursor.skip_blanks();
  // All nesting passes through here: the limit protects the stack from hostile programs.
  const NestingLevel level(cursor.depth);
  if (level.too_deep())
    cursor.throw_input_error(
        cursor.at, fmt::format("at most {} nested brackets, signs and functions", max_nesting),
        "more");
  // A sign directly before digits belongs to the number, so that "-2" needs no level of nesting.
  if (const auto number = cursor.number(true, grammar.blanks_within_numbers)) return *number;
  const char c = cursor.current();
  if (c == '-' || c == '+') {
    ++cursor.at;
    const double inner = parse_value(cursor, grammar, operands);
    return c == '-' ? -inner : inner;
  }
  if (c == grammar.open) return parse_bracketed(cursor, grammar, operands);
  const std::size_t from = cursor.at;
  // The dialect has precedence: its functions of several arguments may share a name with others.
  if (const auto operand = operands.parse_operand(cursor)) return *operand;
  for (const std::span<const Function> functions : {grammar.functions, grammar.common_functions})
    for (const Function& function : functions) {
      const std::size_t start = cursor.at;
      if (!cursor.accept(function.name)) continue;
      cursor.skip_blanks();
      // The name may be the beginning of a longer word, which is not a function call.
      if (cursor.current() == grammar.open)
        return apply_function(function, parse_bracketed(cursor, grammar, operands), grammar, cursor,
                              from);
      cursor.at = start;
    }
  cursor.throw_input_error(cursor.at, "a number");
}

double parse_expression(Cursor& cursor, const ExpressionGrammar& grammar, OperandParser& operands) {
  return parse_operators(cursor, grammar, operands, 0);
}

double parse_bracketed(Cursor& cursor, const ExpressionGrammar& grammar, OperandParser& operands) {
  const std::size_t open = skip_blanks(cursor);
  if (cursor.current() != grammar.open)
    cursor.throw_input_error(open, std::string("an expression in ") + grammar.open + grammar.close);
  ++cursor.at;
  const double inner = parse_expression(cursor, grammar, operands);
  if (next_char(cursor) != grammar.close)
    cursor.throw_input_error(cursor.at, std::string(1, grammar.close) + " or an operator");
  ++cursor.at;
  return inner;
}

}  // namespace abbe::sim::dialects
