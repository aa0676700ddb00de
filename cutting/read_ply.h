#pragma once

#include "cutting/triangle_soup.h"

namespace abbe::cutting {

/// A PLY 1.0, ascii or binary of either byte order, with the elements vertex and face; properties
/// other than x, y, z and vertex_indices are passed over.
/// @throws BadInput for anything else
Soup read_ply(const MeshSource& source);

}  // namespace abbe::cutting
