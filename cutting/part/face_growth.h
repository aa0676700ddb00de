#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "cutting/part/surface_fit.h"

/// Recognition of the analytic faces within smooth patches of a mesh by region growing.
namespace abbe::cutting {

/// Triangles of a smooth patch that lie on one surface.
struct FaceRegion {
  AnalyticPatch surface;
  std::vector<int> triangles;
};

/// The faces that were grown.
struct FaceRegions {
  std::vector<FaceRegion> faces;
  int unexamined_triangles = 0;  ///< triangles on no face if the search ended before all were tried
};

/// Finds the faces within smooth patches. Each is the plane, sphere, cylinder, cone or torus from
/// which none of its vertices is farther than the tolerance: a plane between two fillets, each of
/// the fillets, the corner where they meet. A face grows from a few facets that determine a surface
/// over the adjacent facets for as long as these lie on it; it is fitted again whenever it has
/// doubled.
///
/// A face must determine its surface as a whole patch must (`is_determined`; a torus on five lines
/// as well as on five rings), lie nearer to it than noise would by accident, with a probability of
/// 1e-9, and end clearly: the facets across nine tenths of its border depart from the surface by
/// 2.5 times as much as its own vertices, by the tolerance, and as a surface would whose curvature
/// differs by 3 tenths. Otherwise it is only the surface that touches a free form best. A strip
/// between two circles of a tube is no cylinder, cone or plane: this is assumed where the facets
/// beyond continue to turn like those of a smooth surface that is cut into strips, in proportion to
/// their widths. Facets in a plane are a face if there are more than four, if not all of their
/// vertices lie on two lines, as those of a strip do, and if the facets around them depart from it
/// by a fifth of a degree at least and by 5 to 24 times what they do themselves; or if a curved
/// face runs into them without an edge. A cylinder or cone that runs into such planes, if they are
/// as wide as two of its facets, needs one line fewer for each.
///
/// Each facet has its corners within the tolerance of the surface of its face. Its middle lies
/// within the tolerance plus k L^2 / 6 of it, L being its longest side and k the larger curvature
/// (tested). The normals of facets lower than ten tolerances are not used, and such facets alone
/// make no face.
///
/// Linear in the triangles: 100 000 of a free form, or of an almost cylindrical surface, take about
/// a second of one processor. The growth of regions that are no faces ends when 30 times as many
/// triangles have been visited: `unexamined_triangles` then counts the triangles that may lie on a
/// face that was not searched for.
/// @param open       (triangles) those of smooth patches that are to be searched
/// @param tolerance  mm
FaceRegions grow_face_regions(const Design& design, const std::vector<char>& open,
                              double tolerance);

/// The state of `grow_face_regions`: the face of each triangle, and the growth of one face.
class FaceGrowth {
 public:
  FaceGrowth(const Design& design, const std::vector<char>& open, double tolerance);

  /// Triangles and their vertices.
  struct Region {
    std::vector<int> triangles, vertices;
  };
  /// Returns the region of triangles and their vertices.
  Region region(std::vector<int> triangles);

  /// Result of an attempt to grow faces from a region.
  struct Tried {
    bool is_accepted = false;
    std::vector<int> reached;  ///< largest set of triangles reached by a surface that is no face
  };
  /// Takes the first of the forms that fits the region and grows from it to a face.
  Tried grow(std::span<const Form> forms, const Region& region);

  /// A region that has grown as far as its surface extends.
  struct RegionGrowth {
    FaceRegion face;
    bool is_face = false;
    std::vector<int> reached;  ///< triangles, including those reached before the surface was well
                               ///< known
  };
  /// Grows a region along a surface, and decides if it is a face.
  RegionGrowth grown(AnalyticPatch surface, Region region);
  /// Returns true if the budget for growing regions that are no faces is exhausted. On a surface
  /// that is nearly a face, but not everywhere, the same region would grow again from each of its
  /// triangles.
  bool is_budget_exhausted() const { return wasted_ > waste_; }

  /// Registers a face and closes its triangles.
  void take(FaceRegion face);
  /// Returns the plane of an open flat if its own vertices determine one.
  std::optional<FaceRegion> evident_plane(int flat);
  /// Returns the plane of a flat into which a curved face runs without an edge.
  std::optional<FaceRegion> tangent_plane(int flat);

  bool is_open(int t) const { return face_[std::size_t(t)] == none; }
  int open_triangles() const { return int(std::count(face_.begin(), face_.end(), none)); }
  /// Returns the flats: maximal connected sets of triangles in one plane.
  const std::vector<std::vector<int>>& flats() const { return flats_; }
  int flat_of(int t) const { return flat_[std::size_t(t)]; }
  /// Returns the triangle across a side if it is open; else -1.
  int open_across(int t, int side) const;
  Eigen::Vector3d normal(int t) const { return normals_.row(t); }
  double tolerance() const { return tolerance_; }
  const Design& design() const { return design_; }
  std::vector<FaceRegion> faces() && { return std::move(faces_); }

 private:
  static constexpr int none = -1, closed = -2;  // values of face_
  static constexpr double sliver = 10.0;  // tolerances, height below which the normal of a triangle
                                          // is not used

  /// A side of a region across which the mesh continues smoothly.
  struct Border {
    int inside, outside;  // triangles
    int a, b, beyond;     // vertices: of the side, and the third one of the outer triangle
    double height;        // mm, height of the outer triangle over the side
  };
  std::vector<Border> borders(const Region& region);
  int beyond(int t, int a, int b) const;
  double height_over(int a, int b, int beyond) const;

  using May = std::function<bool(int triangle)>;
  Region spread(const AnalyticPatch& surface, Region region, double reach, const May& may);
  bool lies_on(const AnalyticPatch& surface, int t, double reach) const;
  void find_flats(const std::vector<char>& open);
  void stamp(const Region& region);
  void add_corners(Region& region, int t);
  std::optional<AnalyticPatch> fitted(const FacetPatch& patch, const AnalyticPatch& near) const;
  AnalyticPatch refitted(const AnalyticPatch& surface, const Region& region) const;
  bool is_face(const AnalyticPatch& surface, const Region& region);
  AnalyticPatch with_sizes(AnalyticPatch surface, const Region& region) const;
  bool bends(const Region& region) const;
  bool ends_clearly(const AnalyticPatch& surface, const FacetPatch& patch,
                    const std::vector<Border>& borders) const;
  bool turns_away(const AnalyticPatch& plane, const Region& region,
                  const std::vector<Border>& borders) const;
  bool has_normals(const Region& region) const;
  bool is_tangent(const AnalyticPatch& surface, const Border& border) const;
  int tangent_lines(const AnalyticPatch& surface, const std::vector<Border>& borders) const;
  bool is_sector(const AnalyticPatch& surface, const Region& region,
                 const std::vector<Border>& borders) const;
  double width(const AnalyticPatch& surface, const Region& region) const;
  /// The turn of the surface after the facet across a border, rad, and the width of the next facet,
  /// mm.
  struct Onward {
    double turn = 0.0, width = 0.0;
  };
  Onward onward(const Border& border) const;
  std::optional<AnalyticPatch> plane_of_flat(const Region& region) const;
  Eigen::Vector3d vertex(int v) const { return design_.vertices.row(v); }

  const Design& design_;
  double tolerance_;
  std::vector<std::array<int, 3>> across_;
  Points normals_;          // (triangles) unit
  Eigen::VectorXd height_;  // (triangles) mm, the least height
  std::vector<int> face_;   // (triangles)
  std::vector<int> flat_;   // (triangles)
  std::vector<std::vector<int>> flats_;
  std::vector<FaceRegion> faces_;
  std::vector<int> stamp_, vertex_stamp_;  // number of the last region to which each belonged
  int stamped_ = 0;
  double wasted_ = 0.0, waste_;  // triangles and vertices visited in growing regions that are no
                                 // faces
};

}  // namespace abbe::cutting
