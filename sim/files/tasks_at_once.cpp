#include "sim/files/tasks_at_once.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <numeric>
#include <optional>
#include <thread>

namespace abbe::sim {
namespace {

/// What a task throws that another has made useless.
struct Stopped {};

class TasksAtOnce {
 public:
  TasksAtOnce(const std::vector<Task>& tasks, ProgressLine& line)
      : tasks_(tasks),
        line_(line),
        waiting_(tasks.size()),
        is_begun_(tasks.size(), false),
        is_over_(tasks.size(), false),
        failed_(tasks.size()) {
    std::iota(waiting_.begin(), waiting_.end(), std::size_t(0));
  }

  void begin_longest_first() {
    if (tasks_.empty()) return;
    std::stable_sort(waiting_.begin() + 1, waiting_.end(), [&](std::size_t a, std::size_t b) {
      return tasks_[a].seconds > tasks_[b].seconds;
    });
  }

  /// Task after task, until none is left to begin.
  void work() {
    while (const std::optional<std::size_t> task = next()) {
      try {
        name_shown();
        tasks_[*task].work(progress_of(*task));
        finish(*task);
      } catch (...) {
        fail(*task, std::current_exception());
      }
    }
  }

  void rethrow_first() const {
    if (fault_) std::rethrow_exception(fault_);
  }

 private:
  /// What a failure makes useless is not begun; what comes before it might fail as well.
  std::optional<std::size_t> next() {
    const std::lock_guard lock(mutex_);
    std::erase_if(waiting_, [&](std::size_t task) { return task > failed_; });
    if (waiting_.empty()) return std::nullopt;
    const std::size_t task = waiting_.front();
    waiting_.erase(waiting_.begin());
    is_begun_[task] = true;
    return task;
  }

  Progress progress_of(std::size_t task) {
    return [this, task](const std::string& stage, double fraction) {
      if (task > failed_) throw Stopped();
      if (task == shown_ || fraction < 0.0)
        line_.report(stage, fraction);
      else
        line_.repeat();
    };
  }

  /// Names the task that is shown on the line, once it has begun.
  void name_shown() {
    const std::lock_guard lock(mutex_);
    if (shown_ == named_ && named_ < tasks_.size() && is_begun_[named_])
      line_.begin(tasks_[named_++].name);
  }

  void finish(std::size_t task) {
    {
      const std::lock_guard lock(mutex_);
      is_over_[task] = true;
    }
    while (shows_next()) name_shown();
  }

  /// Where the one that was shown is over.
  bool shows_next() {
    const std::lock_guard lock(mutex_);
    if (shown_ >= tasks_.size() || !is_over_[shown_]) return false;
    ++shown_;
    return true;
  }

  void fail(std::size_t task, const std::exception_ptr& fault) {
    const std::lock_guard lock(mutex_);
    if (task > failed_) return;
    failed_ = task;
    fault_ = fault;
  }

  const std::vector<Task>& tasks_;
  ProgressLine& line_;
  std::mutex mutex_;
  std::vector<std::size_t> waiting_;  // in the order in which they begin
  std::vector<bool> is_begun_, is_over_;
  std::size_t named_ = 0;
  std::atomic<std::size_t> shown_ = 0, failed_;  // the first that is not over; that has failed
  std::exception_ptr fault_;
};

}  // namespace

void do_tasks(const std::vector<Task>& tasks, int at_once, ProgressLine& line) {
  TasksAtOnce all(tasks, line);
  if (at_once > 1) all.begin_longest_first();
  {
    std::vector<std::jthread> beside;
    for (int i = 1; i < std::min(at_once, int(tasks.size())); ++i)
      beside.emplace_back([&] { all.work(); });
    all.work();
  }
  all.rethrow_first();
}

}  // namespace abbe::sim
