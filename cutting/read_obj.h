#pragma once

#include "cutting/triangle_soup.h"

namespace abbe::cutting {

/// Vertices and faces of a Wavefront OBJ; texture, normals, groups, lines and points are passed
/// over.
/// @throws BadInput for anything else
Soup read_obj(const MeshSource& source);

}  // namespace abbe::cutting
