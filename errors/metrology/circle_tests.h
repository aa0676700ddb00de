#pragma once

#include <string>
#include <vector>

#include "errors/metrology/circular.h"
#include "errors/metrology/series.h"

namespace abbe::errors::metrology {

/// Lengths read while two slides go round a point.
struct CircleTest {
  std::string name;        ///< of set-up and channel, and of the run where there are several
  std::string plane;       ///< "XY": letters of the first and the second direction
  bool zero_known = true;  ///< else the bar only shows how its length changes
  CircularRuns runs;
};

/// One test a run; none if anything but two slides moves, or not on a circle about the socket.
/// @param moving  the axes that move
std::vector<CircleTest> circle_tests(const Series& series, const std::vector<int>& moving);

}  // namespace abbe::errors::metrology
