#include "sim/cut/resources.h"

#include <algorithm>
#include <optional>

#include <sys/resource.h>
#include <unistd.h>

namespace abbe::sim {

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
