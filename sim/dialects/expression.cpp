#include "sim/dialects/expression.h"

#include <cmath>
#include <string>

#include <fmt/format.h>

#include "kinematics/text.h"

namespace abbe::sim::dialects {

// Variables of a finished call no longer count towards the limit.
void Variables::leave() {
  count_ -= calls_.back().numbers.size() + calls_.back().names.size();
  calls_.pop_back();
}

std::optional<double> Variables::number(int number, Of of) const {
  const auto& numbers = table(of).numbers;
  const auto found = numbers.find(number);
  return found == numbers.end() ? std::nullopt : std::optional(found->second);
}

std::optional<double> Variables::named(std::string_view name, Of of) const {
  const auto& names = table(of).names;
  const auto found = names.find(name);
  return found == names.end() ? std::nullopt : std::optional(found->second);
}

bool Variables::set(int number, double value, Of of) {
  auto& numbers = table(of).numbers;
  const auto found = numbers.find(number);
  if (found != numbers.end()) {
    found->second = value;
    return true;
  }
  // Only a new variable can exceed the limit; setting an existing one always succeeds.
  if (count_ == max_) return false;
  numbers.emplace(number, value);
  ++count_;
  return true;
}

bool Variables::set(std::string_view name, double value, Of of) {
  auto& names = table(of).names;
  const auto found = names.find(name);
  if (found != names.end()) {
    found->second = value;
    return true;
  }
  if (count_ == max_) return false;
  names.emplace(std::string(name), value);
  ++count_;
  return true;
}

void Variables::unset(int number, Of of) { count_ -= table(of).numbers.erase(number); }

namespace {

// Returns the operator at the cursor and advances past it, if its level is at least `min_level`.
const Operator* operator_at(Cursor& cursor, const ExpressionGrammar& grammar, int min_level) {
  for (const Operator& one : grammar.operators) {
    const std::size_t before = cursor.at;
    if (!cursor.take(one.text)) continue;
    // An operator of a lower level belongs to an outer call of `climb`; the cursor stays before it.
    if (one.level >= min_level) return &one;
    cursor.at = before;
    return nullptr;
  }
  return nullptr;
}

// Returns the result, or throws for infinity and NaN, which no axis position can be.
double checked(double result, const Cursor& cursor, std::size_t from) {
  if (!std::isfinite(result)) cursor.refuse(from, "a result that is a finite number");
  return result;
}

// Precedence climbing. The right operand is parsed with level + 1, so that operators of equal level
// are evaluated from the left.
double climb(Cursor& cursor, const ExpressionGrammar& grammar, Operands& operands, int min_level) {
  double left = value(cursor, grammar, operands);
  while (true) {
    cursor.skip_blanks();
    const std::size_t from = cursor.at;
    const Operator* one = operator_at(cursor, grammar, min_level);
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
  // All nesting passes through here: the limit protects the stack from hostile programs.
  const NestingLevel level(cursor.depth);
  if (level.too_deep())
    cursor.refuse(
        cursor.at,
        fmt::format("at most {} brackets, signs and functions within each other", max_nesting),
        "more");
  // A sign directly before digits belongs to the number, so that "-2" needs no level of nesting.
  if (const auto number = cursor.number(true, grammar.blanks_within_numbers)) return *number;
  const char c = cursor.here();
  if (c == '-' || c == '+') {
    ++cursor.at;
    const double inner = value(cursor, grammar, operands);
    return c == '-' ? -inner : inner;
  }
  if (c == grammar.open) return bracketed(cursor, grammar, operands);
  const std::size_t from = cursor.at;
  // The dialect has precedence: its functions of several arguments may share a name with others.
  if (const auto own = operands.operand(cursor)) return *own;
  for (const Function& function : grammar.functions) {
    const std::size_t before = cursor.at;
    if (!cursor.take(function.name)) continue;
    cursor.skip_blanks();
    // The name may be the beginning of a longer word, which is not a function call.
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
