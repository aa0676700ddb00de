#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sim/files/progress.h"

namespace abbe::sim {

struct Task {
  std::string name;  ///< a part of the plan of the progress line
  std::function<void(const Progress& progress)> work;
  double seconds = 0.0;  ///< predicted, roughly
};

/// Does independent tasks, so many at once: the first, and of the others the longest begin. The
/// first that is not over shows its progress, as if one came after the other, the others theirs
/// when it is their turn; remarks come from all. Where one throws, those after it stop at their
/// next report. Takes no more threads than there are for everything.
/// @throws what the first of those that failed has thrown, once none is at work any more
void run_tasks(const std::vector<Task>& tasks, int at_once, ProgressLine& line);

}  // namespace abbe::sim
