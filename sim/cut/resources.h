#pragma once

#include <chrono>
#include <cstddef>

namespace abbe::sim {

/// Seconds since it was made, or since the last lap.
class Stopwatch {
 public:
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    return seconds;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

/// Returns the bytes that a computation may take: of the computer, or of a limit that is set for
/// the process.
double memory_bytes();

/// Returns the bytes that the moves of a program may take: a third of the memory, the rest is for
/// samples.
std::size_t max_move_bytes();

/// Plans for so many bytes from now on, whatever the computer has; what would take more is an input
/// error before it begins.
void limit_memory(double bytes);

}  // namespace abbe::sim
