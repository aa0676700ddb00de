#pragma once

#include <vector>

#include "sim/commands/command.h"

namespace abbe::sim {

/// Reads the command line and runs the command that it names; prints help, the version and faults
/// of usage.
Exit run_command_line(const std::vector<Command>& commands, const Common& common, int argc,
                      char** argv);

}  // namespace abbe::sim
