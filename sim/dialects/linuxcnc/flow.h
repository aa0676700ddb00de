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

/// A file of a program, line by line.
struct Source {
  std::string text;  ///< of a subprogram file; that of the main program belongs to the caller
  std::vector<std::string_view> lines;
  int file = 0;  ///< file number in the canon
};

/// An O word of a line: its label and its keyword.
struct OWord {
  std::string label;  ///< "100" or "<name>"
  std::string word;   ///< lower case
  Cause cause;
  std::size_t rest = 0;  ///< byte behind the keyword
};

/// Executes the lines of a program: parameters, expressions and O words are handled here,
/// everything else by the machine.
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
    long long left = 0;    ///< repeats still to come
  };
  /// A running subprogram, or the main program.
  struct Call {
    const Source* source = nullptr;
    std::size_t back = 0;  ///< line of the caller to continue with
    std::string name = {};
    std::vector<Loop> loops = {};
    std::array<double, 31> locals{};  ///< #1 .. #30
    std::optional<Modes> saved = {};  ///< by M70 and M73
    bool restores = false;            ///< M73: restore at the end
  };
  /// Location of a subprogram.
  struct Sub {
    const Source* source = nullptr;
    std::size_t line = 0;
    bool ends_with_file = false;
  };

  bool line();
  bool block(Cursor cursor);
  void save_modes();
  std::optional<OWord> o_word(Cursor& cursor);
  std::optional<OWord> parse_o_word(const Source& source, std::size_t at);
  void o_line(const OWord& o, Cursor cursor);
  void branch(const OWord& o, Cursor& cursor);
  void loop(const OWord& o, Cursor& cursor);
  void leave_loop(const OWord& o, bool again);
  void call(const OWord& o, Cursor& cursor);
  void leave(const OWord& o, Cursor& cursor);
  void finish_file();
  Sub find_sub(const OWord& o);
  const Source& load_source(const std::filesystem::path& file);
  /// Returns the line of the next of these keywords with the same label. Throws BadInput if there
  /// is none.
  std::size_t find_next(const OWord& o, std::initializer_list<std::string_view> words);
  double condition(Cursor& cursor);
  void ends(Cursor& cursor) const;
  double parameter(Cursor& cursor);
  double named(const std::string& name, const Cursor& cursor, std::size_t from);
  bool exists(const std::string& name) const;
  void set(const Block& block, const Cursor& cursor);
  Cursor cursor_at(const Source& source, std::size_t line) const;

  ProgramRun& run_;
  Machine machine_;
  Variables variables_;
  std::vector<std::unique_ptr<Source>> sources_;
  std::map<std::string, Sub> subs_;  ///< found so far
  std::unordered_map<std::string, std::size_t> jumps_;
  std::set<std::string> begun_ifs_;  ///< file and label of each executed `if`
  std::vector<Call> calls_;
  std::size_t at_ = 0;  ///< current line of the running source, from 0
  int percents_ = 0;
  bool ended_ = false;
  Block block_;
};

}  // namespace abbe::sim::dialects::linuxcnc
