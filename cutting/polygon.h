#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

namespace abbe::cutting {

/// A polygon in space as triangles on its corners, turned as it is turned. Corner after corner is
/// cut off, always the one whose cut is shortest of those that bulge and hold no other corner, seen
/// along the polygon's mean normal: so a quadrilateral is split along its shorter diagonal that
/// lies inside. It need be neither convex nor flat. Empty if its outline crosses itself or has no
/// area.
/// @param corners  (n >= 3)
std::vector<std::array<int, 3>> triangulated(const std::vector<Eigen::Vector3d>& corners);

}  // namespace abbe::cutting
