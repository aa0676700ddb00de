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

/// A file of a program, line by line.
struct Source {
  std::string text;  ///< of a called program; that of the main program belongs to the caller
  std::vector<std::string_view> lines;
  int file = 0;  ///< file number in the canon
  bool labels_known = false;
  std::unordered_map<std::string, std::vector<std::size_t>> labels;  ///< lines, from 0
};

/// Executes the blocks of a program: Q parameters, jumps, labels and calls are handled here,
/// everything else by the machine.
class Flow : public OperandParser {
 public:
  Flow(std::string_view text, ProgramRun& run);
  void run();

  std::optional<double> parse_operand(Cursor& cursor) override;

 private:
  /// A running program or label.
  struct Call {
    Source* source = nullptr;
    std::size_t back = 0;  ///< line to continue with behind the call
    bool is_program = true;
    bool inch = false;                     ///< unit of the caller
    bool begun = false;                    ///< BEGIN PGM has been read
    std::map<std::size_t, int> left = {};  ///< repeats still to come, by the line of their CALL LBL
  };
  /// A Q parameter as programmed.
  struct Parameter {
    std::string kind;  ///< "Q", "QL", "QR"
    int number = 0;
    std::size_t from = 0;
    std::string name() const { return kind + std::to_string(number); }
  };

  void block();
  /// Executes a block of the flow. Returns false if the keyword is not one of its.
  bool flow_block(const std::string& keyword, Words& words);
  bool before_corner(const Call& now, std::size_t line) const;
  void begin_program(Words& words);
  void end_program();
  void warn_unread();
  void call(Words& words);
  void call_label(Words& words);
  void call_program(Words& words);
  void label(Words& words);
  void fn(Words& words);
  double fn_result(int number, Words& words);
  void jump_if(Words& words);
  void assign(Words& words, const Parameter& parameter);
  std::optional<Parameter> parameter_at(Cursor& cursor) const;
  void set(const Parameter& parameter, double value, const Words& words);
  void set_cycle_parameter(int number, double value);
  double read(const Parameter& parameter, const Cursor& cursor) const;
  std::size_t line_of(const std::string& label, const Words& words, std::size_t from);
  Source& load_source(const std::filesystem::path& file);

  ProgramRun& run_;
  Machine machine_;
  Variables variables_;
  std::vector<std::unique_ptr<Source>> sources_;
  std::map<std::string, Source*> files_;
  std::vector<Call> calls_;
  std::size_t at_ = 0;  ///< current line of the running source, from 0
  bool ended_ = false;
  Block block_;
};

}  // namespace abbe::sim::dialects::heidenhain
