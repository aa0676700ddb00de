#include "errors/metrology/test_result.h"

#include <utility>

#include "kinematics/units.h"

namespace abbe::errors::metrology {

Figure figure(std::string name, const std::optional<double>& value, bool angle) {
  Figure result{std::move(name), angle ? "urad" : "um", {}};
  if (value) result.value = *value / (angle ? units::urad : units::um);
  return result;
}

}  // namespace abbe::errors::metrology
