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
struct TaskCancelled {};

class TaskRunner {
 public:
  TaskRunner(const std::vector<Task>& tasks, ProgressLine& line)
      : tasks_(tasks),
        line_(line),
        pending_reports_(tasks.size()),
        waiting_(tasks.size()),
        is_started_(tasks.size(), false),
        is_finished_(tasks.size(), false),
        failed_task_(tasks.size()) {
    std::iota(waiting_.begin(), waiting_.end(), std::size_t(0));
  }

  void start_longest_first() {
    if (tasks_.empty()) return;
    std::stable_sort(waiting_.begin() + 1, waiting_.end(), [&](std::size_t a, std::size_t b) {
      return tasks_[a].seconds > tasks_[b].seconds;
    });
  }

  /// Runs waiting tasks one after the other until none is left; called in each worker thread.
  void run_waiting_tasks() {
    while (const std::optional<std::size_t> task = take_next_task()) {
      try {
        show_started_tasks();
        tasks_[*task].work(task_progress(*task));
        mark_finished(*task);
      } catch (...) {
        record_failure(*task, std::current_exception());
      }
    }
  }

  void rethrow_first_failure() const {
    if (first_failure_) std::rethrow_exception(first_failure_);
  }

 private:
  /// Returns the next task to start. Tasks after a failed one are dropped. Those before it still
  /// run, because one of them might fail too, and the first failure in order is the one to report.
  std::optional<std::size_t> take_next_task() {
    const std::lock_guard lock(mutex_);
    std::erase_if(waiting_, [&](std::size_t task) { return task > failed_task_; });
    if (waiting_.empty()) return std::nullopt;
    const std::size_t task = waiting_.front();
    waiting_.erase(waiting_.begin());
    is_started_[task] = true;
    return task;
  }

  Progress task_progress(std::size_t task) {
    return [this, task](const std::string& stage, double fraction) {
      // The failure of an earlier task makes this one pointless.
      if (task > failed_task_) throw TaskCancelled();
      stop_if_interrupted();
      if (fraction < 0.0 || is_shown_now(task, stage, fraction)) line_.report(stage, fraction);
    };
  }

  /// Returns true if the report comes from the current task and is to be shown now. Otherwise keeps
  /// the last report of each stage for later.
  bool is_shown_now(std::size_t task, const std::string& stage, double fraction) {
    const std::lock_guard lock(mutex_);
    if (task + 1 == shown_count_) return true;
    std::vector<Report>& reports = pending_reports_[task];
    if (reports.empty() || reports.back().stage != stage) reports.push_back({stage, 0.0});
    reports.back().fraction = fraction;
    return false;
  }

  void mark_finished(std::size_t task) {
    {
      const std::lock_guard lock(mutex_);
      is_finished_[task] = true;
    }
    show_started_tasks();
  }

  /// Announces tasks in order, up to the first that is not finished, and shows their pending
  /// reports.
  void show_started_tasks() {
    const std::lock_guard lock(mutex_);
    while (shown_count_ < tasks_.size() && is_started_[shown_count_] &&
           (shown_count_ == 0 || is_finished_[shown_count_ - 1])) {
      const std::size_t task = shown_count_++;
      line_.begin(tasks_[task].name);
      for (const Report& report : pending_reports_[task])
        line_.report(report.stage, report.fraction);
    }
  }

  void record_failure(std::size_t task, const std::exception_ptr& failure) {
    const std::lock_guard lock(mutex_);
    if (task > failed_task_) return;
    failed_task_ = task;
    first_failure_ = failure;
  }

  struct Report {
    std::string stage;
    double fraction;
  };

  const std::vector<Task>& tasks_;
  ProgressLine& line_;
  std::mutex mutex_;
  std::vector<std::vector<Report>> pending_reports_;
  std::vector<std::size_t> waiting_;  // tasks not started, in the order in which they will start
  std::vector<bool> is_started_, is_finished_;
  std::size_t shown_count_ = 0;           // tasks shown so far; the last of them is the current one
  std::atomic<std::size_t> failed_task_;  // first task in order that failed; tasks_.size() if none
  std::exception_ptr first_failure_;
};

}  // namespace

void run_tasks(const std::vector<Task>& tasks, int max_parallel, ProgressLine& line) {
  TaskRunner runner(tasks, line);
  if (max_parallel > 1) {
    runner.start_longest_first();
    // Isolated: a thread that waits for nested parallel work must not pick up another task
    // meanwhile.
    const auto worker = [&](int) {
      tbb::this_task_arena::isolate([&] { runner.run_waiting_tasks(); });
    };
    tbb::parallel_for(0, std::min(max_parallel, int(tasks.size())), worker,
                      tbb::simple_partitioner());
  } else {
    runner.run_waiting_tasks();
  }
  runner.rethrow_first_failure();
}

}  // namespace abbe::sim
