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

/// A program in a file: the lines from its O number to the next O number.
struct Program {
  int number = 0;                  ///< O number; 0 if there is none
  std::size_t source = 0;          ///< index of its file
  std::size_t first = 0, end = 0;  ///< lines
  /// Sequence numbers with their lines; built at the first jump.
  std::optional<std::vector<std::pair<int, std::size_t>>> sequence = {};
  /// Line of END by line of DO, and vice versa; built at the first loop.
  std::optional<std::unordered_map<std::size_t, std::size_t>> loops = {};
};

/// Flow of a program: executes variables, conditions, loops, jumps and calls, and passes all other
/// blocks to the machine.
class Flow : public MacroOperands {
 public:
  Flow(std::string_view text, ProgramRun& run);
  void run();

  std::optional<double> parse_operand(Cursor& cursor) override;

 private:
  struct Source {
    std::string text;  ///< text of a subprogram file; empty for the main program
    std::vector<std::string_view> lines;
    std::vector<Program> programs;
    std::size_t end = 0;  ///< line of the % that ends the file
    int file = 0;         ///< file number in the canon
  };
  /// A running program.
  struct Call {
    Program* program = nullptr;
    std::size_t return_line = 0;  ///< line of the caller to continue with
    int remaining_repeats = 0;    ///< repeats still to come
    bool has_locals = false;      ///< a macro call, with local variables of its own
    bool is_modal = false;        ///< called by G66
    std::vector<std::pair<int, double>> arguments = {};
  };
  /// A modal call (G66), repeated after every block that moves.
  struct ModalCall {
    int program = 0, repeats = 1;
    std::vector<std::pair<int, double>> arguments;
    Cause cause;
  };

  // Lines, statements and variables.
  bool execute_line();
  bool execute_statement(Cursor& cursor);
  bool execute_block(Cursor cursor);
  void execute_assignment(Cursor& cursor);
  void set_variable(int number, double value, const Cursor& cursor, std::size_t from);
  void raise_alarm(const Cursor& cursor, double number);
  double parse_variable(Cursor& cursor);
  int parse_variable_number(Cursor& cursor);
  double read_variable(int number, const Cursor& cursor, std::size_t from);
  void expect_end(Cursor& cursor);
  int parse_whole_number(Cursor& cursor, int max, std::string_view what);
  Source& source() { return *sources_[calls_.back().program->source]; }

  // Programs, loops and calls.
  void add_programs(std::size_t source);
  void execute_if(Cursor& cursor);
  void begin_loop(Cursor& cursor, std::size_t from, bool conditional);
  void end_loop(Cursor& cursor, std::size_t from);
  void jump(int number, const Cause& cause);
  const std::unordered_map<std::size_t, std::size_t>& loop_lines();
  Program* find_program(int number, const Cause& cause);
  Program* program_in_file(int number);
  void call_subprogram();
  void call_macro();
  void enter_program(Program* program, Call call, const Cause& cause);
  void leave_program(std::optional<int> to, const Cause& cause);
  void keep_modal_arguments();
  void end_without_return();
  void warn_of_unread_lines();
  std::vector<std::pair<int, double>> macro_arguments(const Block& block);

  ProgramRun& run_;
  Machine machine_;
  Variables variables_;
  std::vector<std::unique_ptr<Source>> sources_;
  std::vector<Call> calls_;
  std::optional<ModalCall> modal_call_;
  std::map<int, Program*> programs_by_number_;
  std::size_t line_index_ = 0;  ///< current line of the running program's file, from 0
  bool has_ended_ = false;
  Block block_;
};

}  // namespace abbe::sim::dialects::fanuc
