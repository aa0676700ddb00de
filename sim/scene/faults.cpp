#include "sim/scene/faults.h"

namespace abbe::sim {

void Faults::add(const Place& place, const std::string& expected, const std::string& seen) {
  add(BadInput(place.file ? *place.file : "", place.line, place.column, expected, seen));
}

}  // namespace abbe::sim
