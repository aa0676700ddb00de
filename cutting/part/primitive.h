#pragma once

#include <optional>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "cutting/part/mesh.h"

namespace abbe::cutting {

// Declared analytic surfaces, in the part's own frame; z is the axis of every revolved one. Outward
// is +z, or away from the axis.

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
/// The half of a torus that is seen from +z (z >= 0): tube `tube_radius` about a circle of `radius`
/// at z = 0.
struct Torus {
  double radius = 30.0;
  double tube_radius = 5.0;  ///< <= radius
};
/// A profile (r, z) turned about z: straight lines and arcs (of at most half a turn) from point to
/// point, r growing or equal along every one of them from the axis to the rim; outward is to the
/// left of that walk.
struct RevolvedProfile {
  struct Piece {
    Eigen::Vector2d from;     ///< (r, z) mm
    Eigen::Vector2d to;       ///< (r, z) mm
    double arc_radius = 0.0;  ///< 0 a line; > 0 bulges outward (convex), < 0 inward (concave)
  };
  std::vector<Piece> pieces;  ///< from the axis outwards, connected
};

using Primitive =
    std::variant<RectanglePlane, Disc, Cylinder, Cone, SphereCap, Torus, RevolvedProfile>;

struct TessellateOptions {
  int vertices = 20000;  ///< wanted number, 100 .. 50 million; the result has within a factor
                         ///< of 1.2, unless the pieces of a profile alone need more
};

/// Mesh of the surface whose vertices and normals are exact (to 1e-12 mm and 2e-15 at 1 m), so that
/// faceting never shows as residual. Revolved surfaces are laid out on a phyllotaxis-free polar
/// grid whose ring radii are irregular on purpose: no feed of a program can be commensurable with
/// them. A kink of a profile has two rings of vertices, one for each normal, and no triangles
/// between. On the axis stands one vertex where the surface is smooth there; an apex, which has no
/// normal, is left out: the first ring stands about a third of a spacing below it and is closed by
/// a small flat.
/// @throws std::invalid_argument naming the dimension that is not positive, finite or possible
Design tessellate(const Primitive& primitive, const TessellateOptions& options = {});

/// A point of the surface and its outward normal.
struct Contact {
  Eigen::Vector3d point;
  Eigen::Vector3d normal;
  int face = -1;  ///< the recognised face of a mesh on which it lies; -1: none
};

/// The surface point above (x, y) seen from +z, the rim included; empty where there is none
/// (upright walls show nothing). At a kink the piece nearer to the axis speaks; at an apex the
/// normal is +z.
std::optional<Contact> surface_point_above(const Primitive& primitive, double x, double y);

/// The same surface continued beyond its rims, inner ones too, so that a program may run over the
/// edge: by `margin` mm of r (of x and y for a rectangle, of z for an upright wall), lines straight
/// on, arcs on their circle at most to where it stands upright, nothing across the axis. Cylinders,
/// cones and profiles come back as profiles, because their z = 0 must stay where it is.
/// @throws std::invalid_argument as `tessellate`, and for a margin that is negative or not finite
Primitive enlarged(const Primitive& primitive, double margin);

/// Profile of a revolved primitive in its half plane, from the axis outwards.
/// @throws std::invalid_argument for a rectangle, and as `tessellate`
RevolvedProfile profile(const Primitive& primitive);

/// A piece ready for evaluation. Everything is counted from its start, never from the centre of its
/// arc: so a shallow arc of a large radius loses no digits.
struct Section {
  Eigen::Vector2d from, to;
  Eigen::Vector2d tangent;  ///< unit, at `from`
  double curvature;         ///< 1/mm, > 0 convex: the walk turns to the right
  double length;            ///< mm of arc
};

Section section(const RevolvedProfile::Piece& piece);

/// A place on a profile.
struct Station {
  Eigen::Vector2d point;   ///< (r, z)
  Eigen::Vector2d normal;  ///< outward
};

/// The station `arc` mm from the start; at the nearer end beyond the section.
Station at(const Section& s, double arc);

/// The station at radius r; along a piece the normal's r component grows linearly with r.
Station at_radius(const Section& s, double r);

/// The direction a quarter turn to the left of a tangent: outward.
Eigen::Vector2d left_of(const Eigen::Vector2d& tangent);

}  // namespace abbe::cutting
