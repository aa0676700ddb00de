#pragma once

#include "cutting/part/mesh_file.h"

namespace abbe::cutting {

/// A PLY 1.0, ascii or binary of either byte order, with the elements vertex and face; properties
/// other than x, y, z and vertex_indices are passed over unless they are marks that are asked for.
/// The colour of a face: its red, green and blue, whole numbers 0 .. 255 or fractions 0 .. 1; where
/// faces have none, that of its corners, if they agree. Its groups: name and value of every other
/// property that is a whole number but alpha, such as "object_id 7".
/// @throws BadInput for anything else
TriangleSoup read_ply(const MeshSource& source, const MarkSelection& wanted = {});

/// The facets of an STL, ascii or binary (known by its size); their normals are not read. The group
/// of a facet of an ascii file is the name of its solid; several solids are one body. Its colour in
/// a binary file is in the lower 15 bits of its attribute: red, green and blue from the highest
/// where the 16th is set, else none (VisCAM, SolidView); in a file whose header has COLOR= and four
/// bytes (Materialise Magics) blue, green and red where it is not set, and that of the header where
/// it is.
/// @throws BadInput for anything else
TriangleSoup read_stl(const MeshSource& source, const MarkSelection& wanted = {});

}  // namespace abbe::cutting
