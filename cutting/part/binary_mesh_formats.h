#pragma once

#include "cutting/part/mesh_file.h"

/// Readers of mesh formats that have a binary form: PLY and STL.
namespace abbe::cutting {

/// Reads a PLY 1.0 file, ascii or binary of either byte order, with the elements vertex and face.
/// Properties other than x, y, z and vertex_indices are skipped unless they are requested marks.
/// The colour of a face is its red, green and blue, as integers 0 .. 255 or fractions 0 .. 1. If
/// faces have no colour, a face gets the colour of its corners, provided that they agree. Every
/// other integer property except alpha is a group of the face with its name and value, such as
/// "object_id 7".
/// @throws BadInput if the file is not of this form
TriangleSoup read_ply(const MeshSource& source, const MarkSelection& requested_marks = {});

/// Reads the facets of an STL file, ascii or binary (detected by its size); normals are not read.
/// The group of a facet of an ascii file is the name of its solid; several solids form one body.
/// The colour of a facet of a binary file is stored in the lower 15 bits of its attribute: red,
/// green and blue from the highest bit downwards if the 16th bit is set, else no colour (VisCAM,
/// SolidView). In a file whose header contains COLOR= and four bytes (Materialise Magics) the bits
/// are blue, green and red if the 16th bit is clear; if it is set, the facet has the colour of the
/// header.
/// @throws BadInput if the file is not of this form
TriangleSoup read_stl(const MeshSource& source, const MarkSelection& requested_marks = {});

}  // namespace abbe::cutting
