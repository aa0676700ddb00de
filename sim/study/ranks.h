#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace abbe::sim::study {

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
void leave_ranks(int exit_code);

/// Numbers sent by rank 0 to all others; on them the argument is not used. For what only one
/// process may read from disk (which cases are done).
std::vector<std::uint64_t> from_rank_0(const Ranks& ranks, const std::vector<std::uint64_t>& data);

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
bool threads_may_talk();

}  // namespace abbe::sim::study
