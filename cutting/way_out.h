#pragma once

#include "cutting/body.h"

namespace abbe::cutting {

/// A short way out of an overlap, a translation of b.
struct WayOut {
  double depth = 0.0;  ///< mm, its length
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
};

/// The depth of an overlap: the length of a translation of b that leaves the two apart, neither
/// inside the other. So it is never less than the shortest one, and it is one that settled: from
/// where it ends no slide along what is met is shorter. That none is shorter elsewhere is not
/// proved. What is tried are ways along the normals of the faces that meet, out of all of them at
/// once, along the axes of both frames and all around, so that it is the shortest for a tool in
/// walls, corners, grooves and holes, whatever the number of triangles; a narrow gap between
/// bodies with many of them may be missed. 0 for bodies that are apart.
/// @param resolution  mm, they end half of it apart, so a way out of a single face is so much
///                    longer, one out of a corner by up to what it takes to leave each wall so far
WayOut way_out(const Body& a, const kinematics::Pose& T_a, const Body& b,
               const kinematics::Pose& T_b, double resolution = 1e-3);

}  // namespace abbe::cutting
