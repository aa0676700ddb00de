#pragma once

#include <vector>

#include "cutting/part/design_points.h"
#include "cutting/part/surface_fit.h"

namespace abbe::cutting {

/// A mesh whose vertices were moved, by `off` at most, onto the surfaces that they sample, and
/// carry the normals of these: what its facets were cut from, so that faceting is no residual.
struct Recognised {
  Design design;
  std::vector<AnalyticPatch> patches;
  double area = 0.0;             ///< mm^2, of all patches, recognised or not
  int unexamined_triangles = 0;  ///< triangles that may lie on a face, as `grow_face_regions` says
};

/// Tries each patch of `patches` as a plane, cylinder, cone, sphere and torus, in this order: the
/// first from which no vertex is farther off than the tolerance, and no facet leans by more than 30
/// degrees, is it. A patch with too few vertices to show a surface is not taken: but for planes
/// with less than twice as many as the surface has numbers; on less than five lines of a cylinder
/// or cone, three rings of a sphere, about any axis, or five rings of a torus; a sphere with a
/// flat, a cylinder or cone with a cap. What is none of them is looked through for faces that meet
/// without an edge, fillets and what they join (`grow_face_regions`): each gets vertices of its
/// own, which `seams` join, and what is left of the patch is a face as its facets show it. There
/// its normals are its own, but where it goes on as a curve does that runs into the recognised
/// face: then that face's. Exact vertices of a whole patch come back within 1e-11 of its size.
/// @param tolerance  mm, > 0: the rounding of the file, and what its maker called exact
/// @throws std::invalid_argument if the tolerance is not positive
Recognised recognised(const Design& design, double tolerance);

/// The surface between places of a recognised mesh that stands at T: the nearest point of the face
/// of which all of them are; `smooth_facet_point` where they are of none.
SurfaceInterpolator patch_interpolator(const std::vector<AnalyticPatch>& patches,
                                       const Eigen::Isometry3d& T);

}  // namespace abbe::cutting
