#pragma once

#include <vector>

#include "sim/commands/command.h"

namespace abbe::sim {

/// `abbe help`; the command line answers for commands as `--help` does.
/// @param others  every other command
Command help_command(const std::vector<Command>& others);

}  // namespace abbe::sim
