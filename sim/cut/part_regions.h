#pragma once

#include <string>
#include <vector>

#include "cutting/map/residual.h"
#include "cutting/part/mesh.h"
#include "sim/scene/part.h"

/// Regions of a part: the vertices that they contain, and their tolerances.
namespace abbe::sim {

/// Groups of the faces of a mesh, by the marks in its file. Faces that may lie in the same regions
/// form a group.
struct FaceGroups {
  /// (groups)(regions) false if `group` or `colour` of the region excludes the faces; empty if no
  /// region has either.
  std::vector<std::vector<bool>> can_contain;
};

/// Returns the kinds of marks that the regions of a part need from its mesh file.
cutting::MarkSelection required_marks(const PartDescription& part);

/// The groups of a mesh, and the group of each triangle.
struct GroupedFaces {
  FaceGroups groups;
  std::vector<int> group_of_triangle;  ///< (triangles) number of the group
};

/// Groups the faces of a mesh by the regions of the part.
/// @param marks  of the kinds of `required_marks`
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
           const RegionPoint& point);

/// Returns the last region that contains a point; null if none does.
const PartRegion* region_at(const PartDescription& part, const FaceGroups& groups,
                            const RegionPoint& point);

/// The area of a part that a region contains.
struct RegionCoverage {
  std::string name;
  double area = 0.0;           ///< of the vertices in the region, mm^2
  double area_fraction = 0.0;  ///< fraction of the area of the part
  double deciding_fraction =
      0.0;  ///< that fraction without the area that is also in a later region
};

/// Returns the coverage of each region, with vertices weighted by their area.
std::vector<RegionCoverage> region_coverage(const PartDescription& part, const FaceGroups& groups,
                                            const cutting::Design& design_m);

/// Returns warnings about regions without vertices, or with only vertices of later regions.
std::vector<std::string> region_warnings(const std::vector<RegionCoverage>& coverages);

/// Returns (n) the limits of the residual at each vertex of a design, by its last region, or else
/// by the part. No rows if there is no tolerance at all.
cutting::ToleranceBands tolerance_bands(const PartDescription& part, const FaceGroups& groups,
                                        const cutting::Design& design_w);

}  // namespace abbe::sim
