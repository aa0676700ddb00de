#include "sim/files/parts_at_once.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>

namespace abbe::sim {
namespace {

/// What a part throws that another has made useless.
struct Stopped {};

class PartsAtOnce {
 public:
  PartsAtOnce(const std::vector<Part>& parts, ProgressLine& line)
      : parts_(parts), line_(line), is_over_(parts.size(), false), failed_(parts.size()) {}

  /// Part after part, until none is left to begin.
  void work() {
    while (const std::optional<std::size_t> part = next()) {
      try {
        name_shown();
        parts_[*part].work(progress_of(*part));
        finish(*part);
      } catch (...) {
        fail(*part, std::current_exception());
      }
    }
  }

  void rethrow_first() const {
    if (fault_) std::rethrow_exception(fault_);
  }

 private:
  std::optional<std::size_t> next() {
    const std::lock_guard lock(mutex_);
    if (begun_ >= parts_.size() || failed_ < parts_.size()) return std::nullopt;
    return begun_++;
  }

  Progress progress_of(std::size_t part) {
    return [this, part](const std::string& stage, double fraction) {
      if (part > failed_) throw Stopped();
      if (part == shown_ || fraction < 0.0)
        line_.report(stage, fraction);
      else
        stop_if_interrupted();
    };
  }

  /// Names the part that is shown on the line, once it has begun.
  void name_shown() {
    const std::lock_guard lock(mutex_);
    if (shown_ == named_ && named_ < begun_) line_.begin(parts_[named_++].name);
  }

  void finish(std::size_t part) {
    {
      const std::lock_guard lock(mutex_);
      is_over_[part] = true;
    }
    while (is_shown_over()) name_shown();
  }

  /// Then the next one is shown.
  bool is_shown_over() {
    const std::lock_guard lock(mutex_);
    if (shown_ >= parts_.size() || !is_over_[shown_]) return false;
    ++shown_;
    return true;
  }

  void fail(std::size_t part, const std::exception_ptr& fault) {
    const std::lock_guard lock(mutex_);
    if (part > failed_) return;
    failed_ = part;
    fault_ = fault;
  }

  const std::vector<Part>& parts_;
  ProgressLine& line_;
  std::mutex mutex_;
  std::size_t begun_ = 0, named_ = 0;
  std::vector<bool> is_over_;
  std::atomic<std::size_t> shown_ = 0, failed_;  // the first that is not over; that has failed
  std::exception_ptr fault_;
};

}  // namespace

void do_parts(const std::vector<Part>& parts, int at_once, ProgressLine& line) {
  PartsAtOnce all(parts, line);
  {
    std::vector<std::jthread> beside;
    for (int i = 1; i < std::min(at_once, int(parts.size())); ++i)
      beside.emplace_back([&] { all.work(); });
    all.work();
  }
  all.rethrow_first();
}

}  // namespace abbe::sim
