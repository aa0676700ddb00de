#pragma once

#include "cutting/body.h"

namespace abbe::cutting {

/// A short way out of an overlap, a translation of b.
struct WayOut {
  double depth = 0.0;  ///< mm, its length
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
};

/// The depth of an overlap. The translation leaves the two apart, neither inside the other, so the
/// depth is never less than that of the shortest one. None nearby is shorter, by more than the
/// resolution where faces meet. That none is shorter anywhere is not proved: many ways are tried,
/// along the normals of the faces that meet, along the axes of both frames and all around.
/// Bodies that are apart have the depth 0.
/// @param resolution  mm, they end up half of it from each other
WayOut way_out(const Body& a, const kinematics::Pose& T_a, const Body& b,
               const kinematics::Pose& T_b, double resolution = 1e-3);

}  // namespace abbe::cutting
