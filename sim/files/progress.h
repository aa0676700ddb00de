#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

/// Progress of long work, its remaining time, and interruption by Ctrl-C.
namespace abbe::sim {

/// A planned stage of work.
struct Stage {
  std::string part;      ///< part of the work to which it belongs, such as a case
  std::string kind;      ///< its name in reports; stages of one kind run at a comparable pace
  double seconds = 0.0;  ///< prediction for an average computer
};

/// Estimates the remaining time of planned stages. The plan gives the ratios between stages; the
/// pace of this computer for each kind of work is measured on the finished stages and on the
/// running one. The class has no clock: callers pass the time, s, which must not decrease.
class RemainingTime {
 public:
  explicit RemainingTime(std::vector<Stage> plan, double now_s = 0.0);

  /// Replaces the stages after the running one; measurements are kept.
  void replan(std::vector<Stage> next_stages);
  /// Ends the running stage and begins the first stage of the part; stages in between are skipped.
  void begin(const std::string& part, double now_s);
  /// Reports the progress of a stage of the running part; a stage of another kind begins with its
  /// first report. A kind that is not planned counts for the running stage.
  void report(const std::string& kind, double fraction, double now_s);

  /// Returns the number of the running part, from 1.
  int part() const { return parts_before(running_ + 1); }
  /// Returns the number of parts; consecutive stages of one part count once.
  int parts() const { return parts_before(plan_.size()); }

  double remaining_s(double now_s) const;
  /// Returns the completed fraction of all work, by time: elapsed over elapsed and remaining.
  double completed_fraction(double now_s) const;

 private:
  /// Time taken by work of one kind, s, and the time that was predicted for it, s.
  struct Pace {
    double elapsed = 0.0, predicted = 0.0;
  };
  int parts_before(std::size_t stages) const;
  void move_to(std::size_t stage, double now_s);
  Pace running_pace(double now_s) const;
  double predicted(const Stage& stage, double now_s) const;
  double running_remaining_s(double now_s) const;

  std::vector<Stage> plan_;
  std::size_t running_ = 0;
  double start_s_, stage_start_s_;
  double fraction_ = 0.0;
  std::map<std::string, Pace> paces_;
};

/// Returns "12 s", "3 min", "2 h 10 min".
std::string duration_text(double seconds);

/// Thrown after Ctrl-C: exit code 130.
struct Interrupted : std::runtime_error {
  Interrupted() : std::runtime_error("interrupted") {}
};

/// Makes the next report of progress after Ctrl-C throw Interrupted; a second Ctrl-C ends the
/// process at once.
void watch_interrupts();

/// Checks for Ctrl-C in work without progress reports.
/// @throws Interrupted if Ctrl-C was pressed
void stop_if_interrupted();

/// Receives the progress of the named stage as a fraction in [0, 1]. A negative fraction marks the
/// text as a remark, which is printed on a line of its own.
using Progress = std::function<void(const std::string& stage, double fraction)>;

/// Shows the progress of long work on stderr: on a terminal as one line with the remaining time,
/// redrawn twice a second and at reports; otherwise as a plain line for every part that begins.
/// Thread-safe.
class ProgressLine {
 public:
  /// @param plan     stages of the work in order
  /// @param observer  if given, is called with the part, its stage and the completed fraction of
  /// all work, and nothing is printed; remarks have a negative fraction, as in Progress
  explicit ProgressLine(std::vector<Stage> plan, Progress observer = {});
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// Replaces the stages after the running one when more is known about the work.
  void replan(std::vector<Stage> next_stages);
  /// Begins the next part.
  /// @throws Interrupted
  void begin(const std::string& part);
  /// Reports progress.
  /// @param fraction  negative: the text is a remark, which stays on a line of its own
  /// @throws Interrupted
  void report(const std::string& stage, double fraction);

 private:
  double now_s() const;
  void draw(const std::string& text);
  void draw_progress();

  std::mutex mutex_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::chrono::steady_clock::time_point last_drawn_{};
  RemainingTime remaining_time_;
  std::string part_, stage_;
  double fraction_ = 0.0;  ///< of the stage, as reported
  bool has_begun_ = false;
  Progress observer_;
  bool is_terminal_;
  std::condition_variable_any stopping_;
  std::jthread ticker_;  ///< redraws while nothing is reported; on a terminal only
};

/// Returns a function that reports to a progress line, which must outlive it.
Progress progress_function(ProgressLine& progress_line);

// Parallel tasks with a common progress line.

/// A unit of work that can run in parallel with others.
struct Task {
  std::string name;  ///< part of the plan of the progress line
  std::function<void(const Progress& progress)> work;
  double seconds = 0.0;  ///< rough prediction
};

/// Runs independent tasks, at most `max_parallel` at a time. The first task starts first; the
/// others follow from the longest to the shortest. The progress line shows the first task that is
/// not finished, as if the tasks ran one after the other; remarks of all tasks are shown at once.
/// If a task throws, the tasks after it stop at their next report. Uses only threads that the
/// process already has.
/// @throws the exception of the first task that failed, after all tasks have ended
void run_tasks(const std::vector<Task>& tasks, int max_parallel, ProgressLine& progress_line);

// Memory limits of the process, and a stopwatch.

/// A stopwatch that starts with its construction.
class Stopwatch {
 public:
  /// Returns the seconds since the construction or the last lap.
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    return seconds;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

/// Returns the memory that a computation may use, bytes: that of the computer or of the process.
double memory_bytes();

/// Returns the memory that the moves of a program may use, bytes: a third of the total; the rest is
/// for samples.
std::size_t max_move_bytes();

/// Sets the memory that computations may use, whatever the computer has. Computations that would
/// need more are then input errors before they begin.
void limit_memory(double bytes);

}  // namespace abbe::sim
