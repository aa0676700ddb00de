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

/// Points on design surfaces: the nearest triangle of a mesh and the thickness behind a point,
/// interpolation between vertices, and the highest point above a position in x and y.
namespace abbe::cutting {

/// A hierarchy of bounding boxes of triangles, for the nearest triangle to a point and the first
/// triangle that a ray meets. Immutable; about 50 bytes per triangle and 24 per vertex. Constructed
/// in parallel, with the same result for any number of threads.
class TriangleTree {
 public:
  TriangleTree(Points vertices, Triangles triangles);

  /// The point of a triangle that is nearest to a query point.
  struct Nearest {
    int triangle = -1;  ///< -1 if there is none
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    Eigen::Vector3d weights = Eigen::Vector3d::Zero();  ///< barycentric weights of the corners,
                                                        ///< summing to one
    double squared = 0.0;                               ///< mm^2, squared distance
  };
  /// Returns the nearest triangle; of equally near triangles the one of least number, whatever the
  /// guess.
  /// @param guess  a triangle that may be near, which speeds up the search; -1: none
  /// @param most   mm, triangles farther away are ignored
  Nearest nearest(const Eigen::Vector3d& place, int guess = -1,
                  double most = std::numeric_limits<double>::infinity()) const;
  /// Returns all triangles within `distance` (mm) of a point, in the order of their numbers.
  std::vector<Nearest> within(const Eigen::Vector3d& place, double distance) const;
  /// The side of a triangle from which a ray arrives.
  enum class Side { Outer, Inner };
  /// The first triangle met by a ray.
  struct RayHit {
    double along = 0.0;  ///< mm along the ray
    int triangle = -1;
  };
  /// Returns the first triangle that a ray meets from that side, or nothing within `most` (mm).
  /// Triangles in whose plane the start lies, to 1e-9 mm, do not count.
  /// @param direction  unit
  std::optional<RayHit> first_hit(const Eigen::Vector3d& start, const Eigen::Vector3d& direction,
                                  Side side,
                                  double most = std::numeric_limits<double>::infinity()) const;

  const Points& vertices() const { return vertices_; }
  const Triangles& triangles() const { return corners_; }

 private:
  struct Node {
    Eigen::AlignedBox3d box;
    int first = 0;
    int count = 0;   ///< number of triangles of a leaf; 0 for an inner node
    int second = 0;  ///< index of the second child; the first child is the next node
  };
  void fill_node(int node, int first, int last, const Points& middles);
  Nearest nearest_of(int triangle, const Eigen::Vector3d& place) const;
  std::optional<double> met(int triangle, const Eigen::Vector3d& start,
                            const Eigen::Vector3d& direction, Side side) const;

  Points vertices_;
  Triangles corners_;
  std::vector<int> order_;  ///< triangles in an order in which those of every node are consecutive
  std::vector<Node> nodes_;
};

/// The thickness of a part behind points of its surface, and its distance from points. Immutable.
class Thickness {
 public:
  explicit Thickness(const Design& design);

  /// Returns the distance from a point against its outward normal to the first triangle through
  /// which that line leaves the part, mm; nothing within `most`, as behind an open surface.
  /// Triangles in whose plane the point lies, to 1e-9 mm, do not count.
  std::optional<double> behind(const Eigen::Vector3d& place, const Eigen::Vector3d& normal,
                               double most) const;

  /// Returns the distance of a point from the nearest triangle, mm; at most `most`.
  double nearest(const Eigen::Vector3d& place, double most) const;

  /// Returns true if a triangle lies within `distance` mm of a point.
  bool comes_within(const Eigen::Vector3d& place, double distance) const;

 private:
  TriangleTree tree_;
};

/// Returns the point of a surface between two or three of its points, for weights that sum to one.
using SurfaceInterpolator =
    std::function<Contact(std::span<const Contact> corners, std::span<const double> weights)>;

/// Interpolates on a mesh whose facets are its surface. The normal is the mean of those at the
/// corners.
Contact facet_point(std::span<const Contact> corners, std::span<const double> weights);

/// Interpolates on a mesh whose vertices and normals are those of a smooth surface: returns the
/// point half way between the facet and the mean of the tangent planes at its corners, as
/// `surface_point_above`. On a sphere of radius R with edges L its error is L^4 / 20 R^3, where
/// that of the facet is L^2 / 8 R. Returns the point of the facet itself if a normal is more than
/// 30 degrees off it.
Contact smooth_facet_point(std::span<const Contact> corners, std::span<const double> weights);

/// Returns an interpolator for a declared surface with pose T: the nearest point of the surface to
/// the facet.
SurfaceInterpolator primitive_interpolator(const Primitive& primitive, const Eigen::Isometry3d& T);

/// Returns the nearest point of a declared surface, its rims included, and the outward normal.
/// Within a hundredth of the profile's size of a kink the given normal decides between the pieces.
/// Exact to 1e-12 mm per metre for points nearer than a tenth of the least radius of curvature.
Contact nearest(const Primitive& primitive, const Eigen::Vector3d& point,
                const Eigen::Vector3d& normal);

/// Returns a design with other vertices. Those of the original design come first and keep their
/// facet error, groups, faces and seams; the others belong to the group of their triangles.
/// @param triangles  (m x 3) of the points
/// @param judged     (points)
Design resampled_design(const Design& from, const std::vector<Contact>& places, Triangles triangles,
                        std::vector<std::uint8_t> judged);

/// Returns a vertex of a design with its normal and face.
Contact place_of(const Design& design, int vertex);

/// Returns the vertices of a design with their normals and faces.
std::vector<Contact> places_of(const Design& design);

/// Returns points as a design without triangles, all judged.
Design design_from_points(const std::vector<Contact>& places);

/// The upward-facing triangles of a design, sorted into the cells of a grid in x and y. Immutable.
class MeshContact {
 public:
  /// @param faces  indexed by `Design::face`
  /// @throws std::invalid_argument if a vertex or a normal is not finite
  explicit MeshContact(Design design, std::vector<AnalyticPatch> faces = {});

  const Design& design() const { return design_; }

 private:
  friend std::optional<Contact> surface_point_above(const MeshContact& mesh, double x, double y);

  int column(double x) const;
  int row(double y) const;

  Design design_;
  std::vector<AnalyticPatch> faces_;
  double gap_ = 0.0;  ///< mm, possible gap between triangles of two faces
  Eigen::Vector2d lower_ = Eigen::Vector2d::Zero();
  double cell_ = 1.0;
  int columns_ = 0, rows_ = 0;
  std::vector<int> first_;      ///< (cells + 1) start of the list of each cell
  std::vector<int> triangles_;  ///< indices of triangles, cell after cell
};

/// Returns the highest point of the smooth surface above (x, y) and its normal; nothing if no
/// triangle faces upwards there.
/// Within a triangle the surface is the mean of the flat triangle and of the tangent planes at its
/// corners, weighted by the plan coordinates: exact if the height is quadratic in x and y and the
/// vertex normals are exact (the error of the flat triangle alone is the facet error). The normal
/// follows from the slope, which is linear in the triangle. If a vertex normal deviates from that
/// of the triangle by more than 30 degrees (a sharp edge), the flat triangle and its own normal are
/// used. On a recognised face the result is the analytic surface, to 1e-12 mm, unless that is
/// within 1e-3 rad of upright there.
std::optional<Contact> surface_point_above(const MeshContact& mesh, double x, double y);

}  // namespace abbe::cutting
