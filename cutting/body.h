#pragma once

#include <memory>
#include <vector>

#include <Eigen/Geometry>

#include "cutting/mesh.h"
#include "cutting/tool.h"
#include "kinematics/pose.h"

/// What a machine, its tool and its workpiece are made of, to be asked what meets what.
namespace abbe::cutting {

/// A closed surface, triangles counter-clockwise seen from outside; grown by a ball that rolls
/// around it, where it has a skin. Then a triangle may be a line or a point.
struct ClosedMesh {
  Points vertices;      ///< (n x 3) mm
  Triangles triangles;  ///< (m x 3)
  double skin = 0.0;    ///< mm
};

/// A box about its middle.
/// @throws std::invalid_argument for a size that is not positive
ClosedMesh box_mesh(const Eigen::Vector3d& size);

/// A body of revolution about z. Its facets lie outside of it, by at most `sag`, so that nothing
/// that meets it is missed.
/// @param profile  (n x 2) radius and height, mm, upwards: heights never fall, so there is no bore.
///                 Ends that are not on the axis get a disc.
/// @throws std::invalid_argument for fewer than two points, radii below zero or all zero, heights
///         that fall, equal neighbours, or a sag that is not positive
ClosedMesh revolved_mesh(const Eigen::MatrixX2d& profile, double sag);

/// A sphere about the origin, facets outside by at most `sag`.
/// @throws std::invalid_argument the same way
ClosedMesh sphere_mesh(double radius, double sag);

/// A prism on z = 0.
/// @param outline  (n x 2) mm, counter-clockwise
/// @throws std::invalid_argument for an outline that crosses itself or runs clockwise, or a height
///         that is not positive
ClosedMesh extruded_mesh(const Eigen::MatrixX2d& outline, double height);

/// A milling cutter in its frame t, tip at the origin, as `revolved_mesh`.
/// @throws std::invalid_argument for a cutter that cannot be, or a sag that is not positive
ClosedMesh cutter_mesh(const Cutter& cutter, double sag);

/// The same in pieces: its end is a disc, or a point, grown by the corner, so that a ball end is
/// exact; the flank is a cylinder. A form cutter is one piece, as `cutter_mesh`,
/// a hollow one as many as it has convex parts.
std::vector<ClosedMesh> cutter_pieces(const Cutter& cutter, double sag);

ClosedMesh moved(ClosedMesh mesh, const kinematics::Pose& T);

struct BodySearch;

/// A rigid body that can be asked how far it is from another.
struct Body {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< mm, of a ball around it, in its own frame
  double radius = 0.0;                               ///< mm, of the ball
  std::shared_ptr<const BodySearch> search;
};

/// @param mesh  it may be open, as a design is, and is then its surface alone
/// @throws std::invalid_argument for a mesh without triangles, vertices that are not finite, or
///         triangles of vertices that it has not
Body body_of(const ClosedMesh& mesh);
/// Pieces that are one body, which overlap or touch.
/// @throws as of each, and for none
Body body_of(const std::vector<ClosedMesh>& pieces);

/// One surface in patches, those triangles that are in a cube of `size` mm each. It must be closed,
/// which is not looked at. What a
/// patch has in common with a body that was made so before is taken from there, so that a surface
/// of which little changes costs little more than the comparison.
/// @param before  of another state of the surface and the same size, or a body without search
/// @throws std::invalid_argument as `body_of`, or for a size that is not positive
Body body_of_patches(const ClosedMesh& mesh, double size, const Body& before = {});

/// Of a body along a direction (unit, in its own frame).
Eigen::Vector3d farthest_point(const Body& body, const Eigen::Vector3d& direction);

/// mm along a direction (unit, in its own frame), of the point of the body farthest that way.
double extent(const Body& body, const Eigen::Vector3d& direction);

/// mm, how far a point of the ball around a body is from one pose to another, at most.
double farthest(const kinematics::Pose& from, const kinematics::Pose& to, const Body& body);

}  // namespace abbe::cutting
