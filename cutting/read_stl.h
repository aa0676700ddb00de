#pragma once

#include "cutting/triangle_soup.h"

namespace abbe::cutting {

/// The facets of an STL, ascii or binary (known by its size); their normals are not read. The group
/// of a facet of an ascii file is the name of its solid; several solids are one body. Its colour in
/// a binary file is in the lower 15 bits of its attribute: red, green and blue from the highest
/// where the 16th is set, else none (VisCAM, SolidView); in a file whose header has COLOR= and four
/// bytes (Materialise Magics) blue, green and red where it is not set, and that of the header where
/// it is.
/// @throws BadInput for anything else
Soup read_stl(const MeshSource& source, const WantedMarks& wanted = {});

}  // namespace abbe::cutting
