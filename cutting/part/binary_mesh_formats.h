#pragma once

#include "cutting/part/mesh_file.h"

/// Mesh formats that are binary or may be: PLY and STL.
namespace abbe::cutting {

/// Reads a PLY 1.0 file, ascii or binary of either byte order, with the elements vertex and face.
/// Properties other than x, y, z and vertex_indices are skipped unless they are requested marks.
/// The colour of a face is its red, green and blue, as integers 0 .. 255 or fractions 0 .. 1; if
/// faces have no colour, that of their corners, if they agree. The groups of a face are name and
/// value of every other integer property except alpha, such as "object_id 7".
/// @throws BadInput for anything else
TriangleSoup read_ply(const MeshSource& source, const MarkSelection& wanted = {});

/// Reads the facets of an STL file, ascii or binary (detected by its size); normals are not read.
/// The group of a facet of an ascii file is the name of its solid; several solids form one body.
/// The colour of a facet of a binary file is stored in the lower 15 bits of its attribute: red,
/// green and blue from the highest bit downwards if the 16th bit is set, else none (VisCAM,
/// SolidView). In a file whose header contains COLOR= and four bytes (Materialise Magics) it is
/// blue, green and red if the 16th bit is not set, and that of the header if it is.
/// @throws BadInput for anything else
TriangleSoup read_stl(const MeshSource& source, const MarkSelection& wanted = {});

}  // namespace abbe::cutting
