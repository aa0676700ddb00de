#pragma once

#include "cutting/triangle_soup.h"

namespace abbe::cutting {

/// A PLY 1.0, ascii or binary of either byte order, with the elements vertex and face; properties
/// other than x, y, z and vertex_indices are passed over unless they are marks that are asked for.
/// The colour of a face: its red, green and blue, whole numbers 0 .. 255 or fractions 0 .. 1; where
/// faces have none, that of its corners, if they agree. Its groups: name and value of every other
/// property that is a whole number but alpha, such as "object_id 7".
/// @throws BadInput for anything else
Soup read_ply(const MeshSource& source, const WantedMarks& wanted = {});

}  // namespace abbe::cutting
