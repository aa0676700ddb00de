#pragma once

#include <string>
#include <vector>

#include "sim/commands/command.h"

namespace abbe::sim {

/// The page abbe(1) of the manual, in roff; it names the page of every command.
std::string manual(const std::vector<Command>& commands);

/// The page of one command, abbe-run(1), in roff.
std::string manual(const Command& command);

}  // namespace abbe::sim
