#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/study/journal.h"

namespace abbe::sim::study {

/// The cases first .. last - 1. They are always computed together, so that their bits do not depend
/// on the process that computes them.
struct Batch {
  std::uint64_t first = 0;
  std::uint64_t last = 0;
};

/// The rank of this process among those that mpirun started, and their number; 0 of 1 without MPI.
struct Ranks {
  int rank = 0;
  int size = 1;
};
/// Returns the rank of this process. Starts MPI if mpirun, or srun with its MPI support, started
/// the process as one of several. A process started otherwise never uses MPI, not even inside a
/// Slurm job.
/// @throws std::runtime_error if the process is one of several and the program was built without
/// MPI
Ranks ranks(int& argc, char**& argv);

/// Ends MPI if it was started. With exit code 0 or 1, which are results, all ranks must call this
/// and finish together. Any other code aborts the remaining ranks; ranks above 0 wait 2 s first, so
/// that rank 0 can report its failure.
void finalize_ranks(int exit_code);

/// Sends numbers from rank 0 to all others and returns them; `data` of the other ranks is ignored.
/// Used for data that only one process may read from disk, such as the finished cases.
std::vector<std::uint64_t> broadcast_from_rank_0(const Ranks& ranks,
                                                 const std::vector<std::uint64_t>& data);

/// A message from one rank to another.
struct Message {
  int rank = 0;  ///< the sender
  int kind = 0;
  std::string bytes;
};
/// Sends a message; thread-safe, one call at a time.
/// @throws std::runtime_error for 2 GB and more
void send(int rank, int kind, const std::string& bytes = {});
/// Rank of `receive` for a message from any rank.
inline constexpr int any_rank = -1;
/// Waits for the next message of a rank, or of any rank, without using the processor.
/// @throws Interrupted if Ctrl-C was pressed and `interruptible`
Message receive(int rank, bool interruptible = false);

/// Returns true if several threads may send and receive, one at a time.
bool can_threads_communicate();

/// Shard `index` of `count` of a study, for job arrays.
struct Shard {
  int index = 0;  ///< 0 .. count - 1
  int count = 1;
};
/// Returns the batches of a shard: every count-th one.
/// @throws std::invalid_argument for an index outside 0 .. count - 1
std::vector<Batch> shard_batches(const std::vector<Batch>& batches, const Shard& shard);
/// Returns the batches with at least one case that is not finished.
/// @param finished  ascending
std::vector<Batch> unfinished(const std::vector<Batch>& batches,
                              const std::vector<std::uint64_t>& finished);

/// A function that computes a batch; many threads call it at the same time. Parallel work inside it
/// never begins another batch on the same thread.
using ComputeBatch = std::function<std::vector<Row>(const Batch& batch)>;
/// A function that takes the rows of a finished batch, in the order in which batches finish; one
/// thread at a time calls it.
using TakeBatch = std::function<void(const Batch& batch, std::vector<Row> rows)>;

/// Computes all batches in order. A single process uses the threads of TBB. Of n ranks, rank 0
/// assigns batches and takes their rows, and the other n - 1 compute, each on its own threads; on
/// those `take` is never called and `batches` is not read. Returns on all ranks when all batches
/// are finished.
/// @throws the first exception of `compute` or `take`, and Interrupted. No batch begins after it;
/// batches in progress are finished and taken, unless it came from `take`. All ranks throw it, with
/// its type if the exit code depends on it (BadInput, BadScene, OutputFailure, PlugInFailure,
/// Interrupted), otherwise as std::runtime_error with its text
void farm(const std::vector<Batch>& batches, const Ranks& ranks, const ComputeBatch& compute,
          const TakeBatch& take);

// Messages between ranks as bytes, in the byte order of the computer, since all ranks run the same
// program on the same kind of computer.

std::string to_bytes(const Batch& batch);
Batch parse_batch(std::string_view bytes);

/// A finished batch with its rows.
struct BatchResult {
  Batch batch;
  std::vector<Row> rows;
};
std::string to_bytes(const BatchResult& result);
BatchResult parse_batch_result(std::string_view bytes);

/// Returns a failure as bytes; empty for a null pointer.
std::string to_bytes(const std::exception_ptr& failure);
/// Returns the failure with the same message, and with its type if the exit code depends on it;
/// null for empty bytes.
std::exception_ptr parse_failure(const std::string& bytes);

}  // namespace abbe::sim::study
