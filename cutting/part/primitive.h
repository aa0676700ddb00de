#pragma once

#include <optional>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "cutting/part/mesh.h"

namespace abbe::cutting {

// Analytic surfaces declared in a scene, in the frame of the part; z is the axis of every surface
// of revolution. Outward is +z, or away from the axis.

/// A rectangle at z = 0, centred at the origin; mm.
struct RectanglePlane {
  double length_x = 100.0;
  double length_y = 100.0;
};
/// A disc or ring at z = 0; mm.
struct Disc {
  double radius = 10.0;
  double inner_radius = 0.0;
};
/// The outer surface of a cylinder from z = 0 to z = height; mm.
struct Cylinder {
  double radius = 10.0;
  double height = 10.0;
};
/// The outer surface of a cone frustum from z = 0, where its radius is `base_radius`, to z =
/// height, mm; it narrows upwards.
struct Cone {
  double base_radius = 10.0;
  double height = 10.0;
  double half_apex_angle = 0.26;  ///< rad, in (0, pi/2)
};
/// A cap of a sphere with its top at z = 0 and its rim at radius `rim_radius` (z = sqrt(R^2 - r^2)
/// - R); mm.
struct SphereCap {
  double radius = 100.0;
  double rim_radius = 50.0;  ///< <= radius
};
/// The half of a torus that is visible from +z (z >= 0): a tube of `tube_radius` about a circle of
/// `radius` at z = 0; mm.
struct Torus {
  double radius = 30.0;
  double tube_radius = 5.0;  ///< <= radius
};
/// A profile (r, z) revolved about z: straight lines and arcs (of at most half a turn) from point
/// to point. From the axis to the rim r never decreases; outward is to the left of this path.
struct RevolvedProfile {
  struct ProfileSegment {
    Eigen::Vector2d from;     ///< (r, z) mm
    Eigen::Vector2d to;       ///< (r, z) mm
    double arc_radius = 0.0;  ///< mm; 0: a line; > 0: bulges outward (convex), < 0: inward
                              ///< (concave)
  };
  std::vector<ProfileSegment> profile_segments;  ///< from the axis outwards, connected
};

using Primitive =
    std::variant<RectanglePlane, Disc, Cylinder, Cone, SphereCap, Torus, RevolvedProfile>;

struct TessellationOptions {
  int vertices = 20000;  ///< requested number, 100 .. 50 million; the actual number is within a
                         ///< factor of 1.2, unless the segments of a profile alone need more
};

/// Returns a mesh whose vertices and normals are exact (to 1e-12 mm and 2e-15 rad at 1 m), so that
/// faceting never appears as residual.
/// Surfaces of revolution have a polar grid with irregular ring radii, so that no feed of a program
/// is commensurable with them. A kink of a profile has two rings of vertices, one for each normal,
/// and no triangles between them. If the surface is smooth on the axis, there is a vertex on it. An
/// apex, which has no normal, is omitted: the first ring is about a third of a spacing below it and
/// is closed by a small flat.
/// @throws std::invalid_argument naming the dimension that is not positive, finite or possible
Design tessellate(const Primitive& primitive, const TessellationOptions& options = {});

/// A point of a surface and its outward normal.
struct Contact {
  Eigen::Vector3d point;
  Eigen::Vector3d normal;
  int face = -1;  ///< recognised face of a mesh on which it lies; -1: none
};

/// Returns the highest surface point at (x, y), the rim included; empty if there is none (a
/// vertical wall has no such point). At a kink the segment nearer to the axis is used; at an apex
/// the normal is +z.
std::optional<Contact> highest_surface_point(const Primitive& primitive, double x, double y);

/// Returns the surface extended beyond its rims, including inner ones, so that a program may
/// overrun the edge: by `margin` mm of r (of x and y for a rectangle, of z for a vertical wall).
/// Lines are extended straight, arcs along their circle up to the point where it is vertical, and
/// nothing is extended across the axis. Cylinders, cones and profiles become profiles, because
/// their z = 0 must remain.
/// @throws std::invalid_argument as `tessellate`, and for a margin that is negative or not finite
Primitive enlarge(const Primitive& primitive, double margin);

/// Returns the profile of a surface of revolution in its half plane, from the axis outwards.
/// @throws std::invalid_argument for a rectangle, and as `tessellate`
RevolvedProfile profile(const Primitive& primitive);

/// A segment of a profile as a curve over its arc length, prepared for evaluation. All quantities
/// are relative to its start and not to the centre of its arc, so that a shallow arc of large
/// radius loses no digits.
struct ProfileCurve {
  Eigen::Vector2d from, to;
  Eigen::Vector2d tangent;  ///< unit, at `from`
  double curvature;         ///< 1/mm, > 0: convex, the path turns to the right
  double length;            ///< mm, arc length
};

/// Returns the curve of a segment.
ProfileCurve profile_curve(const RevolvedProfile::ProfileSegment& segment);

/// A point of a profile with its normal.
struct ProfilePoint {
  Eigen::Vector2d point;   ///< (r, z)
  Eigen::Vector2d normal;  ///< outward
};

/// Returns the point at arc length `arc` (mm) from the start, or the nearer end if `arc` is beyond
/// the curve.
ProfilePoint profile_point_at(const ProfileCurve& s, double arc);

/// Returns the direction a quarter turn to the left of a tangent, i.e. the outward normal.
Eigen::Vector2d left_normal(const Eigen::Vector2d& tangent);

}  // namespace abbe::cutting
