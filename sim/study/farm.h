#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "sim/study/batch.h"
#include "sim/study/journal.h"
#include "sim/study/ranks.h"

namespace abbe::sim::study {

/// Part i of n of a study, for job arrays.
struct Shard {
  int index = 0;  ///< 0 .. count - 1
  int count = 1;
};
/// The batches of a shard: every count-th one. @throws std::invalid_argument for no such shard
std::vector<Batch> of_shard(const std::vector<Batch>& batches, const Shard& shard);
/// Batches of which not every case is finished. @param finished  ascending
std::vector<Batch> unfinished(const std::vector<Batch>& batches,
                              const std::vector<std::uint64_t>& finished);

/// Computes a batch; called from many threads at once. Parallel work inside of it never begins
/// another batch on the same thread.
using Compute = std::function<std::vector<Row>(const Batch& batch)>;
/// Takes the rows of a finished batch, in whatever order they finish; called from one thread at a
/// time.
using Take = std::function<void(const Batch& batch, std::vector<Row> rows)>;

/// Computes all batches, the first ones first. Alone: on the threads that TBB has. Among ranks:
/// rank 0 hands out batch by batch and takes the rows, the others compute, each on its own threads,
/// so n ranks compute on n - 1; on them `take` is never called and `batches` is not read. Returns
/// on all ranks when everything is done.
/// @throws what `compute` and `take` throw first, and Interrupted. No batch is begun after it;
/// those
///         that run then are finished and, unless it came from `take`, taken. Among ranks it is
///         thrown on all of them, what it was kept for the exit code: BadInput, BadScene,
///         OutputFailure, PlugInFailure, Interrupted, else std::runtime_error with its text
void farm(const std::vector<Batch>& batches, const Ranks& ranks, const Compute& compute,
          const Take& take);

}  // namespace abbe::sim::study
