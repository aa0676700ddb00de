#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cutting/part/mesh.h"
#include "cutting/part/primitive.h"
#include "cutting/part/surface_fit.h"

/// Queries of design surfaces: the nearest point of a mesh, the wall thickness behind a point,
/// points between vertices, and the highest point at a position in x and y.
namespace abbe::cutting {

/// A bounding volume hierarchy of triangles that finds the triangle nearest to a point and the
/// first one that a ray meets. Immutable; about 50 bytes per triangle and 24 per vertex.
/// Constructed in parallel, with the same result for any number of threads.
class TriangleTree {
 public:
  TriangleTree(Points vertices, Triangles triangles);

  /// The point of a triangle that is nearest to a query point.
  struct NearestPoint {
    int triangle = -1;  ///< -1 if there is none
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    Eigen::Vector3d weights = Eigen::Vector3d::Zero();  ///< barycentric coordinates
    double squared_distance = 0.0;  ///< mm^2, squared distance from the query point
  };
  /// Returns the nearest triangle; of equally near ones the one of lowest index. The result does
  /// not depend on the guess.
  /// @param guess         index of a triangle that is probably near, to speed up the search;
  ///                      -1: none
  /// @param max_distance  mm; triangles farther away are ignored
  NearestPoint nearest(const Eigen::Vector3d& point, int guess = -1,
                       double max_distance = std::numeric_limits<double>::infinity()) const;
  /// Returns all triangles within `distance` (mm) of a point, in ascending order of index.
  std::vector<NearestPoint> within(const Eigen::Vector3d& point, double distance) const;
  /// The side from which a ray meets a triangle.
  enum class Side { Outer, Inner };
  /// The first triangle met by a ray.
  struct RayHit {
    double along = 0.0;  ///< mm along the ray
    int triangle = -1;
  };
  /// Returns the first triangle that a ray meets from the given side within `max_distance` (mm);
  /// empty if there is none. Triangles whose plane contains the start (to 1e-9 mm) are ignored.
  /// @param direction  unit vector
  std::optional<RayHit> first_hit(
      const Eigen::Vector3d& start, const Eigen::Vector3d& direction, Side side,
      double max_distance = std::numeric_limits<double>::infinity()) const;

  const Points& vertices() const { return vertices_; }
  const Triangles& triangles() const { return corners_; }

 private:
  struct Node {
    Eigen::AlignedBox3d box;
    int first = 0;
    int count = 0;   ///< number of triangles of a leaf; 0 for an inner node
    int second = 0;  ///< index of the second child; the first child is the next node
  };
  void fill_node(int node, int first, int last, const Points& centroids);
  NearestPoint nearest_on_triangle(int triangle, const Eigen::Vector3d& point) const;
  std::optional<double> ray_distance(int triangle, const Eigen::Vector3d& start,
                                     const Eigen::Vector3d& direction, Side side) const;

  Points vertices_;
  Triangles corners_;
  std::vector<int> order_;  ///< triangle indices, ordered so that those of a node are consecutive
  std::vector<Node> nodes_;
};

/// Wall thickness of a part behind points of its surface, and distance of points from it.
/// Immutable.
class WallThickness {
 public:
  explicit WallThickness(const Design& design);

  /// Returns the distance, mm, from a point along its inward normal to the point where that line
  /// leaves the part; empty if it does not leave the part within `max_distance`, for instance
  /// behind an open surface. Triangles whose plane contains the point (to 1e-9 mm) are ignored.
  std::optional<double> behind(const Eigen::Vector3d& point, const Eigen::Vector3d& normal,
                               double max_distance) const;

  /// Returns the distance of a point from the nearest triangle, at most `max_distance`, mm.
  double nearest(const Eigen::Vector3d& point, double max_distance) const;

  /// Returns true if a triangle lies within `distance` mm of a point.
  bool comes_within(const Eigen::Vector3d& point, double distance) const;

 private:
  TriangleTree tree_;
};

/// A function that interpolates between two or three points of a surface; the sum of the weights is
/// one.
using SurfaceInterpolator =
    std::function<Contact(std::span<const Contact> corners, std::span<const double> weights)>;

/// Interpolates on a mesh whose facets are the surface itself. The normal is the weighted mean of
/// the normals at the corners.
Contact facet_point(std::span<const Contact> corners, std::span<const double> weights);

/// Interpolates on a mesh whose vertices and normals sample a smooth surface: returns the point
/// half way between the facet and the weighted mean of the tangent planes at its corners, like
/// `highest_surface_point`. On a sphere of radius R with edges of length L the error is L^4 / (20
/// R^3), whereas that of the facet is L^2 / (8 R). Returns the point of the facet itself if the
/// normal at a corner deviates from that of the facet by more than 30 degrees.
Contact smooth_facet_point(std::span<const Contact> corners, std::span<const double> weights);

/// Returns an interpolator for a primitive with pose T, which projects the point of the facet to
/// the nearest point of the primitive.
SurfaceInterpolator primitive_interpolator(const Primitive& primitive, const Eigen::Isometry3d& T);

/// Returns the point of a primitive, rims included, that is nearest to a given point, and its
/// outward normal. Near a kink (within a hundredth of the size of the profile) the given normal
/// selects the piece. Exact to 1e-12 mm per metre of size for points nearer than a tenth of the
/// smallest radius of curvature.
Contact nearest(const Primitive& primitive, const Eigen::Vector3d& point,
                const Eigen::Vector3d& normal);

/// Returns a design with additional vertices. Vertices of the source design come first and keep
/// their facet error, groups, faces and seams; new ones belong to the group of their triangles.
/// @param contacts   all vertices
/// @param triangles  (m x 3) indices of the vertices
/// @param judged     (vertices) nonzero: the vertex is judged
Design resampled_design(const Design& source, const std::vector<Contact>& contacts,
                        Triangles triangles, std::vector<std::uint8_t> judged);

/// Returns a vertex of a design with its normal and face.
Contact vertex_contact(const Design& design, int vertex);

/// Returns the vertices of a design with their normals and faces.
std::vector<Contact> vertex_contacts(const Design& design);

/// Returns a design of points without triangles; all of them are judged.
Design design_from_points(const std::vector<Contact>& contacts);

/// The upward-facing triangles of a design, sorted into the cells of a grid in x and y. Immutable.
class MeshHeightMap {
 public:
  /// @param faces  recognised analytic faces, indexed by `Design::face`
  /// @throws std::invalid_argument if a vertex or a normal is not finite
  explicit MeshHeightMap(Design design, std::vector<AnalyticPatch> faces = {});

  const Design& design() const { return design_; }

 private:
  friend std::optional<Contact> highest_surface_point(const MeshHeightMap& mesh, double x,
                                                      double y);

  int column(double x) const;
  int row(double y) const;

  Design design_;
  std::vector<AnalyticPatch> faces_;
  double gap_ = 0.0;  ///< mm, largest gap between triangles of two faces
  Eigen::Vector2d lower_ = Eigen::Vector2d::Zero();
  double cell_ = 1.0;
  int columns_ = 0, rows_ = 0;
  std::vector<int> first_;      ///< (cells + 1) start of the list of each cell
  std::vector<int> triangles_;  ///< indices of triangles, cell after cell
};

/// Returns the highest point of the smooth surface at (x, y) and its normal; empty if no triangle
/// faces upwards there.
/// Within a triangle the height is the mean of the height of the flat triangle and that of the
/// tangent planes at its corners, weighted by the barycentric coordinates of (x, y). This is exact
/// if the height is quadratic in x and y and the vertex normals are exact; the flat triangle alone
/// would have the facet error. The normal follows from the slope, which is linear in the triangle.
/// If a vertex normal deviates from that of the triangle by more than 30 degrees (a sharp edge),
/// the flat triangle and its own normal are used. On a recognised face the result lies on the
/// analytic surface to 1e-12 mm, unless the surface is within 1e-3 rad of vertical there.
std::optional<Contact> highest_surface_point(const MeshHeightMap& mesh, double x, double y);

}  // namespace abbe::cutting
