#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "sim/dialects/expression.h"
#include "sim/dialects/siemens/block.h"
#include "sim/dialects/siemens/machine.h"

namespace abbe::sim::dialects::siemens {

/// The beginning of a line.
struct LineHead {
  std::string_view number;        ///< digits behind N
  std::string label;              ///< upper case, without :
  std::string keyword;            ///< upper case; a word of program flow, or empty
  std::size_t at = 0;             ///< byte of the keyword, or of the words
  std::size_t rest = 0;           ///< byte behind the keyword
  std::optional<int> skip_level;  ///< of the / at the beginning
};
/// Returns the beginning of a line, which must be without its comment.
LineHead head_of(std::string_view line);

/// A program or subprogram, line by line.
struct Program {
  std::string name;  ///< upper case
  std::string text;  ///< of a subprogram file; that of the main program belongs to the caller
  std::vector<std::string_view> lines;
  int first_line = 1, file = 0;  ///< of the canon

  /// Counterparts of conditions and loops: the line of ELSE or ENDIF for IF, the other end for
  /// others. Built at the first use.
  struct Partner {
    std::size_t line = 0, otherwise = 0;
    bool has_else = false;
  };
  std::optional<std::unordered_map<std::size_t, Partner>> partners;
  /// Lines of labels and of line numbers, ascending. Built at the first use.
  std::optional<std::unordered_map<std::string, std::vector<std::size_t>>> labels;
};

/// Executes the lines of a program: variables, expressions, conditions, loops, jumps and
/// subprograms are handled here, everything else by the machine.
class Flow : public Names {
 public:
  Flow(std::string_view text, ProgramRun& run);
  void run();

  std::optional<double> parse_operand(Cursor& cursor) override;
  bool set_variable(Cursor& cursor) override;
  std::optional<std::string> text_variable(Cursor& cursor) override;

 private:
  enum class Kind { Real, Integer, Truth, Text };
  /// Type of a variable, and its sizes if it is an array.
  struct Variable {
    Kind kind = Kind::Real;
    std::vector<int> sizes;  ///< of an array
  };
  /// A running program, or a part of it that is repeated.
  struct Call {
    Program* program = nullptr;
    std::size_t back = 0;  ///< line of the caller to continue with
    bool part = false;     ///< a repeated part, which uses the variables of the program around it
    std::size_t begin = 0, end = 0;
    long long left = 0;  ///< repeats still to come
    std::vector<Argument> arguments = {};
    std::map<std::string, Variable, std::less<>> variables = {};
    std::map<std::string, std::string, std::less<>> texts = {};
  };

  // Program flow.
  bool line();
  bool block(Cursor cursor);
  bool keyword(const LineHead& head, Cursor cursor);
  void branch(const LineHead& head, Cursor& cursor);
  void loop(const LineHead& head, Cursor& cursor);
  void count_up(Cursor& cursor, bool first);
  void one_of(Cursor& cursor);
  bool condition(Cursor& cursor);
  void jump(Cursor& cursor, const std::string& how);
  static bool is_jump(std::string_view word);
  const Program::Partner& partner(const Cursor& cursor, std::size_t at);
  std::size_t line_of(const std::string& label, const std::string& how, const Cause& cause);
  void ends(Cursor& cursor) const;
  Cursor cursor_at(std::size_t line) const;

  // Subprograms.
  void take_programs(std::string_view text);
  bool uses_m6() const;
  Program* find_program(const std::string& name);
  Program* load_program_file(const std::filesystem::path& file, const std::string& name);
  void call(const ProgramCall& called, long long times);
  void enter(Program& program, const ProgramCall& called, long long times);
  void bind(Program& program, const std::vector<Argument>& arguments, const Cause& cause);
  void repeat(Cursor& cursor, bool one_block);
  long long times_at(Cursor& cursor);
  void finish_part();
  void warn_unread();
  void leave();
  void call_by_name(Cursor& cursor);

  // Variables.
  void define(Cursor& cursor);
  void define_one(Cursor& cursor, Kind kind);
  Call& scope();
  double r_parameter(Cursor& cursor, std::size_t from);
  std::string element(Cursor& cursor, const std::string& name, const Variable& variable);
  void store(const std::string& name, Kind kind, double value, const Cursor& cursor,
             std::size_t from);
  std::optional<double> system_variable(Cursor& cursor);
  std::optional<double> function_of_several(Cursor& cursor, const std::string& name);
  double quoted_number(Cursor& cursor);

  ProgramRun& run_;
  std::vector<std::unique_ptr<Program>> programs_;  ///< the first one is the main program
  std::map<std::string, Program*> found_;
  Variables variables_;
  std::vector<Call> calls_;
  std::optional<ProgramCall> modal_;
  std::size_t modal_depth_ = 0;  ///< call depth of the modal subprogram; 0: none runs
  std::size_t at_ = 0;           ///< current line of the running program, from 0
  /// First line of the main program whose comment has not been recorded.
  std::size_t comments_to_ = 0;
  bool ended_ = false;
  Block block_;
  std::optional<Machine> machine_;
};

}  // namespace abbe::sim::dialects::siemens
