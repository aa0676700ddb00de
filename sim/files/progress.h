#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace abbe::sim {

/// A stage of work to come.
struct Stage {
  std::string part;      ///< to which it belongs, such as a case
  std::string kind;      ///< what it does, as it reports itself; stages of one kind cost alike
  double seconds = 0.0;  ///< predicted, on a computer of about this speed
};

/// How long planned stages will still take. Predictions say how the stages compare; how fast this
/// computer does each kind of work is learned from the stages that are over and from the one that
/// runs. Knows no clock: times are handed in, s, and rise.
class RemainingTime {
 public:
  explicit RemainingTime(std::vector<Stage> plan, double now_s = 0.0);

  /// From now on these stages follow the one that runs; what was learned stays.
  void replan(std::vector<Stage> rest);
  /// The stage that runs is over, and the next one of that part begins; those between are left out.
  void begin(const std::string& part, double now_s);
  /// A stage of the part that runs has come so far; one of another kind is over with its first
  /// report. A kind that is not planned counts for the stage that runs.
  void report(const std::string& kind, double fraction, double now_s);

  /// Number of the part that runs, from 1, and of all; stages of one part stand together.
  int part() const { return parts_before(running_ + 1); }
  int parts() const { return parts_before(plan_.size()); }

  double remaining_s(double now_s) const;
  /// Of all the work, by the predictions as they are now.
  double done(double now_s) const;

 private:
  /// What work of one kind took, and what was predicted for it.
  struct Measured {
    double took = 0.0, predicted = 0.0;
  };
  int parts_before(std::size_t stages) const;
  void move_to(std::size_t stage, double now_s);
  Measured measured_rate_of_running(double now_s) const;
  double predicted(const Stage& stage, double now_s) const;
  double remaining_of_running(double now_s) const;

  std::vector<Stage> plan_;
  std::size_t running_ = 0;
  double start_s_, begun_s_;
  double fraction_ = 0.0;
  std::map<std::string, Measured> measured_;
};

/// "12 s", "3 min", "2 h 10 min"
std::string duration_text(double seconds);

/// Ctrl-C was pressed: exit 130.
struct Interrupted : std::runtime_error {
  Interrupted() : std::runtime_error("interrupted") {}
};

/// From now on Ctrl-C makes the next report of progress throw Interrupted; a second one ends at
/// once.
void watch_interrupts();

/// For work that reports no progress. @throws Interrupted if Ctrl-C was pressed
void stop_if_interrupted();

/// Called now and then with how far the named stage has come, fraction in [0, 1]; below zero the
/// text is a remark, which is for a line of its own.
using Progress = std::function<void(const std::string& stage, double fraction)>;

/// Reports on stderr how far long work has come: one line with the time left
/// (sim/files/progress.h), redrawn twice a second and with reports, on a terminal; a plain line
/// for every part that begins otherwise. Safe from any thread.
class ProgressLine {
 public:
  /// @param plan     stages of the work in their order
  /// @param instead  is called, with the part and its stage and how far the whole has come, and
  ///                 stderr stays empty; its remarks are below zero as those of a stage
  explicit ProgressLine(std::vector<Stage> plan, Progress instead = {});
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// More is known of the work: what follows the part that runs.
  void replan(std::vector<Stage> rest);
  /// The next part begins. @throws Interrupted
  void begin(const std::string& part);
  /// @param fraction  below zero: the text is a remark, which stays on a line of its own
  /// @throws Interrupted
  void report(const std::string& stage, double fraction);

 private:
  double now_s() const;
  double share() const;
  void draw(const std::string& text);
  void draw_state();

  std::mutex mutex_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::chrono::steady_clock::time_point drawn_{};
  RemainingTime remaining_time_;
  std::string part_, stage_;
  double fraction_ = 0.0;  ///< of the stage, as it was reported
  bool begun_ = false;
  Progress instead_;
  bool terminal_;
  std::condition_variable_any ends_;
  std::jthread ticker_;  ///< draws while nothing is reported; on a terminal only
};

/// Reports to a line, which must outlive it.
Progress to(ProgressLine& line);

}  // namespace abbe::sim
