#pragma once

#include "cutting/part/mesh.h"
#include "cutting/surface/surface.h"
#include "tests/test.h"

namespace abbe::cutting {

/// A map that is cut everywhere. @param residual  mm, of a point and the normal there
template <class F>
Surface map_over(const Design& design, const F& residual) {
  const Index n = design.vertices.rows();
  Surface surface{VectorXd(n), VectorXd::Zero(n), std::vector<int>(std::size_t(n), 1),
                  std::vector<VertexStatus>(std::size_t(n), VertexStatus::Cut)};
  for (Index i = 0; i < n; ++i)
    surface.residual[i] =
        residual(Vector3d(design.vertices.row(i)), Vector3d(design.normals.row(i)));
  return surface;
}

}  // namespace abbe::cutting
