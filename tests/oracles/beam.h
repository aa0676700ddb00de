#pragma once

#include <span>

/// Beams and plates by finite elements, for what the program has in closed form.
namespace abbe::oracles {

struct BeamPiece {
  double length = 0.0;             ///< mm
  double bending_stiffness = 0.0;  ///< E I, N mm^2
};

/// Deflection and slope (its derivative along the beam, away from the clamp).
struct BeamEnd {
  double deflection = 0.0;  ///< mm, along the force
  double slope = 0.0;       ///< rad
};

/// Free end of a cantilever under a force across it and a couple (which raises the slope) at
/// `place` mm from the clamp. Cubic Hermite elements, four a piece; exact for point loads at nodes,
/// and the load is one.
/// @param pieces  from the clamp to the free end
BeamEnd beam_end(std::span<const BeamPiece> pieces, double place, double force, double couple);

/// Deflection under a unit point load on a wide cantilever plate of height 1 and D = 1, at height
/// `s`. Rectangles with bicubic Hermite functions (Bogner, Fox, Schmit), which conform, so that the
/// result is too small for its width and rises to the truth as `finest` falls; half of it is
/// meshed, 6 heights wide, free at the far end.
/// @param finest  size of the elements at the load; they grow by 1.4 from there up to 0.2
double plate_under_load(double s, double poisson_ratio, double finest);

}  // namespace abbe::oracles
