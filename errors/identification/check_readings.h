#pragma once

#include <span>

#include "errors/geometric.h"
#include "errors/metrology/readings.h"

namespace abbe::errors::identification {

/// @throws std::invalid_argument unless there are readings, all of one nominal machine, with one
///         finite number at every look, and a model of finite numbers without chance
void check_readings(const GeometricErrors& model, std::span<const metrology::Readings> readings);

}  // namespace abbe::errors::identification
