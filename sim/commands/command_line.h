#pragma once

#include <vector>

#include "sim/commands/command.h"

namespace abbe::sim {

/// Reads the command line and runs the command that it names; prints help, the version and faults
/// of usage, with the nearest command or option. A scene may be named `library:gantry_dome`.
/// @param common  that the commands were made with
Exit run_command_line(const std::vector<Command>& commands, CommonOptions& common, int argc,
                      char** argv);

/// Reads the command line as `run_command_line` does and runs nothing.
Exit parse_command_line(const std::vector<Command>& commands, int argc, char** argv);

/// Every command of abbe, as `--help` lists them.
/// @param common      what several of them take
/// @param argc, argv  what mpirun gave the program
std::vector<Command> all_commands(CommonOptions& common, int& argc, char**& argv);

}  // namespace abbe::sim
