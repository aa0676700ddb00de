#pragma once

#include <array>
#include <vector>

#include "cutting/mesh.h"

namespace abbe::render {

/// Edges at which a surface bends by more than can be a facet, or ends: pairs of rows of `points`.
std::vector<std::array<int, 2>> sharp_edges(const cutting::Points& points,
                                            const cutting::Triangles& triangles);

}  // namespace abbe::render
