#pragma once

#include <functional>
#include <optional>

#include "sim/program/canon.h"

namespace abbe::sim::program {

/// A word that is a length, in mm.
struct LengthWord {
  double mm = 0.0;
  Cause cause;
};

/// A block of G2 or G3 as RS274 controls have it.
struct ArcBlock {
  int plane = 17;  ///< G17, G18 or G19
  bool clockwise = false;
  bool absolute_centre = false;  ///< G90.1: I J K count from the zero of the program
  kinematics::AxisVector from;   ///< (axes) where the program stands, offsets in
  kinematics::AxisVector end;    ///< (axes), offsets in
  Cause cause;
  std::uint32_t stated = 0;  ///< as `ArcMove` has it
  /// The word of I J K or R; none where the block has none.
  std::function<std::optional<LengthWord>(char letter)> word;
};

/// The move that it asks for: by R, or about the centre of I J K (both `centre` and, in a frame
/// that is turned, `placed_centre`).
/// @throws BadInput for a plane without joints, words outside of it, R beside I J K, no centre
ArcMove arc_of_block(const Canon& canon, const ArcBlock& block);

}  // namespace abbe::sim::program
