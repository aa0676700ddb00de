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

/// Result of the search for faces.
struct FaceRegions {
  std::vector<FaceRegion> faces;
  int unexamined_triangles = 0;  ///< triangles on no face if the search ended early, else 0
};

/// Finds the faces within smooth patches, such as a plane between two fillets, the fillets, and the
/// corner where they meet. All vertices of a face lie within the tolerance of a plane, sphere,
/// cylinder, cone or torus. A face grows from a few facets that determine a surface; adjacent
/// facets are added while they lie on it, and the surface is refitted whenever the face has doubled
/// in size.
///
/// A face must determine its surface like a whole patch (`is_determined`; a torus by five lines as
/// well as by five rings). Its vertices must lie nearer to the surface than noise would by chance,
/// with a probability of 1e-9. Its border must be distinct: the facets across nine tenths of it
/// depart from the surface by 2.5 times the deviation of its own vertices, by the tolerance, and as
/// much as a surface whose curvature differs by 3 tenths. Otherwise it is only the surface that
/// best touches a free form. A strip between two circles of a tube is no cylinder, cone or plane:
/// it is recognised by facets beyond the border that continue to turn like those of a smooth
/// surface cut into strips, in proportion to their widths. Facets in a plane are a face if there
/// are more than four of them, if not all of their vertices lie on two lines (as those of a strip),
/// and if the facets around them depart from the plane by at least a fifth of a degree and by 5 to
/// 24 times the deviation of their own vertices; or if a curved face continues in them without an
/// edge. A cylinder or cone that continues in such planes, if they are as wide as two of its
/// facets, needs one line fewer for each of them.
///
/// The corners of each facet lie within the tolerance of the surface of its face. The deviation of
/// its middle is at most the tolerance plus k L^2 / 6, where L is its longest side and k the larger
/// curvature (tested). The normals of facets lower than ten tolerances are not used, and such
/// facets alone form no face.
///
/// The time is linear in the triangles: 100 000 of a free form, or of an almost cylindrical
/// surface, take about a second on one processor. The growth of regions that are no faces ends when
/// 30 times as many triangles have been visited; `unexamined_triangles` then counts the triangles
/// that may lie on a face that was not found.
/// @param open       (triangles) nonzero: a triangle of a smooth patch that is to be searched
/// @param tolerance  mm
FaceRegions grow_face_regions(const Design& design, const std::vector<char>& open,
                              double tolerance);

/// The search of `grow_face_regions`: the face of each triangle, and the growth of faces.
class FaceGrowth {
 public:
  FaceGrowth(const Design& design, const std::vector<char>& open, double tolerance);

  /// Triangles and their vertices.
  struct Region {
    std::vector<int> triangles, vertices;
  };
  /// Returns the region of the triangles, with their vertices.
  Region region(std::vector<int> triangles);

  /// Result of an attempt to grow a face from a region.
  struct GrowthAttempt {
    bool is_accepted = false;
    std::vector<int> visited_triangles;  ///< by the surface that extends farthest but is no face
  };
  /// Fits the forms to a region one after another, and adds the first one that grows to a face.
  GrowthAttempt grow(std::span<const Form> forms, const Region& region);

  /// A region that has grown as far as its surface extends.
  struct RegionGrowth {
    FaceRegion face;
    bool is_face = false;
    std::vector<int> visited_triangles;  ///< including those added before the surface was well
                                         ///< determined
  };
  /// Grows a region along a surface and decides if it is a face.
  RegionGrowth grow_region(AnalyticPatch surface, Region region);
  /// Returns true if the budget for growing regions that are no faces is exhausted. Without a
  /// budget, on a surface that is almost a face the same region would grow again from each of its
  /// triangles.
  bool is_budget_exhausted() const { return wasted_work_ > max_wasted_work_; }

  /// Adds a face and closes its triangles.
  void add_face(FaceRegion face);
  /// Returns the plane of an open flat if its own vertices determine it.
  std::optional<FaceRegion> evident_plane(int flat);
  /// Returns the plane of a flat in which a curved face continues without an edge.
  std::optional<FaceRegion> tangent_plane(int flat);

  bool is_open(int t) const { return face_[std::size_t(t)] == no_face; }
  int open_triangles() const { return int(std::count(face_.begin(), face_.end(), no_face)); }
  /// Returns the flats: maximal connected sets of coplanar triangles.
  const std::vector<std::vector<int>>& flats() const { return flats_; }
  int flat_of(int t) const { return flat_[std::size_t(t)]; }
  /// Returns the triangle across a side if it is open, else -1.
  int open_across(int t, int side) const;
  Eigen::Vector3d normal(int t) const { return normals_.row(t); }
  double tolerance() const { return tolerance_; }
  const Design& design() const { return design_; }
  std::vector<FaceRegion> faces() && { return std::move(faces_); }

 private:
  static constexpr int no_face = -1, closed = -2;    // values of face_
  static constexpr double sliver_tolerances = 10.0;  // the normal of a triangle of less height is
                                                     // not used

  /// A side of a region across which the mesh continues smoothly.
  struct Border {
    int inside, outside;     // triangles
    int a, b, outer_vertex;  // vertices of the side, and the third one of the outer triangle
    double height;           // mm, height of the outer triangle over the side
  };
  std::vector<Border> borders(const Region& region);
  int third_vertex(int t, int a, int b) const;
  double height_over(int a, int b, int c) const;

  using TriangleFilter = std::function<bool(int triangle)>;
  Region expand(const AnalyticPatch& surface, Region region, double reach,
                const TriangleFilter& filter);
  bool is_on_surface(const AnalyticPatch& surface, int t, double reach) const;
  void find_flats(const std::vector<char>& open);
  void mark_region(const Region& region);
  void add_corners(Region& region, int t);
  std::optional<AnalyticPatch> fit_surface(const FacetPatch& patch,
                                           const AnalyticPatch& start) const;
  AnalyticPatch refit_surface(const AnalyticPatch& surface, const Region& region) const;
  bool is_face(const AnalyticPatch& surface, const Region& region);
  AnalyticPatch with_extent(AnalyticPatch surface, const Region& region) const;
  bool is_curved(const Region& region) const;
  bool has_distinct_border(const AnalyticPatch& surface, const FacetPatch& patch,
                           const std::vector<Border>& borders) const;
  bool has_folded_border(const AnalyticPatch& plane, const Region& region,
                         const std::vector<Border>& borders) const;
  bool has_reliable_normals(const Region& region) const;
  bool is_tangent(const AnalyticPatch& surface, const Border& border) const;
  int count_tangent_lines(const AnalyticPatch& surface, const std::vector<Border>& borders) const;
  bool is_sector(const AnalyticPatch& surface, const Region& region,
                 const std::vector<Border>& borders) const;
  double width(const AnalyticPatch& surface, const Region& region) const;
  /// Continuation of the mesh after the facet across a border: the angle to the next facet, rad,
  /// and its width, mm.
  struct Continuation {
    double turn = 0.0, width = 0.0;
  };
  Continuation continuation(const Border& border) const;
  std::optional<AnalyticPatch> fit_plane(const Region& region) const;
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
  std::vector<int> triangle_stamp_, vertex_stamp_;  // number of the last marked region of each
  int last_stamp_ = 0;
  double wasted_work_ = 0.0, max_wasted_work_;  // triangles and vertices visited by regions that
                                                // are no faces
};

}  // namespace abbe::cutting
