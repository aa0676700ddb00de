#pragma once

#include "sim/commands/command.h"

namespace abbe::sim {

/// `abbe run`: cuts one case of a scene.
Command run_command(Common& common);

}  // namespace abbe::sim
