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

/// Modes that a control has when a program begins, and that the program may leave unstated.
enum class StartMode { Units, Distance, Motion, Plane, Feed, WorkOffset };

/// Lines of a file that form one program or subprogram: from `first` up to, not including, `end`,
/// counted from 0.
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
  bool is_turning() const { return is_turning_; }
  /// Returns true if X words are diameters at the start. `usual` is true for dialects whose turning
  /// controls begin with diameters if X is perpendicular to the spindle axis.
  bool has_initial_diameters(bool usual) const;

  /// Executes one block and collects its errors, so that reading continues with the next block.
  /// Drops errors that only follow from a position made uncertain by an earlier error. Returns
  /// false if the block failed.
  bool try_block(const std::function<void()>& block);
  /// Marks a name ("#5", "cycle") as undefined because of an error in its definition: uses of it
  /// are not reported as errors of their own.
  void mark_uncertain(const std::string& name) { uncertain_names_.insert(name); }
  /// Marks the name as defined again.
  void mark_certain(const std::string& name) {
    if (!uncertain_names_.empty()) uncertain_names_.erase(name);
  }
  /// Throws program::FollowingError if the name is marked as uncertain.
  void require_certain(const std::string& name, const program::Cause& cause) const;
  /// Runs the definition of a name, which becomes uncertain if that throws and certain otherwise.
  template <typename Definition>
  void define(const std::string& name, const Definition& definition) {
    try {
      definition();
    } catch (const BadInput&) {
      mark_uncertain(name);
      throw;
    }
    mark_certain(name);
  }
  bool is_uncertain() const { return !uncertain_names_.empty(); }
  /// Throws BadInput for a missing name, such as a label, at its first use; later uses are not
  /// reported.
  [[noreturn]] void refuse_once(const std::string& name, const program::Cause& cause,
                                std::string expected, std::optional<std::string> seen = {});

  /// Executes the startup code, if any, as the only line of a file of that name.
  void run_startup_code(const std::function<void(std::string_view code)>& block);
  /// Collects an error.
  void add_input_error(const BadInput& input_error) { input_errors_.add(input_error); }
  /// Returns true if reading cannot usefully continue: 200 errors, or a limit exceeded.
  bool is_aborted() const { return is_aborted_ || input_errors_.full(); }
  const InputErrorList& input_errors() const { return input_errors_; }

  /// Throws ProgramLimitExceeded if `move_count` moves would exceed the limits of the program.
  /// Called before a cycle makes its moves, so that no memory is taken for too many.
  void check_moves(double move_count, const program::Cause& cause) const;
  /// Counts an executed block. Throws ProgramLimitExceeded.
  void count_block();
  /// Throws ProgramLimitExceeded for too many variables; `noun` is the dialect's word for them.
  [[noreturn]] void throw_variable_limit(const program::NcLocation& location,
                                         const char* noun) const;
  /// Throws ProgramLimitExceeded if `depth` nested calls are too many.
  void check_depth(int depth, const program::Cause& cause, const char* what = "calls") const;
  std::size_t blocks_executed() const { return block_count_; }
  /// Returns true if blocks after a / of that level are skipped, and counts the block for the
  /// assumption about block skip.
  bool skips_block(int level);
  /// Takes the last block out of the count because it is skipped.
  void discount_block() { --block_count_; }
  /// Passes the kept blocks to `ReadOptions::on_path_segment`, if that is set.
  void emit_segment();

  /// Skips and counts a word that the dialect does not have, or throws BadInput if unknown words
  /// are errors.
  void handle_unknown_word(const program::Cause& word, const std::string& expected);
  const std::vector<SkippedWord>& skipped() const { return skipped_words_; }

  /// Records that the program states a mode.
  void mark_stated(StartMode mode) { assumed_modes_[std::size_t(mode)].is_stated = true; }
  /// Records that a block depends on a mode. If the program has not stated the mode, the control is
  /// assumed to begin with `assumed_state`, "mm (G21)"; its text must outlive the object.
  void assume_mode(StartMode mode, std::string_view assumed_state);

  /// Same as `assume_mode` for a work offset, which matters only if the scene states one.
  void assume_offset(int system, std::string_view assumed_state);
  /// Returns the number of the only tool and reports that it was assumed. `missing_statement` names
  /// what the program lacks: "no D with G41". Throws BadInput at `cause` if there are several
  /// tools or none.
  int assume_only_tool(const program::Cause& cause, const std::string& missing_statement);

  /// Reports the assumptions that are known only at the end of the program to `canon.assume`.
  void report_assumptions();

  /// Adds a warning once.
  void warn_once(const std::string& text);

  /// Warns of lines of the main file that contain words but were not read: lines after the end of
  /// the program in the section where reading ended, and sections of which no line was read.
  void warn_of_unread_lines(const std::vector<std::string_view>& lines,
                            const std::vector<Section>& sections);

 private:
  const ReadOptions& options_;
  std::string file_;
  std::vector<bool> line_was_read_;  ///< by line of the main file, from 1
  InputErrorList input_errors_;
  std::vector<SkippedWord> skipped_words_;
  std::set<std::string, std::less<>> uncertain_names_;
  std::size_t line_count_, block_count_ = 0;
  /// Counts blocks after a /.
  struct BlockSkipCount {
    std::size_t count = 0;
    int line = 0;  ///< line of the first one
    std::string file = {};
  };
  BlockSkipCount skipped_blocks_, executed_blocks_;
  struct AssumedMode {
    std::string_view assumed_state;
    bool is_stated = false;
  };
  std::array<AssumedMode, 6> assumed_modes_{};  ///< by `StartMode`
  int first_assumption_line_ = 0;               ///< line at which the first mode was assumed
  bool is_aborted_ = false;
  const bool is_turning_;
};

}  // namespace abbe::sim::dialects
