#include "sim/program/place.h"

#include <utility>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"

namespace abbe::sim::program {

void refuse(const NcPlace& place, const Cause& cause, std::string expected,
            std::optional<std::string> seen) {
  throw BadInput(place.file, place.line, cause.column, std::move(expected),
                 seen ? *std::move(seen) : shown(cause.text));
}

}  // namespace abbe::sim::program
