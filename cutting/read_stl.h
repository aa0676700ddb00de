#pragma once

#include "cutting/triangle_soup.h"

namespace abbe::cutting {

/// The facets of an STL, ascii or binary (known by its size); their normals are not read.
/// @throws BadInput for anything else
Soup read_stl(const MeshSource& source);

}  // namespace abbe::cutting
