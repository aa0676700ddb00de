#pragma once

#include <optional>

#include <Eigen/Core>

namespace abbe::sim {

/// A picture's view: where the camera stands, in the part frame.
struct ViewDescription {
  Eigen::Vector3d from =
      Eigen::Vector3d(-0.5, -1.0, 0.9);  ///< direction from the part to the camera
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  std::optional<double> range_um;  ///< colour scale is -range .. +range; else fitted
};

}  // namespace abbe::sim
