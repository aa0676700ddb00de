#pragma once

#include <chrono>
#include <cstddef>

/// Memory limits of the process, and a stopwatch.
namespace abbe::sim {

/// A stopwatch that starts with its construction.
class Stopwatch {
 public:
  /// Returns the seconds since the construction or the last lap.
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    return seconds;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

/// Returns the memory that a computation may use, bytes: that of the computer, or the limit of the
/// process.
double memory_bytes();

/// Returns the memory that the moves of a program may use, bytes: a third of the total; the rest is
/// for samples.
std::size_t max_move_bytes();

/// Sets the memory that computations may use, whatever the computer has. Computations that would
/// need more are then input errors before they begin.
void limit_memory(double bytes);

}  // namespace abbe::sim
