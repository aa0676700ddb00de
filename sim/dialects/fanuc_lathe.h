#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "sim/program/canon.h"

namespace abbe::sim::dialects::fanuc {

/// What only a program of a turning control says, and where.
struct TurningSign {
  std::string words;  ///< "G50 with S, the largest speed of a turning control"
  int line = 0, column = 0;
};

/// Returns the first sign that a program is one of a turning control: G50 with S; G28 with U or W
/// and G70 to G73 with P and Q on a machine without such axes; tools of four digits beside G96 and
/// without M6. Comments are left out.
std::optional<TurningSign> sign_of_turning(std::string_view text, const program::Canon& canon);

}  // namespace abbe::sim::dialects::fanuc
