#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cutting/part/mesh.h"
#include "cutting/part/primitive.h"

/// Surfaces in closed form that the vertices of a mesh lie on.
namespace abbe::cutting {

enum class Form { Plane, Sphere, Cylinder, Cone, Torus };

/// A smooth face of a mesh that lies on a surface known in closed form, about the third axis of its
/// frame.
struct AnalyticPatch {
  Form form = Form::Plane;
  Eigen::Matrix3d frame = Eigen::Matrix3d::Identity();  ///< columns; the third: axis, or normal
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();     ///< mm, on the axis, or in the plane
  Eigen::VectorXd shape;  ///< mm: radius; cone: radius at the origin, then its growth by the
                          ///< height; torus: radius of the ring, then of its section; plane: none
  double sign = 1.0;      ///< -1 where the outward normal of the part points to the axis
  double area = 0.0;      ///< mm^2, of its triangles
  double off = 0.0;       ///< mm, the vertex farthest from the surface
  Eigen::AlignedBox3d box;
};

/// mm, signed, of a point from the surface; grows along `outward`.
double distance_of(const AnalyticPatch& surface, const Eigen::Vector3d& p);

/// Unit: the direction in which the distance grows.
Eigen::Vector3d outward(const AnalyticPatch& surface, const Eigen::Vector3d& p);

/// The nearest point of the surface, near it, with the normal of the part.
Contact dropped(const AnalyticPatch& surface, const Eigen::Vector3d& p);

/// Facets about the middle of their vertices, their size 1.
struct FacetPatch {
  std::vector<int> vertices, triangles;
  Points points;            ///< (vertices)
  Points centres, normals;  ///< (triangles)
  Points feet;  ///< (triangles) the middles of the circles around them: where a sphere or a surface
                ///< of revolution that is cut into quadrangles has the normal of the facet
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  ///< mm
  double size = 1.0;                                 ///< mm
};
FacetPatch facet_patch(const Design& design, std::vector<int> vertices, std::vector<int> triangles);

/// Numbers that a surface of a form has.
Eigen::Index numbers_of(Form form);

/// A surface in mm in the coordinates of a patch, and back.
AnalyticPatch to_patch_coordinates(const FacetPatch& patch, AnalyticPatch surface);
AnalyticPatch from_patch_coordinates(const FacetPatch& patch, AnalyticPatch surface);

/// mm, the vertex of a patch farthest from a surface in its coordinates.
double farthest(const FacetPatch& patch, const AnalyticPatch& surface);

/// The line that the normals of the facets meet (Pottmann and Wallner 2001, Computational Line
/// Geometry, 4.1), as axis and origin.
AnalyticPatch revolution_from_normals(const FacetPatch& patch);

/// The surface of a form near the vertices of a patch, in its coordinates: a plane or a sphere by
/// least squares, or what is turned about an axis.
AnalyticPatch first_guess(Form form, const FacetPatch& patch, const AnalyticPatch& axis = {});

/// A surface brought to the least squares of the distances by Gauss and Newton, of some 2000
/// vertices of the patch evenly chosen; both in the coordinates of the patch.
/// @param rounds  at most
AnalyticPatch adjusted(AnalyticPatch surface, const FacetPatch& patch, int rounds = 30);

/// Whether the vertices stand on enough lines along a surface, or rings around it, to show it.
/// Three lines of a bend lie on a cylinder, and four of a symmetric one; two rings on a sphere, as
/// those of any cylinder or cone; three rings of a chamfered shaft on a torus, and four of a
/// symmetric one: that these fit says nothing of what lies between them. A torus about a point is a
/// sphere that was refused. Planes are not asked.
/// @param tangents  lines along which a cylinder or cone is known to go on in a plane: each counts
///                  as a line of vertices
bool is_determined(const AnalyticPatch& surface, const FacetPatch& patch, int tangents = 0);

/// Whether there are at least so many lines of vertices around the axis.
bool has_lines(const AnalyticPatch& surface, const FacetPatch& patch, int wanted);

/// The plane, cylinder, cone, sphere or torus, tried in this order, on which all of a patch lies,
/// in mm; none is found of too few vertices to show it.
/// @param tolerance  mm
std::optional<AnalyticPatch> surface_of(const FacetPatch& patch, double tolerance);

}  // namespace abbe::cutting
