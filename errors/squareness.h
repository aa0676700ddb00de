#pragma once

#include <span>
#include <vector>

#include "errors/element.h"
#include "kinematics/chain.h"

namespace abbe::errors {

/// Location error that a straight slope of a straightness amounts to.
struct SquarenessShare {
  ElementName name;    ///< of the slide that states the angle: EC0Y, EB0Z, EA0Z
  double value = 0.0;  ///< rad, to be added to it
};

/// Where a slope taken out by `detrend` belongs: the slope of EXY turns Y, which EC0Y states; that
/// of EYX turns X, which is Y turned the other way. One share a bed axis about which the slide
/// turns, so one for slides along the bed axes, whichever way they point.
/// @param slope   per mm of the carriage's own travel (of a primed axis: minus that per command)
/// @param joints  of the machine
/// @throws std::invalid_argument unless the element is a straightness of a slide of the machine
/// that
///         makes an angle with another
std::vector<SquarenessShare> squareness_shares(const ElementName& straightness, double slope,
                                               std::span<const kinematics::Joint> joints);

}  // namespace abbe::errors
