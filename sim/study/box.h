#pragma once

#include <Eigen/Core>

#include "sim/study/study.h"

namespace abbe::sim::study {

/// Values that inputs are between.
struct Box {
  Eigen::VectorXd low;   ///< (inputs)
  Eigen::VectorXd high;  ///< (inputs)
};
/// Ends of the distributions where they have any; else the values beyond which there is as little
/// as beyond `coverage` standard deviations of a normal distribution. Correlations do not matter to
/// it.
Box box_of(const Study& study, double coverage);

}  // namespace abbe::sim::study
