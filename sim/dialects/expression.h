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

/// Variables of a program: those of the whole program, and on top of them those of the call that
/// runs. What is of a call and what of the program the dialect says when it sets one.
class Variables {
 public:
  enum class Of { Program, Call };

  explicit Variables(std::size_t most = 1'000'000) : max_(most), calls_(1) {}

  /// A call begins with no variables of its own; it ends with `leave`.
  void enter() { calls_.emplace_back(); }
  void leave();
  int depth() const { return int(calls_.size()) - 1; }

  std::optional<double> number(int number, Of of = Of::Program) const;
  std::optional<double> named(std::string_view name, Of of = Of::Program) const;
  /// @return false where there are too many, and then nothing is set
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
  std::vector<Table> calls_;  ///< the last one runs; the first is of the main program
};

// Expressions of numbers as the dialects have them; what differs between them is a table.

/// An operator between two numbers. Of equal level they are taken from the left.
struct Operator {
  std::string_view text;  ///< upper case; of letters it is a word, but digits may follow: "MOD2"
  int level = 0;          ///< a higher one binds more
  double (*apply)(double left, double right) = nullptr;
  /// What is wrong with the right side, null if nothing; left null where nothing can be.
  const char* (*fault)(double left, double right) = nullptr;
};

/// A function of one number.
struct Function {
  std::string_view name;  ///< upper case
  double (*apply)(double) = nullptr;
  const char* (*fault)(double) = nullptr;  ///< as that of an operator
};

/// A function of several numbers, of a name that is in no list: the front end reads it whole.
struct ExpressionGrammar {
  std::span<const Operator> operators;  ///< where one begins another, the longer first
  std::span<const Function> functions;
  char open = '[', close = ']';
  bool blanks_within_numbers = false;
};

/// What a dialect alone knows: variables, and functions of several arguments.
class Operands {
 public:
  virtual ~Operands() = default;
  /// The value that begins at the cursor, which is moved behind it; none if nothing of the dialect
  /// begins there.
  virtual std::optional<double> operand(Cursor& cursor) = 0;
};

/// One value without operators around it: a number, a variable, a function, something in brackets,
/// each with signs before it, which bind most. Whatever nests in an expression, operands of the
/// dialect too, comes back here: here the levels are counted.
/// @throws BadInput where none begins, and beyond `max_nesting` levels
double value(Cursor& cursor, const ExpressionGrammar& grammar, Operands& operands);

/// Values with operators between them, up to where no operator follows.
/// @throws BadInput for what is no expression, a result that is not finite, what an operator or
/// function
///         refuses
double expression(Cursor& cursor, const ExpressionGrammar& grammar, Operands& operands);

/// The same in the brackets of the grammar.
double bracketed(Cursor& cursor, const ExpressionGrammar& grammar, Operands& operands);

}  // namespace abbe::sim::dialects
