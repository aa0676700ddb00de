#pragma once

#include <chrono>
#include <cstddef>

/// Memory limits of the process, and a stopwatch.
namespace abbe::sim {

/// Measures the seconds since its construction or since the last lap.
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

/// Returns the memory that a computation may use, bytes: that of the computer, or a limit set for
/// the process.
double memory_bytes();

/// Returns the memory that the moves of a program may use, bytes: a third of the total; the rest is
/// for samples.
std::size_t max_move_bytes();

/// Sets the memory to plan for, whatever the computer has. A computation that would need more is
/// then an input error before it begins.
void limit_memory(double bytes);

}  // namespace abbe::sim
