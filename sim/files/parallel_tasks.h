#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sim/files/progress.h"

/// Parallel tasks with a common progress line.
namespace abbe::sim {

/// A unit of work that can run beside others.
struct Task {
  std::string name;  ///< part of the plan of the progress line
  std::function<void(const Progress& progress)> work;
  double seconds = 0.0;  ///< rough prediction
};

/// Runs independent tasks, at most `max_parallel` at a time. The first task starts first; the
/// others follow from the longest to the shortest. The progress line shows the first task that is
/// not finished, as if the tasks ran one after the other; remarks of all tasks are shown at once.
/// If a task throws, the tasks after it stop at their next report. Uses only threads that the
/// process already has.
/// @throws the exception of the first task that failed, after all tasks have ended
void run_tasks(const std::vector<Task>& tasks, int max_parallel, ProgressLine& line);

}  // namespace abbe::sim
