#include "sim/files/side_by_side.h"

#include <algorithm>
#include <deque>
#include <future>
#include <memory>
#include <mutex>
#include <utility>

namespace abbe::sim {
namespace {

/// What a part reports while it has not its turn on the line, and where it goes then.
class Reports {
 public:
  void report(const std::string& stage, double fraction) {
    const std::lock_guard lock(mutex_);
    if (stopped_) throw Interrupted();
    if (line_ != nullptr) return line_->report(stage, fraction);
    stop_if_interrupted();
    if (!kept_.empty() && fraction >= 0.0 && kept_.back().first == stage) kept_.pop_back();
    kept_.emplace_back(stage, fraction);
  }

  void show(const std::string& name, ProgressLine& line) {
    const std::lock_guard lock(mutex_);
    line.begin(name);
    line_ = &line;
    for (const auto& [stage, fraction] : kept_) line.report(stage, fraction);
  }

  void stop() {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
  }

 private:
  std::mutex mutex_;
  ProgressLine* line_ = nullptr;
  bool stopped_ = false;
  std::vector<std::pair<std::string, double>> kept_;  ///< stages and remarks, in their order
};

struct RunningPiece {
  std::string name;
  std::shared_ptr<Reports> reports;
  std::future<void> result;
};

RunningPiece started(const PieceOfWork& part) {
  const auto reports = std::make_shared<Reports>();
  return {
      part.name, reports, std::async(std::launch::async, [reports, work = part.work] {
        work([&](const std::string& stage, double fraction) { reports->report(stage, fraction); });
      })};
}

}  // namespace

void side_by_side(const std::vector<PieceOfWork>& parts, int at_a_time, ProgressLine& line) {
  if (at_a_time <= 1) {
    for (const PieceOfWork& part : parts) {
      line.begin(part.name);
      part.work(to(line));
    }
    return;
  }
  std::deque<RunningPiece> running;
  std::size_t next = 0;
  const auto fill = [&] {
    while (next < parts.size() && int(running.size()) < at_a_time)
      running.push_back(started(parts[next++]));
  };
  try {
    for (fill(); !running.empty(); fill()) {
      running.front().reports->show(running.front().name, line);
      running.front().result.get();
      running.pop_front();
    }
  } catch (...) {
    for (const RunningPiece& part : running) part.reports->stop();
    throw;  // the futures wait for what still runs
  }
}

}  // namespace abbe::sim
