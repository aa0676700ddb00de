#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "cutting/part/design_points.h"
#include "cutting/stock/stock_mesh.h"

/// How far the skin of a machined part is off its design.
namespace abbe::cutting {

struct DeviationOptions {
  double band = 5.0;    ///< mm, deviations beyond it are cut off there
  bool smooth = true;   ///< vertices and normals are those of a smooth surface, else the facets are
  double joint = 2e-4;  ///< mm, triangles as near as this to each other share an edge or a corner
};

/// Distance to a design, open or closed, from any place. Immutable.
class DesignDistance {
 public:
  explicit DesignDistance(Design design, const DeviationOptions& options = {});

  struct At {
    double value = 0.0;                                ///< mm, > 0 outside the part
    Eigen::Vector3d from = Eigen::Vector3d::Zero();    ///< mm, from the design to the place
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit, of the design there
    bool is_beyond =
        false;          ///< nearest is a border of the design that is not right below the place
    int triangle = -1;  ///< of the design; -1: none, and the value is NaN
  };
  /// Signed by the normal of the triangles that meet at the nearest point, weighted by their angles
  /// there (Baerentzen and Aanaes 2005): right for every place off a closed or an open mesh without
  /// folds. Of facets exact to rounding (1e-12 of the coordinates). Of a smooth surface the facet
  /// is replaced as `smooth_facet_point` does, whose bound holds, plus (value / R)^2 of the facet
  /// error.
  /// @param guess  a triangle that may be near, which makes it faster; -1: none
  /// @param most   mm, beyond it nothing is found
  At at(const Eigen::Vector3d& place, int guess = -1,
        double most = std::numeric_limits<double>::infinity()) const;

  /// Whether there is no border.
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

enum class SkinStatus : std::uint8_t {
  Compared,
  CutOff,      ///< compared, but further off than the band
  NoDesign,    ///< beside an open design, behind it, or a blank that is too small for it
  Unresolved,  ///< no place of the skin is known there: a wall along dexels of one direction
};

/// The deviation of every vertex of a skin, by its places, which lie on the skin as the vertex does
/// not.
struct PartDeviation {
  /// (n) mm, mean over the places of a vertex: what the skin between them comes to, so that sums
  /// over an area converge. Between the least and the greatest of them, which on a surface that
  /// leans by a slope against the design differ by at most sqrt(3) spacings times the slope. NaN
  /// where not compared.
  Eigen::VectorXd deviation;
  /// (n) mm, that of greatest magnitude, exact as `DesignDistance` and the place are: what limits
  /// are held against, so that nothing is hidden in a mean. NaN where not compared.
  Eigen::VectorXd largest;
  std::vector<int> at;             ///< (n) which place has that; -1 where none is compared
  std::vector<SkinStatus> status;  ///< (n)
};

/// The skin against a design in the same frame. Of an open design skin is not compared that lies
/// beyond its border, or is under it and looks away from it, stands steeper than 84 degrees to it,
/// or was never cut: bottom and sides of the blank. Of places further off than the band only the
/// side is told. Uses all threads, the same for any number.
PartDeviation part_deviation(const StockSkin& skin, const DesignDistance& design,
                             const DeviationOptions& options = {});

/// (n x 3) mm^2, the area of the mesh that each vertex stands for, along its outward normal: a
/// third of that of the triangles around it.
Points directed_area(const StockMesh& mesh);

}  // namespace abbe::cutting
