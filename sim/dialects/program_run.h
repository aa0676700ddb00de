#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "kinematics/fault_list.h"
#include "sim/dialects/read_options.h"
#include "sim/program/canon.h"

namespace abbe::sim::dialects {

/// A limit of the program was reached: reading ends there.
struct Exhausted : BadInput {
  using BadInput::BadInput;
};

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

  /// Runs one block; what it refuses is noted, and reading goes on with the next. Faults that only
  /// follow from where an earlier one left the axes are left out.
  /// @return false if it was refused
  bool attempt(const std::function<void()>& block);
  /// Notes a fault.
  void add(const BadInput& fault) { faults_.add(fault); }
  /// Reading further says nothing new: 200 faults, or a limit reached.
  bool hopeless() const { return hopeless_ || faults_.full(); }
  const FaultList& faults() const { return faults_; }

  /// Counts a block that is executed. @throws Exhausted
  void count_block();
  /// @throws Exhausted where `depth` calls are too deep
  void check_depth(int depth, const program::Cause& cause) const;
  std::size_t blocks_executed() const { return blocks_; }
  /// Gives away the blocks that are kept, where pieces are wanted.
  void hand_over();

  /// A word that the dialect has not: skipped and counted, or a fault.
  /// @throws BadInput unless unknown words are skipped
  void unknown(const program::Cause& word, const std::string& expected);
  const std::vector<Skipped>& skipped() const { return skipped_; }

  /// A warning that is given once, however often it is met.
  void warn_once(const std::string& text);

 private:
  const ReadOptions& options_;
  FaultList faults_;
  std::vector<Skipped> skipped_;
  std::size_t lines_, blocks_ = 0;
  bool hopeless_ = false;
};

}  // namespace abbe::sim::dialects
