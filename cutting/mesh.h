#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace abbe::cutting {

using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;   ///< (n x 3)
using Triangles = Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>;   ///< (m x 3)

/// The design surface on which the residual is told: where, along which normal, for how much area.
struct Design {
  Points vertices;              ///< (n x 3) mm
  Points normals;               ///< (n x 3) unit, outward
  Triangles triangles;          ///< (m x 3) counter-clockwise seen from outside
  Eigen::VectorXd area;         ///< (n) mm^2, a third of the triangles around (the weight of a vertex)
  Eigen::VectorXd facet_error;  ///< (n) mm, estimated sag between mesh and smooth surface; 0 for
                                ///< declared analytic surfaces, whose vertices are exact
  std::vector<std::uint8_t> judged;  ///< (n) 0 where the scene leaves the vertex out (status 2)
};

/// The design moved: vertices and normals by T.
Design transformed(const Design& design, const Eigen::Isometry3d& T);

}  // namespace abbe::cutting
