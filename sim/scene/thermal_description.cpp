#include "sim/scene/thermal_description.h"

namespace abbe::sim {

double history_s(const ThermalDescription& thermal) {
  double sum = 0.0;
  for (const ThermalPhase& phase : thermal.history) sum += phase.duration;
  return sum;
}

}  // namespace abbe::sim
