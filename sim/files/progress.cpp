#include "sim/files/progress.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <exception>
#include <iterator>
#include <mutex>
#include <numeric>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <semaphore.h>
#include <sys/resource.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <unistd.h>

#include "kinematics/bad_input.h"
#include "sim/files/atomic_output.h"
#include "sim/files/terminal.h"

namespace abbe::sim {

namespace {

// The prediction of the plan counts as much as this many seconds of measured work.
constexpr double plan_weight_s = 0.5;
// Weight of the pace of all work against that of work of the same kind, as a fraction of the
// planned time of the stage.
constexpr double all_work_weight = 0.1;
// Completed fraction of a stage above which only its own pace counts.
constexpr double min_self_timing_fraction = 0.3;
// Completed fraction of a stage below which its own pace is too uncertain to be used.
constexpr double min_learning_fraction = 0.02;

}  // namespace

RemainingTime::RemainingTime(std::vector<Stage> plan, double now_s)
    : plan_(std::move(plan)), start_s_(now_s), stage_start_s_(now_s) {
  if (plan_.empty()) plan_.push_back({});
}

void RemainingTime::replan(std::vector<Stage> next_stages) {
  plan_.erase(plan_.begin() + std::ptrdiff_t(running_) + 1, plan_.end());
  std::move(next_stages.begin(), next_stages.end(), std::back_inserter(plan_));
}

int RemainingTime::parts_before(std::size_t stages) const {
  int parts = 0;
  for (std::size_t i = 0; i < stages; ++i) parts += i == 0 || plan_[i].part != plan_[i - 1].part;
  return parts;
}

void RemainingTime::move_to(std::size_t stage, double now_s) {
  Pace& kind = paces_[plan_[running_].kind];
  kind.elapsed += now_s - stage_start_s_;
  kind.predicted += plan_[running_].seconds;
  running_ = stage;
  stage_start_s_ = now_s;
  fraction_ = 0.0;
}

void RemainingTime::begin(const std::string& part, double now_s) {
  for (std::size_t i = running_ + 1; i < plan_.size(); ++i)
    if (plan_[i].part == part && plan_[i - 1].part != part) return move_to(i, now_s);
}

void RemainingTime::report(const std::string& kind, double fraction, double now_s) {
  const std::string& part = plan_[running_].part;
  if (plan_[running_].kind != kind)
    for (std::size_t i = running_ + 1; i < plan_.size() && plan_[i].part == part; ++i)
      if (plan_[i].kind == kind) {
        move_to(i, now_s);
        break;
      }
  if (plan_[running_].kind == kind) fraction_ = std::clamp(fraction, fraction_, 1.0);
}

RemainingTime::Pace RemainingTime::running_pace(double now_s) const {
  if (fraction_ < min_learning_fraction) return {};
  return {now_s - stage_start_s_, fraction_ * plan_[running_].seconds};
}

/// Returns the time that a stage will take, s: its planned time scaled by the measured pace of work
/// of its kind, blended with the pace of all work while little of its kind was measured.
double RemainingTime::predicted(const Stage& stage, double now_s) const {
  Pace overall{plan_weight_s, plan_weight_s}, same_kind;
  const auto add = [&](const std::string& kind, const Pace& pace) {
    overall.elapsed += pace.elapsed;
    overall.predicted += pace.predicted;
    if (kind != stage.kind) return;
    same_kind.elapsed += pace.elapsed;
    same_kind.predicted += pace.predicted;
  };
  for (const auto& [kind, pace] : paces_) add(kind, pace);
  add(plan_[running_].kind, running_pace(now_s));
  const double weight = all_work_weight * stage.seconds,
               speed = overall.elapsed / overall.predicted;
  const double weighted_prediction = same_kind.predicted + weight;
  return weighted_prediction > 0.0
             ? stage.seconds * (same_kind.elapsed + weight * speed) / weighted_prediction
             : 0.0;
}

double RemainingTime::running_remaining_s(double now_s) const {
  const double elapsed = now_s - stage_start_s_;
  const double planned = predicted(plan_[running_], now_s);
  // An overdue stage without reports is assumed to need at least a tenth of its time so far.
  if (fraction_ <= 0.0) return std::max(planned - elapsed, 0.1 * std::min(planned, elapsed));
  // Early in a stage its own pace is uncertain: the plan dominates and then fades out.
  const double own_estimate_s = elapsed * (1.0 - fraction_) / fraction_;
  const double weight = std::min(1.0, fraction_ / min_self_timing_fraction);
  return weight * own_estimate_s + (1.0 - weight) * (1.0 - fraction_) * planned;
}

double RemainingTime::remaining_s(double now_s) const {
  double remaining = running_remaining_s(now_s);
  for (std::size_t i = running_ + 1; i < plan_.size(); ++i) remaining += predicted(plan_[i], now_s);
  return remaining;
}

double RemainingTime::completed_fraction(double now_s) const {
  const double spent = now_s - start_s_, remaining = remaining_s(now_s);
  return spent + remaining > 0.0 ? spent / (spent + remaining) : 0.0;
}

std::string duration_text(double seconds) {
  const auto rounded = [](double value) { return std::lround(std::max(0.0, value)); };
  if (rounded(seconds) < 90) return fmt::format("{} s", rounded(seconds));
  const long minutes = rounded(seconds / 60.0);
  if (minutes < 90) return fmt::format("{} min", minutes);
  return fmt::format("{} h {} min", minutes / 60, minutes % 60);
}

namespace {

volatile std::sig_atomic_t is_interrupted = 0;

constexpr double estimate_delay_s = 1.0;  // the remaining time is shown only after this time
constexpr std::chrono::milliseconds redraw_interval(500), min_redraw_interval(100);

/// Time in which work that checks for interrupts can end cleanly and close its files. Together with
/// the rest of the shutdown, the user waits for less than a second.
constexpr std::chrono::milliseconds stop_grace_period(700);

::sem_t interruption;

// Only async-signal-safe calls are allowed here, so the thread of end_after_interruption does the
// rest.
extern "C" void on_interrupt(int) {
  if (is_interrupted != 0) ::_exit(130);
  is_interrupted = 1;
  ::sem_post(&interruption);
}

/// Runs in a thread of its own. Ends the program if it has not stopped by itself in time, since
/// some work, for instance in libraries, never checks for interrupts. No result is damaged: a file
/// gets its name only when it is complete.
void end_after_interruption() {
  while (::sem_wait(&interruption) != 0) continue;
  std::this_thread::sleep_for(stop_grace_period);
  remove_own_unfinished_files();
  print(stderr, "{}abbe: interrupted\n", MultilineText(::isatty(STDERR_FILENO) != 0 ? "\n" : ""));
  ::_exit(130);
}

}  // namespace

void watch_interrupts() {
  ::sem_init(&interruption, 0, 0);
  std::thread(end_after_interruption).detach();
  std::signal(SIGINT, on_interrupt);
  std::signal(SIGTERM, on_interrupt);
}

void stop_if_interrupted() {
  if (is_interrupted != 0) throw Interrupted();
}

ProgressLine::ProgressLine(std::vector<Stage> plan, Progress observer)
    : remaining_time_(std::move(plan)),
      observer_(std::move(observer)),
      is_terminal_(!observer_ && ::isatty(STDERR_FILENO) != 0) {
  if (!is_terminal_) return;
  ticker_ = std::jthread([this](const std::stop_token& end) {
    std::unique_lock lock(mutex_);
    while (!stopping_.wait_for(lock, end, redraw_interval, [&] { return end.stop_requested(); }))
      draw_progress();
  });
}

ProgressLine::~ProgressLine() {
  if (!is_terminal_) return;
  ticker_ = {};
  std::fputs("\r\x1b[K", stderr);
}

double ProgressLine::now_s() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

void ProgressLine::draw(const std::string& text) {
  std::fputs(("\r\x1b[K" + escaped(text)).c_str(), stderr);
  std::fflush(stderr);
}

void ProgressLine::replan(std::vector<Stage> next_stages) {
  const std::lock_guard lock(mutex_);
  remaining_time_.replan(std::move(next_stages));
}

void ProgressLine::begin(const std::string& part) {
  if (is_interrupted != 0) throw Interrupted();
  const std::lock_guard lock(mutex_);
  if (has_begun_) remaining_time_.begin(part, now_s());
  has_begun_ = true;
  part_ = part;
  stage_.clear();
  if (observer_)
    observer_(part_, remaining_time_.completed_fraction(now_s()));
  else if (!is_terminal_)
    print(stderr, "[{}/{}] {}\n", remaining_time_.part(), remaining_time_.parts(), part_);
}

void ProgressLine::report(const std::string& stage, double fraction) {
  if (is_interrupted != 0) throw Interrupted();
  const std::lock_guard lock(mutex_);
  if (fraction < 0.0) {
    if (observer_) return observer_(stage, fraction);
    if (is_terminal_) draw("");
    print(stderr, "{}\n", stage);
    return;
  }
  remaining_time_.report(stage, fraction, now_s());
  const bool is_new_stage = stage != stage_;
  stage_ = stage;
  fraction_ = fraction;
  if (observer_)
    return observer_(part_ + ": " + stage_, remaining_time_.completed_fraction(now_s()));
  if (is_terminal_ &&
      (is_new_stage || std::chrono::steady_clock::now() - last_drawn_ >= min_redraw_interval))
    draw_progress();
}

void ProgressLine::draw_progress() {
  if (!has_begun_ || stage_.empty()) return;
  last_drawn_ = std::chrono::steady_clock::now();
  const double elapsed = now_s();
  std::string text =
      fmt::format("[{}/{}] {}: {}", remaining_time_.part(), remaining_time_.parts(), part_, stage_);
  if (fraction_ > 0.0) text += fmt::format(" {:.0f} %", 100.0 * std::min(fraction_, 1.0));
  if (elapsed >= estimate_delay_s)
    text += ", " + duration_text(remaining_time_.remaining_s(elapsed)) + " left";
  draw(text);
}

Progress progress_function(ProgressLine& progress_line) {
  return std::bind_front(&ProgressLine::report, &progress_line);
}

namespace {

/// Thrown by a task whose result is no longer needed because another task failed.
struct TaskCancelled {};

class TaskRunner {
 public:
  TaskRunner(const std::vector<Task>& tasks, ProgressLine& progress_line)
      : tasks_(tasks),
        progress_line_(progress_line),
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
      if (fraction < 0.0 || is_shown_now(task, stage, fraction))
        progress_line_.report(stage, fraction);
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

  /// Announces tasks in order, up to the first unfinished one, and shows their pending reports.
  void show_started_tasks() {
    const std::lock_guard lock(mutex_);
    while (shown_count_ < tasks_.size() && is_started_[shown_count_] &&
           (shown_count_ == 0 || is_finished_[shown_count_ - 1])) {
      const std::size_t task = shown_count_++;
      progress_line_.begin(tasks_[task].name);
      for (const Report& report : pending_reports_[task])
        progress_line_.report(report.stage, report.fraction);
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
  ProgressLine& progress_line_;
  std::mutex mutex_;
  std::vector<std::vector<Report>> pending_reports_;
  std::vector<std::size_t> waiting_;  // tasks not started, in the order in which they will start
  std::vector<bool> is_started_, is_finished_;
  std::size_t shown_count_ = 0;           // tasks shown so far; the last of them is the current one
  std::atomic<std::size_t> failed_task_;  // first task in order that failed; tasks_.size() if none
  std::exception_ptr first_failure_;
};

}  // namespace

void run_tasks(const std::vector<Task>& tasks, int max_parallel, ProgressLine& progress_line) {
  TaskRunner runner(tasks, progress_line);
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

double memory_bytes() {
  const auto resource_limit = [](int resource) -> std::optional<double> {
    ::rlimit limit{};
    if (::getrlimit(resource, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return std::nullopt;
    return double(limit.rlim_cur);
  };
  const double physical_bytes =
      double(::sysconf(_SC_PHYS_PAGES)) * double(::sysconf(_SC_PAGE_SIZE));
  double bytes = resource_limit(RLIMIT_RSS).value_or(physical_bytes);
  for (const auto resource : {RLIMIT_AS, RLIMIT_DATA})
    bytes = std::min(bytes, resource_limit(resource).value_or(bytes));
  return bytes;
}

void limit_memory(double bytes) {
  // Sets the limit of the resident memory. Linux stores this limit but does not enforce it, so an
  // estimate that is a little too low does not end a run.
  ::rlimit limit{};
  if (::getrlimit(RLIMIT_RSS, &limit) != 0) return;
  limit.rlim_cur = std::min(::rlim_t(bytes), limit.rlim_max);
  ::setrlimit(RLIMIT_RSS, &limit);
}

std::size_t max_move_bytes() { return std::size_t(memory_bytes() / 3.0); }

}  // namespace abbe::sim
