#pragma once

#include <optional>
#include <vector>

#include "cutting/fitted_surface.h"
#include "cutting/mesh.h"
#include "cutting/primitive.h"

namespace abbe::cutting {

/// The triangles of a design that look up, sorted into the cells of a grid in x and y. Immutable.
class MeshContact {
 public:
  /// @param faces  that `Design::face` numbers
  /// @throws std::invalid_argument if a vertex or a normal is not finite
  explicit MeshContact(Design design, std::vector<RecognisedPatch> faces = {});

  const Design& design() const { return design_; }

 private:
  friend std::optional<Contact> contact_above(const MeshContact& mesh, double x, double y);

  int column(double x) const;
  int row(double y) const;

  Design design_;
  std::vector<RecognisedPatch> faces_;
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
std::optional<Contact> contact_above(const MeshContact& mesh, double x, double y);

}  // namespace abbe::cutting
