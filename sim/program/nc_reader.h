#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "sim/program/canon.h"
#include "sim/program/path.h"

namespace abbe::sim::program {

/// A word that is a length, in mm.
struct LengthValue {
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
  std::function<std::optional<LengthValue>(char letter)> word;
};

/// The move that it asks for: by R, or about the centre of I J K (both `centre` and, in a frame
/// that is turned, `placed_centre`).
/// @throws BadInput for a plane without joints, words outside of it, R beside I J K, no centre
ArcMove arc_from_block(const Canon& canon, const ArcBlock& block);

/// Reads an RS274/NGC program strictly. README of this folder lists the words taken.
/// @throws BadInput (file:line:column, the word, what was expected) on anything else
Path read_nc(std::string_view text, const std::string& file, const NcOptions& options);
/// The same on a control that stands somewhere already.
void read_nc(std::string_view text, Canon& canon);
Path read_nc_file(const std::filesystem::path& file, const NcOptions& options);

}  // namespace abbe::sim::program
