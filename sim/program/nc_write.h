#pragma once

#include <optional>
#include <span>
#include <string>
#include <variant>

#include <Eigen/Core>

#include "kinematics/axis.h"
#include "sim/program/controlled_axes.h"

namespace abbe::sim::program {

/// How many digits an NC file carries.
struct NcFormat {
  int decimals_mm = 7;
  int decimals_deg = 9;
};

/// G0, G1, or G2 and G3 to a point.
struct NcMove {
  bool rapid = false;
  kinematics::AxisVector to;  ///< (axes) as programmed, mm (inch under G20) and rad; spindles get
                              ///< no word
  double feed = 0.0;          ///< F word as it stands: mm/min, inch/min, deg/min or 1/min; a rapid
                              ///< has none
  struct Round {
    bool clockwise = false;
    std::string letters;     ///< "IJ", "KI" or "JK": the plane in force
    Eigen::Vector2d centre;  ///< mm (inch), from the start, in the order of the letters
  };
  std::optional<Round> round = {};  ///< none: a line
};

/// A line of text as it stands, or a move.
using NcItem = std::variant<std::string, NcMove>;

struct NcWriteOptions {
  NcFormat format;
  bool inverse_time = false;  ///< G93 is in force: F stands in every G1
  int feed_digits = 0;        ///< significant digits of F; 0: as many as hold its bits
};

/// NC text of moves, one line an item; words round to nearest, and those that do not change are
/// left out, but not in the first move after a line of text.
std::string write_nc(std::span<const NcItem> items, std::span<const ControlledAxis> axes,
                     const NcWriteOptions& options = {});

/// Number as an NC word: no exponent, no trailing zeros, no -0.
std::string nc_number(double value, int decimals);

/// Number rounded to so many significant digits, as an NC word.
std::string nc_significant(double value, int digits);

/// Number with the fewest digits that read back as the same bits, no exponent.
std::string nc_number(double value);

}  // namespace abbe::sim::program
