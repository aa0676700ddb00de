#pragma once

#include <vector>

#include "cutting/part/design_points.h"
#include "cutting/part/surface_fit.h"

/// Recognition of the analytic surfaces from which the facets of a mesh were made.
namespace abbe::cutting {

/// A mesh whose vertices were moved, by at most `off`, onto the surfaces that they sample, with the
/// normals of these surfaces. Hence its faceting does not appear as residual.
struct Recognised {
  Design design;
  std::vector<AnalyticPatch> patches;
  double area = 0.0;             ///< mm^2, of all patches, recognised or not
  int unexamined_triangles = 0;  ///< triangles that may lie on a face, as described at
                                 ///< `grow_face_regions`
};

/// Recognises each patch of `patches` as a plane, cylinder, cone, sphere or torus, tried in this
/// order: the first from which no vertex is farther than the tolerance, and along which no facet
/// leans by more than 30 degrees.
/// A patch with too few vertices to determine a surface is not recognised: except for planes, fewer
/// than twice as many as the surface has parameters; on fewer than five lines of a cylinder or
/// cone, three rings of a sphere, about any axis, or five rings of a torus; a sphere with a flat, a
/// cylinder or cone with a cap.
/// A patch that is none of them is searched for faces that meet without an edge, fillets and the
/// faces they join (`grow_face_regions`). Each face gets its own vertices, joined by `seams`; the
/// remaining part of the patch is a face made of its facets. Its normals are its own, except where
/// it runs into the recognised face like a curve: there those of that face are used.
/// Exact vertices of a whole patch are reproduced within 1e-11 of its size.
/// @param tolerance  mm, > 0: the rounding of the file, and the accuracy that its author called
///                   exact
/// @throws std::invalid_argument if the tolerance is not positive
Recognised recognised(const Design& design, double tolerance);

/// Returns an interpolator for a recognised mesh with pose T: the nearest point of the face to
/// which all corners belong; `smooth_facet_point` if they belong to no common face.
SurfaceInterpolator patch_interpolator(const std::vector<AnalyticPatch>& patches,
                                       const Eigen::Isometry3d& T);

}  // namespace abbe::cutting
