#pragma once

#include <vector>

#include "cutting/fitted_surface.h"

namespace abbe::cutting {

/// Triangles of a smooth patch on one surface.
struct GrownFace {
  RecognisedPatch surface;
  std::vector<int> triangles;
};

/// Faces within smooth patches, each the plane, sphere, cylinder, cone or torus from which none of
/// its vertices is farther off than the tolerance: a plane between two fillets, each of these, the
/// corner where they meet. From a few facets that show a surface the face grows over those next to
/// it, fitted again whenever it has doubled, for as long as they lie on it.
///
/// A face must show its surface as a whole patch must (`is_evident`; a torus on five lines as well
/// as on five rings), and end clearly: the facets across nine tenths of its border leave it by 2.5
/// times what its own vertices do, by the tolerance, and as a surface would that curves less or
/// more by 3 tenths; else it is only the surface that touches a free form best. A strip between two
/// circles of a tube is no cylinder. Facets in a plane are a face if there are more than four, not
/// all of their vertices on two lines, as those of a strip are, and the facets around them turn
/// away by a degree at least; or if a curved face runs into them without an edge. A cylinder or
/// cone that runs into planes so needs a line less for each.
///
/// Linear in the triangles: 100 000 of a free form, or of what is nearly a cylinder, take about a
/// second of one processor. Growing what is no face ends when 30 times as many were gone over.
/// @param open       (triangles) those of smooth patches that are to be looked at
/// @param tolerance  mm
std::vector<GrownFace> grown_faces(const Design& design, const std::vector<char>& open,
                                   double tolerance);

}  // namespace abbe::cutting
