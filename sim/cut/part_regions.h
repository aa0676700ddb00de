#pragma once

#include <string>
#include <vector>

#include "cutting/map/residual.h"
#include "cutting/part/mesh.h"
#include "sim/scene/part.h"

namespace abbe::sim {

/// In which regions the faces of a mesh may lie, by what its file says of them. Faces of which the
/// regions of a part say the same are one group.
struct FaceGroups {
  std::vector<std::vector<bool>> can_contain;  ///< (groups)(regions) false: `group` and `colour` of
                                               ///< the region say no. Empty: no region has either
};

/// What the regions of a part ask its mesh file for.
cutting::MarkSelection wanted_marks(const PartDescription& part);

/// The groups of the triangles of a mesh.
struct GroupedFaces {
  FaceGroups groups;
  std::vector<int> of_triangle;
};

/// @param marks  those that were wanted
/// @throws BadInput, at the region, if it asks for a group or a colour that no face has
GroupedFaces grouped_faces(const PartDescription& part, const cutting::FaceMarks& marks);

/// A place of the part frame, and the group of the face on which it lies.
struct RegionPoint {
  Eigen::Vector3d p_m;
  int group = -1;  ///< none
};
/// A vertex of a design in the part frame.
RegionPoint region_point(const cutting::Design& design_m, Eigen::Index vertex);

/// Whether a region of a part, counted from 0, holds a place.
bool holds(const PartDescription& part, std::size_t region, const FaceGroups& groups,
           const RegionPoint& place);

/// The last of the regions that hold a place; null where none does.
const PartRegion* region_at(const PartDescription& part, const FaceGroups& groups,
                            const RegionPoint& place);

/// What a region holds of a part.
struct RegionCoverage {
  std::string name;
  double area = 0.0;     ///< mm^2, of the vertices in it
  double share = 0.0;    ///< of the part's area
  double decides = 0.0;  ///< the same without what a later region holds as well
};

/// One a region, of vertices by their area.
std::vector<RegionCoverage> region_coverage(const PartDescription& part, const FaceGroups& groups,
                                            const cutting::Design& design_m);

/// Of regions that hold nothing, or nothing that a later one does not hold.
std::vector<std::string> region_warnings(const std::vector<RegionCoverage>& shares);

/// Limits of the residual at each of the vertices (n) of a design, those of the regions above that
/// of the part; no rows where the part has no tolerance at all.
cutting::ToleranceBands tolerance_bands(const PartDescription& part, const FaceGroups& groups,
                                        const cutting::Design& design_w);

}  // namespace abbe::sim
