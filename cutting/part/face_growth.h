#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "cutting/part/surface_fit.h"

namespace abbe::cutting {

/// Triangles of a smooth patch on one surface.
struct FaceRegion {
  AnalyticPatch surface;
  std::vector<int> triangles;
};

struct FaceRegions {
  std::vector<FaceRegion> faces;
  int unexamined_triangles = 0;  ///< triangles on no face when the work ended before all were tried
};

/// Faces within smooth patches, each the plane, sphere, cylinder, cone or torus from which none of
/// its vertices is farther off than the tolerance: a plane between two fillets, each of these, the
/// corner where they meet. From a few facets that show a surface the face grows over those next to
/// it, fitted again whenever it has doubled, for as long as they lie on it.
///
/// A face must show its surface as a whole patch must (`is_determined`; a torus on five lines as
/// well as on five rings), lie nearer to it than noise would by accident, one time in 1e9, and end
/// clearly: the facets across nine tenths of its border leave it by 2.5 times what its own vertices
/// do, by the tolerance, and as a surface would that curves less or more by 3 tenths; else it is
/// only the surface that touches a free form best. A strip between two circles of a tube is no
/// cylinder, cone or plane: where the facets beyond turn on as those of a smooth surface do that is
/// cut into strips, in proportion to their widths. Facets in a plane are a face if there are more
/// than four, not all of their vertices on two lines, as those of a strip are, and the facets
/// around them leave it by a fifth of a degree at least and by 5 to 24 times what they do
/// themselves; or if a curved face runs into them without an edge. A cylinder or cone that runs
/// into planes so, which are as wide as two of its facets, needs a line less for each.
///
/// Each facet has its corners within the tolerance of the surface of its face. Its middle lies
/// within the tolerance and k L^2 / 6 of it, L its longest side and k the larger curvature
/// (tested); facets lower than ten tolerances have no normals that count, and of them alone no face
/// is made.
///
/// Linear in the triangles: 100 000 of a free form, or of what is nearly a cylinder, take about a
/// second of one processor. Growing what is no face ends when 30 times as many were gone over:
/// `unexamined_triangles` counts what may lie on a face that was not looked for.
/// @param open       (triangles) those of smooth patches that are to be looked at
/// @param tolerance  mm
FaceRegions grow_face_regions(const Design& design, const std::vector<char>& open,
                              double tolerance);

/// The work of `grow_face_regions`: which triangles are on which face, and how one grows.
class FaceGrowth {
 public:
  FaceGrowth(const Design& design, const std::vector<char>& open, double tolerance);

  /// Triangles and their vertices.
  struct Region {
    std::vector<int> triangles, vertices;
  };
  Region region(std::vector<int> triangles);

  /// The first surface of these forms that fits a region and grows to a face from it is taken.
  struct Tried {
    bool is_accepted = false;
    std::vector<int> reached;  ///< triangles, the most that a surface came to that is no face
  };
  Tried grow(std::span<const Form> forms, const Region& region);

  /// What a region covers when it has grown as far as its surface goes, and whether that is a face.
  struct RegionGrowth {
    FaceRegion face;
    bool is_face = false;
    std::vector<int> reached;  ///< triangles, while the surface was not well known too
  };
  RegionGrowth grown(AnalyticPatch surface, Region region);
  /// Whether there is no more time to grow what is no face: on a surface that is nearly one, but
  /// not everywhere, from each of its places the same would grow again.
  bool is_budget_exhausted() const { return wasted_ > waste_; }

  void take(FaceRegion face);
  /// Whether the vertices of a flat that is still open show a plane by themselves.
  std::optional<FaceRegion> evident_plane(int flat);
  /// Whether a curved face runs into a flat without an edge.
  std::optional<FaceRegion> tangent_plane(int flat);

  bool is_open(int t) const { return face_[std::size_t(t)] == none; }
  int open_triangles() const { return int(std::count(face_.begin(), face_.end(), none)); }
  /// Triangles in planes: each with all around it that lie in its plane.
  const std::vector<std::vector<int>>& flats() const { return flats_; }
  int flat_of(int t) const { return flat_[std::size_t(t)]; }
  /// The triangle across a side, if it is open; -1.
  int open_across(int t, int side) const;
  Eigen::Vector3d normal(int t) const { return normals_.row(t); }
  double tolerance() const { return tolerance_; }
  const Design& design() const { return design_; }
  std::vector<FaceRegion> faces() && { return std::move(faces_); }

 private:
  static constexpr int none = -1, closed = -2;  // of face_
  static constexpr double sliver = 10.0;  // tolerances: what is lower has no normal of its own

  /// A side of a region that the mesh crosses smoothly.
  struct Border {
    int inside, outside;  // triangles
    int a, b, beyond;     // vertices: of the side, and of the triangle outside
    double height;        // mm, of the triangle outside over the side
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
  /// What follows the facet across a border: the angle to it, and how wide it is, in mm.
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
  Eigen::VectorXd height_;  // (triangles) mm, the least
  std::vector<int> face_;   // (triangles)
  std::vector<int> flat_;   // (triangles)
  std::vector<std::vector<int>> flats_;
  std::vector<FaceRegion> faces_;
  std::vector<int> stamp_, vertex_stamp_;  // the last region that they were of
  int stamped_ = 0;
  double wasted_ = 0.0, waste_;  // triangles and vertices gone over in growing what is no face
};

}  // namespace abbe::cutting
