#pragma once

#include "sim/commands/command.h"

namespace abbe::sim {

/// `abbe program FILE`
Command program_command(Common& common);

}  // namespace abbe::sim
