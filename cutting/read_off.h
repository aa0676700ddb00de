#pragma once

#include "cutting/triangle_soup.h"

namespace abbe::cutting {

/// An OFF in text, its faces with or without a colour, or a COFF, whose vertices have one. The
/// colour of a face: three or four whole numbers, 0 .. 255, or fractions, 0 .. 1 (so are whole ones
/// of which none is above 1), the fourth not looked at; without one that of its corners, if they
/// agree.
/// @throws BadInput for anything else; for a colour only if colours are asked for, and then for an
///         index into a map of colours too
Soup read_off(const MeshSource& source, const WantedMarks& wanted = {});

}  // namespace abbe::cutting
