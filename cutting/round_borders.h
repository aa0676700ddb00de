#pragma once

#include <vector>

#include "cutting/fitted_surface.h"

namespace abbe::cutting {

/// A design of recognised faces with vertices added where two of them meet without an edge along a
/// curve, a floor and the torus around a boss: a chord of the curve cuts a sliver off one face that
/// the other covers then. The new vertices stand where the normals of both surfaces agree, one for
/// each face, joined by `seams`; chords are halved until what they cut off is nearer than `off` to
/// both surfaces.
/// @param faces  that `Design::face` numbers
/// @param off    mm, > 0
/// @throws std::invalid_argument if `off` is not positive
Design with_round_borders(const Design& design, const std::vector<RecognisedPatch>& faces,
                          double off);

}  // namespace abbe::cutting
