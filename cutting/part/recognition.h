#pragma once

#include <vector>

#include "cutting/part/design_points.h"
#include "cutting/part/surface_fit.h"

/// Recognition of the analytic surfaces that the facets of a mesh approximate.
namespace abbe::cutting {

/// A mesh whose vertices were moved onto the recognised surfaces, by at most `AnalyticPatch::off`,
/// and have the normals of these surfaces. Hence its faceting does not appear as residual.
struct RecognisedMesh {
  Design design;
  std::vector<AnalyticPatch> patches;
  double area = 0.0;             ///< mm^2, of the whole mesh
  int unexamined_triangles = 0;  ///< number of triangles not searched because the search ended
                                 ///< early (`grow_face_regions`); they may lie on a face
};

/// Recognises each patch of `patches` as a plane, cylinder, cone, sphere or torus, tried in this
/// order: the first from which no vertex is farther than the tolerance and no facet deviates by
/// more than 30 degrees.
/// A patch that does not determine a surface is not recognised as one. Except for planes, these are
/// patches with fewer vertices than twice the number of parameters of the surface; with fewer than
/// five lines of a cylinder or cone, three rings of a sphere about any axis, or five rings of a
/// torus; a sphere with a flat; and a cylinder or cone with a cap.
/// A patch that is not recognised is searched for faces that meet without an edge, i.e. fillets and
/// the faces they join (`grow_face_regions`). Each face gets its own vertices, joined by `seams`;
/// the remaining part of the patch stays a face of facets with its own normals, except where it
/// continues a recognised face tangentially: there it gets the normals of that face.
/// Exact vertices of a whole patch are reproduced within 1e-11 of its size.
/// @param tolerance  mm, > 0: maximum distance of the vertices in the file from their exact surface
/// @throws std::invalid_argument if the tolerance is not positive
RecognisedMesh recognise_patches(const Design& design, double tolerance);

/// Returns an interpolator for a recognised mesh with pose T: it returns the nearest point of the
/// face to which all corners belong, or `smooth_facet_point` if they belong to no common face.
SurfaceInterpolator patch_interpolator(const std::vector<AnalyticPatch>& patches,
                                       const Eigen::Isometry3d& T);

}  // namespace abbe::cutting
