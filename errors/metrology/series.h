#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/metrology/positioning.h"
#include "errors/metrology/readings.h"

namespace abbe::errors::metrology {

/// What one channel of one set-up read, in the order of the plan.
struct Series {
  const Readings& readings;
  int set_up = 0;                  ///< in the plan
  int channel = 0;                 ///< of that set-up
  std::vector<std::size_t> looks;  ///< in the plan

  const SetUp& optics() const { return readings.plan.set_ups[std::size_t(set_up)]; }
  const Channel& sensor() const { return optics().channels[std::size_t(channel)]; }
  const Look& look(std::size_t i) const { return readings.plan.looks[looks[i]]; }
  /// Of the set-up, and of the channel where there are several.
  std::string name() const;
};

/// Where the nominal machine has its bodies at a look.
Bodies nominal_at(const Series& series, std::size_t i);

/// Readings minus what a perfect set-up would read on the nominal machine. (looks)
Eigen::VectorXd deviations(const Series& series);

/// Where the nominal machine has the point that is looked at, in the workpiece.
Eigen::Vector3d place_w(const Series& series, const kinematics::AxisVector& q);

/// Axes that do not stand still.
std::vector<int> moving_joints(const Series& series);

/// Deviations of a series as runs over positions along a path, the targets in their order on it.
/// @param along       (looks) position on the path
/// @param from_below  (looks) whether the look was approached from lower positions
/// @return nothing unless every run has every target once and no two targets are one
std::optional<PositionRuns> runs_of(const Series& series, const Eigen::VectorXd& along,
                                    const std::vector<bool>& from_below);

}  // namespace abbe::errors::metrology
