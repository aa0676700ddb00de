#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "cutting/part/design_points.h"
#include "cutting/stock/stock_mesh.h"

/// The deviation of the skin of a machined part from its design.
namespace abbe::cutting {

struct DeviationOptions {
  double band = 5.0;    ///< mm, limit of deviations
  bool smooth = true;   ///< true if vertices and normals represent a smooth surface; false if the
                        ///< facets are the surface
  double joint = 2e-4;  ///< mm; triangles nearer to each other share an edge or a corner
};

/// The signed distance of points from an open or closed design. Immutable.
class DesignDistance {
 public:
  explicit DesignDistance(Design design, const DeviationOptions& options = {});

  /// The signed distance of one point.
  struct PointDistance {
    double value = 0.0;                                ///< mm, > 0 outside the part
    Eigen::Vector3d from = Eigen::Vector3d::Zero();    ///< mm, from the design to the point
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit, of the design there
    /// true if the nearest point is on a border of the design and not vertically below the query
    /// point
    bool is_beyond = false;
    int triangle = -1;  ///< nearest triangle of the design; -1: none, and the value is NaN
  };
  /// Returns the distance of a point. The sign follows from the angle-weighted pseudonormal at the
  /// nearest point (Baerentzen and Aanaes 2005), which is correct for every point beside a closed
  /// or open mesh without folds. For facets the value is exact to rounding (1e-12 of the
  /// coordinates). For a smooth surface the facet is corrected as by `smooth_facet_point`, whose
  /// bound holds, plus (value / R)^2 of the facet error.
  /// @param guess  a triangle that may be near, which speeds up the search; -1: none
  /// @param max_distance  mm; larger distances are not computed
  PointDistance at(const Eigen::Vector3d& query_point, int guess = -1,
                   double max_distance = std::numeric_limits<double>::infinity()) const;

  /// Returns true if the design has no border.
  bool is_closed() const { return is_closed_; }
  const Design& design() const { return design_; }

 private:
  struct PseudoNormal {
    Eigen::Vector3d normal;
    bool is_border = false;
  };
  PseudoNormal pseudo_normal(const Eigen::Vector3d& point) const;
  bool has_border() const;
  double sag(const TriangleTree::NearestPoint& nearest) const;

  Design design_;
  TriangleTree tree_;
  Points facet_normals_;
  DeviationOptions options_;
  bool is_closed_ = false;
};

/// Result of the comparison of a vertex of the skin.
enum class SkinStatus : std::uint8_t {
  Compared,
  BeyondBand,  ///< compared, but beyond the band
  NoDesign,    ///< beside or behind an open design, or of a blank that is too small for it
  Unresolved,  ///< without a skin point: a wall along dexels of one direction
};

/// The deviation of every vertex of a skin, computed at its skin points, since the vertex itself
/// does not lie on the skin.
struct PartDeviation {
  /// (n) mm, mean over the points of a vertex, i.e. the deviation of the skin between them, so that
  /// sums over an area converge. On a surface inclined to the design the deviations of the points
  /// differ by at most sqrt(3) spacings times the slope. NaN if not compared.
  Eigen::VectorXd deviation;
  /// (n) mm, deviation of maximum magnitude among the points, as exact as `DesignDistance` and the
  /// point. This value is compared with limits, since a mean would hide extremes. NaN if not
  /// compared.
  Eigen::VectorXd max_deviation;
  std::vector<int> at;  ///< (n) index of the point with that deviation; -1 if not compared
  std::vector<SkinStatus> status;  ///< (n)
};

/// Compares the skin with a design in the same frame. For an open design this excludes skin beyond
/// its border, and skin below it that faces away, is steeper than 84 degrees to it, or was never
/// cut, i.e. bottom and sides of the blank. For points beyond the band only the side is determined.
/// Uses all threads; the result is the same for any number.
PartDeviation part_deviation(const StockSkin& skin, const DesignDistance& design,
                             const DeviationOptions& options = {});

/// Returns (n x 3) the directed area of each vertex of the mesh, along its outward normal, mm^2: a
/// third of the area of the triangles around it.
Points directed_area(const StockMesh& mesh);

}  // namespace abbe::cutting
