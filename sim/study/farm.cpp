#include "sim/study/farm.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <climits>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <mutex>
#include <new>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>
#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "sim/compensation/plug_in.h"
#include "sim/dialects/read_options.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/scene/scene.h"
#include "sim/scene/toml.h"

#ifdef ABBE_MPI
// Only the C functions are used: the C++ bindings were removed from the standard and need a library
// of their own.
#define OMPI_SKIP_MPICXX 1
#define MPICH_SKIP_MPICXX 1
#include <mpi.h>
#endif

namespace abbe::sim::study {

namespace {

int environment_number(const char* variable) {
  const char* text = std::getenv(variable);
  return text == nullptr ? 0 : std::atoi(text);
}

/// Returns the number of processes that were started together and can communicate. PMI variables
/// alone do not show it: Slurm sets them also in the script of a job and in a step without MPI
/// support, where starting MPI would end the process.
int started_process_count() {
  if (std::getenv("OMPI_COMM_WORLD_SIZE") != nullptr)
    return environment_number("OMPI_COMM_WORLD_SIZE");
  if (std::getenv("PMI_RANK") != nullptr && std::getenv("PMI_SIZE") != nullptr)
    return environment_number("PMI_SIZE");
  if (std::getenv("PMIX_RANK") != nullptr && std::getenv("PMIX_NAMESPACE") != nullptr)
    return environment_number("SLURM_STEP_NUM_TASKS");
  return 1;
}

}  // namespace

#ifdef ABBE_MPI

namespace {

bool is_running() {
  int begun = 0, ended = 0;
  MPI_Initialized(&begun);
  MPI_Finalized(&ended);
  return begun != 0 && ended == 0;
}

}  // namespace

Ranks ranks(int& argc, char**& argv) {
  if (started_process_count() <= 1) return {};
  if (!is_running()) {
    // One thread at a time sends: every thread of a rank asks for batches, but under one lock.
    int provided = 0;
    MPI_Init_thread(&argc, &argv, MPI_THREAD_SERIALIZED, &provided);
  }
  Ranks here;
  MPI_Comm_rank(MPI_COMM_WORLD, &here.rank);
  MPI_Comm_size(MPI_COMM_WORLD, &here.size);
  return here;
}

void finalize_ranks(int exit_code) {
  if (!is_running()) return;
  if (exit_code == 0 || exit_code == 1) {
    MPI_Finalize();
    return;
  }
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  std::signal(SIGTERM, SIG_DFL);  // mpirun ends ranks with it before it kills them
  if (rank != 0) std::this_thread::sleep_for(std::chrono::seconds(2));
  MPI_Abort(MPI_COMM_WORLD, exit_code);
}

std::vector<std::uint64_t> broadcast_from_rank_0(const Ranks& ranks,
                                                 const std::vector<std::uint64_t>& data) {
  if (ranks.size == 1) return data;
  std::uint64_t size = data.size();
  // MPI counts are of type int.
  MPI_Bcast(&size, 1, MPI_UINT64_T, 0, MPI_COMM_WORLD);
  std::vector<std::uint64_t> result(size);
  if (ranks.rank == 0) result = data;
  constexpr std::uint64_t at_once = 1 << 24;
  for (std::uint64_t i = 0; i < size; i += at_once)
    MPI_Bcast(result.data() + i, int(std::min(at_once, size - i)), MPI_UINT64_T, 0, MPI_COMM_WORLD);
  return result;
}

void send(int rank, int kind, const std::string& bytes) {
  if (bytes.size() > INT_MAX) throw std::runtime_error("a batch of 2 GB is too large to send");
  MPI_Send(bytes.data(), int(bytes.size()), MPI_BYTE, rank, kind, MPI_COMM_WORLD);
}

Message receive(int rank, bool interruptible) {
  const int from = rank == any_rank ? MPI_ANY_SOURCE : rank;
  // A blocking receive would keep a core busy that computes for another rank.
  constexpr std::chrono::microseconds longest(1000);
  MPI_Status status;
  std::chrono::microseconds pause(10);
  for (int there = 0;;) {
    MPI_Iprobe(from, MPI_ANY_TAG, MPI_COMM_WORLD, &there, &status);
    if (there != 0) break;
    if (interruptible) stop_if_interrupted();
    std::this_thread::sleep_for(pause);
    pause = std::min(2 * pause, longest);
  }
  int size = 0;
  MPI_Get_count(&status, MPI_BYTE, &size);
  Message message{status.MPI_SOURCE, status.MPI_TAG, std::string(std::size_t(size), '\0')};
  MPI_Recv(message.bytes.data(), size, MPI_BYTE, message.rank, message.kind, MPI_COMM_WORLD,
           MPI_STATUS_IGNORE);
  return message;
}

bool can_threads_communicate() {
  int provided = MPI_THREAD_SINGLE;
  MPI_Query_thread(&provided);
  return provided >= MPI_THREAD_SERIALIZED;
}

#else

Ranks ranks(int&, char**&) {
  if (started_process_count() > 1)
    throw std::runtime_error(
        "started as one of several processes, but built without MPI: run ./abbe setup --cluster to "
        "build with MPI");
  return {};
}

void finalize_ranks(int) {}

std::vector<std::uint64_t> broadcast_from_rank_0(const Ranks&,
                                                 const std::vector<std::uint64_t>& data) {
  return data;
}

void send(int, int, const std::string&) { throw std::logic_error("built without MPI"); }
Message receive(int, bool) { throw std::logic_error("built without MPI"); }
bool can_threads_communicate() { return false; }

#endif

namespace {

/// Keeps the first failure of many threads.
class FirstFailure {
 public:
  void remember(std::exception_ptr failure) {
    const std::lock_guard lock(mutex_);
    if (!failure_) failure_ = std::move(failure);
    has_failed_ = true;
  }
  bool has_failed() const { return has_failed_; }
  /// Returns the failure, null if there is none. Not thread-safe: only after all threads have
  /// ended.
  std::exception_ptr failure() const { return failure_; }

 private:
  std::mutex mutex_;
  std::exception_ptr failure_;
  std::atomic<bool> has_failed_ = false;
};

/// The source of the batches and the destination of their rows. One thread at a time calls either.
struct BatchChannel {
  std::function<std::optional<Batch>()> next;  ///< returns none if no batch is left
  TakeBatch deliver;
};

/// Computes batch after batch, on every thread that calls `run_batches`.
class BatchWorker {
 public:
  BatchWorker(const ComputeBatch& compute, const BatchChannel& channel)
      : compute_(compute), channel_(channel) {}

  void run_batches() {
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
    if (failure_.has_failed()) return {};
    try {
      return channel_.next();
    } catch (...) {
      failure_.remember(std::current_exception());
      return {};
    }
  }
  void deliver(const Batch& batch, std::vector<Row> rows) {
    const std::lock_guard lock(mutex_);
    if (has_deliver_failed_) return;
    has_deliver_failed_ = true;  // stays true if `deliver` throws
    channel_.deliver(batch, std::move(rows));
    has_deliver_failed_ = false;
  }

  const ComputeBatch& compute_;
  const BatchChannel& channel_;
  std::mutex mutex_;
  bool has_deliver_failed_ = false;
  FirstFailure failure_;
};

/// Computes batches on many threads and returns the first failure. It is not thrown through TBB,
/// which would cancel the parallel work inside other batches and let unfinished ones appear
/// finished.
std::exception_ptr compute_batches(const ComputeBatch& compute, const BatchChannel& channel,
                                   int threads) {
  BatchWorker worker(compute, channel);
  tbb::parallel_for(
      tbb::blocked_range<int>(0, threads, 1),
      [&](const tbb::blocked_range<int>&) {
        // A thread that waits inside a batch must not begin another one.
        tbb::this_task_arena::isolate([&] { worker.run_batches(); });
      },
      tbb::simple_partitioner());
  return worker.failure();
}

void rethrow_if_set(const std::exception_ptr& failure) {
  if (failure) std::rethrow_exception(failure);
}

void compute_in_one_process(const std::vector<Batch>& batches, const ComputeBatch& compute,
                            const TakeBatch& take) {
  auto batch = batches.begin();
  const auto next = [&] { return batch == batches.end() ? std::nullopt : std::optional(*batch++); };
  rethrow_if_set(compute_batches(compute, {next, take}, tbb::this_task_arena::max_concurrency()));
}

/// Kinds of messages between ranks.
enum MessageKind : int {
  BatchRequest,     ///< to rank 0
  BatchRows,        ///< rows of a finished batch, to rank 0
  RankDone,         ///< last message of a rank to rank 0, with its failure
  BatchAssignment,  ///< batch to compute
  NoBatchLeft,
  Outcome,  ///< failure of the farm; empty: none
};

/// Assigns batches to the other ranks and takes their rows until all of them are done.
class Dispatcher {
 public:
  Dispatcher(const std::vector<Batch>& batches, const TakeBatch& take)
      : batches_(batches), take_(take) {}

  void run(int active_ranks) {
    while (active_ranks > 0) {
      const Message message = next_message();
      if (message.kind == BatchRequest) assign_batch(message.rank);
      if (message.kind == BatchRows) take(message.bytes);
      if (message.kind == RankDone) --active_ranks;
      if (message.kind == RankDone && !message.bytes.empty())
        failure_.remember(parse_failure(message.bytes));
    }
  }
  std::exception_ptr failure() const { return failure_.failure(); }

 private:
  Message next_message() {
    try {
      // After a failure the remaining messages must still be received, whatever the user presses.
      return receive(any_rank, !failure_.has_failed());
    } catch (const Interrupted&) {
      failure_.remember(std::current_exception());
      return receive(any_rank);
    }
  }
  void assign_batch(int rank) {
    if (failure_.has_failed() || next_batch_ == batches_.size()) return send(rank, NoBatchLeft);
    send(rank, BatchAssignment, to_bytes(batches_[next_batch_++]));
  }
  void take(const std::string& bytes) {
    // After a failure `take_` gets no further rows.
    if (has_take_failed_) return;
    try {
      BatchResult result = parse_batch_result(bytes);
      take_(result.batch, std::move(result.rows));
    } catch (...) {
      has_take_failed_ = true;
      failure_.remember(std::current_exception());
    }
  }

  const std::vector<Batch>& batches_;
  const TakeBatch& take_;
  std::size_t next_batch_ = 0;
  bool has_take_failed_ = false;
  FirstFailure failure_;
};

void dispatch(const std::vector<Batch>& batches, const Ranks& ranks, const TakeBatch& take) {
  Dispatcher dispatcher(batches, take);
  dispatcher.run(ranks.size - 1);
  const std::string outcome = to_bytes(dispatcher.failure());
  for (int rank = 1; rank < ranks.size; ++rank) send(rank, Outcome, outcome);
  rethrow_if_set(dispatcher.failure());
}

void compute_for_rank_0(const ComputeBatch& compute) {
  const auto next = []() -> std::optional<Batch> {
    send(0, BatchRequest);
    const Message reply = receive(0);
    return reply.kind == BatchAssignment ? std::optional(parse_batch(reply.bytes)) : std::nullopt;
  };
  const auto deliver = [](const Batch& batch, std::vector<Row> rows) {
    send(0, BatchRows, to_bytes(BatchResult{batch, std::move(rows)}));
  };
  // Without thread support of MPI only one thread may communicate.
  const int threads = can_threads_communicate() ? tbb::this_task_arena::max_concurrency() : 1;
  send(0, RankDone, to_bytes(compute_batches(compute, {next, deliver}, threads)));
  rethrow_if_set(parse_failure(receive(0).bytes));
}

}  // namespace

std::vector<Batch> shard_batches(const std::vector<Batch>& batches, const Shard& shard) {
  if (shard.count < 1 || shard.index < 0 || shard.index >= shard.count)
    throw std::invalid_argument(
        fmt::format("there is no shard {} of {}", shard.index, shard.count));
  std::vector<Batch> result;
  for (std::size_t i = std::size_t(shard.index); i < batches.size(); i += std::size_t(shard.count))
    result.push_back(batches[i]);
  return result;
}

std::vector<Batch> unfinished(const std::vector<Batch>& batches,
                              const std::vector<std::uint64_t>& finished) {
  std::vector<Batch> result;
  for (const Batch& batch : batches) {
    const auto first = std::lower_bound(finished.begin(), finished.end(), batch.first);
    const auto last = std::lower_bound(first, finished.end(), batch.last);
    if (std::uint64_t(last - first) < batch.last - batch.first) result.push_back(batch);
  }
  return result;
}

void farm(const std::vector<Batch>& batches, const Ranks& ranks, const ComputeBatch& compute,
          const TakeBatch& take) {
  if (ranks.size == 1) return compute_in_one_process(batches, compute, take);
  if (ranks.rank == 0) return dispatch(batches, ranks, take);
  compute_for_rank_0(compute);
}

namespace {

using compensation::PlugInFailure;
using nlohmann::json;

void append(std::string& bytes, const void* data, std::size_t size) {
  if (size > 0) bytes.append(static_cast<const char*>(data), size);
}
void append(std::string& bytes, std::uint64_t number) { append(bytes, &number, sizeof number); }

/// Reads values from the front of the bytes.
struct ByteReader {
  std::string_view bytes;

  void take(void* data, std::size_t size) {
    if (size > bytes.size()) throw std::runtime_error("a message between ranks is incomplete");
    if (size > 0) std::memcpy(data, bytes.data(), size);
    bytes.remove_prefix(size);
  }
  std::uint64_t number() {
    std::uint64_t number = 0;
    take(&number, sizeof number);
    return number;
  }
  /// Returns the number of items that follow, each of at least `size` bytes. The check keeps a
  /// damaged number from reserving memory.
  std::size_t count(std::size_t size) {
    const std::uint64_t n = number();
    if (n > bytes.size() / size) throw std::runtime_error("a message between ranks is incomplete");
    return n;
  }
  Row row() {
    Row row;
    row.index = number();
    row.response_values.resize(count(sizeof(double)));
    take(row.response_values.data(), row.response_values.size() * sizeof(double));
    row.fault.resize(count(1));
    take(row.fault.data(), row.fault.size());
    return row;
  }
};

json to_json(const BadInput& error) {
  return {error.file, error.line, error.column, error.expected, error.seen};
}
BadInput parse_bad_input(const json& error) {
  return {error[0], error[1], error[2], error[3], error[4]};
}

json failure_json(const std::exception_ptr& failure) {
  try {
    std::rethrow_exception(failure);
  } catch (const dialects::BadProgram& program) {
    json input_errors = json::array();
    for (const BadInput& error : program.input_errors) input_errors.push_back(to_json(error));
    return {{"kind", "BadScene"}, {"faults", input_errors}};
  } catch (const BadInput& error) {
    return {{"kind", "BadInput"}, {"faults", {to_json(error)}}};
  } catch (const BadScene& scene) {
    json input_errors = json::array();
    for (const BadInput& error : scene.input_errors) input_errors.push_back(to_json(error));
    return {{"kind", "BadScene"}, {"faults", input_errors}};
  } catch (const Interrupted&) {
    return {{"kind", "Interrupted"}};
  } catch (const OutputFailure& error) {
    return {{"kind", "OutputFailure"}, {"text", error.what()}};
  } catch (const PlugInFailure& error) {
    return {{"kind", "PlugInFailure"}, {"text", error.what()}};
  } catch (const std::bad_alloc&) {
    return {{"kind", "bad_alloc"}};
  } catch (const std::exception& error) {
    return {{"kind", "other"}, {"text", error.what()}};
  } catch (...) {
    return {{"kind", "other"}, {"text", "a failure without a message"}};
  }
}

}  // namespace

std::string to_bytes(const Batch& batch) {
  std::string bytes;
  append(bytes, batch.first);
  append(bytes, batch.last);
  return bytes;
}

Batch parse_batch(std::string_view bytes) {
  ByteReader reader{bytes};
  const std::uint64_t first = reader.number();
  return {first, reader.number()};
}

std::string to_bytes(const BatchResult& result) {
  std::string bytes = to_bytes(result.batch);
  append(bytes, result.rows.size());
  for (const Row& row : result.rows) {
    append(bytes, row.index);
    append(bytes, row.response_values.size());
    append(bytes, row.response_values.data(), row.response_values.size() * sizeof(double));
    append(bytes, row.fault.size());
    append(bytes, row.fault.data(), row.fault.size());
  }
  return bytes;
}

BatchResult parse_batch_result(std::string_view bytes) {
  ByteReader reader{bytes};
  BatchResult result;
  result.batch.first = reader.number();
  result.batch.last = reader.number();
  result.rows.resize(reader.count(3 * sizeof(std::uint64_t)));
  for (Row& row : result.rows) row = reader.row();
  return result;
}

std::string to_bytes(const std::exception_ptr& failure) {
  if (!failure) return {};
  return failure_json(failure).dump(-1, ' ', false, json::error_handler_t::replace);
}

std::exception_ptr parse_failure(const std::string& bytes) {
  if (bytes.empty()) return nullptr;
  const json failure = json::parse(bytes);
  const std::string kind = failure["kind"];
  const std::string text = failure.value("text", "");
  if (kind == "BadInput") return std::make_exception_ptr(parse_bad_input(failure["faults"][0]));
  if (kind == "BadScene") {
    std::vector<BadInput> input_errors;
    for (const json& error : failure["faults"]) input_errors.push_back(parse_bad_input(error));
    return std::make_exception_ptr(BadScene(input_errors));
  }
  if (kind == "Interrupted") return std::make_exception_ptr(Interrupted());
  if (kind == "OutputFailure") return std::make_exception_ptr(OutputFailure(text));
  if (kind == "PlugInFailure") return std::make_exception_ptr(PlugInFailure(text));
  if (kind == "bad_alloc") return std::make_exception_ptr(std::bad_alloc());
  return std::make_exception_ptr(std::runtime_error(text));
}

}  // namespace abbe::sim::study
