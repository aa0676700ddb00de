#pragma once

#include <string>
#include <vector>

#include "cutting/map/residual.h"
#include "cutting/part/mesh.h"
#include "sim/scene/part.h"

/// Regions of a part: which vertices they contain, and the tolerances they set.
namespace abbe::sim {

/// The regions in which the faces of a mesh may lie, by the marks in its file. Faces with the same
/// regions form one group.
struct FaceGroups {
  /// (groups)(regions) false: the `group` or `colour` of the region excludes it. Empty: no region
  /// has either.
  std::vector<std::vector<bool>> can_contain;
};

/// Returns the marks that the regions of a part need from its mesh file.
cutting::MarkSelection wanted_marks(const PartDescription& part);

/// The triangles of a mesh in groups.
struct GroupedFaces {
  FaceGroups groups;
  std::vector<int> group_of_triangle;  ///< (triangles) number of the group
};

/// Groups the faces of a mesh by the regions of the part.
/// @param marks  those of `wanted_marks`
/// @throws BadInput at the region if it names a group or a colour that no face has
GroupedFaces grouped_faces(const PartDescription& part, const cutting::FaceMarks& marks);

/// A point in the part frame, and the group of the face it lies on.
struct RegionPoint {
  Eigen::Vector3d p_m;
  int group = -1;  ///< -1: none
};
/// Returns a vertex of a design in the part frame as a region point.
RegionPoint region_point(const cutting::Design& design_m, Eigen::Index vertex);

/// Returns true if a region of a part, counted from 0, contains a point.
bool holds(const PartDescription& part, std::size_t region, const FaceGroups& groups,
           const RegionPoint& place);

/// Returns the last region that contains a point; null if none does.
const PartRegion* region_at(const PartDescription& part, const FaceGroups& groups,
                            const RegionPoint& place);

/// The area of a part that a region contains.
struct RegionCoverage {
  std::string name;
  double area = 0.0;     ///< area of the vertices in it, mm^2
  double share = 0.0;    ///< fraction of the area of the part
  double decides = 0.0;  ///< the same without the area that a later region contains too
};

/// Returns the coverage of each region, with vertices weighted by their area.
std::vector<RegionCoverage> region_coverage(const PartDescription& part, const FaceGroups& groups,
                                            const cutting::Design& design_m);

/// Returns warnings about regions that contain nothing, or nothing that a later region does not
/// contain.
std::vector<std::string> region_warnings(const std::vector<RegionCoverage>& shares);

/// Returns the limits of the residual at each vertex (n) of a design; those of a region override
/// those of the part. No rows if the part has no tolerance at all.
cutting::ToleranceBands tolerance_bands(const PartDescription& part, const FaceGroups& groups,
                                        const cutting::Design& design_w);

}  // namespace abbe::sim
