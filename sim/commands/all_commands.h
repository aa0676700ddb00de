#pragma once

#include <vector>

#include "sim/commands/command.h"

namespace abbe::sim {

/// Every command of abbe, as `--help` lists them.
/// @param common      what several of them take
/// @param argc, argv  what mpirun gave the program
std::vector<Command> all_commands(Common& common, int& argc, char**& argv);

}  // namespace abbe::sim
