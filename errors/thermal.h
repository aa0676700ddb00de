#pragma once

/// Heat in a machine: its network, a run of it over time, and the sensors that read it.
#include "errors/temperature_sensor.h"
#include "errors/thermal_network.h"
#include "errors/thermal_run.h"
