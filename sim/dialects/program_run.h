#pragma once

#include <array>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "kinematics/bad_input.h"
#include "sim/dialects/read_options.h"
#include "sim/program/canon.h"
#include "sim/program/nc_block.h"

namespace abbe::sim::dialects {

using program::ProgramLimitExceeded;

/// Modes that a control has when a program begins.
enum class StartMode { Units, Distance, Motion, Plane, Feed, WorkOffset };

/// Lines of a file that one program or subprogram has, from 0.
struct Section {
  std::size_t first = 0, end = 0;
};

/// Returns true if a line has letters outside of comments, ( ) and what follows ; or $$.
bool has_words(std::string_view line);

/// What every front end has while it reads one program: the machine that it commands, the faults
/// that it collects, the words that it skips, and how far it may go.
class ProgramRun {
 public:
  /// @param options  outlive it
  /// @param lines  of the file, for progress
  ProgramRun(const std::string& file, const ReadOptions& options, std::size_t lines = 0);

  program::Canon canon;
  std::vector<std::string> warnings;

  const ReadOptions& options() const { return options_; }
  /// The control is one of a turning machine.
  bool turning() const { return turning_; }
  /// X words are diameters until the program says otherwise.
  /// @param usual  the dialect's turning controls begin so where X is across the spindle line
  bool has_initial_diameters(bool usual) const;

  /// Runs one block; what it refuses is noted, and reading goes on with the next. Faults that only
  /// follow from where an earlier one left the axes are left out.
  /// @return false if it was refused
  bool attempt(const std::function<void()>& block);
  /// What a definition was to set and, after an input error in it, does not hold: its uses are no
  /// input errors of their own. @param name  "#5", "cycle"
  void doubt(const std::string& name) { uncertain_names_.insert(name); }
  /// It is set again.
  void mark_certain(const std::string& name) {
    if (!uncertain_names_.empty()) uncertain_names_.erase(name);
  }
  /// @throws program::FollowingError where the name is in doubt
  void require_certain(const std::string& name, const program::Cause& cause) const;
  /// Runs what sets the name, which is in doubt where that throws, and certain where it does not.
  template <typename Set>
  void define(const std::string& name, const Set& set) {
    try {
      set();
    } catch (const BadInput&) {
      doubt(name);
      throw;
    }
    mark_certain(name);
  }
  bool is_uncertain() const { return !uncertain_names_.empty(); }
  /// An input error about what is not there, as a label: at its first use alone.
  [[noreturn]] void refuse_once(const std::string& name, const program::Cause& cause,
                                std::string expected, std::optional<std::string> seen = {});

  /// Runs the startup code, if there is one, as the only line of a file of that name.
  void start(const std::function<void(std::string_view code)>& block);
  /// Notes a fault.
  void add(const BadInput& fault) { input_errors_.add(fault); }
  /// Reading further says nothing new: 200 faults, or a limit reached.
  bool is_aborted() const { return aborted_ || input_errors_.full(); }
  const InputErrorList& input_errors() const { return input_errors_; }

  /// Asked before a cycle makes its moves, so that no memory is spent on what is too much.
  /// @throws Exhausted where they go beyond what the program may have
  void check_moves(double more, const program::Cause& cause) const;
  /// Counts a block that is executed. @throws Exhausted
  void count_block();
  /// @throws Exhausted where `depth` calls are too deep
  void check_depth(int depth, const program::Cause& cause, const char* what = "calls") const;
  std::size_t blocks_executed() const { return blocks_; }
  /// Returns true if what stands behind a / of that level is left out, and counts it for the
  /// assumption about block skip.
  bool skips(int level);
  /// The block that was counted last is left out.
  void discount_block() { --blocks_; }
  /// Gives away the blocks that are kept, where pieces are wanted.
  void hand_over();

  /// A word that the dialect has not: skipped and counted, or a fault.
  /// @throws BadInput unless unknown words are skipped
  void unknown(const program::Cause& word, const std::string& expected);
  const std::vector<SkippedWord>& skipped() const { return skipped_; }

  /// The program states a mode.
  void state(StartMode mode) { modes_[std::size_t(mode)].stated = true; }
  /// A block depends on a mode; where the program has not stated it, `taken` is what the control is
  /// assumed to begin with: "mm (G21)".
  /// @param taken  outlives the run
  void assume_mode(StartMode mode, std::string_view taken);

  /// The same of a work offset, which matters only where the scene states one.
  void assume_offset(int system, std::string_view taken);
  /// Returns the number of the only tool there is and reports that it was taken.
  /// @param wanting  what is not stated: "no D beside G41"
  /// @throws BadInput at `cause` if there are several tools, or none
  int uncalled_tool(const program::Cause& cause, const std::string& missing_statement);

  /// Reports what is only known at the end of the program to `canon.assume`.
  void report_assumptions();

  /// A warning that is given once, however often it is met.
  void warn_once(const std::string& text);

  /// Warns of the lines with words of the main file that stand behind the end of the program and
  /// were not read: of the section where reading ended those behind it, of other sections those in
  /// which nothing was read.
  void warn_unread(const std::vector<std::string_view>& lines,
                   const std::vector<Section>& sections);

 private:
  const ReadOptions& options_;
  std::string file_;
  std::vector<bool> line_was_read_;  ///< by line of the main file, from 1
  InputErrorList input_errors_;
  std::vector<SkippedWord> skipped_;
  std::set<std::string, std::less<>> uncertain_names_;
  std::size_t lines_, blocks_ = 0;
  /// Blocks behind a /.
  struct BlockSkipCount {
    std::size_t count = 0;
    int line = 0;  ///< of the first
    std::string file = {};
  };
  BlockSkipCount left_out_, executed_;
  struct AssumedMode {
    std::string_view taken;
    bool stated = false;
  };
  std::array<AssumedMode, 6> modes_{};  ///< by `StartMode`
  int modes_line_ = 0;                  ///< where the first was taken
  bool aborted_ = false;
  const bool turning_;
};

}  // namespace abbe::sim::dialects
