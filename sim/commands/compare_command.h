#pragma once

#include "sim/commands/command.h"

namespace abbe::sim {

/// `abbe compare`: cuts error-free, uncompensated and every compensator of a scene.
Command compare_command(Common& common);

}  // namespace abbe::sim
