#pragma once

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "sim/dialects/expression.h"
#include "sim/dialects/linuxcnc/block.h"
#include "sim/dialects/linuxcnc/machine.h"

namespace abbe::sim::dialects::linuxcnc {

/// A file of a program.
struct Source {
  std::string text;  ///< text of a subprogram file; empty for the main program
  std::vector<std::string_view> lines;
  int file = 0;  ///< file number in the canon
};

/// An O word of a line: its label and its keyword.
struct OWord {
  std::string label;    ///< "100" or "<name>"
  std::string keyword;  ///< lower case
  Cause cause;
  std::size_t end = 0;  ///< first byte after the keyword
};

/// Flow of a program: executes parameters, expressions and O words, and passes all other lines to
/// the machine.
class Flow : public OperandParser {
 public:
  Flow(std::string_view text, ProgramRun& run);
  void run();

  std::optional<double> parse_operand(Cursor& cursor) override;

 private:
  /// A loop that is running.
  struct Loop {
    std::string label;
    enum class Kind { While, Do, Repeat } kind = Kind::While;
    std::size_t line = 0;  ///< line of its first keyword
    long long remaining_repeats = 0;
  };
  /// A running subprogram, or the main program.
  struct Call {
    const Source* source = nullptr;
    std::size_t return_line = 0;  ///< line of the caller to continue with
    std::string name = {};
    std::vector<Loop> loops = {};
    std::array<double, 31> locals{};        ///< #1 .. #30
    std::optional<Modes> saved_modes = {};  ///< by M70 and M73
    bool restores_modes = false;            ///< M73: restored at the end of the call
  };
  /// Location of a subprogram.
  struct Subprogram {
    const Source* source = nullptr;
    std::size_t line = 0;
  };

  bool execute_line();
  bool execute_block(Cursor cursor);
  void save_modes();
  std::optional<OWord> read_o_word(Cursor& cursor);
  std::optional<OWord> find_o_word(const Source& source, std::size_t at);
  void execute_o_word(const OWord& o, Cursor cursor);
  void execute_if(const OWord& o, Cursor& cursor);
  void execute_loop(const OWord& o, Cursor& cursor);
  void leave_loop(const OWord& o, bool continues);
  void call_subprogram(const OWord& o, Cursor& cursor);
  void return_from_subprogram(const OWord& o, Cursor& cursor);
  void end_without_endsub();
  Subprogram find_subprogram(const OWord& o);
  const Source& load_source(const std::filesystem::path& file);
  /// Returns the next line that has one of the keywords and the label of `o`. Throws BadInput if
  /// there is none.
  std::size_t find_next(const OWord& o, std::initializer_list<std::string_view> keywords);
  double evaluate_condition(Cursor& cursor);
  void expect_end(Cursor& cursor) const;
  double parse_parameter(Cursor& cursor);
  double read_named_parameter(const std::string& name, const Cursor& cursor, std::size_t from);
  bool has_named_parameter(const std::string& name) const;
  void set_parameters(const Block& block, const Cursor& cursor);
  Cursor cursor_of_line(const Source& source, std::size_t line) const;

  ProgramRun& run_;
  Machine machine_;
  Variables variables_;
  std::vector<std::unique_ptr<Source>> sources_;
  std::map<std::string, Subprogram> subprograms_;  ///< those found so far, by file and label
  std::unordered_map<std::string, std::size_t> found_lines_;  ///< results of `find_next`
  std::set<std::string> executed_ifs_;  ///< file and label of each executed `if`
  std::vector<Call> calls_;
  std::size_t line_index_ = 0;  ///< current line of the running source, from 0
  int percent_count_ = 0;
  bool has_ended_ = false;
  Block block_;
};

}  // namespace abbe::sim::dialects::linuxcnc
