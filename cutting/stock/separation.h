#pragma once

#include <span>

#include "cutting/stock/body.h"
#include "cutting/stock/collision.h"

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
/// @param hull_b  of `hull_balls`
/// @param way     from a to b, near the shortest, in the frame of a
PartingPlane parting_plane(const Body& a, std::span<const Ball> hull_b,
                           const kinematics::Pose& T_ab, const Eigen::Vector3d& way);

/// mm that b is beyond a plane of a: no more than their distance, whatever the plane. Below zero
/// where it does not part them; 0 without a plane or a hull.
double beyond(const PartingPlane& plane, std::span<const Ball> hull_b,
              const kinematics::Pose& T_ab);

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
