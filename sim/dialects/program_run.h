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

/// Modes that a control has when a program begins, and that a program may leave unstated.
enum class StartMode { Units, Distance, Motion, Plane, Feed, WorkOffset };

/// Lines of a file that form one program or subprogram, counted from 0.
struct Section {
  std::size_t first = 0, end = 0;
};

/// Returns true if a line has letters outside of comments, i.e. outside of ( ) and before ; or $$.
bool has_words(std::string_view line);

/// State that every front end has while it reads one program: the machine it commands, collected
/// errors, skipped words, and limits.
class ProgramRun {
 public:
  /// `options` must outlive the object. `lines` is the number of lines of the file, for progress
  /// reports.
  ProgramRun(const std::string& file, const ReadOptions& options, std::size_t lines = 0);

  program::Canon canon;
  std::vector<std::string> warnings;

  const ReadOptions& options() const { return options_; }
  /// Returns true for a turning control.
  bool turning() const { return turning_; }
  /// Returns true if X words are diameters at the start. `usual` is true for dialects whose turning
  /// controls begin with diameters if X is perpendicular to the spindle axis.
  bool has_initial_diameters(bool usual) const;

  /// Executes one block and collects its errors; reading continues with the next block. Errors that
  /// only follow from an earlier wrong position are dropped. Returns false if the block failed.
  bool attempt(const std::function<void()>& block);
  /// Marks a name ("#5", "cycle") as undefined because of an error in its definition: uses of it
  /// are not reported as errors of their own.
  void doubt(const std::string& name) { uncertain_names_.insert(name); }
  /// Marks the name as defined again.
  void mark_certain(const std::string& name) {
    if (!uncertain_names_.empty()) uncertain_names_.erase(name);
  }
  /// Throws program::FollowingError if the name is marked as uncertain.
  void require_certain(const std::string& name, const program::Cause& cause) const;
  /// Runs the definition of a name, which becomes uncertain if that throws and certain otherwise.
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
  /// Throws an error about something missing, such as a label, only at its first use.
  [[noreturn]] void refuse_once(const std::string& name, const program::Cause& cause,
                                std::string expected, std::optional<std::string> seen = {});

  /// Executes the startup code, if any, as the only line of a file of that name.
  void start(const std::function<void(std::string_view code)>& block);
  /// Collects an error.
  void add(const BadInput& fault) { input_errors_.add(fault); }
  /// Returns true if reading further is pointless: 200 errors, or a limit reached.
  bool is_aborted() const { return aborted_ || input_errors_.full(); }
  const InputErrorList& input_errors() const { return input_errors_; }

  /// Throws ProgramLimitExceeded if `more` moves would exceed the limits of the program. Called
  /// before a cycle makes its moves, so that no memory is taken for too many.
  void check_moves(double more, const program::Cause& cause) const;
  /// Counts an executed block. Throws ProgramLimitExceeded.
  void count_block();
  /// Throws ProgramLimitExceeded if `depth` nested calls are too many.
  void check_depth(int depth, const program::Cause& cause, const char* what = "calls") const;
  std::size_t blocks_executed() const { return blocks_; }
  /// Returns true if blocks behind a / of that level are skipped, and counts the block for the
  /// assumption about block skip.
  bool skips(int level);
  /// Removes the last counted block from the count because it is skipped.
  void discount_block() { --blocks_; }
  /// Passes the kept blocks on if the caller wants segments.
  void hand_over();

  /// Skips and counts a word that the dialect does not have, or throws BadInput if unknown words
  /// are errors.
  void unknown(const program::Cause& word, const std::string& expected);
  const std::vector<SkippedWord>& skipped() const { return skipped_; }

  /// Records that the program states a mode.
  void state(StartMode mode) { modes_[std::size_t(mode)].stated = true; }
  /// Records that a block depends on a mode. If the program has not stated it, `taken` is the state
  /// that the control is assumed to begin with, "mm (G21)"; it must outlive the object.
  void assume_mode(StartMode mode, std::string_view taken);

  /// Same for a work offset, which matters only if the scene states one.
  void assume_offset(int system, std::string_view taken);
  /// Returns the number of the only tool and reports that it was assumed. `missing_statement` names
  /// what the program lacks: "no D beside G41". Throws BadInput at `cause` if there are several
  /// tools or none.
  int uncalled_tool(const program::Cause& cause, const std::string& missing_statement);

  /// Reports the assumptions that are known only at the end of the program to `canon.assume`.
  void report_assumptions();

  /// Adds a warning once.
  void warn_once(const std::string& text);

  /// Warns of lines of the main file that contain words but were not read because the program ended
  /// before them: in the section where reading ended those behind the end, of other sections those
  /// that were not read at all.
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
  /// Counts blocks behind a /.
  struct BlockSkipCount {
    std::size_t count = 0;
    int line = 0;  ///< line of the first one
    std::string file = {};
  };
  BlockSkipCount left_out_, executed_;
  struct AssumedMode {
    std::string_view taken;
    bool stated = false;
  };
  std::array<AssumedMode, 6> modes_{};  ///< by `StartMode`
  int modes_line_ = 0;                  ///< line at which the first mode was assumed
  bool aborted_ = false;
  const bool turning_;
};

}  // namespace abbe::sim::dialects
