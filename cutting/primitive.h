#pragma once

#include <optional>
#include <variant>
#include <vector>

#include "cutting/mesh.h"

namespace abbe::cutting {

// Declared analytic surfaces, in the part's own frame; z is the axis of every revolved one. Outward is
// +z, or away from the axis.

/// z = 0, a rectangle centred at the origin.
struct RectanglePlane {
  double length_x = 100.0;
  double length_y = 100.0;
};
/// z = 0, a disc or ring.
struct Disc {
  double radius = 10.0;
  double inner_radius = 0.0;
};
/// Outer surface of a cylinder from z = 0 to z = height.
struct Cylinder {
  double radius = 10.0;
  double height = 10.0;
};
/// Outer surface of a cone frustum from radius `base_radius` at z = 0 to z = height; the half apex
/// angle opens downwards.
struct Cone {
  double base_radius = 10.0;
  double height = 10.0;
  double half_apex_angle = 0.26;  ///< rad, in (0, pi/2)
};
/// Cap of a sphere: its top at z = 0, its rim at radius `rim_radius` (z = sqrt(R^2 - r^2) - R).
struct SphereCap {
  double radius = 100.0;
  double rim_radius = 50.0;  ///< <= radius
};
/// Outer half of a torus, seen from +z: tube `tube_radius` about a circle of `radius` at z = 0.
struct Torus {
  double radius = 30.0;
  double tube_radius = 5.0;
};
/// A profile (r, z) turned about z: straight lines and arcs from point to point, r falling or equal
/// along it from the rim to the axis; outward is to the left of the walk from the axis to the rim.
struct RevolvedProfile {
  struct Piece {
    Eigen::Vector2d from;           ///< (r, z) mm
    Eigen::Vector2d to;             ///< (r, z) mm
    double arc_radius = 0.0;        ///< 0 a line; > 0 bulges outward (convex), < 0 inward (concave)
  };
  std::vector<Piece> pieces;  ///< from the axis outwards, connected
};

using Primitive = std::variant<RectanglePlane, Disc, Cylinder, Cone, SphereCap, Torus, RevolvedProfile>;

struct TessellateOptions {
  int vertices = 20000;  ///< wanted number of vertices; the result has within a factor of 1.2
};

/// Mesh of the surface whose vertices and normals are exact (to 1e-12 mm and 1e-15 at 1 m), so that
/// faceting never shows as residual. Revolved surfaces are laid out on a phyllotaxis-free polar grid
/// whose ring radii are irregular on purpose: no feed of a program can be commensurable with them.
/// A kink of a profile has two rings of vertices, one for each normal.
/// @throws std::invalid_argument naming the dimension that is not positive, finite or possible
Design tessellate(const Primitive& primitive, const TessellateOptions& options = {});

/// A point of the surface and its outward normal.
struct Contact {
  Eigen::Vector3d point;
  Eigen::Vector3d normal;
};

/// The surface point above (x, y) seen from +z; empty where there is none.
std::optional<Contact> contact_above(const Primitive& primitive, double x, double y);

/// The same surface continued by `margin` mm beyond its rim, where it can be (a sphere at most to its
/// equator), so that a program may run over the edge.
Primitive enlarged(const Primitive& primitive, double margin);

/// Profile of a revolved primitive in its half plane, from the axis outwards.
/// @throws std::invalid_argument for a rectangle
RevolvedProfile profile(const Primitive& primitive);

}  // namespace abbe::cutting
