#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/study/journal.h"

namespace abbe::sim::study {

/// Cases first .. last - 1, computed together; always the same ones, so that their bits do not
/// depend on who computes them.
struct Batch {
  std::uint64_t first = 0;
  std::uint64_t last = 0;
};

/// Who computes: this process alone, or one of several started by mpirun.
struct Ranks {
  int rank = 0;
  int size = 1;
};
/// Where this process stands; starts MPI if mpirun (or srun with its MPI support) started the
/// process as one of several. A process started otherwise never touches MPI, inside a Slurm job
/// neither.
/// @throws std::runtime_error if it is one of several and the program was built without MPI
Ranks ranks(int& argc, char**& argv);

/// Ends MPI if it was started. Exit codes 0 and 1 are results: all ranks come here together. With
/// any other the remaining ranks are ended as well, wherever they are; those above 0 wait a moment
/// first, for rank 0 to tell its failure.
void finalize_ranks(int exit_code);

/// Numbers sent by rank 0 to all others; on them the argument is not used. For what only one
/// process may read from disk (which cases are done).
std::vector<std::uint64_t> broadcast_from_rank_0(const Ranks& ranks,
                                                 const std::vector<std::uint64_t>& data);

/// What one rank says to another.
struct Message {
  int rank = 0;  ///< who sent it
  int kind = 0;
  std::string bytes;
};
/// Safe from any thread, one at a time. @throws std::runtime_error for 2 GB and more
void send(int rank, int kind, const std::string& bytes = {});
/// Waits for the next message of a rank, or of any; leaves the processor to others while it waits.
/// @throws Interrupted if Ctrl-C was pressed and `interruptible`
inline constexpr int any_rank = -1;
Message receive(int rank, bool interruptible = false);

/// Whether several threads may take turns at sending and receiving.
bool can_threads_communicate();

/// Part i of n of a study, for job arrays.
struct Shard {
  int index = 0;  ///< 0 .. count - 1
  int count = 1;
};
/// The batches of a shard: every count-th one. @throws std::invalid_argument for no such shard
std::vector<Batch> shard_batches(const std::vector<Batch>& batches, const Shard& shard);
/// Batches of which not every case is finished. @param finished  ascending
std::vector<Batch> unfinished(const std::vector<Batch>& batches,
                              const std::vector<std::uint64_t>& finished);

/// Computes a batch; called from many threads at once. Parallel work inside of it never begins
/// another batch on the same thread.
using ComputeBatch = std::function<std::vector<Row>(const Batch& batch)>;
/// Takes the rows of a finished batch, in whatever order they finish; called from one thread at a
/// time.
using TakeBatch = std::function<void(const Batch& batch, std::vector<Row> rows)>;

/// Computes all batches, the first ones first. Alone: on the threads that TBB has. Among ranks:
/// rank 0 hands out batch by batch and takes the rows, the others compute, each on its own threads,
/// so n ranks compute on n - 1; on them `take` is never called and `batches` is not read. Returns
/// on all ranks when everything is done.
/// @throws what `compute` and `take` throw first, and Interrupted. No batch is begun after it;
/// those
///         that run then are finished and, unless it came from `take`, taken. Among ranks it is
///         thrown on all of them, what it was kept for the exit code: BadInput, BadScene,
///         OutputFailure, PlugInFailure, Interrupted, else std::runtime_error with its text
void farm(const std::vector<Batch>& batches, const Ranks& ranks, const ComputeBatch& compute,
          const TakeBatch& take);

// What ranks of a farm say to each other, as bytes; the ranks run one program on one kind of
// computer.

std::string to_bytes(const Batch& batch);
Batch parse_batch(std::string_view bytes);

struct BatchResult {
  Batch batch;
  std::vector<Row> rows;
};
std::string to_bytes(const BatchResult& finished);
BatchResult parse_batch_result(std::string_view bytes);

/// Empty for none.
std::string to_bytes(const std::exception_ptr& failure);
/// One with the same message, of the same type where the exit code depends on it; none of empty
/// bytes.
std::exception_ptr parse_failure(const std::string& bytes);

}  // namespace abbe::sim::study
