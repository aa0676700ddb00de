#pragma once

#include <vector>

#include "cutting/fitted_surface.h"

namespace abbe::cutting {

/// Triangles of a smooth patch on one surface.
struct GrownFace {
  RecognisedPatch surface;
  std::vector<int> triangles;
};

struct GrownFaces {
  std::vector<GrownFace> faces;
  int untried = 0;  ///< triangles on no face when the work ended before all were tried
};

/// Faces within smooth patches, each the plane, sphere, cylinder, cone or torus from which none of
/// its vertices is farther off than the tolerance: a plane between two fillets, each of these, the
/// corner where they meet. From a few facets that show a surface the face grows over those next to
/// it, fitted again whenever it has doubled, for as long as they lie on it.
///
/// A face must show its surface as a whole patch must (`is_evident`; a torus on five lines as well
/// as on five rings), lie nearer to it than noise would by accident, one time in 1e9, and end
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
/// `untried` counts what may lie on a face that was not looked for.
/// @param open       (triangles) those of smooth patches that are to be looked at
/// @param tolerance  mm
GrownFaces grown_faces(const Design& design, const std::vector<char>& open, double tolerance);

}  // namespace abbe::cutting
