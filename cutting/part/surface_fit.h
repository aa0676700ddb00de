#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cutting/part/mesh.h"
#include "cutting/part/primitive.h"

/// Analytic surfaces fitted to the vertices of a mesh.
namespace abbe::cutting {

/// Forms of analytic surfaces.
enum class Form { Plane, Sphere, Cylinder, Cone, Torus };

/// A smooth face of a mesh that lies on an analytic surface about the third axis of its frame.
struct AnalyticPatch {
  Form form = Form::Plane;
  Eigen::Matrix3d frame = Eigen::Matrix3d::Identity();  ///< columns; the third is the axis or the
                                                        ///< normal
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();     ///< mm, on the axis or in the plane
  Eigen::VectorXd shape;  ///< mm: radius; cone: radius at the origin, then its growth per height;
                          ///< torus: radius of the ring, then that of the tube; plane: empty
  double sign = 1.0;      ///< -1 if the outward normal of the part points to the axis
  double area = 0.0;      ///< mm^2, of its triangles
  double off = 0.0;       ///< mm, distance of the farthest vertex from the surface
  Eigen::AlignedBox3d box;
};

/// Returns the signed distance of a point from the surface, mm; it increases in the direction of
/// `outward`.
double distance_of(const AnalyticPatch& surface, const Eigen::Vector3d& p);

/// Returns the unit direction in which the distance increases.
Eigen::Vector3d outward(const AnalyticPatch& surface, const Eigen::Vector3d& p);

/// Returns the nearest point of the surface to a nearby point, with the normal of the part.
Contact project_to_surface(const AnalyticPatch& surface, const Eigen::Vector3d& p);

/// Facets in coordinates relative to the mean of their vertices, scaled to size 1.
struct FacetPatch {
  std::vector<int> vertices, triangles;
  Points points;            ///< (vertices)
  Points centres, normals;  ///< (triangles)
  Points circumcentres;     ///< (triangles) where a sphere, or a surface of revolution divided into
                            ///< quadrangles, has the normal of the facet
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  ///< mm
  double size = 1.0;                                 ///< mm
};
/// Returns facets of a design in patch coordinates.
FacetPatch facet_patch(const Design& design, std::vector<int> vertices, std::vector<int> triangles);

/// Returns the number of parameters of a form.
Eigen::Index parameter_count(Form form);

/// Return the surface converted from mm to the coordinates of a patch, and back.
AnalyticPatch to_patch_coordinates(const FacetPatch& patch, AnalyticPatch surface);
AnalyticPatch from_patch_coordinates(const FacetPatch& patch, AnalyticPatch surface);

/// Returns the largest distance of the vertices of a patch from a surface in patch coordinates, mm.
double max_vertex_distance(const FacetPatch& patch, const AnalyticPatch& surface);

/// Returns the axis of revolution, i.e. the line that meets the normals of the facets (Pottmann and
/// Wallner 2001, Computational Line Geometry, 4.1).
AnalyticPatch revolution_from_normals(const FacetPatch& patch);

/// Returns a surface of the given form near the vertices of a patch, in patch coordinates: a plane
/// or a sphere by least squares, or a surface of revolution about the given axis.
AnalyticPatch initial_surface(Form form, const FacetPatch& patch, const AnalyticPatch& axis = {});

/// Returns the surface that minimises the squared distances of about 2000 evenly chosen vertices of
/// the patch, by the Gauss-Newton method; both surfaces in patch coordinates.
/// @param surface         start of the iteration
/// @param max_iterations  maximum number of iterations
AnalyticPatch refine_fit(AnalyticPatch surface, const FacetPatch& patch, int max_iterations = 30);

/// Returns true if the vertices lie on enough lines along a surface, or rings around it, to
/// determine it. Any three lines of a bend lie on a cylinder, and so do four of a symmetric bend;
/// any two rings, such as those of a cylinder or cone, lie on a sphere; three rings of a chamfered
/// shaft lie on a torus, and so do four of a symmetric one. A fit through them proves nothing about
/// the surface in between. A torus about a point is a sphere that was rejected. Planes are not
/// tested.
/// @param tangent_lines  number of lines along which a cylinder or cone is known to continue in a
///                       plane; each counts as a line of vertices
bool is_determined(const AnalyticPatch& surface, const FacetPatch& patch, int tangent_lines = 0);

/// Returns true if the vertices lie on at least `min_count` lines around the axis.
bool has_lines(const AnalyticPatch& surface, const FacetPatch& patch, int min_count);

/// Returns the plane, cylinder, cone, sphere or torus, tried in this order, on which the whole
/// patch lies, in mm; empty if there is none or the vertices do not determine it.
/// @param tolerance  mm
std::optional<AnalyticPatch> recognise_surface(const FacetPatch& patch, double tolerance);

}  // namespace abbe::cutting
