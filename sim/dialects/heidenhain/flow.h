#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "sim/dialects/expression.h"
#include "sim/dialects/heidenhain/block.h"
#include "sim/dialects/heidenhain/machine.h"

namespace abbe::sim::dialects::heidenhain {

/// A file of a program.
struct Source {
  std::string text;  ///< text of a called program; empty for the main program
  std::vector<std::string_view> lines;
  int file = 0;  ///< file number in the canon
  bool are_labels_collected = false;
  std::unordered_map<std::string, std::vector<std::size_t>> labels;  ///< lines by label
};

/// Flow of a program: executes Q parameters, jumps, labels and calls, and passes all other blocks
/// to the machine.
class Flow : public OperandParser {
 public:
  Flow(std::string_view text, ProgramRun& run);
  void run();

  std::optional<double> parse_operand(Cursor& cursor) override;

 private:
  /// A running program or label.
  struct Call {
    Source* source = nullptr;
    std::size_t return_line = 0;  ///< line to continue with after the call
    bool is_program = true;
    bool is_caller_inch = false;                        ///< unit of the caller
    bool has_begun = false;                             ///< BEGIN PGM has been read
    std::map<std::size_t, int> remaining_repeats = {};  ///< by the line of CALL LBL
  };
  /// A Q parameter as programmed.
  struct Parameter {
    std::string kind;  ///< "Q", "QL", "QR"
    int number = 0;
    std::size_t from = 0;
    std::string name() const { return kind + std::to_string(number); }
  };

  void execute_block();
  /// Executes a block of program flow. Returns false for any other keyword.
  bool execute_flow_statement(const std::string& keyword, WordReader& words);
  bool is_corner_next(const Call& call, std::size_t line) const;
  void begin_program(WordReader& words);
  void end_program();
  void warn_of_unread_lines();
  void execute_call(WordReader& words);
  void call_label(WordReader& words);
  void call_program(WordReader& words);
  void execute_label(WordReader& words);
  void execute_fn(WordReader& words);
  double fn_result(int number, WordReader& words);
  void execute_if(WordReader& words);
  void execute_assignment(WordReader& words, const Parameter& parameter);
  std::optional<Parameter> parse_parameter(Cursor& cursor) const;
  void set_parameter(const Parameter& parameter, double value, const WordReader& words);
  void set_cycle_parameter(int number, double value);
  double read_parameter(const Parameter& parameter, const Cursor& cursor) const;
  std::size_t line_of_label(const std::string& label, const WordReader& words, std::size_t from);
  Source& load_source(const std::filesystem::path& file);

  ProgramRun& run_;
  Machine machine_;
  Variables variables_;
  std::vector<std::unique_ptr<Source>> sources_;
  std::map<std::string, Source*> sources_by_file_;
  std::vector<Call> calls_;
  std::size_t line_index_ = 0;  ///< current line of the running source, from 0
  bool has_ended_ = false;
  Block block_;
};

}  // namespace abbe::sim::dialects::heidenhain
