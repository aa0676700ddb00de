#pragma once

#include <stdexcept>
#include <vector>

#include "kinematics/bad_input.h"

namespace abbe::sim {

/// All faults of a scene at once; `what()` has one "file:line:column: expected ..., seen ..." a
/// line.
struct BadScene : std::runtime_error {
  explicit BadScene(std::vector<BadInput> faults);
  std::vector<BadInput> faults;
};

}  // namespace abbe::sim
