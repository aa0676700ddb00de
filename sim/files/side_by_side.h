#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sim/files/progress.h"

namespace abbe::sim {

/// A part of some work, as it stands on the line of progress; its work reports there.
struct PieceOfWork {
  std::string name;
  std::function<void(const Progress&)> work;
};

/// Does all parts, so many at a time, the first ones first. On the line each has its turn when
/// those before it are over; what it reported until then is shown then.
/// @param at_a_time  1: in this thread, one after the other; a part may wait for one before it
/// @throws what the first part in their order threw that failed, once those that ran beside it have
///         stopped with their next report
void side_by_side(const std::vector<PieceOfWork>& parts, int at_a_time, ProgressLine& line);

}  // namespace abbe::sim
