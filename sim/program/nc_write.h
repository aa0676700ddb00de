#pragma once

#include <span>
#include <string>
#include <variant>

#include "kinematics/axis.h"
#include "sim/program/nc.h"

namespace abbe::sim::program {

/// How many digits an NC file carries.
struct NcFormat {
  int decimals_mm = 7;
  int decimals_deg = 9;
};

/// G0 or G1 to a point.
struct NcMove {
  bool rapid = false;
  kinematics::AxisVector to;  ///< (axes) as programmed, mm and rad; spindles get no word
  double feed = 0.0;          ///< F word as it stands: mm/min, deg/min or 1/min; a rapid has none
};

/// A line of text as it stands, or a move.
using NcItem = std::variant<std::string, NcMove>;

struct NcWriteOptions {
  NcFormat format;
  bool inverse_time = false;  ///< G93 is in force: F stands in every G1
};

/// NC text of moves; words round to nearest, and those that do not change are left out, but not in
/// the first move after a line of text.
std::string write_nc(std::span<const NcItem> items, std::span<const ControlledAxis> axes,
                     const NcWriteOptions& options = {});

/// Number as an NC word: no exponent, no trailing zeros, no -0.
std::string nc_number(double value, int decimals);

/// Number with the fewest digits that read back as the same bits, no exponent.
std::string nc_number(double value);

}  // namespace abbe::sim::program
