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

/// Beginning of a line.
struct LineHead {
  std::string_view number;        ///< digits after N
  std::string label;              ///< upper case, without :
  std::string keyword;            ///< upper case; a word of program flow, or empty
  std::size_t at = 0;             ///< first byte of the keyword, or of the words
  std::size_t end = 0;            ///< first byte after the keyword
  std::optional<int> skip_level;  ///< level of the / at the beginning
};

/// Parses the beginning of a line without its comment.
LineHead parse_line_head(std::string_view line);

/// A program or subprogram, line by line.
struct Program {
  std::string name;  ///< upper case
  std::string text;  ///< text of a subprogram file; empty for the main program
  std::vector<std::string_view> lines;
  int first_line = 1, file = 0;  ///< as the canon numbers them

  /// The other end of a structure: of IF the line of ENDIF and maybe of ELSE, of ELSE that of
  /// ENDIF, of a loop the line at its other end.
  struct Counterpart {
    std::size_t line = 0, else_line = 0;
    bool has_else = false;
  };
  /// Counterparts by line. Built at the first use.
  std::optional<std::unordered_map<std::size_t, Counterpart>> counterparts;
  /// Lines by label or by line number, ascending. Built at the first use.
  std::optional<std::unordered_map<std::string, std::vector<std::size_t>>> labels;
};

/// Flow of a program: executes variables, expressions, conditions, loops, jumps and subprograms,
/// and passes all other blocks to the machine.
class Flow : public VariableParser {
 public:
  Flow(std::string_view text, ProgramRun& run);
  void run();

  std::optional<double> parse_operand(Cursor& cursor) override;
  bool assign_variable(Cursor& cursor) override;
  std::optional<std::string> parse_text_variable(Cursor& cursor) override;

 private:
  enum class VariableKind { Real, Integer, Boolean, Text };
  /// Type of a variable.
  struct Variable {
    VariableKind kind = VariableKind::Real;
    std::vector<int> sizes;  ///< of an array; empty for a simple variable
  };
  /// A running program, or a section of it that is repeated.
  struct Call {
    Program* program = nullptr;
    std::size_t return_line = 0;  ///< line of the caller to continue with
    /// True for a repeated section, which uses the variables of the program around it.
    bool is_repeated_section = false;
    std::size_t begin = 0, end = 0;
    long long remaining_repeats = 0;
    std::vector<Argument> arguments = {};
    std::map<std::string, Variable, std::less<>> variables = {};
    std::map<std::string, std::string, std::less<>> texts = {};
  };

  // Program flow.
  bool execute_line();
  bool execute_block(Cursor cursor);
  bool execute_keyword(const LineHead& head, Cursor cursor);
  void execute_if(const LineHead& head, Cursor& cursor);
  void execute_loop(const LineHead& head, Cursor& cursor);
  void execute_for(Cursor& cursor, bool first);
  void execute_case(Cursor& cursor);
  bool evaluate_condition(Cursor& cursor);
  void execute_jump(Cursor& cursor, const std::string& keyword);
  static bool is_jump(std::string_view word);
  const Program::Counterpart& counterpart(const Cursor& cursor, std::size_t at);
  std::size_t line_of(const std::string& label, const std::string& keyword, const Cause& cause);
  void expect_end(Cursor& cursor) const;
  Cursor cursor_of_line(std::size_t line) const;

  // Subprograms.
  void add_programs(std::string_view text);
  bool uses_m6() const;
  Program* find_program(const std::string& name);
  Program* load_program_file(const std::filesystem::path& file, const std::string& name);
  void call_program(const ProgramCall& program_call, long long count);
  void enter_program(Program& program, const ProgramCall& program_call, long long count);
  void bind_parameters(Program& program, const std::vector<Argument>& arguments,
                       const Cause& cause);
  void repeat_section(Cursor& cursor, bool one_block);
  long long parse_repeat_count(Cursor& cursor);
  void finish_repeated_section();
  void warn_unread();
  void leave_program();
  void call_by_name(Cursor& cursor);

  // Variables.
  void execute_definition(Cursor& cursor);
  void define_variable(Cursor& cursor, VariableKind kind);
  static std::optional<VariableKind> find_kind(std::string_view type);
  Call& local_scope();
  double parse_r_parameter(Cursor& cursor, std::size_t from);
  std::string parse_element(Cursor& cursor, const std::string& name, const Variable& variable);
  void store_value(const std::string& name, VariableKind kind, double value, const Cursor& cursor,
                   std::size_t from);
  std::optional<double> parse_system_variable(Cursor& cursor);
  std::optional<double> parse_multi_argument_function(Cursor& cursor, const std::string& name);
  double parse_quoted_number(Cursor& cursor);

  ProgramRun& run_;
  std::vector<std::unique_ptr<Program>> programs_;  ///< the first one is the main program
  std::map<std::string, Program*> programs_by_name_;
  Variables variables_;
  std::vector<Call> calls_;
  std::optional<ProgramCall> modal_call_;
  std::size_t modal_depth_ = 0;  ///< call depth of the modal subprogram; 0: none runs
  std::size_t line_index_ = 0;   ///< current line of the running program, from 0
  /// First line of the main program whose comment has not been recorded.
  std::size_t first_unrecorded_comment_ = 0;
  bool has_ended_ = false;
  Block block_;
  std::optional<Machine> machine_;
};

}  // namespace abbe::sim::dialects::siemens
