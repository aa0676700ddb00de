#include "sim/files/parallel_tasks.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <numeric>
#include <optional>

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

namespace abbe::sim {

namespace {

/// Thrown by a task whose result is no longer needed because another task failed.
struct Stopped {};

class TaskRunner {
 public:
  TaskRunner(const std::vector<Task>& tasks, ProgressLine& line)
      : tasks_(tasks),
        line_(line),
        kept_(tasks.size()),
        waiting_(tasks.size()),
        is_begun_(tasks.size(), false),
        is_over_(tasks.size(), false),
        failed_(tasks.size()) {
    std::iota(waiting_.begin(), waiting_.end(), std::size_t(0));
  }

  void start_longest_first() {
    if (tasks_.empty()) return;
    std::stable_sort(waiting_.begin() + 1, waiting_.end(), [&](std::size_t a, std::size_t b) {
      return tasks_[a].seconds > tasks_[b].seconds;
    });
  }

  /// Runs task after task until none is left to begin.
  void work() {
    while (const std::optional<std::size_t> task = next()) {
      try {
        show();
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
  /// Returns the next task to begin. Tasks after a failed one are dropped. Those before it still
  /// run, because one of them might fail too, and the first failure is the one to report.
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
      // The failure of an earlier task makes this one pointless.
      if (task > failed_) throw Stopped();
      stop_if_interrupted();
      if (fraction < 0.0 || shows_progress(task, stage, fraction)) line_.report(stage, fraction);
    };
  }

  /// Returns true if the report is to be shown now, i.e. comes from the current task. Otherwise
  /// keeps the last report of each stage for later.
  bool shows_progress(std::size_t task, const std::string& stage, double fraction) {
    const std::lock_guard lock(mutex_);
    if (task + 1 == named_) return true;
    std::vector<Report>& reports = kept_[task];
    if (reports.empty() || reports.back().stage != stage) reports.push_back({stage, 0.0});
    reports.back().fraction = fraction;
    return false;
  }

  void finish(std::size_t task) {
    {
      const std::lock_guard lock(mutex_);
      is_over_[task] = true;
    }
    show();
  }

  /// Announces tasks in order, up to the first that is not finished, and passes on the reports that
  /// were kept for them.
  void show() {
    const std::lock_guard lock(mutex_);
    while (named_ < tasks_.size() && is_begun_[named_] && (named_ == 0 || is_over_[named_ - 1])) {
      const std::size_t task = named_++;
      line_.begin(tasks_[task].name);
      for (const Report& report : kept_[task]) line_.report(report.stage, report.fraction);
    }
  }

  void fail(std::size_t task, const std::exception_ptr& fault) {
    const std::lock_guard lock(mutex_);
    if (task > failed_) return;
    failed_ = task;
    fault_ = fault;
  }

  struct Report {
    std::string stage;
    double fraction;
  };

  const std::vector<Task>& tasks_;
  ProgressLine& line_;
  std::mutex mutex_;
  std::vector<std::vector<Report>> kept_;
  std::vector<std::size_t> waiting_;  // tasks not begun, in the order in which they will be
  std::vector<bool> is_begun_, is_over_;
  std::size_t named_ = 0;  // number of tasks shown so far; the last of them is the current one
  std::atomic<std::size_t> failed_;  // first task that failed; tasks_.size(): none
  std::exception_ptr fault_;
};

}  // namespace

void run_tasks(const std::vector<Task>& tasks, int at_once, ProgressLine& line) {
  TaskRunner all(tasks, line);
  if (at_once > 1) {
    all.start_longest_first();
    // Isolated: a thread that waits for nested parallel work must not pick up another task
    // meanwhile.
    const auto work = [&](int) { tbb::this_task_arena::isolate([&] { all.work(); }); };
    tbb::parallel_for(0, std::min(at_once, int(tasks.size())), work, tbb::simple_partitioner());
  } else {
    all.work();
  }
  all.rethrow_first();
}

}  // namespace abbe::sim
