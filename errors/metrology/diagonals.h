#pragma once

#include <array>
#include <vector>

#include "errors/metrology/positioning.h"

namespace abbe::errors::metrology {

/// Runs along one diagonal of the work zone, targets counted along it from its start. Signs give
/// its direction: {1, 1, 1} goes up in X, Y and Z, {-1, 1, 1} goes down in X; a face diagonal has a
/// zero. A diagonal and its reverse are one.
struct DiagonalRuns {
  std::array<int, 3> signs{1, 1, 1};
  PositionRuns runs;
};

/// Quantities of ISO 230-6, in mm.
struct Diagonals {
  std::vector<Positioning> each;  ///< in the order given
  double E_d = 0.0;  ///< diagonal systematic deviation: largest E of the set (of the one direction
                     ///< measured where a diagonal was measured in one only)
  std::optional<double> B_d;  ///< largest |B_i| of the set, if every diagonal has both directions
};

/// ISO 230-2 quantities of every diagonal, and of the set.
/// Source: ISO 230-6:2002.
/// @throws std::invalid_argument as `positioning`, or for no diagonal, signs other than -1, 0, 1,
///         fewer than two of them not zero, or the same diagonal twice
Diagonals diagonals(const std::vector<DiagonalRuns>& set);

/// Angles between the directions of travel beyond 90 degrees, as location elements: EC0Y > 0 makes
/// the angle between X and Y larger, EB0Z > 0 leans Z towards +X, EA0Z > 0 leans Z towards -Y.
/// Rad.
struct Squareness {
  double EC0Y = 0.0;
  double EB0Z = 0.0;
  double EA0Z = 0.0;
};

/// Squareness of a box of `sides` (mm) from how much longer than nominal its four body diagonals
/// are (mm, in the order ppp, npp, pnp, ppn: the sign is negative in no axis, X, Y, Z). Scale
/// errors of the axes cancel; angular errors of the axes do not. First order in the deviations d:
/// neglects at most 4 d^2 / (shortest side)^2.
/// @throws std::invalid_argument unless sides are positive and all is finite
Squareness squareness_from_body_diagonals(const std::array<double, 3>& sides,
                                          const std::array<double, 4>& lengthening);

/// The same in one face with sides `first` and `second` (mm): the angle by which the second axis is
/// turned about the normal first x second, so EC0Y for (X, Y) and -EB0Z for (X, Z), EA0Z for (Y,
/// Z).
/// @param lengthening_pp  of the diagonal that goes up in both axes, mm
/// @param lengthening_np  of the one that goes down in the first, mm
double squareness_from_face_diagonals(double first, double second, double lengthening_pp,
                                      double lengthening_np);

}  // namespace abbe::errors::metrology
