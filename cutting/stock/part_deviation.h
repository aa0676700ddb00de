#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "cutting/part/design_points.h"
#include "cutting/stock/stock_mesh.h"

/// The deviation of the skin of a machined part from its design.
namespace abbe::cutting {

struct DeviationOptions {
  double band = 5.0;    ///< mm, larger deviations are limited to it
  bool smooth = true;   ///< vertices and normals represent a smooth surface; false: the facets are
                        ///< the surface
  double joint = 2e-4;  ///< mm, triangles nearer to each other than this share an edge or a corner
};

/// The signed distance of any point from a design, open or closed. Immutable.
class DesignDistance {
 public:
  explicit DesignDistance(Design design, const DeviationOptions& options = {});

  /// The distance at one point.
  struct At {
    double value = 0.0;                                ///< mm, > 0 outside the part
    Eigen::Vector3d from = Eigen::Vector3d::Zero();    ///< mm, from the design to the point
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit, of the design there
    /// true if the nearest point is on a border of the design and not right below the query point
    bool is_beyond = false;
    int triangle = -1;  ///< nearest triangle of the design; -1: none, and the value is NaN
  };
  /// Returns the distance of a point. Its sign is that of the normal of the triangles that meet at
  /// the nearest point, weighted by their angles there (Baerentzen and Aanaes 2005), which is
  /// correct for every point beside a closed or an open mesh without folds. For facets it is exact
  /// to rounding (1e-12 of the coordinates). For a smooth surface the facet is corrected as by
  /// `smooth_facet_point`, whose bound holds, plus (value / R)^2 of the facet error.
  /// @param guess  a triangle that may be near, which speeds up the search; -1: none
  /// @param most   mm, larger distances are not computed
  At at(const Eigen::Vector3d& place, int guess = -1,
        double most = std::numeric_limits<double>::infinity()) const;

  /// Returns true if the design has no border.
  bool is_closed() const { return is_closed_; }
  const Design& design() const { return design_; }

 private:
  struct Meeting {
    Eigen::Vector3d normal;
    bool is_border = false;
  };
  Meeting meeting(const Eigen::Vector3d& point) const;
  bool has_border() const;
  double sag(const TriangleTree::Nearest& nearest) const;

  Design design_;
  TriangleTree tree_;
  Points facet_normals_;
  DeviationOptions options_;
  bool is_closed_ = false;
};

/// Result of comparing a vertex of the skin.
enum class SkinStatus : std::uint8_t {
  Compared,
  CutOff,      ///< compared, but farther than the band
  NoDesign,    ///< beside an open design, behind it, or a blank that is too small for it
  Unresolved,  ///< no point on the skin is known there: a wall along dexels of one direction
};

/// The deviation of every vertex of a skin, computed at its points, which lie on the skin while the
/// vertex does not.
struct PartDeviation {
  /// (n) mm, mean over the points of a vertex, i.e. the deviation of the skin between them, so that
  /// sums over an area converge. It lies between the least and the greatest of them, which differ
  /// by at most sqrt(3) spacings times the slope on a surface that is inclined to the design by
  /// that slope. NaN if not compared.
  Eigen::VectorXd deviation;
  /// (n) mm, value of greatest magnitude, as exact as `DesignDistance` and the point; it is
  /// compared with limits, so that nothing is hidden in a mean. NaN if not compared.
  Eigen::VectorXd largest;
  std::vector<int> at;  ///< (n) index of the point with that value; -1 if none is compared
  std::vector<SkinStatus> status;  ///< (n)
};

/// Compares the skin with a design in the same frame. With an open design, skin is not compared
/// that lies beyond its border, or that is under it and faces away from it, is steeper than 84
/// degrees to it, or was never cut: bottom and sides of the blank. For points farther than the band
/// only the side is determined. Uses all threads; the result is the same for any number.
PartDeviation part_deviation(const StockSkin& skin, const DesignDistance& design,
                             const DeviationOptions& options = {});

/// Returns (n x 3) the area that each vertex of the mesh represents, along its outward normal,
/// mm^2: a third of that of the triangles around it.
Points directed_area(const StockMesh& mesh);

}  // namespace abbe::cutting
