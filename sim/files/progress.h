#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "sim/files/time_left.h"

namespace abbe::sim {

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
/// (sim/files/time_left.h), redrawn twice a second and with reports, on a terminal; a plain line
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
  TimeLeft time_left_;
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
