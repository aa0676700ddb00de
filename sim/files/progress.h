#pragma once

#include <chrono>
#include <functional>
#include <mutex>
#include <stdexcept>
#include <string>

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

/// Reports on stderr how far long work has come: one line with the time left, redrawn, on a
/// terminal; a plain line for every finished stage otherwise. Safe from any thread.
class ProgressLine {
 public:
  /// @param parts  how many parts of about equal work there are, for the time left
  explicit ProgressLine(int parts);
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// The next part begins.
  void begin(const std::string& part);
  /// @param fraction  below zero: the text is a remark, which stays on a line of its own
  /// @throws Interrupted
  void report(const std::string& stage, double fraction);

 private:
  void draw(const std::string& text);

  std::mutex mutex_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::chrono::steady_clock::time_point drawn_{};
  std::string part_;
  int parts_;
  int done_ = -1;
  bool terminal_;
};

}  // namespace abbe::sim
