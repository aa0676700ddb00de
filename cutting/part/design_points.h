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

namespace abbe::cutting {

/// Triangles sorted into boxes within boxes, for the nearest one to a place and the first that a
/// ray meets. Immutable; about 50 bytes a triangle and 24 a vertex. Built by all threads, the same
/// for any number of them.
class TriangleTree {
 public:
  TriangleTree(Points vertices, Triangles triangles);

  /// The place of a triangle that is nearest to another place.
  struct Nearest {
    int triangle = -1;  ///< -1 where there is none
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    Eigen::Vector3d weights = Eigen::Vector3d::Zero();  ///< of the corners, summing to one
    double squared = 0.0;                               ///< mm^2, of the distance
  };
  /// Of equally near triangles the one of least number, whatever the guess.
  /// @param guess  a triangle that may be near, which makes it faster; -1: none
  /// @param most   mm, triangles further off are not found
  Nearest nearest(const Eigen::Vector3d& place, int guess = -1,
                  double most = std::numeric_limits<double>::infinity()) const;
  /// All triangles that come as near as `distance`, by their numbers.
  std::vector<Nearest> within(const Eigen::Vector3d& place, double distance) const;
  /// From which side a ray comes upon a triangle.
  enum class Side { Outer, Inner };
  struct RayHit {
    double along = 0.0;  ///< mm
    int triangle = -1;
  };
  /// The first triangle that a ray meets from that side; none within `most`. Triangles in whose
  /// plane the start lies, to 1e-9 mm, do not count.
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
    int count = 0;   ///< of a leaf's triangles; 0 else
    int second = 0;  ///< the other child, the first is the next node
  };
  void fill_node(int node, int first, int last, const Points& middles);
  Nearest nearest_of(int triangle, const Eigen::Vector3d& place) const;
  std::optional<double> met(int triangle, const Eigen::Vector3d& start,
                            const Eigen::Vector3d& direction, Side side) const;

  Points vertices_;
  Triangles corners_;
  std::vector<int> order_;  ///< triangles, so that every node has a run of them
  std::vector<Node> nodes_;
};

/// A part as places see it: how thick it is behind them, whether it comes near. Immutable.
class Thickness {
 public:
  explicit Thickness(const Design& design);

  /// mm from a place against its outward normal to the first triangle through which that line
  /// leaves the part; none within `most`, as behind an open surface. Triangles in whose plane
  /// the place lies, to 1e-9 mm, do not count.
  std::optional<double> behind(const Eigen::Vector3d& place, const Eigen::Vector3d& normal,
                               double most) const;

  /// mm from a place to the nearest triangle; `most` where none is nearer.
  double nearest(const Eigen::Vector3d& place, double most) const;

  /// Whether a triangle comes as near to a place as `distance` mm.
  bool comes_within(const Eigen::Vector3d& place, double distance) const;

 private:
  TriangleTree tree_;
};

/// The place of a surface between two or three places of it, at weights that sum to one.
using SurfaceInterpolator =
    std::function<Contact(std::span<const Contact> corners, std::span<const double> weights)>;

/// Of a mesh whose facets are its surface. The normal is the mean of those at the corners.
Contact facet_point(std::span<const Contact> corners, std::span<const double> weights);

/// Of a mesh whose vertices and normals are those of a smooth surface: half way between the facet
/// and the mean of the tangent planes at its corners, as `surface_point_above`. On a sphere of
/// radius R with edges L it is L^4 / 20 R^3 off, where the facet is L^2 / 8 R. The facet itself
/// where a normal is more than 30 degrees off it.
Contact smooth_facet_point(std::span<const Contact> corners, std::span<const double> weights);

/// Of a declared surface that stands at T: the nearest place to the facet.
SurfaceInterpolator primitive_interpolator(const Primitive& primitive, const Eigen::Isometry3d& T);

/// The nearest point of a declared surface, its rims included, and the outward normal. Within a
/// hundredth of the profile's size of a kink the normal given says which piece is meant. Exact to
/// 1e-12 mm per metre for points nearer than a tenth of the least radius of curvature.
Contact nearest(const Primitive& primitive, const Eigen::Vector3d& point,
                const Eigen::Vector3d& normal);

/// A design of other vertices, those of the one it is made from first, with their facet error,
/// their groups, faces and seams. The others are of the group of the triangles at them.
/// @param triangles  (m x 3) of the places
/// @param judged     (places)
Design resampled_design(const Design& from, const std::vector<Contact>& places, Triangles triangles,
                        std::vector<std::uint8_t> judged);

/// A vertex of a design, with its normal and face.
Contact place_of(const Design& design, int vertex);

/// The vertices of a design, with their normals and faces.
std::vector<Contact> places_of(const Design& design);

/// Places as a design without triangles, all judged.
Design design_from_points(const std::vector<Contact>& places);

/// The triangles of a design that look up, sorted into the cells of a grid in x and y. Immutable.
class MeshContact {
 public:
  /// @param faces  that `Design::face` numbers
  /// @throws std::invalid_argument if a vertex or a normal is not finite
  explicit MeshContact(Design design, std::vector<AnalyticPatch> faces = {});

  const Design& design() const { return design_; }

 private:
  friend std::optional<Contact> surface_point_above(const MeshContact& mesh, double x, double y);

  int column(double x) const;
  int row(double y) const;

  Design design_;
  std::vector<AnalyticPatch> faces_;
  double gap_ = 0.0;  ///< mm, that may be between triangles of two faces
  Eigen::Vector2d lower_ = Eigen::Vector2d::Zero();
  double cell_ = 1.0;
  int columns_ = 0, rows_ = 0;
  std::vector<int> first_;      ///< (cells + 1) where the list of a cell begins
  std::vector<int> triangles_;  ///< indices of triangles, cell after cell
};

/// The highest point of the smooth surface above (x, y) and its normal; empty where no triangle
/// looks up there. In a triangle the surface is the mean of the flat triangle and of the tangent
/// planes at its corners, weighted by the plan coordinates: exact where the height is quadratic in
/// x and y and the vertex normals are exact (the flat triangle alone errs by the facet error). The
/// normal goes with the slope, linear in the triangle. Where a vertex normal leaves the triangle's
/// by more than 30 degrees (a sharp edge) the flat triangle and its own normal serve. On a
/// recognised face it is the surface of that, to 1e-12 mm, unless that stands within 1e-3 rad of
/// upright there.
std::optional<Contact> surface_point_above(const MeshContact& mesh, double x, double y);

}  // namespace abbe::cutting
