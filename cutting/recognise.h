#pragma once

#include <vector>

#include "cutting/nearest.h"

namespace abbe::cutting {

enum class Form { Plane, Sphere, Cylinder, Cone, Torus };

/// A smooth patch of a mesh that lies on a surface known in closed form, about the third axis of
/// its frame.
struct RecognisedPatch {
  Form form = Form::Plane;
  Eigen::Matrix3d frame = Eigen::Matrix3d::Identity();  ///< columns; the third: axis, or normal
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();     ///< mm, on the axis, or in the plane
  Eigen::VectorXd shape;  ///< mm: radius; cone: radius at the origin, then its growth by the
                          ///< height; torus: radius of the ring, then of its section; plane: none
  double sign = 1.0;      ///< -1 where the outward normal of the part points to the axis
  double area = 0.0;      ///< mm^2, of its triangles
  double off = 0.0;       ///< mm, the vertex farthest from the surface
  Eigen::AlignedBox3d box;
};

/// A mesh whose vertices were moved, by `off` at most, onto the surfaces that they sample, and
/// carry the normals of these: what its facets were cut from, so that faceting is no residual.
struct Recognised {
  Design design;
  std::vector<RecognisedPatch> patches;
  double area = 0.0;  ///< mm^2, of all patches, recognised or not
};

/// Tries each patch of `patches` as a plane, cylinder, cone, sphere and torus, in this order: the
/// first from which no vertex is farther off than the tolerance, and no facet leans by more than 30
/// degrees, is it. A patch with too few vertices to show a surface is left as it is: but for planes
/// with less than twice as many as the surface has numbers; on less than five lines of a cylinder
/// or cone, three rings of a sphere, about any axis, or five rings of a torus; a sphere with a
/// flat, a cylinder or cone with a cap. The axis of a surface of revolution is the line that all
/// normals meet (Pottmann and Wallner 2001, Computational Line Geometry, 4.1), then the distances
/// are brought to their least squares by Gauss and Newton, of some 2000 vertices evenly chosen.
/// Exact vertices come back within 1e-11 of the size of the patch.
/// @param tolerance  mm, > 0: the rounding of the file, and what its maker called exact
/// @throws std::invalid_argument if the tolerance is not positive
Recognised recognised(const Design& design, double tolerance);

/// The surface between places of a recognised mesh that stands at T: the nearest point of the patch
/// on which all of them lie; `on_smooth_facet` where there is none.
OnSurface on_recognised(const std::vector<RecognisedPatch>& patches, const Eigen::Isometry3d& T);

}  // namespace abbe::cutting
