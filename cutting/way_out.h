#pragma once

#include "cutting/body.h"

namespace abbe::cutting {

/// A short way out of an overlap, a translation of b.
struct WayOut {
  double depth = 0.0;  ///< mm, its length
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
};

/// The depth of an overlap: the length of a translation of b that leaves the two apart, neither
/// inside the other. So it is never less than the shortest one. That none is shorter is not proved:
/// ways are tried along the normals of the faces that meet, out of all of them at once, along the
/// axes of both frames and all around, and each slides along what it meets until that gains
/// nothing. This finds the shortest for a tool in walls, corners, grooves and holes, whatever the
/// number of triangles; a gap may be missed that is narrow and not faced by what meets. An open
/// mesh is its surface alone: what is beside it is apart from it. 0 for bodies that are apart.
/// @param resolution  mm, they end half of it apart: a way out of one face is so much longer, one
///                    out of a corner by what it takes to leave each of its walls so far
/// @throws std::invalid_argument for a resolution that is not positive
WayOut way_out(const Body& a, const kinematics::Pose& T_a, const Body& b,
               const kinematics::Pose& T_b, double resolution = 1e-3);

}  // namespace abbe::cutting
