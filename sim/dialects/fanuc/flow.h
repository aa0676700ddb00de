#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "sim/dialects/expression.h"
#include "sim/dialects/fanuc/block.h"
#include "sim/dialects/fanuc/machine.h"

namespace abbe::sim::dialects::fanuc {

/// A program of a file: from its O number to the next one.
struct Program {
  int number = 0;                  ///< O number; 0 if there is none
  std::size_t source = 0;          ///< index of its file
  std::size_t first = 0, end = 0;  ///< lines
  /// Sequence numbers with their lines, and both ends of loops; built at the first jump.
  std::optional<std::vector<std::pair<int, std::size_t>>> sequence = {};
  std::optional<std::unordered_map<std::size_t, std::size_t>> loops = {};
};

/// Executes the blocks of a program: variables, conditions, loops, jumps and calls are handled
/// here, everything else by the machine.
class Flow : public MacroOperands {
 public:
  Flow(std::string_view text, ProgramRun& run);
  void run();

  std::optional<double> operand(Cursor& cursor) override;

 private:
  struct Source {
    std::string text;  ///< of a subprogram file; that of the main program belongs to the caller
    std::vector<std::string_view> lines;
    std::vector<Program> programs;
    std::size_t end = 0;  ///< line of the % that ends the file
    int file = 0;         ///< file number in the canon
  };
  /// A running program.
  struct Call {
    Program* program = nullptr;
    std::size_t back = 0;  ///< line of the caller to continue with
    int left = 0;          ///< repeats still to come
    bool macro = false;    ///< has local variables of its own
    bool modal = false;    ///< called by G66
    std::vector<std::pair<int, double>> arguments = {};
  };
  /// The call of G66, repeated after every block that moves.
  struct Modal {
    int program = 0, repeats = 1;
    std::vector<std::pair<int, double>> arguments;
    Cause cause;
  };

  // Lines, statements and variables.
  bool line();
  bool statement(Cursor& cursor);
  bool block(Cursor cursor);
  bool calls_of(const Cause& cause);
  void assign(Cursor& cursor);
  void set(int number, double value, const Cursor& cursor, std::size_t from);
  void alarm(const Cursor& cursor, double number);
  double variable(Cursor& cursor);
  int variable_number(Cursor& cursor);
  double read(int number, const Cursor& cursor, std::size_t from);
  void ends(Cursor& cursor);
  int whole_value(Cursor& cursor, int most, std::string_view what);
  Source& source() { return *sources_[calls_.back().program->source]; }

  // Programs, loops and calls.
  void add_programs(std::size_t source);
  void branch(Cursor& cursor);
  void begin_loop(Cursor& cursor, std::size_t from, bool conditional);
  void end_loop(Cursor& cursor, std::size_t from);
  void jump(int number, const Cause& cause);
  const std::unordered_map<std::size_t, std::size_t>& loops();
  Program* find_program(int number, const Cause& cause);
  Program* program_in_file(int number);
  void call_subprogram();
  void call_macro();
  void enter(Program* program, Call call, const Cause& cause);
  void leave(std::optional<int> to, const Cause& cause);
  void store_locals();
  void end_of_program();
  void warn_unread();
  std::vector<std::pair<int, double>> macro_arguments(const Block& block);

  ProgramRun& run_;
  Machine machine_;
  Variables variables_;
  std::vector<std::unique_ptr<Source>> sources_;
  std::vector<Call> calls_;
  std::optional<Modal> modal_;
  std::map<int, Program*> found_;
  std::size_t at_ = 0;  ///< current line of the running program's file, from 0
  bool ended_ = false;
  Block block_;
};

}  // namespace abbe::sim::dialects::fanuc
