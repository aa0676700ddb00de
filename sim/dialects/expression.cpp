#include "sim/dialects/expression.h"

#include <cmath>
#include <string>

#include <fmt/format.h>

#include "kinematics/nesting.h"

namespace abbe::sim::dialects {
namespace {

const Operator* operator_at(Cursor& cursor, const ExpressionGrammar& grammar, int least_level) {
  for (const Operator& one : grammar.operators) {
    const std::size_t before = cursor.at;
    if (!cursor.take(one.text)) continue;
    if (one.level >= least_level) return &one;
    cursor.at = before;
    return nullptr;
  }
  return nullptr;
}

double checked(double result, const Cursor& cursor, std::size_t from) {
  if (!std::isfinite(result)) cursor.refuse(from, "a result that is a finite number");
  return result;
}

double climb(Cursor& cursor, const ExpressionGrammar& grammar, Operands& operands,
             int least_level) {
  double left = value(cursor, grammar, operands);
  while (true) {
    cursor.skip_blanks();
    const std::size_t from = cursor.at;
    const Operator* one = operator_at(cursor, grammar, least_level);
    if (one == nullptr) return left;
    const double right = climb(cursor, grammar, operands, one->level + 1);
    if (one->fault != nullptr)
      if (const char* wanted = one->fault(left, right)) cursor.refuse(from, wanted);
    left = checked(one->apply(left, right), cursor, from);
  }
}

}  // namespace

double value(Cursor& cursor, const ExpressionGrammar& grammar, Operands& operands) {
  cursor.skip_blanks();
  const NestingLevel level(cursor.depth);
  if (level.too_deep())
    cursor.refuse(
        cursor.at,
        fmt::format("at most {} brackets, signs and functions within each other", max_nesting),
        "more");
  if (const auto number = cursor.number(true, grammar.blanks_within_numbers)) return *number;
  const char c = cursor.here();
  if (c == '-' || c == '+') {
    ++cursor.at;
    const double inner = value(cursor, grammar, operands);
    return c == '-' ? -inner : inner;
  }
  if (c == grammar.open) return bracketed(cursor, grammar, operands);
  const std::size_t from = cursor.at;
  if (const auto own = operands.operand(cursor)) return *own;
  for (const Function& function : grammar.functions) {
    const std::size_t before = cursor.at;
    if (!cursor.take(function.name)) continue;
    cursor.skip_blanks();
    if (cursor.here() != grammar.open) {
      cursor.at = before;
      continue;
    }
    const double argument = bracketed(cursor, grammar, operands);
    if (function.fault != nullptr)
      if (const char* wanted = function.fault(argument)) cursor.refuse(from, wanted);
    return checked(function.apply(argument), cursor, from);
  }
  cursor.refuse(cursor.at, "a number");
}

double expression(Cursor& cursor, const ExpressionGrammar& grammar, Operands& operands) {
  return climb(cursor, grammar, operands, 0);
}

double bracketed(Cursor& cursor, const ExpressionGrammar& grammar, Operands& operands) {
  cursor.skip_blanks();
  const std::size_t open = cursor.at;
  if (cursor.here() != grammar.open)
    cursor.refuse(open, std::string("an expression in ") + grammar.open + grammar.close);
  ++cursor.at;
  const double inner = expression(cursor, grammar, operands);
  cursor.skip_blanks();
  if (cursor.here() != grammar.close)
    cursor.refuse(cursor.at, std::string(1, grammar.close) + " or an operator");
  ++cursor.at;
  return inner;
}

}  // namespace abbe::sim::dialects
