#include "sim/study/ranks.h"

#include <algorithm>
#include <chrono>
#include <climits>
#include <csignal>
#include <cstdlib>
#include <stdexcept>
#include <thread>

#ifdef ABBE_MPI
// the C functions alone: the C++ ones are no more in the standard and need a library of their own
#define OMPI_SKIP_MPICXX 1
#define MPICH_SKIP_MPICXX 1
#include <mpi.h>
#endif

#include "sim/files/progress.h"

namespace abbe::sim::study {
namespace {

int number_in(const char* variable) {
  const char* text = std::getenv(variable);
  return text == nullptr ? 0 : std::atoi(text);
}

/// How many processes were started together with this one, so that they can talk. A Slurm job has
/// variables of PMI even where no MPI program was started: in its script, and in a step of which
/// the MPI support is off. To start MPI there would end the process.
int started_together() {
  if (std::getenv("OMPI_COMM_WORLD_SIZE") != nullptr) return number_in("OMPI_COMM_WORLD_SIZE");
  if (std::getenv("PMI_RANK") != nullptr && std::getenv("PMI_SIZE") != nullptr)
    return number_in("PMI_SIZE");
  if (std::getenv("PMIX_RANK") != nullptr && std::getenv("PMIX_NAMESPACE") != nullptr)
    return number_in("SLURM_STEP_NUM_TASKS");
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
  if (started_together() <= 1) return {};
  if (!is_running()) {
    int provided = 0;
    MPI_Init_thread(&argc, &argv, MPI_THREAD_SERIALIZED, &provided);
  }
  Ranks here;
  MPI_Comm_rank(MPI_COMM_WORLD, &here.rank);
  MPI_Comm_size(MPI_COMM_WORLD, &here.size);
  return here;
}

void leave_ranks(int exit_code) {
  if (!is_running()) return;
  if (exit_code == 0 || exit_code == 1) {
    MPI_Finalize();
    return;
  }
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  std::signal(SIGTERM, SIG_DFL);  // mpirun asks with it first
  if (rank != 0) std::this_thread::sleep_for(std::chrono::seconds(2));
  MPI_Abort(MPI_COMM_WORLD, exit_code);
}

std::vector<std::uint64_t> from_rank_0(const Ranks& ranks, const std::vector<std::uint64_t>& data) {
  if (ranks.size == 1) return data;
  std::uint64_t size = data.size();
  MPI_Bcast(&size, 1, MPI_UINT64_T, 0, MPI_COMM_WORLD);
  std::vector<std::uint64_t> result(size);
  if (ranks.rank == 0) result = data;
  constexpr std::uint64_t at_once = 1 << 24;
  for (std::uint64_t i = 0; i < size; i += at_once)
    MPI_Bcast(result.data() + i, int(std::min(at_once, size - i)), MPI_UINT64_T, 0, MPI_COMM_WORLD);
  return result;
}

void send(int rank, int kind, const std::string& bytes) {
  if (bytes.size() > INT_MAX) throw std::runtime_error("a batch of 2 GB is too large to be sent");
  MPI_Send(bytes.data(), int(bytes.size()), MPI_BYTE, rank, kind, MPI_COMM_WORLD);
}

Message receive(int rank, bool interruptible) {
  const int from = rank == any_rank ? MPI_ANY_SOURCE : rank;
  // a blocking receive would keep a core busy that computes for another rank
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

bool threads_may_talk() {
  int provided = MPI_THREAD_SINGLE;
  MPI_Query_thread(&provided);
  return provided >= MPI_THREAD_SERIALIZED;
}

#else

Ranks ranks(int&, char**&) {
  if (started_together() > 1)
    throw std::runtime_error(
        "one of several processes, but built without MPI: ./abbe setup --cluster builds it with");
  return {};
}

void leave_ranks(int) {}

std::vector<std::uint64_t> from_rank_0(const Ranks&, const std::vector<std::uint64_t>& data) {
  return data;
}

void send(int, int, const std::string&) { throw std::logic_error("built without MPI"); }
Message receive(int, bool) { throw std::logic_error("built without MPI"); }
bool threads_may_talk() { return false; }

#endif

}  // namespace abbe::sim::study
