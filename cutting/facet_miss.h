#pragma once

#include "cutting/mesh.h"

namespace abbe::cutting {

/// (n) mm, about how far what facets and normals show between the vertices (`on_smooth_facet`) may
/// be off the surface that they stand for, at each vertex on no recognised face; 0 elsewhere. Where
/// the curvature is k on one side of a vertex and k' on the other, over edges L and L', the middle
/// of an edge lies off by about |k - k'| L L' / 8: facets of a fillet beside a plane, those next to
/// a rim, where normals are of one side only, or of a curve that is coarse for how it bends. Within
/// a factor of 2 of the largest error on fillets of 5 to 22.5 degrees a facet and on ellipsoids
/// (tested).
Eigen::VectorXd facet_miss(const Design& design);

}  // namespace abbe::cutting
