#pragma once

#include <span>

#include "cutting/stock/body.h"
#include "cutting/stock/collision.h"

/// Separation of bodies: planes between disjoint bodies, and translations out of an overlap.
namespace abbe::cutting {

/// A plane with a body on its inner side, in the frame of the body.
struct PartingPlane {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit; zero if there is no plane
  double height = 0.0;                               ///< mm, of the plane along the normal
};

/// Returns a plane of a whose distance from b is nearly that of the convex hulls. Takes up to six
/// steps of the Frank-Wolfe method towards the shortest connection of the hulls, until within 0.5 %
/// of it. Each step visits every vertex of a.
/// @param hull_b  balls returned by `hull_balls`
/// @param a_to_b  approximately the shortest vector from a to b, in the frame of a
PartingPlane parting_plane(const Body& a, std::span<const Ball> hull_b,
                           const kinematics::Pose& T_ab, const Eigen::Vector3d& a_to_b);

/// Returns the distance, mm, of b beyond a plane of a, which is a lower bound of the distance of
/// the bodies for any plane. Negative if the plane does not separate them; 0 without a plane or a
/// hull.
double plane_distance(const PartingPlane& plane, std::span<const Ball> hull_b,
                      const kinematics::Pose& T_ab);

/// A short translation of b out of an overlap.
struct Penetration {
  double depth = 0.0;  ///< mm, its length
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
};

/// Returns a short translation of b after which the bodies are apart and neither is inside the
/// other. A shorter one may exist, which the search does not exclude. 0 for bodies that are apart.
/// Tries translations along the normals of the faces that meet, out of all of them at once, along
/// the axes of both frames and in all directions; each slides along the faces it meets as long as
/// this shortens it. This finds the shortest for a tool in walls, corners, grooves and holes, for
/// any number of triangles; a narrow gap to which no meeting face points may be missed. An open
/// mesh is its surface only: bodies beside it are apart from it.
/// @param resolution  mm; after the translation the distance is half of it. A translation out of
/// one
///                    face is longer by that much, one out of a corner by the amount needed for
///                    that distance from each wall
/// @throws std::invalid_argument for a resolution that is not positive
Penetration penetration(const Body& a, const kinematics::Pose& T_a, const Body& b,
                        const kinematics::Pose& T_b, double resolution = 1e-3);

}  // namespace abbe::cutting
