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
  enum class Of { Program, Call };

  explicit Variables(std::size_t most = 1'000'000) : max_(most), calls_(1) {}

  /// Begins a call with no local variables; `leave` ends it.
  void enter() { calls_.emplace_back(); }
  void leave();
  int depth() const { return int(calls_.size()) - 1; }

  std::optional<double> number(int number, Of of = Of::Program) const;
  std::optional<double> named(std::string_view name, Of of = Of::Program) const;
  /// Returns false, without setting anything, if there would be too many variables.
  [[nodiscard]] bool set(int number, double value, Of of = Of::Program);
  [[nodiscard]] bool set(std::string_view name, double value, Of of = Of::Program);
  void unset(int number, Of of = Of::Program);

 private:
  struct Table {
    std::unordered_map<int, double> numbers;
    std::map<std::string, double, std::less<>> names;
  };
  Table& table(Of of) { return of == Of::Program ? program_ : calls_.back(); }
  const Table& table(Of of) const { return of == Of::Program ? program_ : calls_.back(); }

  std::size_t max_, count_ = 0;
  Table program_;
  std::vector<Table> calls_;  ///< the last one is running; the first is the main program
};

// Arithmetic expressions of the dialects; a grammar holds the differences.

/// A binary operator. Operators of equal level are evaluated from the left.
struct Operator {
  std::string_view text;  ///< upper case; an operator of letters may be followed by digits: "MOD2"
  int level = 0;          ///< a higher level binds more tightly
  double (*apply)(double left, double right) = nullptr;
  /// Returns what was expected of the operands, or null if they are valid; no function means always
  /// valid.
  const char* (*fault)(double left, double right) = nullptr;
};

/// A function of one number.
struct Function {
  std::string_view name;  ///< upper case
  double (*apply)(double) = nullptr;
  const char* (*fault)(double) = nullptr;  ///< as in `Operator`
};

/// Operators, functions and brackets of a dialect. Functions of several arguments are parsed by the
/// dialect itself.
struct ExpressionGrammar {
  std::span<const Operator> operators;  ///< where one is a prefix of another, the longer one first
  std::span<const Function> functions;
  char open = '[', close = ']';
  bool blanks_within_numbers = false;
};

/// Operands that only the dialect knows: variables, and functions of several arguments.
class Operands {
 public:
  virtual ~Operands() = default;
  /// Parses the operand at the cursor and advances past it. Returns nothing if none of the
  /// dialect's operands begins there.
  virtual std::optional<double> operand(Cursor& cursor) = 0;
};

/// Parses one value without binary operators: a number, a variable, a function or a bracketed
/// expression, with leading signs, which bind most tightly. Every nested construct, operands of the
/// dialect included, passes through this function, which counts the levels. Throws BadInput if no
/// value begins there, and beyond `max_nesting` levels.
double value(Cursor& cursor, const ExpressionGrammar& grammar, Operands& operands);

/// Parses values with operators between them, up to where no operator follows. Throws BadInput for
/// a malformed expression, a result that is not finite, and operands that an operator or function
/// rejects.
double expression(Cursor& cursor, const ExpressionGrammar& grammar, Operands& operands);

/// Parses an expression in the brackets of the grammar.
double bracketed(Cursor& cursor, const ExpressionGrammar& grammar, Operands& operands);

}  // namespace abbe::sim::dialects
