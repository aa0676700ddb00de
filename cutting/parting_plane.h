#pragma once

#include <span>

#include "cutting/collision.h"

/// Planes between bodies: what stands beyond one comes no nearer by sliding along it.
namespace abbe::cutting {

/// A plane that a body does not pass, in its frame.
struct PartingPlane {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit; zero where there is no plane
  double height = 0.0;                               ///< mm along it
};

/// About as far from b as the hull of a is: by up to six steps of Frank and Wolfe towards the
/// shortest way between the hulls, until it is within 0.5 % of that. Costs a look at every vertex
/// of a in each.
/// @param hull_b  of `hull_of`
/// @param way     from a to b, near the shortest, in the frame of a
PartingPlane parting_plane(const Body& a, std::span<const Ball> hull_b,
                           const kinematics::Pose& T_ab, const Eigen::Vector3d& way);

/// mm that b is beyond a plane of a: no more than their distance, whatever the plane. Below zero
/// where it does not part them; 0 without a plane or a hull.
double beyond(const PartingPlane& plane, std::span<const Ball> hull_b,
              const kinematics::Pose& T_ab);

}  // namespace abbe::cutting
