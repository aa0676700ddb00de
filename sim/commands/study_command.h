#pragma once

#include "sim/commands/command.h"

namespace abbe::sim {

/// `abbe study`: thousands of machines. @param argc, argv  what mpirun gave the program
Command study_command(Common& common, int& argc, char**& argv);

}  // namespace abbe::sim
