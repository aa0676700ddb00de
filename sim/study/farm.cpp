#include "sim/study/farm.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>

#include "sim/files/progress.h"
#include "sim/study/messages.h"

namespace abbe::sim::study {
namespace {

/// Remembers the first failure of many threads.
class FirstFailure {
 public:
  void remember(std::exception_ptr failure) {
    const std::lock_guard lock(mutex_);
    if (!failure_) failure_ = std::move(failure);
    happened_ = true;
  }
  bool happened() const { return happened_; }
  /// Empty for none; when all threads are done.
  std::exception_ptr failure() const { return failure_; }

 private:
  std::mutex mutex_;
  std::exception_ptr failure_;
  std::atomic<bool> happened_ = false;
};

/// Where batches come from and where their rows go; both are called by one thread at a time.
struct Ends {
  std::function<std::optional<Batch>()> next;
  Take deliver;
};

/// What each of the threads does: batch after batch until there are none.
class Work {
 public:
  Work(const Compute& compute, const Ends& ends) : compute_(compute), ends_(ends) {}

  void until_done() {
    while (const std::optional<Batch> batch = next()) {
      try {
        stop_if_interrupted();
        deliver(*batch, compute_(*batch));
      } catch (...) {
        failure_.remember(std::current_exception());
      }
    }
  }
  std::exception_ptr failure() const { return failure_.failure(); }

 private:
  std::optional<Batch> next() {
    const std::lock_guard lock(mutex_);
    if (failure_.happened()) return {};
    try {
      return ends_.next();
    } catch (...) {
      failure_.remember(std::current_exception());
      return {};
    }
  }
  void deliver(const Batch& batch, std::vector<Row> rows) {
    const std::lock_guard lock(mutex_);
    if (refused_) return;
    refused_ = true;  // unless it comes back
    ends_.deliver(batch, std::move(rows));
    refused_ = false;
  }

  const Compute& compute_;
  const Ends& ends_;
  std::mutex mutex_;
  bool refused_ = false;
  FirstFailure failure_;
};

/// A failure is remembered rather than thrown through TBB, which would cancel the parallel work in
/// other batches half done and have it look finished.
std::exception_ptr work(const Compute& compute, const Ends& ends, int threads) {
  Work work(compute, ends);
  tbb::parallel_for(
      tbb::blocked_range<int>(0, threads, 1),
      [&](const tbb::blocked_range<int>&) {
        // a thread that waits inside a batch must not begin another one
        tbb::this_task_arena::isolate([&] { work.until_done(); });
      },
      tbb::simple_partitioner());
  return work.failure();
}

void rethrow(const std::exception_ptr& failure) {
  if (failure) std::rethrow_exception(failure);
}

void farm_alone(const std::vector<Batch>& batches, const Compute& compute, const Take& take) {
  auto at = batches.begin();
  const auto next = [&] { return at == batches.end() ? std::nullopt : std::optional(*at++); };
  rethrow(work(compute, {next, take}, tbb::this_task_arena::max_concurrency()));
}

// ---------------------------------------------------------------- among ranks

enum Kind : int {
  Ask,      ///< for the next batch
  Rows,     ///< of a finished batch
  Done,     ///< nothing more comes from this rank; how it failed
  Do,       ///< this batch
  Rest,     ///< there are none
  Outcome,  ///< how the farm ended
};

/// What rank 0 does until the others have nothing more to say.
class Office {
 public:
  Office(const std::vector<Batch>& batches, const Take& take) : batches_(batches), take_(take) {}

  void run(int others) {
    while (others > 0) {
      const Message message = next_message();
      if (message.kind == Ask) answer(message.rank);
      if (message.kind == Rows) take(message.bytes);
      if (message.kind == Done) --others;
      if (message.kind == Done && !message.bytes.empty())
        failure_.remember(failure_in(message.bytes));
    }
  }
  std::exception_ptr failure() const { return failure_.failure(); }

 private:
  Message next_message() {
    try {
      return receive(any_rank, !failure_.happened());
    } catch (const Interrupted&) {
      failure_.remember(std::current_exception());
      return receive(any_rank);
    }
  }
  void answer(int rank) {
    if (failure_.happened() || handed_out_ == batches_.size()) return send(rank, Rest);
    send(rank, Do, to_bytes(batches_[handed_out_++]));
  }
  void take(const std::string& bytes) {
    if (refused_) return;
    try {
      Finished finished = finished_in(bytes);
      take_(finished.batch, std::move(finished.rows));
    } catch (...) {
      refused_ = true;
      failure_.remember(std::current_exception());
    }
  }

  const std::vector<Batch>& batches_;
  const Take& take_;
  std::size_t handed_out_ = 0;
  bool refused_ = false;
  FirstFailure failure_;
};

void farm_out(const std::vector<Batch>& batches, const Ranks& ranks, const Take& take) {
  Office office(batches, take);
  office.run(ranks.size - 1);
  const std::string outcome = to_bytes(office.failure());
  for (int rank = 1; rank < ranks.size; ++rank) send(rank, Outcome, outcome);
  rethrow(office.failure());
}

void work_for_rank_0(const Compute& compute) {
  const auto next = []() -> std::optional<Batch> {
    send(0, Ask);
    const Message answer = receive(0);
    return answer.kind == Do ? std::optional(batch_in(answer.bytes)) : std::nullopt;
  };
  const auto deliver = [](const Batch& batch, std::vector<Row> rows) {
    send(0, Rows, to_bytes(Finished{batch, std::move(rows)}));
  };
  const int threads = threads_may_talk() ? tbb::this_task_arena::max_concurrency() : 1;
  send(0, Done, to_bytes(work(compute, {next, deliver}, threads)));
  rethrow(failure_in(receive(0).bytes));
}

}  // namespace

std::vector<Batch> of_shard(const std::vector<Batch>& batches, const Shard& shard) {
  if (shard.count < 1 || shard.index < 0 || shard.index >= shard.count)
    throw std::invalid_argument(fmt::format("no shard {} of {}", shard.index, shard.count));
  std::vector<Batch> mine;
  for (std::size_t i = std::size_t(shard.index); i < batches.size(); i += std::size_t(shard.count))
    mine.push_back(batches[i]);
  return mine;
}

std::vector<Batch> unfinished(const std::vector<Batch>& batches,
                              const std::vector<std::uint64_t>& finished) {
  std::vector<Batch> left;
  for (const Batch& batch : batches) {
    const auto first = std::lower_bound(finished.begin(), finished.end(), batch.first);
    const auto last = std::lower_bound(first, finished.end(), batch.last);
    if (std::uint64_t(last - first) < batch.last - batch.first) left.push_back(batch);
  }
  return left;
}

void farm(const std::vector<Batch>& batches, const Ranks& ranks, const Compute& compute,
          const Take& take) {
  if (ranks.size == 1) return farm_alone(batches, compute, take);
  if (ranks.rank == 0) return farm_out(batches, ranks, take);
  work_for_rank_0(compute);
}

}  // namespace abbe::sim::study
