#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sim/files/progress.h"

namespace abbe::sim {

/// A task of a plan.
struct Task {
  std::string name;  ///< its part in the plan of the progress line
  std::function<void(const Progress& progress)> work;
  double seconds = 0.0;  ///< rough prediction
};

/// Runs independent tasks, `at_once` at a time: the first one, and then the longest of the others.
/// The progress line shows the first task that is not finished, as if the tasks ran one after the
/// other; remarks are shown from all of them. If a task throws, the tasks after it stop at their
/// next report. Uses no more threads than the process has.
/// @throws the exception of the first task that failed, after all tasks have ended
void run_tasks(const std::vector<Task>& tasks, int at_once, ProgressLine& line);

}  // namespace abbe::sim
