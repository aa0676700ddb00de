#pragma once

#include <string>

#include "sim/cut/way_out.h"

namespace abbe::sim {

/// "2 % of the judged area is cut within 2 mm of the design; with the part 25.4 times as large it
/// would be 97 %: part.unit = "inch" may be meant". For a program from a file that comes to less
/// than half of the part, and cuts four times as much of it, and a tenth, if the part is so many
/// times as large or small as units are; empty else, and for a mesh of part.any_size.
/// @param reach  of the thinned design as it stands
std::string unit_doubt(const Job& job, const WithinReach& reach);

}  // namespace abbe::sim
