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

/// The bodies of a machine, its tool and its workpiece for collision checks: meshes, their search
/// structures, and the contact of the non-cutting parts of a tool with a design.
namespace abbe::cutting {

/// A closed surface with triangles counter-clockwise seen from outside. A skin enlarges the surface
/// by the radius of a ball; with a skin a triangle may degenerate to a line or a point.
struct ClosedMesh {
  Points vertices;      ///< (n x 3) mm
  Triangles triangles;  ///< (m x 3)
  double skin = 0.0;    ///< mm, radius of the ball
};

/// Returns a box with its centre at the origin, mm.
/// @throws std::invalid_argument for a size that is not positive
ClosedMesh box_mesh(const Eigen::Vector3d& size);

/// Returns a body of revolution about z. Its facets lie outside it, by at most `sag` (mm), so that
/// no contact is missed.
/// @param profile  (n x 2) radius and height, mm; heights must not fall, so a bore is not possible.
///                 A disc closes an end off the axis.
/// @throws std::invalid_argument for fewer than two points, radii below zero or all zero, heights
///         that fall, equal neighbours, or a sag that is not positive
ClosedMesh revolved_mesh(const Eigen::MatrixX2d& profile, double sag);

/// Returns a sphere about the origin with facets outside by at most `sag`, mm.
/// @throws std::invalid_argument if radius or sag is not positive
ClosedMesh sphere_mesh(double radius, double sag);

/// Returns a prism that stands on z = 0.
/// @param outline  (n x 2) mm, counter-clockwise
/// @throws std::invalid_argument for an outline that crosses itself or is clockwise, or a height
///         that is not positive
ClosedMesh extruded_mesh(const Eigen::MatrixX2d& outline, double height);

/// Returns the mesh of a milling cutter in its frame t, with the tip at the origin and facets as in
/// `revolved_mesh`.
/// @throws std::invalid_argument for an impossible cutter or a sag that is not positive
ClosedMesh cutter_mesh(const Cutter& cutter, double sag);

/// Returns the meshes whose union is the cutter. The end is a disc, or a point, with the corner as
/// skin, so that a ball end is exact; the flank is a cylinder. A form cutter is a single mesh, as
/// in `cutter_mesh`; a hollow one has a mesh for each convex part.
std::vector<ClosedMesh> cutter_meshes(const Cutter& cutter, double sag);

/// Returns the mesh transformed by T.
ClosedMesh transformed_mesh(ClosedMesh mesh, const kinematics::Pose& T);

struct BodySearch;

/// A rigid body prepared for distance queries.
struct Body {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< mm, of a ball around it, in its own frame
  double radius = 0.0;                               ///< mm, of that ball
  std::shared_ptr<const BodySearch> search;
};

/// Returns the body of a mesh.
/// @param mesh  may be open, such as a design; the body is then the surface only
/// @throws std::invalid_argument for a mesh without triangles, vertices that are not finite, or
///         triangles with invalid vertices
Body make_body(const ClosedMesh& mesh);
/// Returns the body that is the union of meshes that overlap or touch.
/// @throws std::invalid_argument as for a single mesh, or if there is none
Body make_body(const std::vector<ClosedMesh>& meshes);

/// Returns the body of one surface, divided into patches: the triangles in each cube of `size` mm.
/// The surface must be closed, which is not checked. Reuses the patches of an earlier body that are
/// equal, so that after a small change the cost is little more than the comparison.
/// @param previous  body of an earlier state of the surface with the same size, or an empty body
/// @throws std::invalid_argument as `make_body`, or for a size that is not positive
Body make_patched_body(const ClosedMesh& mesh, double size, const Body& previous = {});

/// Returns the farthest point of a body in a direction (unit, in its own frame).
Eigen::Vector3d support_vertex(const Body& body, const Eigen::Vector3d& direction);

/// Returns the extent of a body in a direction (unit, in its own frame): the coordinate of its
/// farthest point, mm.
double extent(const Body& body, const Eigen::Vector3d& direction);

/// Returns an upper bound of the displacement of a body's points between two poses, mm: that of the
/// ball around the body.
double max_displacement(const kinematics::Pose& from, const kinematics::Pose& to, const Body& body);

/// A convex section of the shank, the collet or the holder of a tool, which must not cut.
struct NonCuttingSection {
  Cutter shape;       ///< relative to its own tip
  double base = 0.0;  ///< mm, height of that tip above the tip of the tool
};

/// Returns the sections of a profile of revolution: a cone from each point to the next.
/// @param profile  (n x 2) mm, radius and height above the tip, rising
std::vector<NonCuttingSection> non_cutting_sections(const Eigen::MatrixX2d& profile);

/// The contact of the non-cutting parts of a tool with the design.
struct ShankContact {
  int vertices = 0;  ///< number of vertices with a contact deeper than `tolerated_depth`
  double tolerated_depth = 0.0;  ///< mm, tolerated depth below the design
  double deepest =
      0.0;  ///< mm, maximum depth below the nearest point of the design, at most the band
  bool continues_deeper =
      false;           ///< true if the search ended inside the tool: the depth is a lower bound
  int line = 0;        ///< program line of the deepest contact
  int first_line = 0;  ///< earliest program line with a contact
};

struct ShankOptions {
  double length = 0.0;                ///< mm, from the tip to the end of the shank
  double band = 2.0;                  ///< mm, depth of the search below the design
  std::optional<double> radius = {};  ///< mm, of the shank; empty: that of the cutter
};

/// Returns the contact of the shank, the cylinder from the end of the flank up to `length`, with
/// the part if it is deeper than `rubbing` (stock.h; a quarter of the radius if that is less) at
/// any time of the motion, rapids included; otherwise nothing. The depth is measured from the
/// nearest point of the design, so a shank that slides along a wall has none. All vertices count,
/// judged or not. Does not detect a shank that passes through the part farther than the band from
/// every vertex.
/// @throws std::invalid_argument as milled_surface
std::optional<ShankContact> shank_contact(const Design& design_w, const Cutter& cutter,
                                          const CutterMotion& motion, const ShankOptions& options);

/// Returns the contact of several sections; at each vertex that of the deepest one.
/// @param band  mm, depth of the search below the design
std::optional<ShankContact> non_cutting_contact(const Design& design_w,
                                                const std::vector<NonCuttingSection>& sections,
                                                const CutterMotion& motion, double band);

}  // namespace abbe::cutting
