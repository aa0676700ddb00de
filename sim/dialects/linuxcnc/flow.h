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
  std::string text;  ///< of a subprogram; the main program's is the caller's
  std::vector<std::string_view> lines;
  int file = 0;  ///< number of the canon
};

/// What stands behind O in a line: its label and its word.
struct OWord {
  std::string label;  ///< "100" or "<name>"
  std::string word;   ///< lower case
  Cause cause;
  std::size_t rest = 0;  ///< byte of the line behind it
};

/// Runs the lines of a program: parameters, expressions, O words, and what is left as blocks of the
/// machine.
class Flow : public Operands {
 public:
  Flow(std::string_view text, ProgramRun& run);
  void run();

  std::optional<double> operand(Cursor& cursor) override;

 private:
  struct Loop {
    std::string label;
    enum class Kind { While, Do, Repeat } kind = Kind::While;
    std::size_t line = 0;  ///< of the word that begins it
    long long left = 0;    ///< of repeat
  };
  /// A subprogram that runs, or the main program.
  struct Call {
    const Source* source = nullptr;
    std::size_t back = 0;  ///< line to go on with
    std::string name = {};
    std::vector<Loop> loops = {};
    std::array<double, 31> locals{};  ///< #1 .. #30
    std::optional<Modes> saved = {};  ///< of M70 and M73
    bool restores = false;            ///< M73
  };
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
  /// Line of the next of these words with the same label. @throws BadInput where there is none
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
  std::set<std::string> begun_ifs_;  ///< file and label of each `if` that has run
  std::vector<Call> calls_;
  std::size_t at_ = 0;  ///< line of the running source, from 0
  int percents_ = 0;
  bool ended_ = false;
  Block block_;
};

}  // namespace abbe::sim::dialects::linuxcnc
