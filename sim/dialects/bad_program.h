#pragma once

#include <string>
#include <vector>

#include "kinematics/bad_input.h"

namespace abbe::sim::dialects {

/// All faults of a program at once: as a BadInput it is the first of them, `what()` has one
/// "file:line:column: expected ..., seen ..." a line.
struct BadProgram : BadInput {
  /// @param faults  at least one
  explicit BadProgram(std::vector<BadInput> faults);
  const char* what() const noexcept override { return text.c_str(); }

  std::vector<BadInput> faults;
  std::string text;
};

}  // namespace abbe::sim::dialects
