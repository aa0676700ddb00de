#pragma once

#include <cstdint>

namespace abbe::sim::study {

/// Cases first .. last - 1, computed together; always the same ones, so that their bits do not
/// depend on who computes them.
struct Batch {
  std::uint64_t first = 0;
  std::uint64_t last = 0;
};

}  // namespace abbe::sim::study
