#pragma once

#include <vector>

#include "sim/commands/command.h"

/// Parsing of the command line, and the list of all commands.
namespace abbe::sim {

/// Parses the command line and runs its command. Prints help, the version, and usage errors with
/// the nearest command or option. A scene of the library is named `library:gantry_dome`.
/// @param common  the options to which the commands refer
Exit run_command_line(const std::vector<Command>& commands, CommonOptions& common, int argc,
                      char** argv);

/// Parses the command line like `run_command_line`, without running a command.
Exit parse_command_line(const std::vector<Command>& commands, int argc, char** argv);

/// Returns all commands of abbe in the order of `--help`.
/// @param common      options of several commands
/// @param argc, argv  of the program, as started by mpirun
std::vector<Command> all_commands(CommonOptions& common, int& argc, char**& argv);

}  // namespace abbe::sim
