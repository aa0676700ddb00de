#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "sim/dialects/cursor.h"

namespace abbe::sim::dialects {

/// Variables of a program: those of the whole program and those local to the running call. The
/// dialect decides which kind a variable is when it sets one.
class Variables {
 public:
  enum class Scope { Program, Call };

  explicit Variables(std::size_t max_variables = 1'000'000)
      : max_variables_(max_variables), calls_(1) {}

  /// Begins a call without local variables; `leave` ends it.
  void enter() { calls_.emplace_back(); }
  void leave();
  int depth() const { return int(calls_.size()) - 1; }

  std::optional<double> number(int number, Scope scope = Scope::Program) const;
  std::optional<double> named(std::string_view name, Scope scope = Scope::Program) const;
  /// Sets a variable. Returns false, without setting anything, if there would be more than
  /// `max_variables`.
  [[nodiscard]] bool set(int number, double value, Scope scope = Scope::Program);
  [[nodiscard]] bool set(std::string_view name, double value, Scope scope = Scope::Program);
  void unset(int number, Scope scope = Scope::Program);

 private:
  struct Table {
    std::unordered_map<int, double> numbers;
    std::map<std::string, double, std::less<>> names;
  };
  Table& table(Scope scope) { return scope == Scope::Program ? program_ : calls_.back(); }
  const Table& table(Scope scope) const {
    return scope == Scope::Program ? program_ : calls_.back();
  }

  std::size_t max_variables_, count_ = 0;
  Table program_;
  std::vector<Table> calls_;  ///< the last one is running; the first is the main program
};

/// Advances past blanks and returns the byte at which the next word begins.
inline std::size_t skip_blanks(Cursor& cursor) {
  cursor.skip_blanks();
  return cursor.at;
}
/// Advances past blanks and returns the character there.
inline char next_char(Cursor& cursor) { return cursor.skip_blanks(), cursor.current(); }
/// Advances past a text as `Cursor::accept` does. Throws BadInput with `expected` if it does not
/// follow.
inline void expect_text(Cursor& cursor, std::string_view text, std::string_view expected) {
  if (!cursor.accept(text)) cursor.throw_input_error(cursor.at, std::string(expected));
}

// Arithmetic expressions of the dialects; a grammar holds the differences.

/// A binary operator. Operators of equal level are evaluated from the left.
struct Operator {
  std::string_view text;  ///< upper case; an operator of letters may be followed by digits: "MOD2"
  int level = 0;          ///< a higher level binds more tightly
  double (*apply)(double left, double right) = nullptr;
  /// Returns the expectation that the operands do not meet, or null if they are valid. Without this
  /// function all operands are valid.
  const char* (*operand_error)(double left, double right) = nullptr;
};

/// A function of one number.
struct Function {
  std::string_view name;  ///< upper case
  double (*apply)(double) = nullptr;
  const char* (*operand_error)(double) = nullptr;  ///< as in `Operator`
};

/// Operators, functions and brackets of a dialect. Functions of several arguments are parsed by the
/// dialect itself.
struct ExpressionGrammar {
  std::span<const Operator> operators;  ///< an operator stands before its own prefixes: ** before *
  std::span<const Function> functions;
  char open = '[', close = ']';
  bool blanks_within_numbers = false;
  /// Functions that the dialect shares with others; `functions` has precedence.
  std::span<const Function> common_functions = {};
  /// Returns the argument of a function as the dialect takes it; null: as it is.
  double (*argument)(double) = nullptr;
};

/// Returns ABS, EXP, LN, SQRT, and the trigonometric functions of angles in degrees.
std::span<const Function> common_functions();

// Checks of operands, as `Operator::operand_error` and `Function::operand_error` require them.

const char* require_nonzero_divisor(double left, double right);
const char* require_real_power(double base, double exponent);
const char* require_positive(double x);

/// Parser of the operands that only the dialect knows: variables, and functions of several
/// arguments.
class OperandParser {
 public:
  virtual ~OperandParser() = default;
  /// Parses the operand at the cursor and advances past it. Returns nothing if none of the
  /// dialect's operands begins there.
  virtual std::optional<double> parse_operand(Cursor& cursor) = 0;
};

/// Returns the value of a function whose name begins at byte `from`. Throws BadInput for an
/// argument that it rejects, and for a result that is not finite.
double apply_function(const Function& function, double argument, const ExpressionGrammar& grammar,
                      const Cursor& cursor, std::size_t from);

/// Parses one value without binary operators: a number, a variable, a function or a bracketed
/// expression, with leading signs, which bind most tightly. Every nested construct, operands of the
/// dialect included, passes through this function, which counts the levels. Throws BadInput if no
/// value begins there, and beyond `max_nesting` levels.
double parse_value(Cursor& cursor, const ExpressionGrammar& grammar, OperandParser& operands);

/// Parses values with operators between them, up to where no operator follows. Throws BadInput for
/// a malformed expression, a result that is not finite, and operands that an operator or function
/// rejects.
double parse_expression(Cursor& cursor, const ExpressionGrammar& grammar, OperandParser& operands);

/// Parses an expression enclosed in the brackets of the grammar. Throws BadInput if a bracket is
/// missing.
double parse_bracketed(Cursor& cursor, const ExpressionGrammar& grammar, OperandParser& operands);

}  // namespace abbe::sim::dialects
