#pragma once

#include <span>

#include "cutting/stock/body.h"
#include "cutting/stock/collision.h"

/// Separation of bodies: planes between disjoint bodies, and translations out of an overlap.
namespace abbe::cutting {

/// A plane that a body does not cross, in the frame of the body.
struct PartingPlane {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit; zero if there is no plane
  double height = 0.0;                               ///< mm, of the plane along the normal
};

/// Returns a plane of a whose distance from b is nearly that between the convex hulls: takes up to
/// six steps of the Frank-Wolfe method towards the shortest connection of the hulls, until within
/// 0.5 % of it. Each step visits every vertex of a.
/// @param hull_b  of `hull_balls`
/// @param way     vector from a to b, near the shortest, in the frame of a
PartingPlane parting_plane(const Body& a, std::span<const Ball> hull_b,
                           const kinematics::Pose& T_ab, const Eigen::Vector3d& way);

/// Returns the distance of b beyond a plane of a, mm, which is a lower bound of the distance of the
/// bodies whatever the plane. Negative if the plane does not separate them; 0 without a plane or a
/// hull.
double beyond(const PartingPlane& plane, std::span<const Ball> hull_b,
              const kinematics::Pose& T_ab);

/// A short translation of b out of an overlap.
struct WayOut {
  double depth = 0.0;  ///< mm, its length
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
};

/// Returns the depth of an overlap: the length of a translation of b after which the two are apart
/// and neither is inside the other. It is never less than the shortest one; that no translation is
/// shorter is not proved.
/// Translations are tried along the normals of the faces that meet, out of all of them at once,
/// along the axes of both frames and in all directions, and each slides along the faces it meets
/// until that gains nothing. This finds the shortest for a tool in walls, corners, grooves and
/// holes, whatever the number of triangles; a narrow gap that no meeting face points to may be
/// missed. An open mesh is its surface alone: bodies beside it are apart from it. 0 for bodies that
/// are apart.
/// @param resolution  mm, the bodies end half of it apart: a translation out of one face is longer
///                    by that much, one out of a corner by what it takes to leave each of its walls
///                    by that much
/// @throws std::invalid_argument for a resolution that is not positive
WayOut way_out(const Body& a, const kinematics::Pose& T_a, const Body& b,
               const kinematics::Pose& T_b, double resolution = 1e-3);

}  // namespace abbe::cutting
