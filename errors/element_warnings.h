#pragma once

#include <string>
#include <vector>

#include "errors/geometric.h"

namespace abbe::errors {

/// Source of elements, for the wording of a warning.
struct ElementSource {
  std::string section = "errors";  ///< of the scene, before the name of an element
  bool identified = false;         ///< found from readings, not stated
};

/// Returns a warning for each element whose size no machine has, as of a number in another unit
/// than its key: 0.25 mm or 2.5 mrad and more; of a slide or a location, 10 nm or 0.01 urad and
/// less but not nothing (only where it is stated). Each with its largest value at 129 positions of
/// its axis from `least` to `most`, of a spindle over a turn. Of stated curves also those that are
/// followed beyond their range, and tables held far beyond theirs.
/// @param model  with the scale of the errors in it
std::vector<std::string> element_warnings(const GeometricModel& model,
                                          const kinematics::AxisVector& least,
                                          const kinematics::AxisVector& most,
                                          const ElementSource& source = {});

}  // namespace abbe::errors
