#pragma once

#include <Eigen/Core>

#include "cutting/stock.h"

namespace abbe::cutting {

/// The tool at an instant: rows of R are its axes in the grid frame, z to the spindle.
struct ToolPose {
  Eigen::Vector3d tip;  // mm, from the grid's origin
  Eigen::Matrix3d R;

  Eigen::Vector3d axis() const { return R.row(2); }
};

/// The move in the grid frame: tip on a line, axis on a great circle about `R.row(1)`.
class ToolPath {
 public:
  /// @throws std::invalid_argument unless the poses are finite and the axis turns by less than half
  ///         a turn
  ToolPath(const Stock& stock, const StockMove& move);

  double angle() const { return angle_; }
  double length() const { return step_.norm(); }

  /// At t of the move, 0 .. 1.
  ToolPose at(double t) const;

 private:
  Eigen::Vector3d tip_, step_;
  Eigen::Matrix3d R_;
  double angle_;
};

}  // namespace abbe::cutting
