#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cutting/part/mesh.h"
#include "cutting/surface/surface.h"
#include "cutting/surface/tool.h"
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
Body make_body(const ClosedMesh& mesh);
/// Pieces that are one body, which overlap or touch.
/// @throws as of each, and for none
Body make_body(const std::vector<ClosedMesh>& pieces);

/// One surface in patches, those triangles that are in a cube of `size` mm each. It must be closed,
/// which is not looked at. What a
/// patch has in common with a body that was made so before is taken from there, so that a surface
/// of which little changes costs little more than the comparison.
/// @param before  of another state of the surface and the same size, or a body without search
/// @throws std::invalid_argument as `make_body`, or for a size that is not positive
Body make_patched_body(const ClosedMesh& mesh, double size, const Body& before = {});

/// Of a body along a direction (unit, in its own frame).
Eigen::Vector3d support_vertex(const Body& body, const Eigen::Vector3d& direction);

/// mm along a direction (unit, in its own frame), of the point of the body farthest that way.
double extent(const Body& body, const Eigen::Vector3d& direction);

/// mm, how far a point of the ball around a body is from one pose to another, at most.
double farthest(const kinematics::Pose& from, const kinematics::Pose& to, const Body& body);

/// A convex piece of a tool that must not cut: of its shank, its collet, its holder.
struct NonCuttingPiece {
  Cutter shape;       ///< by its own tip
  double base = 0.0;  ///< mm, of that above the tip of the tool
};

/// Of a profile of revolution, a cone from each point to the next.
/// @param profile  (n x 2) mm, radius and height above the tip, rising
std::vector<NonCuttingPiece> non_cutting_pieces(const Eigen::MatrixX2d& profile);

/// A tool that goes into the design with what does not cut.
struct ShankContact {
  int vertices = 0;      ///< at which it goes deeper than `passed`
  double passed = 0.0;   ///< mm below the design that are let pass
  double deepest = 0.0;  ///< mm from the whole of the design, at most the band
  bool deeper = false;   ///< the search ended in the shank
  int line = 0;          ///< program line of that
  int first_line = 0;    ///< of the earliest line that does
};

struct ShankOptions {
  double length = 0.0;                ///< mm from the tip to the end of the shank
  double band = 2.0;                  ///< mm below the design that are searched
  std::optional<double> radius = {};  ///< mm, of the shank; none: the cutter's
};

/// Where the shank, the cylinder from the end of the flank up to `length`, is in the part by more
/// than `rubbing` (stock.h; a quarter of its radius where that is less) during the motion, rapids
/// too; nothing if nowhere. How deep it is counts from the nearest place of the design, so one that
/// runs along a wall is in nothing. Every vertex counts, judged or not. A shank that passes through
/// the part and comes nearer to no vertex than the band is not seen.
/// @throws std::invalid_argument as milled_surface
std::optional<ShankContact> shank_contact(const Design& design_w, const Cutter& cutter,
                                          const CutterMotion& motion, const ShankOptions& options);

/// The same of any pieces, at each vertex of the one that goes in deepest there.
/// @param band  mm below the design that are searched
std::optional<ShankContact> non_cutting_contact(const Design& design_w,
                                                const std::vector<NonCuttingPiece>& pieces,
                                                const CutterMotion& motion, double band);

}  // namespace abbe::cutting
