#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "sim/program/canon.h"
#include "sim/program/path.h"

/// The strict reader of plain RS274/NGC programs.
namespace abbe::sim::program {

/// A programmed length, in mm.
struct LengthValue {
  double mm = 0.0;
  Cause cause;
};

/// The words of a G2 or G3 block of an RS274 control.
struct ArcBlock {
  int plane = 17;  ///< G17, G18 or G19
  bool clockwise = false;
  bool absolute_centre = false;  ///< G90.1: I J K count from the program zero
  kinematics::AxisVector from;   ///< (axes) current position, offsets included
  kinematics::AxisVector end;    ///< (axes), offsets included
  Cause cause;
  std::uint32_t stated = 0;  ///< see `ArcMove`
  /// Returns the value of I, J, K or R; nothing if the block does not have it.
  std::function<std::optional<LengthValue>(char letter)> word;
};

/// Returns the move of an arc block, by R or about the centre I J K (then both `centre` and, in a
/// rotated frame, `placed_centre` are set). Throws BadInput for a plane without joints, a centre
/// offset outside of it, R with I J K, or no centre.
ArcMove arc_from_block(const Canon& canon, const ArcBlock& block);

/// Reads an RS274/NGC program strictly; the README of this folder lists the accepted words. Throws
/// BadInput (file:line:column, the word, what was expected) on anything else.
Path read_nc(std::string_view text, const std::string& file, const NcOptions& options);
/// Reads a program on a control whose state the program continues.
void read_nc(std::string_view text, Canon& canon);
/// Reads a program from a file.
Path read_nc_file(const std::filesystem::path& file, const NcOptions& options);

}  // namespace abbe::sim::program
